"""Lamps and suns: the nodes of traced layers, and what of them is kept when things move."""

from __future__ import annotations

import numpy as np
import pytest
from counting_stages import StoppingJob
from hypothesis import given
from hypothesis import strategies as st
from oracles import cuts as oracle
from scenes import cube, floor

from studio_core.errors import Cancelled
from studio_core.kernels.directions import DirectionList
from studio_core.kernels.radiance import lamp_terms
from studio_core.kernels.visibility import occlusion_rays
from studio_core.params import defaults
from studio_core.scene.transform import Transform, axis_angle, rotation_matrix
from studio_core.shading.artifacts import Lamp, Shapes
from studio_core.shading.brute_force import lamp_layer
from studio_core.shading.job import Job
from studio_plugins.cuts.lamps import LampCache, Source, lamp_source, shadowed, sphere
from studio_plugins.cuts.store import VisibilityStore

EYE = np.array([0.5, 1.5, 3.0])


def lamp(kind, place=(0.4, 1.6, 0.3), turn=(1, 0, 0), degrees=-80.0, size=0.8):
    right, up, back = rotation_matrix(axis_angle(turn, degrees)).T
    return Lamp(
        kind, kind, np.array(place), -back, right * size, up * size, np.cos(0.9), np.cos(0.4), np.radians(3.0)
    )


LAMPS = [lamp("point"), lamp("spot"), lamp("directional"), lamp("area")]


@pytest.fixture(scope="session")
def shapes(host):
    """A matt and a glossy material."""
    own = []
    for model, values in (("lambert", {}), ("ggx", {"roughness": 0.5})):
        brdf = host.brdf(model)
        own.append((brdf, np.atleast_1d(brdf.shape({**defaults(brdf.Params), **values})).astype(np.float32)))
    address, terms = ([getattr(b, name) for b, _ in own] for name in ("address", "terms"))
    return Shapes(
        np.array(address, np.int64),
        np.array(terms, np.int64),
        np.array([0, len(own[0][1])], np.int64),
        np.concatenate([own[0][1], own[1][1], np.zeros(1, np.float32)]),
    )


def with_materials(room):
    """Every other object is glossy."""
    mesh = room.mesh
    material = (mesh.object % 2).astype(np.int32)
    object.__setattr__(mesh, "material", material)
    return material == 1


class Bench:
    def __init__(self, room, workers, shapes):
        self.workers, self.shapes = workers, shapes
        self.store, self.cache = VisibilityStore(10, workers), LampCache(workers)
        self.follow(room)

    def follow(self, room):
        self.room, self.glossy = room, with_materials(room)
        self.store.follow(room.surfaces, room.occluders)
        return self

    def gather(self, source, points=None, coarse=None, job=None, glossy=None):
        self.cache.follow(source, self.store)
        points = self.room.everything if points is None else points
        glossy = self.glossy if glossy is None else glossy
        job = job or Job("test")
        return self.cache.gather(self.room.mesh, self.room.casters.shadow, points, glossy, coarse, job)

    def layer(self):
        mesh = self.room.mesh
        terms = np.zeros((len(mesh), self.shapes.width, 3), np.float32)
        eye, every = (EYE - mesh.origin).astype(np.float32), np.ones(len(mesh), np.bool_)
        self.cache.table.shade(mesh, self.shapes, eye, every, terms, self.workers, Job("test"))
        return terms, self.cache.table.irradiance

    def assert_like(self, other):
        for mine, theirs in zip(self.layer(), other.layer(), strict=True):
            np.testing.assert_array_equal(mine, theirs)


@pytest.fixture
def fresh(workers, shapes):
    """The same asked of a cache that knows nothing."""

    def make(room, source):
        made = Bench(room, workers, shapes)
        made.gather(source)
        return made

    return make


@pytest.mark.parametrize("one", LAMPS, ids=lambda one: one.kind)
def test_a_lamp_s_layer_is_that_of_brute_force(kit, workers, shapes, one, job):
    bench = Bench(kit.room, workers, shapes)
    assert bench.gather(lamp_source(one, 16)) == len(kit.room.mesh)
    room = kit.room
    truth = lamp_layer(room.mesh, shapes, room.casters.shadow, one, EYE, room.everything, 16, workers, job)
    terms, irradiance = bench.layer()
    scale = truth.irradiance.max()
    assert (truth.irradiance == 0).any()
    np.testing.assert_allclose(irradiance, truth.irradiance, rtol=1e-5, atol=1e-6 * scale)
    np.testing.assert_allclose(terms, truth.terms, rtol=1e-3, atol=1e-5 * np.abs(truth.terms).max())


def test_suns_are_samples_with_colours_of_their_own(kit, workers, shapes):
    rng = np.random.default_rng(1)
    ways = rng.normal((0.3, 1.0, 0.2), 0.01, (5, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    power = rng.uniform(0.5, 2.0, (5, 3)).astype(np.float32)
    targets = np.column_stack([ways, np.zeros(5)])
    bench = Bench(kit.room, workers, shapes)
    bench.gather(Source(targets, None, power))
    mesh = kit.room.mesh
    seen = occlusion_rays(
        kit.room.casters.shadow,
        mesh.positions + mesh.origin,
        mesh.normals,
        targets,
        workers,
        geometric_normals=mesh.geometric,
        inset=mesh.inset,
    )
    assert seen.any()
    terms, irradiance = (
        np.zeros((len(mesh), shapes.width, 3), np.float32),
        np.zeros((len(mesh), 3), np.float32),
    )
    towards = DirectionList(ways.astype(np.float32)).given[None]
    eye = (EYE - mesh.origin).astype(np.float32)
    kernels = (shapes.address, shapes.terms, shapes.offset, shapes.data)
    lamp_terms(
        0, len(mesh), kit.room.everything, mesh.positions, mesh.normals, mesh.tangents, mesh.material, eye,
        np.ascontiguousarray(towards), np.ones((1, 5), np.float32), power, seen, *kernels, terms, irradiance,
    )  # fmt: skip
    found = bench.layer()
    np.testing.assert_allclose(found[1], irradiance, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(found[0], terms, rtol=1e-3, atol=1e-4)


spots = st.tuples(*[st.floats(-2, 2)] * 3)


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(["point", "spot", "directional", "area"]),
    spots,
    st.floats(0.0, 1.0),
    st.sampled_from([0.05, 1.0, 6.0]),
)
def test_whoever_a_sphere_shadows_is_told(seed, kind, centre, radius, size):
    """No vertex behind the sphere is forgotten; far from all ways nobody is asked again."""
    rng = np.random.default_rng(seed)
    one = lamp(kind, rng.uniform(-2, 2, 3), rng.normal(size=3), rng.uniform(-180, 180), size)
    source = lamp_source(one, 32)
    positions = rng.uniform(-2, 2, (40, 3))
    found = shadowed(positions, source, np.array(centre), radius)
    truth = [oracle.meets_sphere(p, source.targets, np.array(centre), radius) for p in positions]
    assert (found | ~np.array(truth)).all()
    far = np.array([500.0, 0.0, 0.0]) if kind != "directional" else 500 * one.axis
    assert not shadowed(positions, source, far, radius).any()


def test_suns_all_around():
    ways = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    source = Source(np.column_stack([ways, np.zeros(2)]), None, np.ones((2, 3), np.float32))
    for centre in ((0.0, 5.0, 0.0), (0.0, -5.0, 0.0)):
        assert shadowed(np.zeros((1, 3)), source, np.array(centre), 0.1).all()


@pytest.mark.parametrize("one", LAMPS, ids=lambda one: one.kind)
def test_moved_occluders_leave_what_a_fresh_look_finds(kit, workers, shapes, fresh, one):
    source = lamp_source(one, 8)
    bench = Bench(kit.room, workers, shapes)
    bench.gather(source)
    moved = kit.room.placed(soup=Transform((0.25, 0.5, 0.25)), box=Transform((-0.5, 0.25, 0.75)))
    for name in ("soup", "box"):
        index = list(moved.things).index(name)
        bench.cache.forget(moved.mesh.vertices_of(index))
        for mesh in (kit.room.mesh, moved.mesh):
            middle, radius = sphere(mesh, index)
            positions = moved.mesh.positions + moved.mesh.origin
            bench.cache.forget(bench.cache.shadowed_by(positions, middle, radius))
    bench.follow(moved)
    looked = bench.gather(source)
    assert looked > 0
    assert looked < len(moved.mesh) or one.kind == "area"
    bench.assert_like(fresh(moved, source))


def test_what_is_known_is_not_looked_at_again(kit, workers, shapes):
    source, bench = lamp_source(LAMPS[3], 8), Bench(kit.room, workers, shapes)
    some = kit.room.everything[::2]
    assert bench.gather(source, some) == len(some)
    assert bench.gather(lamp_source(LAMPS[3], 8), some) == 0
    assert bench.gather(source) == len(kit.room.mesh) - len(some)
    newest = bench.cache.table.newest
    assert bench.gather(source) == 0
    assert bench.cache.table.newest == newest
    assert bench.cache.settled.all()
    assert bench.gather(lamp_source(lamp("area", (0.5, 1.6, 0.3)), 8)) == len(kit.room.mesh)


def test_coarse_samples_stand_in_for_the_rest(kit, workers, shapes, fresh):
    source, coarse = lamp_source(LAMPS[3], 32), lamp_source(LAMPS[3], 8)
    bench = Bench(kit.room, workers, shapes)
    some = kit.room.everything[: len(kit.room.mesh) // 2]
    bench.gather(source, some)
    assert bench.gather(source, None, coarse) == len(kit.room.mesh) - len(some)
    np.testing.assert_array_equal(np.flatnonzero(bench.cache.settled), some)
    exact = fresh(kit.room, source)
    mean = exact.layer()[1].mean()
    assert np.abs(bench.layer()[1] - exact.layer()[1]).mean() < 0.1 * mean
    assert bench.gather(source) == len(kit.room.mesh) - len(some)
    bench.assert_like(exact)


def test_materials_that_get_glossy_get_nodes(kit, workers, shapes, fresh):
    source, bench = lamp_source(LAMPS[3], 8), Bench(kit.room, workers, shapes)
    bench.gather(source, glossy=np.zeros(len(kit.room.mesh), np.bool_))
    assert bench.gather(source) == int(bench.glossy.sum())
    bench.assert_like(fresh(kit.room, source))


def test_objects_that_come_and_go_keep_what_others_know(kit, workers, shapes):
    source, bench = lamp_source(LAMPS[0], 1), Bench(kit.room, workers, shapes)
    bench.gather(source, glossy=np.zeros(len(kit.room.mesh), np.bool_))
    more = kit.room.with_thing("third", kit.Thing(cube(0.3), Transform((9.0, 0.5, 9.0))))
    matt = np.zeros(len(more.mesh), np.bool_)
    assert bench.follow(more).gather(source, glossy=matt) == len(more.mesh) - len(kit.room.mesh)
    bench.follow(more.without("box").without("third"))
    assert bench.gather(source, glossy=matt) == 0
    assert len(bench.layer()[1]) == len(bench.room.mesh)


def test_another_store_means_other_vertices(kit, workers, shapes, fresh):
    """A store that was made anew counts its numberings from the beginning."""
    source, bench = lamp_source(LAMPS[0], 1), Bench(kit.room, workers, shapes)
    bench.gather(source)
    other = kit.make({"floor": kit.Thing(floor(3.0)), "box": kit.Thing(cube(0.5), Transform((0, 0.3, 0)))})
    bench.store = VisibilityStore(11, workers)
    assert bench.follow(other).gather(source) == len(other.mesh)
    bench.assert_like(fresh(other, source))


def test_a_cancelled_look_is_taken_again(kit, workers, shapes, fresh):
    source, bench = lamp_source(LAMPS[3], 8), Bench(kit.room, workers, shapes)
    for at in (1, 2, 3):
        with pytest.raises(Cancelled):
            bench.gather(source, job=StoppingJob(at))
        assert not bench.cache.settled.any()
    bench.gather(source)
    bench.assert_like(fresh(kit.room, source))
