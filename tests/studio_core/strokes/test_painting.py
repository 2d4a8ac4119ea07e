"""Marks of a mask over a picture: where they lie, what they say, and that nothing is lost."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import little_scene

from studio_core.contract import Services
from studio_core.scene.nodes import Camera
from studio_core.scene.transform import Transform, axis_angle, rotation_matrix
from studio_core.session import View
from studio_core.shading.offline import backend_params, picture
from studio_core.strokes.brush import Brush
from studio_core.strokes.marks import Marks
from studio_core.strokes.painting import NOTHING_KNOWN, NOTHING_SEEN, marks_of, stroke_name, stroke_of
from studio_core.strokes.tools import Gesture, Seen, ToolSettings, wanted

WIDTH, HEIGHT = 96, 64


def render(scene, services, antialias=2, fine=True):
    backend = services.registry.get("backend", "reference")
    view = View.of(next(scene.of(Camera)), scene, WIDTH, HEIGHT)
    view = dataclasses.replace(view, antialias=antialias, fine_edges=fine)
    params = backend_params(backend, {"directions": "1024", "vertices": "600"})
    return picture(scene, view, backend, params, services)


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


@pytest.fixture(scope="module")
def scene():
    made = little_scene()
    turned = Transform((0.3, 0.5, -0.2), axis_angle((0, 1, 0), 25), 0.9)
    return made.with_nodes(dataclasses.replace(made["cube"], transform=turned))


@pytest.fixture(scope="module")
def shown(scene, services):
    return render(scene, services)


def whole(shown):
    return np.ones(shown.linear.shape[:2], np.float32)


def world(scene, marked):
    """Places and normals in the world."""
    place, normal = np.empty((len(marked.marks), 3)), np.empty((len(marked.marks), 3))
    for number, node in enumerate(marked.objects):
        own, to = marked.marks.object == number, scene.world(node)
        turn = rotation_matrix(to.rotation)
        place[own] = to.scale * marked.marks.place[own] @ turn.T + to.translation
        normal[own] = marked.marks.normal[own] @ turn.T
    return place, normal


@pytest.mark.parametrize("limit", [1, 7, 60, 600, 10_000])
def test_marks_lie_on_the_surface_that_is_painted(scene, shown, limit):
    made = marks_of(shown, whole(shown), shown.linear, limit)
    assert len(made.marks) <= limit
    assert set(made.objects) <= {"floor", "cube"}
    place, normal = world(scene, made)
    kinds = np.array(made.objects)[made.marks.object]
    np.testing.assert_allclose(place[kinds == "floor", 1], 0, atol=1e-5)
    np.testing.assert_allclose(
        normal[kinds == "floor"], np.tile((0, 1, 0), (sum(kinds == "floor"), 1)), atol=1e-5
    )
    cube = np.abs(made.marks.place[kinds == "cube"]).max(axis=1)
    np.testing.assert_allclose(cube, 0.5, atol=1e-5)
    facing = ((made.marks.eye - place) * normal).sum(axis=1)
    assert (facing > 0).all()
    assert not made.marks.slot.any()
    assert np.isnan(made.marks.offset).all()


def test_no_light_is_lost_and_noise_averages_out(shown):
    rng = np.random.default_rng(5)
    mask = Brush(size=0.7, hardness=0.3).mask([(0.4, 0.5), (0.7, 0.8)], WIDTH, HEIGHT)
    noisy = shown.linear + rng.normal(0, 0.1, shown.linear.shape).astype(np.float32)
    few, many = marks_of(shown, mask, noisy, 20), marks_of(shown, mask, noisy, 5000)
    assert len(few.marks) > 10
    for name in ("shown", "wanted"):
        sums = [
            (getattr(made.marks, name) * made.marks.weight[:, None]).sum(axis=0) / made.marks.weight.sum()
            for made in (few, many)
        ]
        np.testing.assert_allclose(*sums, rtol=1e-4)
    spread = [
        (made.marks.weight @ (made.marks.wanted - made.marks.shown) ** 2).sum() / made.marks.weight.sum()
        for made in (few, many)
    ]
    assert spread[0] < spread[1] / 10
    assert (few.marks.weight > 0).all()
    assert (few.marks.weight <= 1).all()


def test_single_pixels_say_what_the_picture_says(shown):
    mask = np.zeros((HEIGHT, WIDTH), np.float32)
    y, x = np.argwhere((shown.node >= 0) & (shown.coverage == 1))[500]
    mask[y, x] = 0.25
    made = marks_of(shown, mask, 2 * shown.linear)
    assert len(made.marks) == 1
    assert made.marks.weight[0] == pytest.approx(0.25)
    np.testing.assert_allclose(made.marks.shown[0], shown.linear[y, x])
    np.testing.assert_allclose(made.marks.wanted[0], 2 * shown.linear[y, x], rtol=1e-6)
    assert made.objects == (shown.nodes[shown.node[y, x]],)


def test_parts_of_one_object_that_face_apart_have_marks_of_their_own(scene, shown):
    """With few marks, none stands for two sides of the cube."""
    only = (shown.node == shown.nodes.index("cube")).astype(np.float32)
    made = marks_of(shown, only, shown.linear, 4)
    _, normal = world(scene, made)
    sides = np.abs(normal @ rotation_matrix(scene.world("cube").rotation)).max(axis=1)
    np.testing.assert_allclose(sides, 1, atol=1e-5)
    assert len(made.marks) == 3


def test_marks_are_evenly_spread(shown):
    only = (shown.node == shown.nodes.index("floor")).astype(np.float32)
    made = marks_of(shown, only, shown.linear, 50)
    pixels = (only > 0).sum()
    assert 25 < len(made.marks) <= 50
    fair = made.marks.weight > 0.5
    assert made.marks.weight[fair].sum() > 0.7 * made.marks.weight.sum()
    assert pixels > 1000


def test_the_same_stroke_gives_the_same_marks(shown):
    one, other = (marks_of(shown, whole(shown), 2 * shown.linear, 100) for _ in range(2))
    assert one.marks.table().key == other.marks.table().key


def test_one_light_over_everything_is_flat(shown):
    seen, hand = Seen.of(shown), Gesture.of(Brush(size=0.4), [(0.5, 0.6)])
    mask = hand.mask(seen)
    red = wanted("replace", seen, hand, ToolSettings(colour=(0.6, 0.1, 0.1)))
    assert marks_of(shown, mask, red).flat
    assert not marks_of(shown, mask, wanted("brighten", seen, hand, ToolSettings())).flat
    assert not marks_of(shown, mask, shown.linear).flat
    even = dataclasses.replace(shown, linear=np.full_like(shown.linear, 0.5))
    assert not marks_of(even, mask, red).flat, "all of one colour has no shape that could be lost"


def test_a_stroke_on_the_background_has_no_marks_and_says_so(scene, shown):
    sky = (shown.coverage == 0).astype(np.float32)
    assert sky.any()
    for mask in (sky, np.zeros_like(sky)):
        made = marks_of(shown, mask, shown.linear)
        assert len(made.marks) == 0
        assert made.notes == (NOTHING_SEEN,)
        stroke = stroke_of(made, scene, "replace")
        assert stroke.marks is None
        assert stroke.objects == ()


def test_light_that_is_no_number_is_left_out(shown):
    broken = shown.linear.copy()
    broken[: HEIGHT // 2] = np.nan
    made = marks_of(shown, whole(shown), broken)
    assert np.isfinite(made.marks.wanted).all()
    assert len(made.marks) > 0
    assert len(marks_of(shown, whole(shown), np.full_like(broken, np.inf)).marks) == 0


def test_pictures_that_do_not_tell_what_they_show(shown):
    blind = dataclasses.replace(shown, radiance=dataclasses.replace(shown.radiance, hits=None))
    assert marks_of(blind, whole(shown), shown.linear).notes == (NOTHING_KNOWN,)
    with pytest.raises(ValueError, match="sizes"):
        marks_of(shown, np.ones((3, 3), np.float32), shown.linear)


@pytest.mark.parametrize("change", [{"opacity": 0.2}, {"catches": True}])
def test_what_is_looked_through_or_catches_shadows_is_not_painted(scene, services, change):
    clear = scene.with_materials(dataclasses.replace(scene.material("paint"), **change))
    shown = render(clear, services)
    assert marks_of(shown, whole(shown), shown.linear).objects == ("floor",)


def test_slots_are_told(scene, services):
    cube = scene["cube"]
    slots = np.repeat(np.arange(2, dtype=np.uint16), 6)
    geometry = dataclasses.replace(cube.geometry, slots=slots)
    made = dataclasses.replace(cube, geometry=geometry, materials=("matt", "paint"))
    shown = render(scene.with_nodes(made), services, antialias=1, fine=False)
    marked = marks_of(shown, (shown.node == shown.nodes.index("cube")).astype(np.float32), shown.linear)
    place, slot = marked.marks.place, marked.marks.slot
    axis = np.argmax(np.abs(place), axis=1)
    side = 2 * axis + (place[np.arange(len(axis)), axis] > 0)
    assert set(slot.tolist()) == {0, 1}
    np.testing.assert_array_equal(slot, side >= 3)


def test_strokes_are_named_after_what_they_are_on(scene, shown):
    made = marks_of(shown, whole(shown), 2 * shown.linear)
    assert np.bincount(made.marks.object).tolist() == sorted(np.bincount(made.marks.object), reverse=True)
    part = Brush(size=0.3).mask([(0.5, 0.45), (0.5, 0.6)], WIDTH, HEIGHT)
    assert marks_of(shown, part, 2 * shown.linear).objects[0] == "cube"
    stroke = stroke_of(made, scene, "brighten", weight=2.0)
    assert stroke.name == "Brighten on Floor and 1 other"
    assert stroke.weight == 2.0
    assert isinstance(stroke.marks, Marks)
    assert len(stroke.marks) == len(made.marks)
    assert stroke_of(made, scene, "blur", name="Softer").name == "Softer"
    assert stroke_name(scene, "blur", ("gone",)) == "Blur"


def test_a_flat_stroke_tells_what_lies_beside_it(shown):
    seen, hand = Seen.of(shown), Gesture.of(Brush(size=0.15), [(0.5, 0.45)])
    mask = hand.mask(seen)
    made = marks_of(shown, mask, wanted("replace", seen, hand, ToolSettings(colour=(0.6, 0.1, 0.1))), 80)
    assert made.flat
    beside = (made.marks.wanted == made.marks.shown).all(axis=1)
    assert 5 < beside.sum() <= 20
    assert (made.marks.weight[beside] <= 0.1).all()
    assert set(made.marks.object[beside]) <= set(made.marks.object[~beside]), "and not on other objects"
    alone = marks_of(shown, mask, wanted("brighten", seen, hand, ToolSettings()), 80)
    assert not (alone.marks.wanted == alone.marks.shown).all(axis=1).any()


def test_what_is_clipped_says_nothing(shown):
    """A painted picture that was cut off at 70 % of its pixels' brightness."""
    only = (shown.node == shown.nodes.index("cube")).astype(np.float32)
    wish = 3 * shown.linear
    level = np.quantile(wish[only > 0], 0.7, axis=0)
    made = marks_of(shown, only, np.minimum(wish, level))
    assert "clipped" in made.notes[0]
    np.testing.assert_allclose(made.marks.wanted, 3 * made.marks.shown, rtol=1e-3)
    assert not marks_of(shown, only, wish).notes


def test_light_that_is_even_is_not_clipped(shown):
    half = shown.linear.copy()
    half[:, : WIDTH // 2] = 2.0
    even = dataclasses.replace(shown, linear=half)
    made = marks_of(even, whole(shown), 2 * half)
    assert made.notes == ()
    assert (made.marks.wanted == 4).all(axis=1).any()
