"""What snaps and along which axes things move: remembered, and switched by actions."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from studio_core.signal import Signal
from studio_ui.canvas.snapping import Snap
from studio_ui.settings import Settings

STEP, ANGLE = "snap_step", "snap_angle"
"""Settings: metres and degrees."""
_SWITCHES = {
    "on": "snap",
    "grid": "snap_grid",
    "objects": "snap_objects",
    "surfaces": "snap_surfaces",
}


class Magnet:
    """`changed` is emitted after a switch; `snap` is asked for at the start of every gesture."""

    def __init__(self, settings: Settings) -> None:
        self.changed: Signal[[]] = Signal()
        self._settings = settings

    @property
    def snap(self) -> Snap:
        """Steps that make no sense are those of the first start."""
        usual = Snap()
        step, angle = self._settings.get(STEP, usual.step), self._settings.get(ANGLE, usual.angle)
        return Snap(
            **{field: self._settings.get(name, True) for field, name in _SWITCHES.items()},
            step=step if 1e-4 <= step <= 100 else usual.step,
            angle=angle if 0.01 <= angle <= 180 else usual.angle,
        )

    @property
    def local_axes(self) -> bool:
        """Whether gizmos have the axes of what is chosen, instead of the world's."""
        return bool(self._settings.get("local_axes", False))

    def switch(self, name: str, *, usual: bool = True) -> None:
        """Turn a switch round."""
        self._settings.set(name, not self._settings.get(name, usual))
        self.changed.emit()

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        made: dict[str, Callable[[], object]] = {
            f"snap.{field}": partial(self.switch, name) for field, name in _SWITCHES.items()
        }
        made["tool.local_axes"] = partial(self.switch, "local_axes", usual=False)
        return made

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name, as actions use them."""
        made: dict[str, Callable[[], bool]] = {
            f"snap_{field}": partial(self._settings.get, name, True) for field, name in _SWITCHES.items()
        }
        made["local_axes"] = lambda: self.local_axes
        return made
