"""Path traced indirect light: closed forms, another path tracer, and what must not matter."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from brdf_models import MODELS
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.paths import PathOracle
from path_rooms import box_room, furnished, globe, stand
from scenes import floor, sky

from studio_core.contract import Services
from studio_core.errors import Cancelled
from studio_core.kernels.packets import OPAQUE
from studio_core.parallel import Workers
from studio_core.params import param_infos
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import (
    AreaLamp,
    DirectionalLamp,
    Environment,
    Material,
    MeshObject,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.scene.transform import Transform, looking
from studio_core.shading.artifacts import Hits
from studio_core.shading.brute_force import lamp_layer
from studio_core.shading.job import Job
from studio_core.shading.materials import coefficients, resolve
from studio_core.shading.path_tracing import (
    CONVERGED,
    PathCounts,
    PathSettings,
    chosen_points,
    growing,
    indirect_halves,
    indirect_layer,
    mean_layer,
)
from studio_core.shading.path_world import shown_gains
from studio_core.shading.primary import visible_vertices
from studio_core.shading.surface_points import surface_points, surface_uvs
from studio_core.shading.varying import ShapeTable
from studio_core.shading.vertex_radiance import bilinear

GLOSSY = Material(id="paint", name="Paint", model="ggx", values={"roughness": 0.5, "metallic": 0.3})
LIGHTS = {
    "point": (PointLamp(id="lamp", intensity=5.0, transform=Transform((1.0, 2.0, 1.0))),),
    "area": (
        AreaLamp(
            id="lamp",
            intensity=6.0,
            width=1.0,
            height=0.6,
            transform=looking((0.8, 2.4, 0.9), (-0.5, 0, -0.5)),
        ),
    ),
    "spot": (
        SpotLamp(
            id="lamp", intensity=9.0, cone=40.0, inner=25.0, transform=looking((1, 3, 1), (-1, 0.5, -1))
        ),
    ),
    "sun": (DirectionalLamp(id="lamp", intensity=2.0, angle=4.0, transform=looking((2, 3, 2), (0, 0, 0))),),
    "sky": (Environment(id="sky", image=sky(), intensity=0.8),),
    "several": (
        PointLamp(id="near", intensity=1.0, transform=Transform((0.6, 1.4, 0.8))),
        PointLamp(id="far", intensity=9.0, tint=(1.0, 0.4, 0.2), transform=Transform((3.0, 3.0, 3.0))),
        Environment(id="sky", image=sky(), intensity=0.2),
    ),
}


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def traced(found, points, samples, bounces=3, seed=0, eye=(0.0, 1.0, 6.0), shapes=None, **more):
    return indirect_layer(
        points,
        found.shapes if shapes is None else shapes,
        np.array(eye),
        found.world,
        PathSettings(bounces, samples, seed),
        more.pop("workers", None) or Workers(1),
        Job("trace"),
        **more,
    )


def inner_points(found, every=7):
    mesh = found.surfaces.mesh
    inside = np.flatnonzero((mesh.normals * mesh.positions).sum(axis=1) < 0)
    return chosen_points(mesh, inside[::every])


@pytest.mark.parametrize("albedo", [0.5, 0.8])
@pytest.mark.parametrize("bounces", [1, 2, 3, CONVERGED])
def test_a_globe_lit_from_its_middle(services, albedo, bounces):
    """Every bounce brings albedo times the one before: E_n = E_0 Σ ρ^i, the same everywhere."""
    material = Material(id="m", name="m", values={"base_color": (albedo, albedo / 2, 0.0)})
    scene = (
        Scene()
        .with_materials(material)
        .with_nodes(
            MeshObject(id="globe", geometry=globe(), materials=("m",)), PointLamp(id="lamp", intensity=1.0)
        )
    )
    found = stand(scene, services, 3000)
    made = traced(found, inner_points(found), 128, bounces, seed=bounces).irradiance
    wanted = [sum(rho**i for i in range(1, bounces + 1)) for rho in (albedo, albedo / 2, 0)]
    faces = 1.006  # a globe of facets is smaller
    np.testing.assert_allclose(made.mean(axis=0), np.array(wanted) * faces, rtol=0.01)
    assert np.abs(made[:, 0] / made[:, 0].mean() - 1).max() < 0.25


def test_no_light_is_lost_in_a_box(services):
    """A closed box of albedo ρ where everything is lit alike cannot be made, but its power is known.

    What a lamp sends out is absorbed in the end: Σ (1 − ρ) E dA = power, over direct light and all bounces.
    """
    albedo = 0.6
    material = Material(id="m", name="m", values={"base_color": (albedo,) * 3})
    lamp = PointLamp(id="lamp", intensity=1.0, transform=Transform((0.3, 0.2, -0.1)))
    scene = (
        Scene()
        .with_materials(material)
        .with_nodes(MeshObject(id="room", geometry=box_room(), materials=("m",)), lamp)
    )
    found = stand(scene, services, 4000)
    mesh = found.surfaces.mesh
    inside = np.flatnonzero((mesh.normals * mesh.positions).sum(axis=1) < 0)
    made = traced(found, chosen_points(mesh, inside), 16, CONVERGED).irradiance[:, 0]
    bounced = float((made * mesh.area[inside]).sum() / mesh.area[inside].sum())
    direct = 4 * np.pi / mesh.area[inside].sum()
    assert bounced == pytest.approx(direct * albedo / (1 - albedo), rel=0.01)


@pytest.mark.parametrize("lights", sorted(LIGHTS))
@pytest.mark.parametrize("paint", [None, GLOSSY], ids=["matte", "glossy"])
def test_it_agrees_with_paths_one_by_one(services, host, workers, lights, paint):
    scene = furnished(LIGHTS[lights], *(() if paint is None else (paint,)))
    found = stand(scene, services, 600)
    mesh = found.surfaces.mesh
    rng = np.random.default_rng(3)
    front = np.flatnonzero(mesh.normals @ np.array([0.3, 0.6, 0.5]) > 0.2)
    some = rng.choice(front, 6, replace=False)
    oracle = PathOracle(
        scene, found.surfaces, found.casters, found.lighting, shown_gains(scene), host, workers, 16
    )
    ours = traced(found, chosen_points(mesh, some), 4096, 2, seed=1, shapes=found.shapes.of_points(some))
    theirs = [
        oracle.irradiance(
            mesh.positions[p] + mesh.origin, mesh.normals[p].astype(float), mesh.geometric[p].astype(float),
            mesh.inset[p], 2, 800, rng,
        )
        for p in some
    ]  # fmt: skip
    mean = np.array([paths.mean(axis=0) for paths in theirs])
    error = np.array([paths.std(axis=0) / np.sqrt(len(paths)) for paths in theirs])
    assert (mean > 0).any(axis=1).sum() >= 4
    np.testing.assert_array_less(np.abs(ours.irradiance - mean), 4.5 * error + 0.02 * mean + 1e-5)
    assert ours.irradiance.sum() == pytest.approx(mean.sum(), rel=4 * np.sqrt((error**2).sum()) / mean.sum())


def test_terms_are_the_light_times_the_reflectance(services, host):
    """A matte point's term is its irradiance over π; a glossy one's follow the light from where it comes."""
    found = stand(furnished(LIGHTS["point"], GLOSSY), services, 800)
    mesh = found.surfaces.mesh
    made = traced(found, mesh, 64)
    matte = np.flatnonzero(mesh.material == found.surfaces.materials.index("wall"))
    np.testing.assert_allclose(made.terms[matte, 0], made.irradiance[matte], rtol=1e-4, atol=1e-7)
    assert not made.terms[matte, 1:].any()
    glossy = np.flatnonzero(mesh.material == found.surfaces.materials.index("paint"))
    assert (made.terms[glossy, 1] > 0).any()


def test_gains_are_linear_and_lamps_add_up(services):
    one, other = LIGHTS["several"][:2]
    rooms = [furnished(lights) for lights in ((one,), (other,), (one, other))]
    irradiance = []
    for scene in rooms:
        found = stand(scene, services, 500)
        irradiance.append(traced(found, found.surfaces.mesh, 512).irradiance.astype(float))
    lit = irradiance[2].mean(axis=1) > 0.05 * irradiance[2].mean()
    ratio = (irradiance[0] + irradiance[1])[lit].mean(axis=0) / irradiance[2][lit].mean(axis=0)
    np.testing.assert_allclose(ratio, 1, atol=0.02)
    double = stand(furnished((dataclasses.replace(one, intensity=2 * one.intensity),)), services, 500)
    again = traced(double, double.surfaces.mesh, 512).irradiance
    np.testing.assert_allclose(again, 2 * irradiance[0], rtol=1e-3, atol=1e-6)


def test_hidden_lights_and_dark_scenes_bring_nothing(services):
    hidden = furnished((dataclasses.replace(LIGHTS["point"][0], hidden=True),))
    for scene in (furnished(()), hidden):
        found = stand(scene, services, 500)
        assert found.world.dark
        assert not traced(found, found.surfaces.mesh, 4).irradiance.any()
    lit = stand(furnished(LIGHTS["point"]), services, 500)
    assert not traced(lit, lit.surfaces.mesh, 4, bounces=0).terms.any()


def test_a_floor_alone_gets_no_indirect_light(services):
    wall = Material(id="wall", name="Wall")
    scene = (
        Scene()
        .with_materials(wall)
        .with_nodes(MeshObject(id="floor", geometry=floor(), materials=("wall",)), *LIGHTS["several"])
    )
    found = stand(scene, services, 500)
    assert not traced(found, found.surfaces.mesh, 64).irradiance.any()


def test_threads_and_neighbours_change_nothing(services, workers):
    found = stand(furnished(LIGHTS["several"], GLOSSY), services, 600)
    mesh = found.surfaces.mesh
    one = traced(found, mesh, 300)
    two = traced(found, mesh, 300, workers=workers)
    np.testing.assert_array_equal(one.terms, two.terms)
    first = traced(found, chosen_points(mesh, np.arange(5)), 300, shapes=found.shapes.of_points(np.arange(5)))
    np.testing.assert_array_equal(first.terms, one.terms[:5])


def test_halves_are_independent_and_meet(services, workers):
    found = stand(furnished(LIGHTS["area"]), services, 600)
    args = (found.surfaces.mesh, found.shapes, np.array([0, 1.0, 6]), found.world)
    a, b = (
        layer.irradiance.astype(float).mean(axis=1)
        for layer in indirect_halves(*args, PathSettings(2, 64, 5), workers, Job("t"))
    )
    truth = traced(found, found.surfaces.mesh, 4096, 2, seed=77).irradiance.astype(float).mean(axis=1)
    noise_a, noise_b = a - truth, b - truth
    assert not np.array_equal(a, b)
    assert abs(np.corrcoef(noise_a, noise_b)[0, 1]) < 4 / np.sqrt(len(a))
    assert np.sqrt(np.mean(noise_a**2)) < 0.3 * truth.mean()


def test_more_samples_are_truer(services):
    found = stand(furnished(LIGHTS["point"]), services, 600)
    truth = traced(found, found.surfaces.mesh, 4096, seed=9).irradiance.astype(float)
    errors = [
        np.sqrt(np.mean((traced(found, found.surfaces.mesh, n, seed=2).irradiance - truth) ** 2))
        for n in (8, 128)
    ]
    assert errors[1] < errors[0] / 3  # at least as fast as chance


def test_glossy_receivers_keep_what_brighter_samples_say(services):
    """Terms by their own samplers and by cosine alone agree in the mean: nothing is counted twice."""
    sharp = dataclasses.replace(GLOSSY, values={"roughness": 0.45, "metallic": 1.0})
    found = stand(furnished(LIGHTS["area"], sharp), services, 500)
    glossy = np.flatnonzero(found.surfaces.mesh.material == found.surfaces.materials.index("paint"))
    points, shapes = chosen_points(found.surfaces.mesh, glossy), found.shapes.of_points(glossy)
    both = traced(found, points, 4096, 2, shapes=shapes)
    models = found.world.models
    blind = dataclasses.replace(
        found, world=dataclasses.replace(found.world, models=models._replace(sampler=0 * models.sampler))
    )
    plain = traced(blind, points, 8192, 2, seed=3, shapes=shapes)
    ours, theirs = both.terms[:, 1].astype(float), plain.terms[:, 1].astype(float)
    assert ours.mean() == pytest.approx(theirs.mean(), rel=0.02)
    assert np.sqrt(np.mean((ours - theirs) ** 2)) < 0.15 * ours.mean()


def test_textures_are_read_where_paths_meet_them(services):
    """A floor that is black but for a strip reflects as much as its texels' mean."""
    pixels = np.zeros((8, 8, 3), np.float32)
    pixels[:, ::2] = [0.8, 0.4, 0.2]
    striped = Material(
        id="paint",
        name="P",
        values={"base_color": (1.0,) * 3},
        textures={"base_color": Texture(Image(pixels), (8.0, 8.0))},
    )
    plain = Material(id="paint", name="P", values={"base_color": (0.4, 0.2, 0.1)})
    made = []
    for paint in (striped, plain):
        scene = furnished((PointLamp(id="lamp", intensity=5.0, transform=Transform((1.0, 2.5, 1.0))),), paint)
        nodes = [n for n in scene.of(MeshObject) if n.id in ("floor", "side")]
        scene = Scene().with_materials(*scene.materials.values()).with_nodes(*nodes, *scene.of(PointLamp))
        found = stand(scene, services, 500)
        own = found.surfaces.mesh.vertices_of(found.surfaces.mesh.index_of("floor"))
        made.append(traced(found, found.surfaces.mesh, 1024, 1).irradiance[own].mean(axis=0))
    np.testing.assert_allclose(made[0], made[1], rtol=0.04)


def test_once_reflected_light_is_brute_force_seen_from_the_points(services, workers):
    """Captured materials, with terms below 0 and maps of their own, and a picture of the roughness.

    What one bounce brings to points is what brute force says of the places they see, looked at from there.
    """
    from studio.samples import sample
    from studio_core.project.store import load

    grey = np.linspace(0.3, 1.0, 64, dtype=np.float32).reshape(8, 8, 1)
    rough = Material(
        id="rough", model="ggx", values={"metallic": 1.0, "roughness": 0.7},
        textures={"roughness": Texture(Image(grey, "data"), (0.7, 0.7))},
    )  # fmt: skip
    room = load(sample("captured-room")).scene
    shown = [dataclasses.replace(node, hidden=True) for node in (*room.of(Environment), *room.of(PointLamp))]
    lamp = PointLamp(id="one", intensity=8.0, transform=Transform((0.6, 1.8, 0.9)))
    wall = MeshObject(
        id="wall", geometry=floor(3.0), materials=("rough",), transform=Transform((0, 2.6, 0), (0, 1, 0, 0))
    )
    found = stand(room.with_materials(rough).with_nodes(*shown, lamp, wall), services, 3000)
    mesh, rng = found.surfaces.mesh, np.random.default_rng(4)
    assert found.world.shapes.row is not None
    some = rng.choice(np.flatnonzero(visible_vertices(found.surfaces, found.hits)), 24, replace=False)
    ours = traced(found, chosen_points(mesh, some), 4096, 1, shapes=found.shapes.of_points(some)).irradiance
    theirs = np.array([_once(found, p, 1500, services, workers, rng) for p in some])
    ratio = ours.astype(float).sum(axis=0) / theirs.sum(axis=0)
    np.testing.assert_allclose(ratio, 1, atol=0.04)
    assert np.sqrt(np.mean((ours - theirs) ** 2)) < 0.3 * theirs.mean()


def _once(found, vertex, count, services, workers, rng):
    """(3,) irradiance of a vertex by way of one surface, from the brute force of what it sees."""
    mesh, caster = found.surfaces.mesh, found.casters.primary
    n = mesh.normals[vertex].astype(float)
    d = rng.normal(size=(count, 3))
    d = n + d / np.linalg.norm(d, axis=1, keepdims=True)  # as the cosine
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    place = mesh.positions[vertex] + mesh.origin
    start = place + caster.epsilon * mesh.geometric[vertex] + mesh.inset[vertex]
    hits = caster.closest(np.tile(start, (count, 1)), d, 0.0, np.inf, workers, mask=OPAQUE)
    met = np.flatnonzero((hits.object >= 0) & (d @ mesh.geometric[vertex] > 0))
    face = (mesh.face_offsets[hits.object] + hits.face)[met]
    met, face = (a[hits.front[met] | (mesh.back_faces[face, 0] != NO_BACK)] for a in (met, face))
    if not len(met):
        return np.zeros(3)
    seen = Hits(found.frame.view, 1, face.astype(np.int32), hits.u[met], hits.v[met], hits.t[met])
    points, uvs = surface_points(found.surfaces, seen, start), surface_uvs(found.surfaces, seen, start)
    table = ShapeTable(services.registry)
    shapes = dataclasses.replace(
        table.at(found.scene, found.surfaces.materials, points.material, uvs), tilt=None
    )
    lamp = found.lighting.lamps[0]
    every = np.arange(len(met), dtype=np.int64)
    terms = lamp_layer(points, shapes, caster, lamp, start, every, 1, workers, Job("direct")).terms
    sent = np.zeros((len(met), 3))
    for number, name in enumerate(found.surfaces.materials):
        own = np.flatnonzero(points.material == number)
        if not len(own):
            continue
        resolved = resolve(found.scene.material(name), services.registry)
        looks = coefficients(resolved, shapes.width)
        if looks.ndim == 4:
            looks = bilinear(looks, next(iter(resolved.textures.values())).placed(uvs[own]))
        sent[own] = (terms[own] * looks).sum(axis=1)
    gain = shown_gains(found.scene)[lamp.node]
    return np.pi * sent.sum(axis=0) * gain / count


def test_what_is_see_through_is_passed_and_closed_insides_are_black(services):
    lamp = PointLamp(id="lamp", intensity=5.0, transform=Transform((1.2, 0.6, 1.2)))
    glass = Material(id="glass", name="Glass", opacity=0.2)
    screen = MeshObject(
        id="screen", geometry=floor(8.0), materials=("glass",), transform=Transform((0, 1.5, 0))
    )
    bare = stand(furnished((lamp,)), services, 600)
    behind = stand(furnished((lamp,), glass).with_nodes(screen), services, 1500)
    own = bare.surfaces.mesh.vertices_of(bare.surfaces.mesh.index_of("back"))
    points = chosen_points(bare.surfaces.mesh, np.arange(own.start, own.stop))
    means = [traced(found, points, 256).irradiance.mean() for found in (bare, behind)]
    assert behind.world.mesh.faces.size > bare.world.mesh.faces.size
    assert means[1] == pytest.approx(means[0], rel=0.02)
    inside = dataclasses.replace(lamp, transform=Transform((-0.4, 0.5, -0.3)))  # in the middle of the box
    found = stand(furnished((inside,)), services, 600)
    assert not traced(found, found.surfaces.mesh, 64).irradiance.any()


def test_far_from_the_origin_nothing_differs(services):
    near = furnished(LIGHTS["area"])
    shift = np.array([1e4, -300.0, 2e4])
    moved = [
        dataclasses.replace(node, transform=_shifted(node.transform, shift)) for node in near.nodes.values()
    ]
    made = []
    for scene, eye in (
        (near, np.array([0.0, 1, 6])),
        (near.with_nodes(*moved), np.array([0.0, 1, 6]) + shift),
    ):
        found = stand(scene, services, 600)
        made.append(traced(found, found.surfaces.mesh, 512, eye=eye).irradiance.astype(float))
    assert np.sqrt(np.mean((made[0] - made[1]) ** 2)) < 0.1 * made[0].mean()
    assert made[0].mean() == pytest.approx(made[1].mean(), rel=0.01)


def _shifted(transform, by):
    return dataclasses.replace(transform, translation=tuple(np.array(transform.translation) + by))


@pytest.mark.parametrize("model", sorted(MODELS))
def test_any_model_reflects_light_and_not_more_than_arrives(services, model):
    """With its defaults and where its numbers are least and most: finite, no brighter than white paint."""
    infos = param_infos(MODELS[model].Params)
    numbers = {name: info for name, info in infos.items() if info.kind in ("number", "integer")}
    white = Material(id="paint", name="P", values={"base_color": (1.0, 1.0, 1.0)})
    limit = _bounced(services, white)
    for extreme in (None, "low", "high"):
        values = {} if extreme is None else {name: getattr(info, extreme) for name, info in numbers.items()}
        light = _bounced(services, Material(id="paint", name="P", model=model, values=values))
        assert np.isfinite(light.terms).all()
        assert np.isfinite(light.irradiance).all()
        assert light.irradiance.mean() < 1.6 * limit.irradiance.mean()


def _bounced(services, paint):
    found = stand(furnished((*LIGHTS["point"], *LIGHTS["sky"]), paint), services, 500)
    return traced(found, found.surfaces.mesh, 64)


def test_either_tracer_will_do(services, monkeypatch):
    made = []
    for tracer in ("auto", "bvh"):
        monkeypatch.setenv("LUCARNE_RAYCASTER", tracer)
        found = stand(furnished(LIGHTS["several"], GLOSSY), services, 500)
        made.append((found.casters.primary.backend, traced(found, found.surfaces.mesh, 32).irradiance))
    assert made[1][0] == "bvh"
    apart = np.abs(made[0][1] - made[1][1]).max(axis=1) > 1e-3 * made[0][1].mean()
    assert apart.mean() < 0.02  # rays along edges


def test_where_nothing_stands_nothing_is_traced(services):
    found = stand(Scene().with_nodes(*LIGHTS["several"]), services)
    made = traced(found, found.surfaces.mesh, 16)
    assert made.terms.shape == (0, made.terms.shape[1], 3)
    assert not len(made.irradiance)


def test_it_stops_when_asked(services, workers):
    found = stand(furnished(LIGHTS["point"]), services, 600)
    job = Job("trace")
    job.cancel()
    with pytest.raises(Cancelled):
        indirect_layer(
            found.surfaces.mesh, found.shapes, np.zeros(3), found.world, PathSettings(), workers, job
        )


def test_it_counts_its_work(services):
    found = stand(furnished(LIGHTS["point"]), services, 500)
    counts = PathCounts()
    traced(found, found.surfaces.mesh, 8, 2, counts=counts)
    assert counts.paths == 8 * len(found.surfaces.mesh)
    assert 0 < counts.segments <= 2 * counts.paths  # without an environment no ray follows the last surface


@given(st.integers(1, 5000), st.integers(1, 9))
def test_growing_samples_come_to_all(samples, first):
    steps = list(growing(samples, first))
    assert sum(steps) == samples
    assert all(step > 0 for step in steps)


@settings(max_examples=20)
@given(st.floats(0.1, 9), st.floats(0.1, 9))
def test_mean_layers_are_weighted(a, b):
    from studio_core.shading.artifacts import LayerRadiance

    one = LayerRadiance(np.ones((2, 1, 3), np.float32), np.ones((2, 3), np.float32))
    two = LayerRadiance(np.zeros((2, 1, 3), np.float32), 3 * np.ones((2, 3), np.float32))
    made = mean_layer([(one, a), (two, b)])
    np.testing.assert_allclose(made.terms, a / (a + b), rtol=1e-5)
    np.testing.assert_allclose(made.irradiance, (a + 3 * b) / (a + b), rtol=1e-5)
