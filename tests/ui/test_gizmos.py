"""Gizmos and drags without a window: what a handle is, and where things go."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from ui_support import room

from studio_core.copies import duplicate
from studio_core.edits import Add, Move
from studio_core.scene.bounds import exact_bounds
from studio_core.scene.nodes import PointLamp, Scene
from studio_core.scene.room import Room
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_core.session import View
from studio_ui.canvas.drags import CopyDrag, Hold, Words, called
from studio_ui.canvas.gizmos import ARM, Frame, Gizmo, Handle, metres_per_pixel
from studio_ui.canvas.moving import MoveDrag, on_axis, on_plane
from studio_ui.canvas.projection import axes_of, eye_of, project
from studio_ui.canvas.snapping import Neighbours, Pull, Snap, rounded
from studio_ui.canvas.turning import SizeDrag, TurnDrag
from studio_ui.canvas.typed import Typed
from studio_ui.canvas.viewport import Pointer

SIZE = (800.0, 600.0)
PIXELS = (800, 600)
coordinate = st.floats(-8, 8)
points = st.tuples(coordinate, coordinate, coordinate)
views = st.builds(
    lambda eye, fov: View(looking(eye, (0.1, 0.2, 0.3)), fov, 800, 600, math.dist(eye, (0.1, 0.2, 0.3))),
    st.tuples(coordinate, coordinate, coordinate).filter(lambda e: math.dist(e, (0.1, 0.2, 0.3)) > 1.0),
    st.floats(20, 90),
)
FREE = Snap(on=False)
FRONT = View(looking((0.0, 2.5, 7.0), (0.0, 0.6, 0.0)), 40.0, 800, 600, 7.2)


def pointer(view: View, point: np.ndarray | tuple[float, ...], **keys: bool) -> Pointer:
    x, y = project(view, point)[0]
    return Pointer("move", float(x), float(y), "left", pixels=PIXELS, **keys)


def hold(
    node: str = "stool",
    scene: Scene | None = None,
    view: View = FRONT,
    grip: tuple[float, float, float] | None = None,
    snap: Snap = FREE,
    **more: bool,
) -> Hold:
    made = scene or room()
    frame = Frame.of(made, (node,))
    assert frame is not None
    at = frame.pivot if grip is None else np.array(grip)
    return Hold(made, (node,), view, frame, pointer(view, at), at, snap, called=called(made, (node,)), **more)


def moved(held: Hold, edit: Move) -> np.ndarray:
    node = held.nodes[0]
    return np.subtract(edit(held.scene).world(node).translation, held.scene.world(node).translation)


@given(views, st.integers(0, 2), st.floats(-3, 3))
def test_a_drag_of_an_arrow_goes_along_its_axis_to_where_the_mouse_is(
    view: View, axis: int, metres: float
) -> None:
    held = hold(view=view)
    goal = held.grip + np.eye(3)[axis] * metres
    assume(all((p - eye_of(view)) @ -axes_of(view)[2] > 0.3 for p in (held.grip, goal)))
    sight = (held.grip - eye_of(view)) / np.linalg.norm(held.grip - eye_of(view))
    assume(abs(sight[axis]) < 0.98)
    edit = MoveDrag(held, Handle("axis", axis)).edit(pointer(view, goal))
    delta = moved(held, edit)
    assert delta == pytest.approx(np.eye(3)[axis] * metres, abs=1e-5)


@given(views, st.integers(0, 2), st.floats(-1, 2), st.floats(-1, 2))
def test_whatever_the_mouse_does_an_arrow_moves_along_its_axis_only(
    view: View, axis: int, x: float, y: float
) -> None:
    held = hold(view=view)
    assume(np.isfinite(held.press.x))
    delta = moved(held, MoveDrag(held, Handle("axis", axis)).edit(Pointer("move", x, y, pixels=PIXELS)))
    assert np.abs(np.delete(delta, axis)).max() < 1e-9
    assert abs(delta[axis]) <= 30 * np.linalg.norm(held.grip - eye_of(view))


@given(views, st.integers(0, 2), points)
def test_a_plane_is_kept_and_followed(view: View, normal: int, goal: tuple[float, float, float]) -> None:
    held = hold(view=view)
    point = np.array(goal)
    point[normal] = held.grip[normal]
    eye = eye_of(view)
    assume((held.grip - eye) @ -axes_of(view)[2] > 0.3)
    assume((point - eye) @ -axes_of(view)[2] > 0.3)
    assume(np.linalg.norm(point - eye) < 10 * np.linalg.norm(held.grip - eye))
    for p in (held.grip, point):
        assume(abs((p - eye)[normal]) > 0.05 * np.linalg.norm(p - eye))
    delta = moved(held, MoveDrag(held, Handle("plane", normal)).edit(pointer(view, point)))
    assert abs(delta[normal]) < 1e-9
    assert delta == pytest.approx(point - held.grip, abs=1e-4)


def test_past_the_vanishing_point_an_axis_goes_no_further() -> None:
    view = View(looking((0, 1, 4), (0, 0, 0)), 50, 800, 600, 4.0)
    end = project(view, (0.0, 0.0, -1e6))[0]
    here = on_axis(view, (0, 0, 0), (0, 0, -1), float(end[0]), float(end[1]) + 0.01)
    beyond = on_axis(view, (0, 0, 0), (0, 0, -1), float(end[0]), float(end[1]) - 0.3)
    assert 0 < here <= beyond == pytest.approx(12 * math.hypot(1, 4))
    behind = View(looking((0, 1, 4), (0, 1, 8)), 50, 800, 600, 4.0)
    assert on_axis(behind, (0, 0, 0), (1, 0, 0), 0.5, 0.5) == 0.0


@given(views, st.floats(0, 1), st.floats(0, 1), points)
def test_points_of_planes_lie_in_them(view: View, x: float, y: float, through: tuple[float, ...]) -> None:
    for normal in np.eye(3):
        found = on_plane(view, through, normal, x, y)
        assert np.isfinite(found).all()
        assert abs((found - through) @ normal) < 1e-6


@given(views)
def test_a_gizmo_is_as_large_from_everywhere(view: View) -> None:
    frame = Frame(np.array([0.1, 0.2, 0.3]), np.eye(3))
    gizmo = Gizmo("move", frame, view, SIZE)
    right = axes_of(view)[0] * gizmo.arm
    ends = project(view, [frame.pivot, frame.pivot + right]) * SIZE
    assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(ARM, rel=1e-6)


@given(views, st.sampled_from(["move", "rotate", "scale"]))
def test_what_is_drawn_can_be_grabbed_where_it_is_drawn(view: View, tool: str) -> None:
    gizmo = Gizmo(tool, Frame(np.array([0.1, 0.2, 0.3]), np.eye(3)), view, SIZE)
    for handle in gizmo.handles():
        if handle.kind not in ("axis", "size") or handle.axis < 0:
            continue
        x, y = project(view, gizmo.frame.pivot + gizmo.arm * 0.95 * np.eye(3)[handle.axis])[0]
        picked = gizmo.pick(float(x), float(y))
        assert picked is not None
        assert picked.kind in (handle.kind, "ring")
    assert gizmo.pick(0.02, 0.02) is None or gizmo.arm == 0


def test_an_axis_at_the_eye_and_a_plane_seen_edge_on_cannot_be_grabbed() -> None:
    view = View(looking((0, 0, 6), (0, 0, 0)), 40, 800, 600, 6.0)
    kinds = [(h.kind, h.axis) for h in Gizmo("move", Frame(np.zeros(3), np.eye(3)), view, SIZE).handles()]
    assert kinds == [("free", -1), ("axis", 0), ("axis", 1), ("plane", 2)]
    assert Gizmo("move", Frame(np.array([0.0, 0.0, 9.0]), np.eye(3)), view, SIZE).handles() == []


def test_a_gizmo_stands_at_the_foot_of_furniture_and_at_a_lamp() -> None:
    scene = Add((PointLamp(id="lamp", name="Lamp", transform=Transform((0.0, 2.0, 0.0))),))(room())
    turn = Move({"stool": Transform((1.0, 0.0, 0.0), axis_angle((0, 1, 0), 30))})(scene)
    for local in (False, True):
        frame = Frame.of(turn, ("stool",), local=local)
        assert frame is not None
        assert frame.pivot == pytest.approx((1.0, 0.0, 0.0))
        assert frame.axes[0] == pytest.approx((np.cos(np.pi / 6), 0, -0.5) if local else (1, 0, 0))
    lamp = Frame.of(scene, ("lamp",))
    assert lamp is not None
    assert lamp.pivot == pytest.approx((0, 2, 0))


# the floor, and what stands on it


def test_what_is_dragged_over_a_table_stands_on_it_and_goes_under_it() -> None:
    scene = Move({"stool": Transform((2.0, 0.0, 0.0), scale=0.4)})(room())
    held = hold("stool", scene, snap=Snap(grid=False, objects=False), grip=(2.0, 0.2, 0.2))
    drag = MoveDrag(held)
    offset = held.grip - held.frame.pivot
    onto = drag.edit(pointer(FRONT, np.array([-0.8, 1.0, 0.3]) + offset))
    assert onto(scene).world("stool").translation == pytest.approx((-0.8, 1.0, 0.3), abs=1e-6)
    beside = drag.edit(pointer(FRONT, np.array([0.5, 0.0, 0.8]) + offset))
    assert beside(scene).world("stool").translation == pytest.approx((0.5, 0.0, 0.8), abs=1e-6)
    plain = drag.edit(pointer(FRONT, np.array([-0.8, 0.0, 0.3]) + offset, ctrl=True))
    assert plain(scene).world("stool").translation == pytest.approx((-0.8, 0.0, 0.3), abs=1e-6)


def test_nothing_jumps_when_it_is_grabbed_behind_a_table() -> None:
    scene = Move({"stool": Transform((-1.0, 0.0, -1.6), scale=0.4)})(room())
    view = View(looking((-1.0, 2.5, 7.0), (-1.0, 0.6, 0.0)), 40.0, 800, 600, 7.2)
    held = hold("stool", scene, view, (-1.0, 0.4, -1.6), Snap(grid=False, objects=False))
    assert moved(held, MoveDrag(held).edit(held.press)) == pytest.approx((0, 0, 0), abs=1e-6)


@given(views, st.floats(0, 1), st.floats(0, 1))
def test_what_stands_never_floats(view: View, x: float, y: float) -> None:
    scene = Move({"stool": Transform((2.0, 0.0, 0.0), scale=0.4)})(room())
    held = hold("stool", scene, view)
    assume(np.isfinite(held.press.x))
    edit = MoveDrag(dataclasses.replace(held, snap=Snap())).edit(Pointer("move", x, y, pixels=PIXELS))
    low, high = exact_bounds(edit(scene), ("stool",)) or (np.zeros(3), np.zeros(3))
    levels = {0.0, 1.0, 1.5}
    assert min(abs(low[1] - level) for level in levels) < 1e-6
    assert (high - low) == pytest.approx((0.4, 0.4, 0.4), abs=1e-6)


def test_lamps_keep_their_height_and_shift_lifts() -> None:
    scene = Add((PointLamp(id="lamp", name="Lamp", transform=Transform((0.0, 2.0, 0.0))),))(room())
    held = hold("lamp", scene, snap=Snap(objects=False))
    drag = MoveDrag(held)
    assert moved(held, drag.edit(pointer(FRONT, (0.52, 2.0, 0.31)))) == pytest.approx((0.5, 0, 0.3), abs=1e-6)
    drag.edit(pointer(FRONT, (0.52, 2.0, 0.31), shift=True))
    up = moved(held, drag.edit(pointer(FRONT, (0.52, 2.5, 0.31), shift=True)))
    assert up == pytest.approx((0.5, 0.5, 0.3), abs=0.03)
    assert drag.label == f"Move Lamp {drag.told()}" or drag.label.startswith("Move Lamp ")


# snapping

deltas = st.tuples(*[st.floats(-3, 3)] * 3)


@given(deltas, st.sampled_from([0.0, 0.05, 0.3]), st.floats(0.003, 0.1), st.booleans())
def test_what_is_snapped_stays(delta: tuple[float, ...], step: float, near: float, objects: bool) -> None:
    neighbours = Neighbours(room(), ("stool",))
    pull = Pull(near, step, (1.0, 0.013, -0.2), objects, (0.0, 0.7))
    once, _ = neighbours.snapped(delta, (0, 1, 2), pull)
    twice, met = neighbours.snapped(once, (0, 1, 2), pull)
    assert twice == pytest.approx(once, abs=1e-12)
    box = neighbours.box
    assert box is not None
    for one in met:
        mine = [*(box[:, one.axis] + once[one.axis]), (box[:, one.axis] + once[one.axis]).mean()]
        assert min(abs(place - one.at) for place in mine) < 1e-9, "a side or the middle is there"


@given(deltas, st.floats(0.003, 0.1))
def test_without_anything_near_things_come_to_the_grid(delta: tuple[float, ...], near: float) -> None:
    far = tuple(d + 50 for d in delta)
    made, met = Neighbours(room(), ("stool",)).snapped(far, (0, 2), Pull(near, 0.05, (1.0, 0.0, 0.0)))
    assert met == []
    assert made[1] == far[1]
    for axis, lead in ((0, 1.0), (2, 0.0)):
        assert (made[axis] + lead) / 0.05 == pytest.approx(round((made[axis] + lead) / 0.05), abs=1e-6)
        assert abs(made[axis] - far[axis]) <= 0.025 + 1e-9


def test_a_side_is_met_and_shown() -> None:
    neighbours = Neighbours(room(), ("stool",))
    made, met = neighbours.snapped((-0.98, 0.0, 0.0), (0, 2), Pull(0.05, 0.05))
    assert made == pytest.approx((-1.0, 0.0, 0.0)), "beside the chair"
    assert {(m.axis, m.at) for m in met} >= {(0, -0.5)}
    words = [mark.text for mark in neighbours.guides(made, met, str).marks if hasattr(mark, "text")]
    assert words
    assert all("Chair" in text for text in words)


def test_what_surrounds_a_thing_counts_by_its_parts() -> None:
    inside = Neighbours(room(), ("back",))
    assert inside.names.count("Seat") == 1
    assert "Chair" not in inside.names
    assert Neighbours(room(), ("chair",)).names == ["Stool"]


def test_furniture_meets_a_rooms_walls_from_inside() -> None:
    materials = ("blue",) * 5
    walls = Room(id="walls", name="Walls", materials=materials, width=6.0, depth=4.0, thickness=0.3)
    neighbours = Neighbours(Add((walls,))(room()), ("stool",))
    assert set(neighbours.names) == {"Walls", "Chair"}
    made, met = neighbours.snapped((1.48, 0.0, -1.53), (0, 2), Pull(0.05))
    assert made == pytest.approx((1.5, 0.0, -1.5))
    assert {(one.axis, one.at) for one in met} == {(0, 3.0), (2, -2.0)}
    turned = Add((dataclasses.replace(walls, transform=Transform(rotation=axis_angle((0, 1, 0), 30))),))(
        room()
    )
    assert "Walls" in Neighbours(turned, ("stool",)).names


@given(st.floats(-1000, 1000), st.sampled_from([0.0, 0.05, 15.0]))
def test_rounding_twice_is_rounding_once(value: float, step: float) -> None:
    assert rounded(rounded(value, step), step) == pytest.approx(rounded(value, step))


# turning and scaling


@given(views, st.integers(0, 2), st.floats(-170, 170))
def test_a_ring_turns_as_far_as_the_mouse_goes_round(view: View, axis: int, degrees: float) -> None:
    held = hold(view=view)
    normal = np.eye(3)[axis]
    sight = eye_of(view) - held.frame.pivot
    assume(abs(sight[axis]) > 0.3 * np.linalg.norm(sight))
    u = np.roll(normal, 1) * 0.4
    v = np.cross(normal, u)

    def at(angle: float) -> Pointer:
        return pointer(view, held.frame.pivot + u * np.cos(np.radians(angle)) + v * np.sin(np.radians(angle)))

    assume((held.frame.pivot - eye_of(view)) @ -axes_of(view)[2] > 1.0)
    start = dataclasses.replace(held, press=at(0))
    drag = TurnDrag(start, Handle("ring", axis))
    for share in (0.25, 0.5, 0.75, 1.0):
        edit = drag.edit(at(share * degrees))
    turn = edit(held.scene).world("stool").matrix()[:3, :3]
    assert turn == pytest.approx(Transform(rotation=axis_angle(normal, degrees)).matrix()[:3, :3], abs=1e-5)


def test_angles_snap_and_are_told() -> None:
    drag = TurnDrag(dataclasses.replace(hold(), snap=Snap()))
    press = drag._hold.press
    edit = drag.edit(dataclasses.replace(press, x=press.x + 50 / 360))
    assert edit.label == "Turn Stool 45°"
    edit = drag.edit(dataclasses.replace(press, x=press.x + 50 / 360, ctrl=True))
    assert edit.label == "Turn Stool 50°"
    drag.type(-12.5)
    assert drag.edit(press).label == "Turn Stool -12.5°"


def test_a_thing_grows_about_its_foot() -> None:
    held = hold()
    start = dataclasses.replace(held, press=pointer(FRONT, (2.0, 0.0, 0.0)))
    drag = SizeDrag(start, Handle("size", 0))
    edit = drag.edit(pointer(FRONT, (3.0, 0.0, 0.0)))
    after = edit(held.scene)
    assert after.world("stool").scale == pytest.approx(2.0, rel=1e-6)
    low, _ = exact_bounds(after, ("stool",)) or (np.zeros(3), np.zeros(3))
    assert low == pytest.approx((0.0, 0.0, -1.0))
    assert edit.label == "Scale Stool to 200%"
    drag.type(1.5)
    assert drag.edit(start.press)(held.scene).world("stool").scale == pytest.approx(1.5)


# typing, copies


@given(st.integers(0, 2), st.floats(-5, 5), st.floats(0, 1), st.floats(0, 1))
def test_what_is_typed_counts_wherever_the_mouse_is(axis: int, metres: float, x: float, y: float) -> None:
    held = hold(snap=Snap())
    drag = MoveDrag(held, Handle("axis", axis))
    drag.edit(Pointer("move", x, y, pixels=PIXELS))
    drag.type(metres)
    assert moved(held, drag.edit(Pointer("move", y, x, pixels=PIXELS))) == pytest.approx(
        np.eye(3)[axis] * metres, abs=1e-9
    )
    drag.type(None)
    again = moved(held, drag.edit(held.press))
    assert again == pytest.approx((0, 0, 0), abs=1e-9)


def test_a_typed_distance_goes_the_way_of_the_hand() -> None:
    held = hold(snap=FREE)
    drag = MoveDrag(held)
    drag.edit(pointer(FRONT, held.grip + np.array([0.3, 0.0, 0.4])))
    drag.type(2.0)
    delta = moved(held, drag.edit(held.press))
    assert delta == pytest.approx((1.2, 0.0, 1.6), abs=1e-5)
    assert drag.label == "Move Stool 2 m"


def test_amounts_are_told_in_a_persons_unit() -> None:
    assert [Words().length(m) for m in (1.25, 0.8, -0.003)] == ["1.25 m", "80 cm", "-3 mm"]
    assert Words("mm", ",").length(1.2338) == "1234 mm"
    assert Words("cm", ",").length(1.2348) == "123,5 cm"
    assert Words("ft-in").length(0.762) == "2'6\""
    assert Words(mark=",").angle(12.5) == "12,5°"


def test_typing() -> None:
    typed = Typed("m")
    for letter in "80 cm":
        assert typed.take(letter)
    assert typed.amount == pytest.approx(0.8)
    for _ in range(3):
        typed.take("backspace")
    assert (typed.text, typed.amount) == ("80", 80.0)
    assert not typed.take("x")
    for text, metres in (("2'6\"", 0.762), ("0,8", 0.8), ("1 m + 20 cm", 1.2), ("-5mm", -0.005)):
        typed = Typed("m")
        assert all(typed.take(letter) for letter in text)
        assert typed.amount == pytest.approx(metres)
    assert not Typed("m").take("m"), "typing starts with a number"
    odd = Typed("m")
    for letter in "80 grams":
        odd.take(letter)
    assert odd.amount is None
    assert "gram" in odd.problem


def test_copies_go_and_the_original_stays() -> None:
    held = hold("chair", copies=True, snap=FREE)
    add = duplicate(held.scene, held.nodes)
    (copy,) = [n.id for n in add.nodes if n.parent is None]
    inner = MoveDrag(dataclasses.replace(held, scene=add(held.scene), nodes=(copy,)), Handle("axis", 0))
    drag = CopyDrag(add, (copy,), inner)
    edit = drag.edit(pointer(FRONT, held.grip + np.array([0.5, 0, 0])))
    after = edit(held.scene)
    assert after["chair"] is held.scene["chair"]
    assert after.world(copy).translation == pytest.approx((-0.5, 0, 0), abs=1e-6)
    assert edit.label == "Copy Chair 50 cm along X"


def test_a_pixel_in_metres() -> None:
    view = View(looking((0, 0, 10), (0, 0, 0)), 90, 800, 600, 10.0)
    assert metres_per_pixel(view, 600, (0, 0, 0)) == pytest.approx(20 / 600)
    assert metres_per_pixel(view, 600, (0, 0, 11)) == 0.0
