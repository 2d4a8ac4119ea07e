"""Everything the window can be told to do, as data; menus, toolbar and the list of keys are made from it.

A new action is a line in its menu's module and a handler in some feature's `handlers()` (see `features`).
"""
