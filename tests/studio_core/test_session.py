"""View, selection, backend: what is told when, and what a framed view shows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import little_scene

from studio_core.scene.diff import Aspect
from studio_core.scene.nodes import Camera, Group
from studio_core.scene.transform import Transform, looking
from studio_core.session import Session, View, framing

CORNER = st.tuples(*[st.floats(-100, 100)] * 3)


def listening(session: Session) -> list[object]:
    heard: list[object] = []
    session.changed.connect(heard.append)
    session.selected.connect(lambda: heard.append("selected"))
    session.displayed.connect(lambda: heard.append("displayed"))
    return heard


def test_only_what_differs_is_told() -> None:
    session = Session()
    heard = listening(session)
    session.look(View())
    session.select(())
    assert heard == []
    session.look(View(fov=30.0))
    session.select(["a", "b", "a"])
    session.select(("a", "b"))
    assert heard == [Aspect.VIEW, "selected"]
    assert session.selection == ("a", "b")


def test_exposure_shades_nothing_again() -> None:
    session = Session()
    heard = listening(session)
    session.display(exposure=2.0)
    session.display(tonemap="agx")
    assert heard == ["displayed", "displayed"]
    assert (session.exposure, session.tonemap) == (2.0, "agx")


def test_another_backend_is_another_quality() -> None:
    session = Session()
    heard = listening(session)
    params = {"directions": 4096}
    session.shade_with("reference", params)
    params["directions"] = 1
    assert heard == [Aspect.QUALITY]
    assert dict(session.params) == {"directions": 4096}


def test_two_sessions_do_not_interact() -> None:
    one, two = Session(), Session()
    heard = listening(two)
    one.select(["a"])
    one.look(View(fov=20.0))
    assert heard == []
    assert (two.selection, two.view) == ((), View())


def test_a_camera_in_a_scaled_group_sees_in_metres() -> None:
    scene = little_scene().with_nodes(
        Group(id="g", transform=Transform((1.0, 0.0, 0.0), scale=3.0)),
        Camera(id="inside", parent="g", transform=looking((0, 1, 0), (0, 1, -1)), fov=60.0, focus=2.0),
    )
    camera = scene["inside"]
    assert isinstance(camera, Camera)
    view = View.of(camera, scene, 640, 480)
    assert (view.transform.scale, view.fov, view.width, view.height) == (1.0, 60.0, 640, 480)
    assert view.transform.translation == pytest.approx((1, 3, 0))
    assert view.target == pytest.approx((1, 3, -2))


def test_no_view_has_no_pixels() -> None:
    assert (View().sized(0, -3).width, View().sized(0, -3).height) == (1, 1)
    assert View().sized(7, 5).fov == View().fov


@given(CORNER, CORNER, st.integers(1, 4000), st.integers(1, 4000), st.floats(5, 120))
def test_framing_shows_the_whole_box(one: object, other: object, width: int, height: int, fov: float) -> None:
    low, high = np.minimum(one, other), np.maximum(one, other)
    view = framing(low, high, View(fov=fov, width=width, height=height))
    inward = np.linalg.inv(view.transform.matrix())
    tangent = np.tan(np.radians(fov / 2))
    for pick in np.ndindex(2, 2, 2):
        corner = np.where(pick, high, low)
        x, y, z, _ = inward @ (*corner, 1.0)
        assert z < 0
        assert abs(y) <= -z * tangent * (1 + 1e-6) + 1e-6
        assert abs(x) <= -z * tangent * width / height * (1 + 1e-6) + 1e-6
    assert view.target == pytest.approx(tuple((low + high) / 2), abs=1e-6 * (1 + view.focus))
    assert view.transform.matrix()[1, 1] > 0  # upright


def test_a_part_knows_its_whole() -> None:
    whole = View(width=8, height=6)
    part = whole.part(2, 3)
    assert (part.top, part.height, part.rows, part.width) == (2, 3, 6, 8)
    assert part.part(4, 2) == whole.part(4, 2)
    assert whole.rows == 6


@pytest.mark.parametrize(("top", "height"), [(4, 3), (-1, 2), (6, 1)])
def test_a_part_lies_in_the_picture(top: int, height: int) -> None:
    with pytest.raises(ValueError, match="part"):
        View(width=8, height=6).part(top, height)


def test_light_between_surfaces_is_a_matter_of_its_own() -> None:
    session = Session()
    heard = listening(session)
    assert session.bouncing
    session.bounce()
    session.bounce(True)
    session.show_light("all")
    assert heard == []
    session.bounce(False)
    session.bounce(True, "paths", {"samples": 8})
    session.bounce(method="gather", params={"bounces": 2})
    session.bounce(method="paths")
    assert dict(session.indirect_params["paths"]) == {"samples": 8}
    assert dict(session.indirect_params["gather"]) == {"bounces": 2}
    session.show_light("share")
    assert heard == [Aspect.INDIRECT] * 5
    with pytest.raises(ValueError, match="'dim'"):
        session.show_light("dim")
