"""Views to try, for hypothesis."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from studio_core.scene.transform import looking
from studio_core.session import View

PLACES = st.tuples(*[st.floats(-5, 5)] * 3)


@st.composite
def views(draw: st.DrawFn) -> View:
    """An upright view of something nearby, neither from straight above nor below."""
    target, turned, height = draw(PLACES), draw(st.floats(0, 360)), draw(st.floats(-80, 80))
    focus = draw(st.floats(0.5, 20))
    a, b = np.radians(turned), np.radians(height)
    way = np.array([np.cos(b) * np.sin(a), np.sin(b), np.cos(b) * np.cos(a)])
    place = looking(np.array(target) + focus * way, target)
    width, height_px = draw(st.sampled_from([(960, 540), (400, 900), (500, 500)]))
    return View(place, draw(st.floats(15, 90)), width, height_px, focus)
