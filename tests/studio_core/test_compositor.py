"""Pictures against an oracle that takes every sample by itself, and what a stage keeps between pictures."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import compose as oracle
from scenes import floor
from scenes import little_scene as make_little_scene

from studio_core import edits
from studio_core.contract import Services
from studio_core.parallel import Workers
from studio_core.raster import CoefficientTable, Compositor, PictureStage
from studio_core.scene.diff import everything
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import (
    FAR_AWAY,
    ON_THE_GROUND,
    Camera,
    Environment,
    Light,
    Material,
    MeshObject,
    PointLamp,
)
from studio_core.scene.transform import Transform
from studio_core.session import View
from studio_core.shading.artifacts import TERMS, Casters, Hits, LayerRadiance, Radiance, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_core.shading.primary import PrimaryStage, visible_vertices
from studio_core.shading.stages import CasterStage, SurfaceParams, SurfaceStage

RNG = np.random.default_rng(8)
CHECKS = Image(RNG.integers(0, 256, (13, 24, 3), dtype=np.uint8), "srgb")
GREY = Image(RNG.random((8, 8, 1)).astype(np.float32))
BUMPS = Image(RNG.integers(40, 256, (11, 14, 3), dtype=np.uint8), "data")
LOOKS = {
    "normal map": Material(
        id="look", name="Stone", model="ggx", values={"normal": 0.7},
        textures={"normal": Texture(BUMPS, (2.0, 3.0), (0.1, 0.6), 30.0, 1.3)},
    ),
    "normal map and picture": Material(
        id="look", name="Tiles",
        textures={"base_color": Texture(CHECKS, (3.0, 2.0)), "normal": Texture(BUMPS, (-2.0, 1.0))},
    ),
    "normal map and two maps": Material(
        id="look", name="Both", model="ggx", opacity=0.7,
        textures={"base_color": Texture(CHECKS), "metallic": Texture(GREY), "normal": Texture(BUMPS)},
    ),
    "plain": Material(id="look", name="Plain", model="ggx", values={"base_color": (0.9, 0.4, 0.2)}),
    "textured": Material(
        id="look", name="Oak", model="ggx",
        values={"metallic": 0.1, "base_color": (0.4, 0.4, 0.4)},  # so that no term is straightened
        textures={"base_color": Texture(CHECKS, (3.0, 2.0), (0.2, 0.7), 25.0, 1.4)},
    ),
    "grey": Material(id="look", name="Worn", model="ggx", textures={"metallic": Texture(GREY)}),
    "two maps": Material(
        id="look", name="Both", model="ggx",
        textures={"base_color": Texture(CHECKS), "metallic": Texture(GREY)},
    ),
    "bending": Material(
        id="look", name="Bending", model="phong", values={"diffuse": (0.9,) * 3, "specular": (0.5,) * 3},
        textures={"diffuse": Texture(CHECKS)},
    ),
    "glass": Material(id="look", name="Glass", model="ggx", opacity=0.3),
    "patterned glass": Material(
        id="look", name="Pane", opacity=0.6, textures={"base_color": Texture(CHECKS, (2.0, 2.0))}
    ),
    "floor of a photograph": Material(id="look", name="Floor", catches=True),
    "textured floor of a photograph": Material(
        id="look", name="Oak", model="ggx", textures={"base_color": Texture(CHECKS)}, catches=True
    ),
    "catching glass": Material(id="look", name="Both", catches=True, opacity=0.3),
}  # fmt: skip


def room(look="textured"):
    """The little scene with one look on its first object, an open sheet, and a lamp."""
    scene = make_little_scene().with_materials(LOOKS[look])
    first = next(scene.of(MeshObject))
    sheet = MeshObject(
        id="sheet", name="Sheet", geometry=floor(1.2), materials=("look",),
        transform=Transform((0.4, 0.9, 0.9), (0.6, 0.8, 0.0, 0.0)),
    )  # fmt: skip
    painted = dataclasses.replace(first, materials=("look",) * len(first.materials))
    off = PointLamp(id="off", name="Switched off", hidden=True)
    return scene.with_nodes(painted, sheet, PointLamp(id="lamp", name="Lamp"), off)


class Studio:
    """Surfaces and hits of a scene, and random light sums."""

    def __init__(self, host, workers):
        self.services = Services(workers, host)
        self.stages = (SurfaceStage(), CasterStage(), PrimaryStage(self.services))
        self.made = (None, None, None)

    def see(self, scene, view, vertices=500):
        frame, job, changes = (
            Frame(scene, view, SurfaceParams(vertices=vertices)),
            Job("see"),
            everything(scene),
        )
        surface, caster, primary = self.stages
        surfaces = surface.run(frame, Inputs({}, changes, self.made[0]), job)
        casters = caster.run(frame, Inputs({Surfaces: surfaces}, changes, self.made[1]), job)
        made = {Surfaces: surfaces, Casters: casters}
        hits = primary.run(frame, Inputs(made, changes, self.made[2]), job)
        self.made = (surfaces, casters, hits)
        return frame, surfaces, hits


def light_sums(scene, surfaces, hits, seed=0):
    rng = np.random.default_rng(seed)
    count = len(surfaces.mesh)
    valid = visible_vertices(surfaces, hits)
    layers = {}
    for light in scene.of(Light):
        terms = rng.random((count, TERMS, 3)).astype(np.float32) * valid[:, None, None]
        irradiance = rng.random((count, 3)).astype(np.float32)
        mapped = any("normal" in material.textures for material in scene.materials.values())
        tilts = rng.normal(0.0, 1.0, (count, 3, TERMS, 3)) * valid[:, None, None, None] if mapped else None
        layers[light.id] = LayerRadiance(
            terms, irradiance, None if tilts is None else tilts.astype(np.float32)
        )
    return Radiance(surfaces, None, layers, valid, 1024, True)


def view_of(scene, width=24, height=17, antialias=1, fine=False):
    view = View.of(next(scene.of(Camera)), scene, width, height)
    return dataclasses.replace(view, antialias=antialias, fine_edges=fine)


@pytest.mark.parametrize("antialias", [1, 2])
@pytest.mark.parametrize("look", LOOKS)
def test_pictures_are_those_of_the_oracle(host, workers, look, antialias):
    scene = room(look)
    _, surfaces, hits = Studio(host, workers).see(scene, view_of(scene, antialias=antialias))
    radiance = light_sums(scene, surfaces, hits)
    made = Compositor(workers).picture(scene, radiance, hits, CoefficientTable(host)(scene, surfaces))
    expected, unsure = oracle.picture(scene, radiance, hits, host)
    assert unsure.mean() < 0.02
    np.testing.assert_allclose(made.linear[~unsure], expected[~unsure], rtol=3e-4, atol=3e-5)
    n2 = antialias**2
    face = hits.face.reshape(-1, n2)
    np.testing.assert_allclose(made.coverage.ravel(), (face >= 0).mean(axis=1), atol=1e-6)
    for pixel, (first, node, distance) in enumerate(
        zip(face[:, 0], made.node.ravel(), made.distance.ravel(), strict=True)
    ):
        assert node == (surfaces.mesh.object[surfaces.mesh.faces[first, 0]] if first >= 0 else -1)
        assert distance == (hits.distance[pixel * n2] if first >= 0 else np.inf)


@pytest.mark.parametrize("antialias", [1, 2])
@pytest.mark.parametrize("look", ["floor of a photograph", "glass"])
def test_pictures_on_the_ground_are_those_of_the_oracle(host, workers, look, antialias):
    scene = room(look)
    sky = dataclasses.replace(
        next(scene.of(Environment)),
        projection=ON_THE_GROUND,
        ground_radius=5.0 if antialias == 1 else 1.0,
        ground_height=1.3,
        background_azimuth=70.0,
        tint=(1.0, 0.5, 2.0),
        azimuth=-30.0,
        transform=Transform((0.3, -0.2, 0.1)),
    )
    floor_material = dataclasses.replace(scene.material("matt"), catches=True)
    scene = scene.with_nodes(sky).with_materials(floor_material)
    view = view_of(scene, antialias=antialias, fine=antialias == 2)
    _, surfaces, hits = Studio(host, workers).see(scene, view)
    radiance = light_sums(scene, surfaces, hits)
    made = Compositor(workers).picture(scene, radiance, hits, CoefficientTable(host)(scene, surfaces))
    expected, unsure = oracle.picture(scene, radiance, hits, host)
    np.testing.assert_allclose(made.linear[~unsure], expected[~unsure], rtol=1e-3, atol=2e-4)


@pytest.mark.parametrize("look", LOOKS)
def test_pictures_with_fine_edges_are_those_of_the_oracle(host, workers, look):
    scene = room(look)
    _, surfaces, hits = Studio(host, workers).see(scene, view_of(scene, 18, 13, fine=True))
    assert len(hits.edges.pixels) > 20
    radiance = light_sums(scene, surfaces, hits)
    made = Compositor(workers).picture(scene, radiance, hits, CoefficientTable(host)(scene, surfaces))
    expected, unsure = oracle.picture(scene, radiance, hits, host)
    assert unsure.mean() < 0.05
    np.testing.assert_allclose(made.linear[~unsure], expected[~unsure], rtol=3e-4, atol=3e-5)


@pytest.mark.parametrize("background", [False, True])
@pytest.mark.parametrize("look", LOOKS)
def test_fine_edges_are_the_pixels_of_sixteen_samples_and_all_others_as_before(
    host, workers, look, background
):
    scene = room(look)
    scene = scene.with_nodes(dataclasses.replace(next(scene.of(Environment)), background=background))
    whole_view, view = view_of(scene, 60, 41, 4), view_of(scene, 60, 41, 2)
    _, surfaces, fine = Studio(host, workers).see(scene, dataclasses.replace(view, fine_edges=True))
    plain, whole = (Studio(host, workers).see(scene, each)[2] for each in (view, whole_view))
    seen = dataclasses.replace(light_sums(scene, surfaces, fine), valid=np.ones(len(surfaces.mesh), np.bool_))
    table = CoefficientTable(host)(scene, surfaces)
    made, two, four = (Compositor(workers).picture(scene, seen, hits, table) for hits in (fine, plain, whole))
    ended = np.zeros(60 * 41, np.bool_)
    ended[fine.edges.pixels] = True
    ended = ended.reshape(41, 60)
    assert 0.02 < ended.mean() < 0.5
    for name in ("linear", "coverage"):
        ours = getattr(made, name)
        np.testing.assert_array_equal(ours[ended], getattr(four, name)[ended])
        np.testing.assert_array_equal(ours[~ended], getattr(two, name)[~ended])
    np.testing.assert_array_equal(made.node, two.node)
    np.testing.assert_array_equal(made.distance, two.distance)


@pytest.mark.parametrize("look", [look for look in LOOKS if not LOOKS[look].catches])
def test_coefficients_and_radiance_of_single_hits_are_those_of_the_picture(host, workers, look):
    scene = room(look)
    scene = scene.with_materials(dataclasses.replace(LOOKS[look], opacity=1.0))
    _, surfaces, hits = Studio(host, workers).see(scene, view_of(scene))
    radiance, table = light_sums(scene, surfaces, hits), CoefficientTable(host)(scene, surfaces)
    compositor = Compositor(workers)
    shown = compositor.picture(scene, radiance, hits, table).linear.reshape(-1, 3)
    some = np.flatnonzero(hits.face >= 0)[::3]
    parts = (hits.face[some], hits.u[some], hits.v[some], hits.distance[some])
    chosen = Hits(hits.view, hits.samples, *parts)
    single = compositor.radiance(scene, radiance, chosen, table)
    np.testing.assert_array_equal(single, shown[some])
    if "normal" in LOOKS[look].textures:
        return  # more than sums with coefficients
    lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
    mesh, eye = surfaces.mesh, np.asarray(hits.view.transform.translation) - surfaces.mesh.origin
    a, b, c = np.moveaxis(mesh.positions[mesh.faces[parts[0]]].astype(np.float64), 1, 0)
    behind = (np.cross(b - a, c - a) * (a - eye)).sum(axis=1) > 0
    back = behind & (mesh.back_faces[parts[0], 0] != oracle.NO_BACK)
    corners = np.where(back[:, None], mesh.back_faces[parts[0]], mesh.faces[parts[0]])
    weights = np.stack([1 - parts[1] - parts[2], parts[1], parts[2]], axis=1)
    sums = np.einsum("nk,nktc->ntc", weights, radiance.combined(lights)[corners][..., : table.width, :])
    looks = compositor.coefficients(surfaces, chosen, table)
    np.testing.assert_allclose((sums * looks).sum(axis=1), single, rtol=2e-4, atol=1e-5)


def texture(look, seed):
    rng = np.random.default_rng(seed)
    image = Image(rng.integers(0, 256, (8, 8, 3), dtype=np.uint8), "srgb")
    return dataclasses.replace(look, textures={"base_color": Texture(image)})


OTHER_SKY = Image(RNG.random((8, 16, 3)).astype(np.float32))
KINDS = ["light", "gain", "hidden", "look", "colour", "texture", "opacity"]
KINDS += ["catches", "turn", "ground", "height", "foot"]
KINDS += ["sky", "background", "image", "assign", "move", "view", "eye", "size", "edges"]


def changed(scene, view, seed, kind, number):
    """Scene, view and seed of the light sums after a change."""
    sky = next(scene.of(Environment))
    look = scene.material("look")
    if kind == "light":
        return scene, view, seed + 1 + number
    if kind == "gain":
        return scene.with_nodes(dataclasses.replace(scene["lamp"], intensity=1.0 + number)), view, seed
    if kind == "hidden":
        return scene.with_nodes(dataclasses.replace(scene["lamp"], hidden=number % 2 == 0)), view, seed
    if kind == "look":
        return scene.with_materials(LOOKS[list(LOOKS)[number]]), view, seed
    if kind == "colour":
        return edits.SetMaterial("look", {"base_color": (0.1 * number, 0.5, 0.5)})(scene), view, seed
    if kind == "texture":
        painted = texture(dataclasses.replace(look, model="lambert"), number)
        return scene.with_materials(painted), view, seed
    if kind == "opacity":
        clear = dataclasses.replace(look, opacity=0.2 + 0.2 * (number % 5))
        return scene.with_materials(clear), view, seed
    if kind == "catches":
        return scene.with_materials(dataclasses.replace(look, catches=number % 2 == 0)), view, seed
    if kind == "turn":
        return scene.with_nodes(dataclasses.replace(sky, background_azimuth=50.0 * number)), view, seed
    if kind in ("ground", "height"):
        fields = {"projection": ON_THE_GROUND if number % 2 else FAR_AWAY} if kind == "ground" else {}
        made = dataclasses.replace(
            sky, **fields, ground_height=1.0 + 0.2 * number, ground_radius=4.0 + number
        )
        return scene.with_nodes(made), view, seed
    if kind == "foot":
        away = Transform((0.3 * number, -0.1 * number, 0.2))
        return scene.with_nodes(dataclasses.replace(sky, transform=away)), view, seed
    if kind == "sky":
        turned = dataclasses.replace(sky, azimuth=40.0 * number, intensity=1.0 + number % 2)
        return scene.with_nodes(turned), view, seed
    if kind == "background":
        return scene.with_nodes(dataclasses.replace(sky, background=number % 2 == 0)), view, seed
    if kind == "image":
        shown = OTHER_SKY if number % 2 else make_little_scene()[sky.id].image
        return scene.with_nodes(dataclasses.replace(sky, image=shown)), view, seed
    if kind == "assign":
        other = next(m for m in scene.materials if (m == "look") == (number % 2 == 0))
        return scene.with_nodes(dataclasses.replace(scene["sheet"], materials=(other,))), view, seed
    if kind == "move":
        moved = dataclasses.replace(scene["sheet"].transform, translation=(0.2 * number, 0.8, 0.5))
        return edits.Move({"sheet": moved})(scene), view, seed
    if kind == "eye":
        across = dataclasses.replace(view.transform, translation=(0.7 * number - 1.5, 1.0, 3.0))
        return scene, dataclasses.replace(view, transform=across), seed
    if kind == "view":
        return scene, dataclasses.replace(view, fov=30.0 + 5 * number), seed
    if kind == "size":
        return scene, dataclasses.replace(view, width=16 + number, antialias=1 + number % 2), seed
    if kind == "edges":
        return scene, dataclasses.replace(view, fine_edges=number % 2 == 1), seed
    return scene, view, seed


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("look", ["textured", "patterned glass"])
def test_a_change_shows_as_if_nothing_had_been_kept(host, workers, look, kind):
    check_kept(host, workers, room(look), [(kind, number) for number in (1, 2, 4, 3)])


@given(st.lists(st.tuples(st.sampled_from(KINDS), st.integers(0, 5)), min_size=2, max_size=6))
@settings(max_examples=20)
def test_what_is_kept_never_shows(host, workers, steps):
    check_kept(host, workers, room(), steps)


def check_kept(host, workers, scene, steps):
    """A stage that has seen all steps draws what a new one does."""
    studio, kept = Studio(host, workers), PictureStage(Services(workers, host))
    view, seed = view_of(scene, 20, 13, fine=len(steps) % 2 == 0), 0
    for kind, number in [("", 0), *steps]:
        scene, view, seed = changed(scene, view, seed, kind, number)
        frame, surfaces, hits = studio.see(scene, view)
        inputs = {Surfaces: surfaces, Hits: hits, Radiance: light_sums(scene, surfaces, hits, seed)}
        pictures = [
            stage.run(frame, Inputs(inputs, everything(scene)), Job("draw"))
            for stage in (kept, PictureStage(Services(workers, host)))
        ]
        for name in ("linear", "coverage", "node", "distance"):
            np.testing.assert_array_equal(*(getattr(picture, name) for picture in pictures))


def test_radiance_on_a_finer_mesh_is_drawn_with_its_own_hits(host, workers):
    scene = room()
    frame, surfaces, hits = Studio(host, workers).see(scene, view_of(scene))
    _, finer, own = Studio(host, workers).see(scene, view_of(scene), vertices=3000)
    assert len(finer.mesh) > len(surfaces.mesh)
    fine = dataclasses.replace(light_sums(scene, finer, own), hits=own)
    stage = PictureStage(Services(workers, host))
    coarse = light_sums(scene, surfaces, hits)
    for radiance, table_surfaces, expected in (
        (coarse, surfaces, hits),
        (fine, finer, own),
        (coarse, surfaces, hits),
    ):
        inputs = {Surfaces: surfaces, Hits: hits, Radiance: radiance}
        made = stage.run(frame, Inputs(inputs, everything(scene)), Job("draw"))
        table = CoefficientTable(host)(scene, table_surfaces)
        again = Compositor(workers).picture(scene, radiance, expected, table)
        np.testing.assert_array_equal(made.linear, again.linear)
        np.testing.assert_array_equal(made.node, again.node)


def test_vertices_that_were_not_lit_are_dark(host, workers):
    scene = room("plain")
    _, surfaces, hits = Studio(host, workers).see(scene, view_of(scene))
    radiance = light_sums(scene, surfaces, hits)
    none = dataclasses.replace(radiance, valid=np.zeros_like(radiance.valid))
    table = CoefficientTable(host)(scene, surfaces)
    made = Compositor(workers).picture(scene, none, hits, table)
    assert not made.linear[made.coverage == 1].any()
    assert Compositor(workers).picture(scene, radiance, hits, table).linear[made.coverage == 1].all()


@pytest.mark.parametrize("look", ["textured", "patterned glass"])
def test_the_number_of_threads_changes_nothing(host, workers, look):
    scene = room(look)
    with Workers(1) as alone:
        _, surfaces, hits = Studio(host, alone).see(scene, view_of(scene, 160, 120, 2, fine=True))
        radiance, table = light_sums(scene, surfaces, hits), CoefficientTable(host)(scene, surfaces)
        one = Compositor(alone).picture(scene, radiance, hits, table)
    two = Compositor(workers).picture(scene, radiance, hits, table)
    np.testing.assert_array_equal(one.linear, two.linear)
