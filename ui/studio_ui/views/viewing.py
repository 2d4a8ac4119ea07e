"""Where one looks from, as actions: framing, the axes, how bright; habits of navigating, remembered."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import numpy.typing as npt

from studio_core.session import framing
from studio_ui.canvas import navigation
from studio_ui.canvas.looking import Looking
from studio_ui.canvas.presets import LUCARNE, PRESETS
from studio_ui.context import Context
from studio_ui.settings import Settings

_EV_LIMIT = 16.0


class Viewing:
    """A feature. Settings: `navigation` (an id of `PRESETS`), `invert_wheel`, `animate_view`."""

    def __init__(self, context: Context, looking: Looking, settings: Settings) -> None:
        self._context, self._looking, self._settings = context, looking, settings
        looking.preset = PRESETS.get(settings.get("navigation", LUCARNE.id), LUCARNE)
        looking.inverted = settings.get("invert_wheel", False)
        looking.flight.animated = settings.get("animate_view", True)

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        made: dict[str, Callable[[], object]] = {
            "view.frame_selection": self.frame_selection,
            "view.frame_all": self.frame_all,
            "view.home": self.home,
            "view.walk": self.walk,
            "view.brighter": lambda: self.expose(0.5),
            "view.darker": lambda: self.expose(-0.5),
            "view.invert_wheel": lambda: self.invert_wheel(not self._looking.inverted),
            "view.animate": lambda: self.animate(not self._looking.flight.animated),
        }
        made |= {f"view.{axis}": partial(self.look_from, way) for axis, way in navigation.AXES.items()}
        made |= {f"view.navigation_{name}": partial(self.navigate_like, name) for name in PRESETS}
        return made

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """By name."""
        made: dict[str, Callable[[], bool]] = {
            "walk": lambda: self._looking.walking.active,
            "invert_wheel": lambda: self._looking.inverted,
            "animate": lambda: self._looking.flight.animated,
        }
        made |= {f"navigation_{name}": partial(self._navigates_like, name) for name in PRESETS}
        return made

    def frame_selection(self) -> None:
        """See all of what is chosen, else everything."""
        scene = self._context.document.scene
        chosen = tuple(n for n in self._context.session.selection if n in scene.nodes)
        found = navigation.seen_box(scene, chosen)
        if found is None:
            self.frame_all()
        else:
            self._looking.flight.to(navigation.frame(self._context.session.view, *found))

    def frame_all(self) -> None:
        """See everything."""
        found = self._everything()
        if found is not None:
            self._looking.flight.to(navigation.frame(self._context.session.view, *found))

    def home(self) -> None:
        """See everything from the front, a little from the right and from above."""
        found = self._everything()
        if found is not None:
            view = framing(found[0], found[1], self._context.session.view)
            self._looking.flight.to(navigation.frame(view, *found))

    def walk(self) -> None:
        """Start walking with keys, or stop."""
        walking = self._looking.walking
        if walking.active:
            walking.stop()
        else:
            self._looking.flight.stop()
            walking.start()
            self._context.journal.write("W A S D walk, E and Q go up and down, Shift hurries; Esc ends it")

    def look_from(self, way: npt.ArrayLike) -> None:
        """From a side, an edge or a corner of the world, about what is chosen or looked at."""
        view, about = self._context.session.view, self._looking.pivot()
        self._looking.flight.to(navigation.from_direction(view, way, about))

    def expose(self, ev: float) -> None:
        """More or less exposure."""
        session = self._context.session
        session.display(exposure=float(np.clip(session.exposure + ev, -_EV_LIMIT, _EV_LIMIT)))

    def navigate_like(self, preset: str) -> None:
        """Another habit, of `PRESETS`."""
        self._looking.preset = PRESETS[preset]
        self._settings.set("navigation", preset)

    def invert_wheel(self, inverted: bool) -> None:
        """Which way the wheel goes."""
        self._looking.inverted = inverted
        self._settings.set("invert_wheel", inverted)

    def animate(self, animated: bool) -> None:
        """Whether the view moves smoothly to where it is sent."""
        self._looking.flight.animated = animated
        self._settings.set("animate_view", animated)

    def mouse(self) -> list[tuple[str, str]]:
        """What the mouse does to the view, as Help tells it."""
        return list(self._looking.preset.table())

    def _everything(self) -> tuple[navigation.F64, navigation.F64] | None:
        scene = self._context.document.scene
        return navigation.seen_box(scene, tuple(node.id for node in scene.children(None)))

    def _navigates_like(self, preset: str) -> bool:
        return self._looking.preset.id == preset
