"""What the command palette finds in the library: its materials, for what is chosen or for the scene."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from itertools import islice

from studio_ui.library.library import MaterialLibrary
from studio_ui.library.taking import Taking
from studio_ui.palette.palette import Entry

_MOST = 300
_AFTER = -8.0
"""The scene's own materials come first where both fit."""


def library_entries(library: MaterialLibrary, taking: Taking) -> Iterator[Entry]:
    """What a double click in the library does."""
    whom = taking.whom
    place = f"Library \u25b8 Give to {whom}" if whom else "Library \u25b8 Add to scene"
    for entry in islice((one for one in library.entries if one.kept is not None), _MOST):
        run, hint = partial(taking.use, [entry]), " ".join(entry.tags)
        yield Entry(f"library.{entry.key}", entry.name, place, run, hint=hint, rank=_AFTER, kept=False)
