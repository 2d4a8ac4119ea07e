"""Light straight from all lights at vertices: against brute force, after moves, and where it is awkward."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import pytest
from oracles.source_light import arriving, light_at_vertices
from scenes import cube, floor, little_scene, sky

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.errors import Cancelled
from studio_core.scene.diff import diff
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import (
    AreaLamp,
    DirectionalLamp,
    Environment,
    Light,
    Material,
    MeshObject,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_core.shading.artifacts import Casters, Lighting, Shapes, Surfaces
from studio_core.shading.brute_force import VisibilityBits, all_points, environment_layer, lamp_layer
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import scene_view
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.stages import SurfaceParams, common_stages
from studio_core.transport.light_samples import SampleCounts
from studio_core.transport.source_light import SourceLight

JOB = Job("test")


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


class World:
    """A scene with the artifacts that light needs, and the light."""

    def __init__(self, services: Services, scene: Scene, vertices: int = 600) -> None:
        self.pipeline = Pipeline(common_stages(services)[:-1])
        self.params = SurfaceParams(vertices=vertices)
        self.workers = services.workers
        self.light = SourceLight(services.workers)
        self.scene = Scene()
        self.show(scene)

    def show(self, scene: Scene) -> None:
        view = scene_view(scene, None, 32, 24)
        self.pipeline.update(Frame(scene, view, self.params, 1), diff(self.scene, scene), Job("show"))
        self.scene = scene

    def __getattr__(self, name: str):
        kinds = {"surfaces": Surfaces, "casters": Casters, "lighting": Lighting, "shapes": Shapes}
        return self.pipeline.artifact(kinds[name])

    @property
    def lights(self):
        return {node.id: node for node in self.scene.of(Light)}

    def update(self, counts: SampleCounts, light: SourceLight | None = None, job: Job = JOB):
        return (light or self.light).update(self.surfaces, self.casters, self.lighting, counts, job)

    def sums(self, separated, light: SourceLight | None = None, some=None):
        return (light or self.light).sums(self.surfaces, self.shapes, separated, self.lights, some)

    def irradiance(self, counts: SampleCounts, light: SourceLight | None = None):
        self.update(counts, light)
        return self.sums(functions(self.shapes, 0), light).irradiance


@dataclass
class Functions:
    count: np.ndarray
    base: np.ndarray
    incoming: np.ndarray

    def of_row(self, row):
        count, base = self.count[row], self.base[row]
        return self.incoming[base : base + 1024 * count].reshape(1024, count)


def functions(shapes, count, rows=None):
    """Random functions, of all rows or some."""
    counts = np.zeros(len(shapes.terms), np.int64)
    counts[slice(None) if rows is None else rows] = count
    base = np.concatenate([[0], np.cumsum(1024 * counts)[:-1]]).astype(np.int64)
    values = np.random.default_rng(3).normal(size=1024 * counts.sum())
    return Functions(counts, base, values.astype(np.float32))


def lamps(count=0, far=0.0):
    """One of each kind about the middle of the floor, and further points."""
    down = Transform(rotation=axis_angle((1, 0, 0), -90))
    found = [
        PointLamp(id="point", name="Point", transform=Transform((far + 1.2, 1.5, 0.3)), intensity=2.0),
        SpotLamp(id="spot", name="Spot", transform=looking((far - 1, 2, 1), (far, 0, 0)), cone=40, inner=20),
        AreaLamp(
            id="area", name="Area", transform=looking((far, 2.2, -1), (far, 0, 0)), width=0.6, height=0.4
        ),
        DirectionalLamp(id="sun", name="Sun", transform=down, angle=5.0, tint=(1, 0.8, 0.5)),
    ]
    rng = np.random.default_rng(2)
    for i in range(count):
        place = Transform((far + rng.uniform(-1.5, 1.5), rng.uniform(0.8, 2), rng.uniform(-1.5, 1.5)))
        found.append(PointLamp(id=f"p{i}", name=f"P{i}", transform=place, intensity=rng.uniform(0.1, 2)))
    return found


def lit_by(*nodes, environment=False, far=0.0):
    scene = little_scene()
    kept = [n for n in scene.nodes.values() if environment or not isinstance(n, Environment)]
    moved = [
        dataclasses.replace(
            n,
            transform=dataclasses.replace(
                n.transform, translation=tuple(np.add(n.transform.translation, (far, 0, 0)))
            ),
        )
        for n in kept
    ]
    return dataclasses.replace(scene, nodes=frozen_map({n.id: n for n in (*moved, *nodes)}))


def brute(world, samples, level=12):
    """Irradiance by brute force at all vertices, against the meshes that bounces meet."""
    mesh, casters, total = world.surfaces.mesh, world.casters, 0.0
    points, eye = all_points(mesh), np.zeros(3)
    for lamp in world.lighting.lamps:
        layer = lamp_layer(
            mesh, world.shapes, casters.primary, lamp, eye, points, samples, world.workers, JOB
        )
        total = total + layer.irradiance * np.asarray(world.lights[lamp.node].gain())
    if world.lighting.environment is not None:
        bits = VisibilityBits(mesh, casters.primary, world.workers)
        layer = environment_layer(
            mesh, world.shapes, world.lighting, bits, eye, points, level, world.workers, JOB
        )
        total = total + layer.irradiance * np.asarray(world.lighting.environment.gain())
    return total


@pytest.mark.parametrize("far", [0.0, 1e4])
def test_lamps_are_as_by_brute_force(services, far):
    world = World(services, lit_by(*lamps(far=far), far=far))
    made = world.irradiance(SampleCounts(8, 0, 1))
    expected = brute(world, 8)
    np.testing.assert_allclose(made, expected, rtol=1e-5, atol=1e-5 * expected.mean())
    assert np.count_nonzero(made.sum(axis=1)) > 0.5 * len(made)


def test_sums_equal_the_plain_loop(services):
    """Irradiance and functions in all variants, with shadow rays one by one."""
    world = World(services, lit_by(*lamps(), environment=True), 120)
    counts = SampleCounts(3, 8, 4)
    world.update(counts)
    separated = functions(world.shapes, 5, rows=[1])
    made = world.sums(separated)
    mesh, samples, caster = world.surfaces.mesh, world.light.samples, world.casters.primary
    rows = world.shapes.rows(mesh)
    of_vertex = world.light.variant
    assert len(set(of_vertex % 4)) == 4
    assert len(set(of_vertex)) > 20
    starts = mesh.positions + mesh.origin + caster.epsilon * mesh.geometric + mesh.inset
    seen = np.zeros((len(mesh), len(samples)), np.bool_)
    for c in range(len(samples)):
        ways = [arriving(samples, c, of_vertex[v], starts[v]) for v in range(len(mesh))]
        far = np.array([way[2] for way in ways])
        seen[:, c] = ~caster.occluded(
            starts, np.array([way[0] for way in ways]), np.maximum(far - 4 * caster.epsilon, 0), world.workers
        )
    light = samples.coloured(world.lights)
    irradiance, sums = light_at_vertices(
        samples, light, of_vertex.__getitem__, mesh, seen, rows, [separated.of_row(r) for r in range(2)]
    )
    np.testing.assert_allclose(made.irradiance, irradiance, rtol=2e-5, atol=1e-5 * irradiance.mean())
    assert (made.slot[rows == 0] == -1).all()
    own = np.flatnonzero(rows == 1)
    assert made.functions.shape == (5 * len(own), 3)
    size = np.abs(np.concatenate([sums[v] for v in own])).mean()
    for v in own:
        np.testing.assert_allclose(made.functions[made.slot[v] :][:5], sums[v], rtol=1e-4, atol=1e-4 * size)


def test_only_wanted_vertices_are_summed(services):
    world = World(services, lit_by(*lamps()))
    world.update(SampleCounts(2, 0))
    every = world.sums(functions(world.shapes, 2))
    some = np.random.default_rng(0).random(len(every.irradiance)) < 0.3
    made = world.sums(functions(world.shapes, 2), some=some)
    np.testing.assert_array_equal(made.irradiance, np.where(some[:, None], every.irradiance, 0))
    np.testing.assert_array_equal(made.slot, every.slot)
    np.testing.assert_array_equal(made.functions, np.where(np.repeat(some, 2)[:, None], every.functions, 0))


def test_variants_together_are_the_whole_lamp(services):
    """Each vertex looks at 2 places; over the floor their mean is that of 32, and each alone is rougher."""
    area = AreaLamp(id="a", name="A", transform=looking((0.4, 2.5, 1.2), (0, 0, 0)), width=1.5, height=1.5)
    world = World(services, lit_by(area), 1500)
    made, expected = world.irradiance(SampleCounts(2, 0, 16)), brute(world, 256)
    weight = world.surfaces.mesh.area[:, None]
    assert (made * weight).sum() == pytest.approx((expected * weight).sum(), rel=0.01)
    assert np.abs(made - expected).mean() > 0.02 * expected.mean()


def test_the_environment_is_right_on_average(services):
    """At what the others see; of the floor's lower side nobody sees anything, and few directions go there."""
    world = World(services, lit_by(environment=True), 1500)
    made, expected = world.irradiance(SampleCounts(2, 64, 16)), brute(world, 1)
    mesh = world.surfaces.mesh
    below = (mesh.normals[:, 1] < -0.5) & (mesh.object == 0)
    made, expected, weight = made[~below], expected[~below], mesh.area[~below, None]
    assert np.sqrt(((made - expected) ** 2).mean()) < 0.15 * expected.mean()
    assert (made * weight).sum() == pytest.approx((expected * weight).sum(), rel=0.005)


def test_a_sun_in_the_sky(services):
    """A million times as bright as the sky about it: it is looked at as itself."""
    pixels = np.full((64, 128, 3), 0.1, np.float32)
    pixels[12, 40] = 1e5
    world = World(services, lit_by(Environment(id="e", name="E", image=Image(pixels))), 1500)
    assert world.lighting.sun is not None
    made, expected = world.irradiance(SampleCounts(4, 64)), brute(world, 1)
    open_ones = expected.sum(axis=1) > 0.5 * expected.sum(axis=1).max()
    near = np.isclose(made, expected, rtol=0.03).all(axis=1)
    assert near[open_ones].mean() > 0.98  # the others are at the edge of a shadow
    assert np.median(np.abs(made - expected)) < 0.01 * expected.mean()


def cluttered(environment=True):
    """Some cubes of different sizes on the floor, with lamps."""
    scene = lit_by(*lamps(), environment=environment)
    rng = np.random.default_rng(4)
    more = [
        MeshObject(
            id=f"c{i}",
            name=f"C{i}",
            geometry=cube(0.3),
            materials=("paint",),
            transform=Transform((rng.uniform(-1.5, 1.5), rng.uniform(0.15, 0.5), rng.uniform(-1.5, 1.5))),
        )
        for i in range(4)
    ]
    return scene.with_nodes(*more)


def test_after_moves_it_is_as_if_made_afresh(services):
    """200 moves of one or two objects, turns and sizes among them; now and then a lamp moves."""
    world = World(services, cluttered(), 500)
    counts = SampleCounts(2, 24, 4)
    first = world.update(counts)
    rng = np.random.default_rng(5)
    objects = [n.id for n in world.scene.of(MeshObject) if n.id != "floor"]
    rays, differing, pairs = 0, 0, 0
    for step in range(200):
        moved = []
        for node in rng.choice(objects, rng.integers(1, 3), replace=False):
            turn = axis_angle(rng.normal(size=3), rng.uniform(0, 360))
            place = (rng.uniform(-1.5, 1.5), rng.uniform(0.1, 0.8), rng.uniform(-1.5, 1.5))
            moved.append(
                dataclasses.replace(
                    world.scene[node], transform=Transform(place, turn, rng.uniform(0.4, 1.6))
                )
            )
        if step % 10 == 0:
            lamp = world.scene["point"]
            at = Transform((rng.uniform(-1, 1), 1.5, rng.uniform(-1, 1)))
            moved.append(dataclasses.replace(lamp, transform=at))
        world.show(world.scene.with_nodes(*moved))
        rays += world.update(counts).rays
        if step % 20 != 19:
            continue
        world.update(counts)  # once it stands still, it may look elsewhere
        fresh = SourceLight(world.workers, world.light.sky)
        world.update(counts, fresh)
        a, b = world.light.seen, fresh.seen
        differing += int(np.unpackbits((a ^ b).view(np.uint8)).sum())
        pairs += len(a) * len(world.light.samples)
        made, afresh = (
            world.sums(functions(world.shapes, 0), light).irradiance for light in (world.light, fresh)
        )
        assert np.sqrt(((made - afresh) ** 2).mean()) < 1e-3 * afresh.mean()
    assert differing <= 1e-4 * pairs
    assert rays < 0.6 * 200 * first.rays


def test_colours_and_gains_cost_no_rays(services):
    world = World(services, lit_by(*lamps(), environment=True))
    counts = SampleCounts()
    before = world.irradiance(counts)
    brighter = [dataclasses.replace(n, intensity=3 * n.intensity) for n in world.scene.of(Light)]
    world.show(world.scene.with_nodes(*brighter))
    assert world.update(counts).rays == 0
    made = world.sums(functions(world.shapes, 0)).irradiance
    np.testing.assert_allclose(made, 3 * before, rtol=1e-5)


def test_a_lamp_that_comes_goes_or_moves_costs_its_own_rays(services):
    world = World(services, lit_by(*lamps(90)))  # bits over two words
    counts = SampleCounts(2, 0)
    first = world.update(counts)
    lamp = world.scene["p7"]
    moved = dataclasses.replace(lamp, transform=Transform((0.1, 1.9, 0.2)))
    for scene in (
        world.scene.with_nodes(moved),
        dataclasses.replace(
            world.scene, nodes=frozen_map({k: n for k, n in world.scene.nodes.items() if k != "p3"})
        ),
        world.scene,
    ):
        world.show(scene)
        assert world.update(counts).rays < 0.03 * first.rays
        afresh = SourceLight(world.workers)
        np.testing.assert_array_equal(world.irradiance(counts), world.irradiance(counts, afresh))


def test_two_counts_are_kept_side_by_side(services):
    world = World(services, lit_by(*lamps(), environment=True))
    for counts in (SampleCounts(2, 16), SampleCounts(4, 32)):
        assert world.update(counts).rays > 0
    for counts in (SampleCounts(2, 16), SampleCounts(4, 32)):
        assert world.update(counts).rays == 0
    assert world.light.nbytes > 0


class CancelledAfter(Job):
    def __init__(self, checkpoints):
        super().__init__("cancelled")
        self.left = checkpoints

    def checkpoint(self, done=0, total=0):
        self.left -= 1
        if self.left < 0:
            raise Cancelled(self.label)


def test_a_cancelled_update_is_gone_on_with(services):
    world = World(services, cluttered(), 3000)
    counts = SampleCounts(4, 64, 4)
    cancelled = 0
    for step, left in enumerate((0, 2, 1, 3, 0, 1)):
        at = Transform((0.3 * step - 0.9, 0.5, 0.4))
        world.show(world.scene.with_nodes(dataclasses.replace(world.scene["cube"], transform=at)))
        try:
            world.update(counts, job=CancelledAfter(left))
        except Cancelled:
            cancelled += 1
    assert cancelled >= 3
    world.update(counts)
    made = world.irradiance(counts)
    afresh = world.irradiance(counts, SourceLight(world.workers, world.light.sky))
    assert np.sqrt(((made - afresh) ** 2).mean()) < 1e-3 * afresh.mean()


def test_no_light_at_all(services):
    world = World(services, lit_by())
    assert world.update(SampleCounts()).rays == 0
    made = world.sums(functions(world.shapes, 3))
    assert not made.irradiance.any()
    assert not made.functions.any()


def test_a_black_environment(services):
    black = Environment(id="e", name="E", image=Image(np.zeros((16, 32, 3), np.float32)))
    world = World(services, lit_by(black))
    assert not world.irradiance(SampleCounts()).any()


def test_a_lamp_inside_an_object_lights_only_what_is_there(services):
    """The cube is closed: of its outside and the floor nothing is lit."""
    middle = Transform((0.0, 0.9, 0.0))
    scene = lit_by(PointLamp(id="l", name="L", transform=middle))
    world = World(services, scene.with_nodes(dataclasses.replace(scene["cube"], transform=middle)))
    assert not world.irradiance(SampleCounts()).any()


def test_a_lamp_at_a_vertex(services):
    """At the very place of a vertex, and as near above as floats tell apart: finite, and the rest is lit."""
    world = World(services, lit_by(*lamps()))
    mesh = world.surfaces.mesh
    at = mesh.positions[0].astype(np.float64) + mesh.origin
    for height in (0.0, 1e-7):
        lamp = PointLamp(id="l", name="L", transform=Transform((at[0], at[1] + height, at[2])))
        world.show(lit_by(lamp))
        made = world.irradiance(SampleCounts())
        assert np.isfinite(made).all()
    lamp = PointLamp(id="l", name="L", transform=Transform((at[0], at[1] + 0.2, at[2])))
    world.show(lit_by(lamp))
    assert world.irradiance(SampleCounts())[0] == pytest.approx(1 / 0.2**2, rel=1e-4)


def test_an_area_lamp_seen_edge_on(services):
    """Upright on the floor's level: what lies in its plane gets nothing, what is behind it neither."""
    upright = looking((0, 0.0, -1.0), (0, 0.0, 0))
    lamp = AreaLamp(id="a", name="A", transform=upright, width=1.0, height=1.0)
    world = World(services, lit_by(lamp))
    made, expected = world.irradiance(SampleCounts(8, 0, 1)), brute(world, 8)
    np.testing.assert_allclose(made, expected, rtol=1e-5, atol=1e-5 * expected.mean())
    behind = world.surfaces.mesh.positions[:, 2] + world.surfaces.mesh.origin[2] < -1.0
    assert behind.any()
    assert not made[behind].any()


def test_two_hundred_lamps(services):
    world = World(services, lit_by(*lamps(200)), 200)
    made, expected = world.irradiance(SampleCounts(4, 0, 1)), brute(world, 4)
    np.testing.assert_allclose(made, expected, rtol=2e-5, atol=1e-5 * expected.mean())


def test_a_see_through_material_stops_no_light(services):
    scene = lit_by(*lamps())
    glass = dataclasses.replace(scene.material("paint"), opacity=0.2)
    world = World(services, scene.with_materials(glass))
    assert isinstance(glass, Material)
    without = dataclasses.replace(
        scene, nodes=frozen_map({k: n for k, n in scene.nodes.items() if k != "cube"})
    )
    bare = World(services, without)
    on_floor = world.surfaces.mesh.vertices_of(0)
    counts = SampleCounts(4, 0, 1)
    np.testing.assert_allclose(
        world.irradiance(counts)[on_floor].sum(),
        bare.irradiance(counts)[bare.surfaces.mesh.vertices_of(0)].sum(),
        rtol=1e-3,
    )


def test_an_empty_scene(services):
    world = World(services, Scene().with_nodes(*lamps(), Environment(id="e", name="E", image=sky())))
    assert world.update(SampleCounts()).rays == 0
    assert world.sums(functions(world.shapes, 1)).irradiance.shape == (0, 3)


def test_nothing_but_a_floor(services):
    only = MeshObject(id="floor", name="Floor", geometry=floor(), materials=("matt",))
    scene = Scene().with_materials(Material(id="matt", name="Matt")).with_nodes(only, *lamps())
    world = World(services, scene, 100)
    made, expected = world.irradiance(SampleCounts(8, 0, 1)), brute(world, 8)
    np.testing.assert_allclose(made, expected, rtol=1e-5, atol=1e-5 * expected.mean())
