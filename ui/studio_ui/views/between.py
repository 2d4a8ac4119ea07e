"""Light between surfaces as actions: on and off, and which light is looked at."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from studio_core.session import ALL, INDIRECT, LIGHTS, SHARE
from studio_ui.context import Context

KIND = "indirect"
_NEEDED = (INDIRECT, SHARE)


class Between:
    """A feature; what it does, it does to the session."""

    def __init__(self, context: Context) -> None:
        self._context = context

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        made: dict[str, Callable[[], object]] = {"shade.bounces": lambda: self.bounce(not self.on)}
        return made | {f"view.light_{light}": partial(self.show, light) for light in LIGHTS}

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name."""
        made: dict[str, Callable[[], bool]] = {
            "bounces": lambda: self.on,
            "bouncing": lambda: bool(self.methods),
        }
        return made | {f"light_{light}": partial(self._shows, light) for light in LIGHTS}

    @property
    def methods(self) -> tuple[str, ...]:
        """Ids of what can compute it."""
        return tuple(self._context.host.names(KIND))

    @property
    def on(self) -> bool:
        """Whether light goes on between surfaces."""
        session = self._context.session
        return session.bouncing and session.indirect in self.methods

    def bounce(self, on: bool) -> None:
        """Switch it on, by the method there was or else the first there is, or off."""
        session, methods = self._context.session, self.methods
        if not on and session.light in _NEEDED:
            session.show_light(ALL)
        if on and session.indirect not in methods:
            session.bounce(True, methods[0])
        else:
            session.bounce(on)

    def show(self, light: str) -> None:
        """Look at other light, of `LIGHTS`; what there is only between surfaces switches that on."""
        if light in _NEEDED and not self.on and self.methods:
            self.bounce(True)
        self._context.session.show_light(light)

    def _shows(self, light: str) -> bool:
        return self._context.session.light == light
