"""What the brush is set to: kept from one stroke to the next, and from one day to the next."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from studio_core.errors import InputError
from studio_core.params import Colour, ParamInfo, build, check, nearest, param_infos
from studio_core.signal import Signal
from studio_core.strokes.brush import Brush
from studio_core.strokes.stroke import REPLACE, Stroke
from studio_core.strokes.tools import ToolSettings
from studio_ui.settings import Settings

REACH = ("near", "facing", "alike")
_KEY = "stroke_brush"
_STEP = 1.2  # of the size, a key
_SOFTER = 0.1  # of the hardness, a key


@dataclass(frozen=True)
class Setting:
    """Everything that the next stroke will be made with. `reach` is that of `Stroke`, by name."""

    tool: str = REPLACE
    indirect: bool = False
    brush: Brush = Brush()
    settings: ToolSettings = ToolSettings()
    near: float = 0.0
    facing: float = 0.0
    alike: float = 0.0
    solver: str = ""
    across: bool = False
    """Whether strokes go on from the object that they begin on to others."""

    @property
    def reach(self) -> dict[str, float]:
        """By name."""
        return {name: getattr(self, name) for name in REACH}


def brush_infos() -> Mapping[str, ParamInfo]:
    """What brush and tools can be set to, by name."""
    return {**param_infos(ToolSettings), **param_infos(Brush)}


class BrushStore:
    """`now` is in use; `changed()` when it is another one."""

    def __init__(self, settings: Settings) -> None:
        self.changed: Signal[[]] = Signal()
        self._settings = settings
        self.now = _read(settings.get(_KEY, {}))

    def use(self, **values: Any) -> None:
        """Other values of `Setting`, of its brush, or of the tools', by name; kept in their ranges."""
        infos, now = brush_infos(), self.now
        given = {name: nearest(infos[name], v) if name in infos else v for name, v in values.items()}

        def of(kind: type[Any]) -> dict[str, Any]:
            return {name: value for name, value in given.items() if name in names(kind)}

        brush = dataclasses.replace(now.brush, **of(Brush))
        settings = dataclasses.replace(now.settings, **of(ToolSettings))
        made = dataclasses.replace(now, brush=brush, settings=settings, **of(Setting))
        if made != now:
            self.now = made
            self._settings.set(_KEY, _written(made))
            self.changed.emit()

    def values(self) -> dict[str, Any]:
        """What forms show, by name."""
        infos = brush_infos()
        parts = (self.now.settings, self.now.brush)
        return {name: getattr(part, name) for part in parts for name in infos if hasattr(part, name)}

    def pick(self, colour: Colour) -> None:
        """Paint with this radiance from now on."""
        self.use(colour=colour)

    def larger(self, steps: float = 1.0) -> None:
        """By so many steps; smaller with fewer than none."""
        self.use(size=self.now.brush.size * _STEP**steps)

    def harder(self, steps: float = 1.0) -> None:
        """By so many steps; softer with fewer than none."""
        self.use(hardness=round(self.now.brush.hardness + _SOFTER * steps, 3))


def names(kind: type[Any]) -> set[str]:
    """The fields of a dataclass."""
    return {field.name for field in fields(kind)}


def _written(now: Setting) -> dict[str, Any]:
    kept = {name: getattr(now, name) for name in ("tool", "indirect", "solver", "across", *REACH)}
    for part in (now.brush, now.settings):
        kept |= {name: getattr(part, name) for name in param_infos(type(part))}
    return {name: list(value) if isinstance(value, tuple) else value for name, value in kept.items()}


def _read(kept: Mapping[str, Any]) -> Setting:
    """What was written; where something does not fit, all is as at first."""
    stroke = param_infos(Stroke)

    def checked(name: str) -> Any:
        return check(name, stroke[name], kept.get(name, getattr(Setting(), name)))

    with contextlib.suppress(InputError, TypeError, ValueError):
        brush, settings = (
            build(kind, {name: kept[name] for name in param_infos(kind) if name in kept})
            for kind in (Brush, ToolSettings)
        )
        near, facing, alike = (checked(name) for name in REACH)
        solver = str(kept.get("solver", ""))
        across = kept.get("across") is True
        return Setting(
            checked("tool"), checked("indirect"), brush, settings, near, facing, alike, solver, across
        )
    return Setting()


__all__ = ["REACH", "BrushStore", "Setting", "brush_infos"]
