"""What the preferences do to the parts of a window, at its start and when they change."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from studio_ui.context import Context
from studio_ui.files.project_files import ProjectFiles
from studio_ui.preferences.catalogue import ALL
from studio_ui.preferences.store import Preferences
from studio_ui.quality import QualityControl
from studio_ui.views.viewing import Viewing


class Effects:
    """Ends with `close`. Theme, canvas and grid are `Appearance`'s; snapping asks for its steps."""

    def __init__(
        self,
        preferences: Preferences,
        context: Context,
        files: ProjectFiles,
        quality: QualityControl,
        viewing: Viewing,
        soon: Callable[[], object],
    ) -> None:
        """`soon` asks the actions again which of them are on."""
        self._preferences, self._quality = preferences, quality
        self._off: list[Callable[[], None]] = []
        autosaver = files.keeper.autosaver
        self._now("rest_pixels", lambda value: context.feed.show_pixels(round(float(value) * 1e6)))
        self._now("autosave", lambda value: setattr(autosaver, "interval", value))
        self._later("navigation", viewing.navigate_like)
        self._later("invert_wheel", viewing.invert_wheel)
        self._later("animate_view", viewing.animate)
        for preference in ALL:
            self._later(preference.name, lambda _: soon())
        self._off += [
            files.opened.connect(self._start_quality),
            context.warmed.connect(self._start_quality),
        ]

    def close(self) -> None:
        """Stop following."""
        while self._off:
            self._off.pop()()

    def _later(self, name: str, apply: Callable[[Any], object]) -> None:
        self._off.append(self._preferences.bind(name, apply))

    def _now(self, name: str, apply: Callable[[Any], object]) -> None:
        apply(self._preferences.get(name))
        self._later(name, apply)

    def _start_quality(self) -> None:
        self._quality.start_with(self._preferences.get("quality"))
