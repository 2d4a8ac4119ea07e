"""Preferences: a declarative list, the dialog made from it, and the page of keys."""
