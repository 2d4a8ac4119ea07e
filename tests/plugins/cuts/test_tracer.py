"""Tracing object by object finds what one ray after the other against the whole scene finds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import cuts as oracle
from scenes import cube, floor

from studio_core.kernels.directions import direction_set
from studio_core.parallel import Workers
from studio_core.scene.geometry import Geometry
from studio_core.scene.transform import Transform, axis_angle
from studio_plugins.cuts import store as module
from studio_plugins.cuts.store import VisibilityStore
from studio_plugins.cuts.tracer import HORIZON, PACKETS, RAYS, SKIPPED, TRACED, frustum

GRAZING = 2e-4  # share of rays that pass an edge so closely that rounding decides
numbers = st.floats(-3, 3, allow_nan=False)
halves = st.sampled_from([0.0, 1e-3]) | st.floats(0.01, 2)


def traced(room, workers, job, k=10):
    store = VisibilityStore(k, workers)
    store.follow(room.surfaces, room.occluders)
    store.trace(room.everything, job)
    return store


def random_room(kit, seed, **options):
    """A floor, and things of all kinds turned, scaled, through each other, some of them of one mesh."""
    rng = np.random.default_rng(seed)
    shapes = [cube(0.5), kit.soup(seed), kit.sheet()]
    things = {"floor": kit.Thing(floor(4.0))}
    for number in range(6):
        turn = axis_angle(rng.normal(size=3), rng.uniform(-180, 180))
        place = Transform(rng.uniform((-1.2, 0.1, -1.2), (1.2, 1.0, 1.2)), turn, rng.choice([0.4, 1.0, 1.7]))
        things[f"thing {number}"] = kit.Thing(shapes[number % 3], place, bool(number != 4))
    return kit.make(things, **options)


@given(st.tuples(numbers, numbers, numbers), st.tuples(halves, halves, halves), st.integers(0, 2**32 - 1))
def test_the_frustum_holds_the_box_and_no_more_than_it_must(point, half, seed):
    half, point = np.array(half), np.array(point)
    planes = np.full((6, 3), np.nan)
    sides = frustum(*point, half, planes)
    skin = 1e-5 * half.sum() + 1e-9
    if (np.abs(point) <= half + skin).all():
        assert sides == 0
        return
    normals = planes[:sides]
    assert 4 <= sides <= 6
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-12)
    rng = np.random.default_rng(seed)
    inside = oracle.ways_to_a_box(point, half, 64, rng)
    assert (inside @ normals.T).min() > -1e-9
    ways = rng.normal(size=(256, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (-half - skin - point) / ways, (half + skin - point) / ways
    near, far = np.minimum(a, b).max(axis=1), np.maximum(a, b).min(axis=1)
    meets = (far >= near) & (far > 0)
    within = (ways @ normals.T >= 1e-6).all(axis=1)
    assert not (meets & (ways @ normals.T < -1e-6).any(axis=1)).any()
    assert not (within & ~meets & (ways @ -point > 0)).any()


@pytest.mark.parametrize(("seed", "backend"), [(0, "auto"), (1, "auto"), (2, "bvh")])
def test_records_say_what_rays_against_the_scene_say(kit, workers, job, seed, backend):
    room = random_room(kit, seed, backend=backend, edge=4.0 if backend == "bvh" else 0.4)
    assert backend == "auto" or room.casters.shadow.backend == "bvh"
    store = traced(room, workers, job)
    found, truth = kit.seen_by(store), room.truth(10, workers)
    assert truth.any()
    assert (found != truth).mean() < GRAZING
    assert store.counts[[RAYS, HORIZON, SKIPPED, PACKETS, TRACED]].min() > 0


def test_coordinates_far_away_and_tiny_things(kit, workers, job):
    for scale, place in ((1e-3, (0.0, 0.0, 0.0)), (1.0, (1e4, -2e3, 1e4))):
        base = Transform(place, scale=scale)
        things = {
            "floor": kit.Thing(floor(4.0), base),
            "box": kit.Thing(cube(0.5), base @ Transform((0.4, 0.25, 0.1), axis_angle((0, 1, 0), 30))),
            "soup": kit.Thing(kit.soup(1), base @ Transform((-0.5, 0.6, -0.2))),
        }
        room = kit.make(things, edge=0.5 * scale, origin=place)
        found = kit.seen_by(traced(room, workers, job))
        assert (found != room.truth(10, workers)).mean() < GRAZING
        assert 0.1 < found.mean() < 0.5


def test_what_does_not_stop_light_stops_none(kit, workers, job):
    room = kit.room
    clear = kit.Thing(room.things["box"].geometry, room.things["box"].transform, opaque=False)
    with_box, without = traced(room.with_thing("box", clear), workers, job), traced(room, workers, job)
    floor_points = room.mesh.vertices_of(0)
    gone = traced(room.without("box"), workers, job)
    np.testing.assert_array_equal(kit.seen_by(with_box)[floor_points], kit.seen_by(gone)[floor_points])
    assert kit.seen_by(without)[floor_points].sum() < kit.seen_by(with_box)[floor_points].sum()


def test_more_directions_than_a_small_record_holds(kit, workers, job):
    room = kit.make({n: kit.room.things[n] for n in ("floor", "box")}, edge=4.0)
    store = traced(room, workers, job, 17)
    assert store.exact.pool.dtype == np.uint32
    found = kit.seen_by(store)
    assert (found != room.truth(17, workers)).mean() < GRAZING
    assert found[:, 1 << 16 :].any()


def test_blocks_skipped_by_cones_lose_no_hit(kit, workers, job):
    """A wall all around is traced in every direction; what is skipped then is the horizon's."""
    shell = Geometry(-cube(3.9).positions, cube(3.9).faces[:, ::-1].copy())
    room = kit.make({"floor": kit.Thing(floor(2.0)), "shell": kit.Thing(shell)}, edge=1.0)
    store = traced(room, workers, job, 11)
    inside = room.mesh.vertices_of(0)
    assert not room.truth(11, workers)[inside].any()
    assert not kit.seen_by(store)[inside].any()


def test_vertices_that_are_not_finite_see_nothing(kit, workers, job):
    room = kit.room
    mesh = room.mesh
    broken = mesh.normals.copy()
    broken[3] = np.nan
    broken.flags.writeable = False
    object.__setattr__(mesh, "normals", broken)
    found = kit.seen_by(traced(room, workers, job))
    assert not found[3].any()
    assert found[4].any()


def test_one_and_two_threads_write_the_same_records(kit, job):
    made = []
    for threads in (1, 2):
        with Workers(threads) as own:
            made.append(kit.records(traced(kit.room, own, job)))
    assert made[0] == made[1]


def test_rooms_for_records_grow_while_they_are_filled(kit, workers, job, monkeypatch):
    """Records of hundreds of shards do not fit at first."""
    shards = {f"soup {i}": kit.Thing(kit.soup(i, 40), Transform((0, 0.5, 0))) for i in range(3)}
    room = kit.make({"floor": kit.Thing(floor(1.0)), **shards}, edge=0.5)
    wide = kit.records(traced(room, workers, job))
    monkeypatch.setattr(module, "_NUMBERS_A_RECORD", {True: 0, False: 0})
    assert kit.records(traced(room, workers, job)) == wide


@pytest.mark.parametrize("axis", [0, 2])
def test_a_turn_by_a_right_angle_turns_what_is_seen(kit, workers, job, axis):
    """Directions in the frame of a turned object are the turned directions."""
    directions = direction_set(10)
    box = kit.Thing(cube(0.5), Transform((0.0, 0.5, 0.0)))
    plain = kit.make({"floor": kit.Thing(floor(4.0)), "box": box}, edge=0.5)
    turn = axis_angle(np.eye(3)[axis], 90.0)
    turned = plain.placed(box=Transform((0.0, 0.5, 0.0), turn))
    a, b = (kit.seen_by(traced(room, workers, job)) for room in (plain, turned))
    here = plain.mesh.vertices_of(0)
    assert (a[here] != b[here]).mean() < 10 * GRAZING  # the same cube, whichever way it is turned
    assert a[here].mean() < (directions.directions[:, 1] > 0).mean()
