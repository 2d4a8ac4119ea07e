"""What an action is, as data, and why one cannot be done."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ActionSpec:
    """One action: `menu` is a path (`Edit`, `View/Look from`), `tip` says what its name does not.

    `enabled` and `checked` name conditions (see `REASONS`). `canvas` limits the shortcut to the picture;
    actions of one `group` exclude each other; `bar` puts it on the toolbar.
    """

    id: str
    text: str
    menu: str
    shortcut: str = ""
    tip: str = ""
    icon: str = ""
    enabled: str = ""
    checked: str = ""
    canvas: bool = False
    bar: bool = False
    group: str = ""

    @property
    def checkable(self) -> bool:
        """Whether it shows a check mark while it is on."""
        return bool(self.group or self.checked)


SEPARATOR = None
"""A line between the actions of a menu."""

Item = ActionSpec | None

REASONS = {
    "undo": "Nothing to undo",
    "redo": "Nothing to redo",
    "selection": "Nothing is chosen",
    "objects": "No object is chosen",
    "movable": "Nothing is chosen that can be moved",
    "two": "Choose two things or more",
    "three": "Choose three things or more",
    "mesh": "Nothing is chosen that has a material",
    "bare": "Nothing is chosen that has no texture coordinates",
    "aimable": "No camera is chosen",
    "through": "No camera is looked through",
    **{f"camera_{n}": "There are fewer cameras" for n in range(1, 10)},
    "group": "No group is chosen",
    "room": "There is no room",
    "captured": "Neither a capture nor an environment made by one is chosen",
    "savable": "Nothing has changed since it was saved",
    "correctable": "No object is chosen",
    "has_file": "The project is in no file yet",
    "own_file": "The project is in no file that can be changed",
    "picture": "There is no picture yet",
    "furnished": "There is nothing in the scene",
    "computing": "Nothing is being computed",
    "bouncing": "No plugin computes light between surfaces",
}
"""Every condition that `enabled` names, with what is told while it does not hold."""
