"""Rows of shapes for vertices: what a picture comes to there, and that light sums read them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import floor, sky

from studio_core.contract import Services
from studio_core.scene.diff import Changes, diff
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Environment, Material, MeshObject, PointLamp, Scene
from studio_core.scene.shading_mesh import shade_mesh
from studio_core.scene.transform import Transform
from studio_core.scene.world_mesh import Placed, assemble
from studio_core.shading.artifacts import Hits, Radiance, Shapes, Surfaces
from studio_core.shading.error_meter import ErrorMeter
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.materials import finite_shape, resolve, same_shapes, shapes
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.surface_points import surface_uvs
from studio_core.shading.texels import picture_areas
from studio_core.shading.varying import MOST, Grey, ShapeTable, step_of, stepped

seeds = st.integers(0, 2**32 - 1)


def picture(pixels, encoding="data"):
    return Image(np.asarray(pixels, np.float32)[..., None], encoding)


def shiny(*textures, roughness=1.0, name="m", **more):
    values = {"roughness": roughness, "metallic": 1.0}
    return Material(id=name, name=name, model="ggx", values=values, textures=dict(textures), **more)


def of(*materials):
    return Scene().with_materials(*materials)


def mesh_of(edge=0.25, transform=None):
    return assemble([Placed("floor", shade_mesh(floor(2.0), edge), transform or Transform(), (0,))])


def roughness_of(table, points):
    return np.sqrt(table.data[table.offset[table.rows(points)]])


@given(seeds)
def test_a_square_of_texels_is_their_mean(seed):
    """Squares that are texels of some level, repeated about the picture."""
    rng = np.random.default_rng(seed)
    level = int(rng.integers(0, 4))
    pixels = rng.random((16, 32)).astype(np.float32)
    size = 1 << level
    means = pixels[::-1].reshape(16 // size, size, 32 // size, size).mean(axis=(1, 3))
    v, u = np.indices(means.shape)
    uvs = np.stack([(u + 0.5) * size / 32, (v + 0.5) * size / 16], axis=-1).reshape(-1, 2)
    uvs = (uvs + rng.integers(-2, 3, uvs.shape)).astype(np.float32)
    area = np.full(len(uvs), size * size / 512, np.float32)
    np.testing.assert_allclose(Grey.of(picture(pixels)).at(uvs, area), means.ravel(), atol=1e-5)


def test_between_levels_and_texels_it_is_linear_and_ends_in_the_mean():
    ramp = np.tile(np.linspace(0, 1, 64, dtype=np.float32), (8, 1))
    grey = Grey.of(picture(ramp))
    inside = np.array([[0.3, 0.5], [0.613, 0.2]], np.float32)
    for area in (0.0, 1 / 512, 2 / 512, 11 / 512):
        made = grey.at(inside, np.full(2, area, np.float32))
        np.testing.assert_allclose(made, (inside[:, 0] * 64 - 0.5) / 63, atol=2e-6)
    np.testing.assert_allclose(grey.at(inside, np.full(2, 9.0, np.float32)), ramp.mean(), atol=1e-6)
    assert grey.range == (0.0, 1.0)
    assert grey.mean == pytest.approx(0.5)


def test_the_areas_of_vertices_are_those_of_their_faces():
    mesh = mesh_of()
    area = picture_areas(mesh)
    front = mesh.side > 0
    assert area[front].sum() == pytest.approx(1.0)
    assert area[~front].sum() == pytest.approx(1.0)
    np.testing.assert_allclose(area, mesh.area / 4, rtol=1e-4)
    moved = mesh.moved(0, Transform((1, 2, 3), scale=3.0))
    np.testing.assert_array_equal(picture_areas(moved), area)


@given(seeds, st.floats(0.2, 1.0))
def test_every_vertex_has_the_roughness_of_its_place(host, seed, factor):
    rng = np.random.default_rng(seed)
    texture = Texture(
        picture(rng.uniform(0.2, 0.9, (16, 8))),
        (float(rng.uniform(0.5, 3)), float(rng.uniform(-2, 2))),
        (float(rng.uniform(-1, 1)), 0.25),
    )
    scene, mesh = of(shiny(("roughness", texture), roughness=factor)), mesh_of()
    made = ShapeTable(host)(scene, ("m",), mesh)
    grey, scale = Grey.of(texture.image), np.array(texture.scale)
    at = (mesh.uvs * scale + np.array(texture.offset)).astype(np.float32)
    wanted = factor * grey.at(at, picture_areas(mesh) * abs(scale[0] * scale[1]).astype(np.float32))
    allowed = factor * step_of(*grey.range) / 2 + 1e-6
    np.testing.assert_allclose(roughness_of(made, mesh), wanted, atol=allowed)
    assert (made.owner == 0).all()
    assert made.data[made.offset[0]] == pytest.approx((factor * grey.mean) ** 2, rel=1e-5)
    assert len(made.address) - 1 <= min(256, len(mesh))
    assert (made.address == made.address[0]).all()
    assert made.width == 4


def test_other_materials_and_none_keep_their_rows(host):
    texture = Texture(picture([[0.2, 0.8], [0.5, 0.4]]))
    scene = of(shiny(name="plain", roughness=0.3), shiny(("roughness", texture)), shiny(name="last"))
    mesh = mesh_of()
    for number, expected in ((0, 0.3), (2, 1.0)):
        one = dataclasses.replace(mesh, material=np.full(len(mesh), number, np.int32))
        made = ShapeTable(host)(scene, ("plain", "m", "last"), one)
        assert (made.rows(one) == number).all()
        np.testing.assert_allclose(roughness_of(made, one), expected, rtol=1e-5)
    mixed = np.where(np.arange(len(mesh)) % 2, 1, -1).astype(np.int32)
    made = ShapeTable(host)(scene, ("plain", "m", "last"), dataclasses.replace(mesh, material=mixed))
    rows = made.rows(mesh)
    assert (rows[::2] == -1).all()
    assert (made.owner[rows[1::2]] == 1).all()
    by_material = np.array([10, 20, 30, 40], np.float32)
    assert made.of_rows(by_material)[rows[1]] == 20
    assert made.of_rows(by_material)[-1] == 40


def test_without_a_picture_of_the_shape_rows_are_materials(host):
    colour = Texture(Image(np.random.default_rng(0).random((4, 4, 3)).astype(np.float32)))
    mesh = mesh_of()
    made = ShapeTable(host)(of(shiny(("base_color", colour))), ("m",), mesh)
    assert made.row is None
    assert made.rows(mesh) is mesh.material


def test_only_the_picture_and_the_mesh_make_new_rows(host):
    """Another colour, another place: the same shapes; another roughness or picture: others."""
    texture = Texture(picture(np.random.default_rng(1).random((8, 8))))
    table, mesh = ShapeTable(host), mesh_of()
    start = shiny(("roughness", texture))
    first = table(of(start), ("m",), mesh)
    blue = dataclasses.replace(start, values={**start.values, "base_color": (0.1, 0.2, 0.9)})
    assert same_shapes(table(of(blue), ("m",), mesh), first)
    assert same_shapes(table(of(start), ("m",), mesh.moved(0, Transform((1, 0, 0)))), first)
    half = dataclasses.replace(start, values={**start.values, "roughness": 0.5})
    other = table(of(half), ("m",), mesh)
    assert not same_shapes(other, first)
    np.testing.assert_allclose(roughness_of(other, mesh), roughness_of(first, mesh) / 2, rtol=1e-5)
    turned = dataclasses.replace(
        start, textures={"roughness": Texture(texture.image, (1.0, 1.0), (0.5, 0.0))}
    )
    assert not same_shapes(table(of(turned), ("m",), mesh), first)
    finer = mesh_of(0.1)
    assert len(table(of(start), ("m",), finer).rows(finer)) == len(finer)
    assert same_shapes(table(of(start), ("m",), mesh), first)


@given(seeds)
def test_pictures_of_one_material_share_few_rows(seed):
    """Rows are capped; what is rounded away is half a step, which is as long as it has to be."""
    rng = np.random.default_rng(seed)
    values = rng.random((5000, 2)).astype(np.float32)
    made = stepped(values, [(0.0, 1.0), (0.0, 1.0)])
    assert MOST / 8 < len(made.texels) <= MOST
    np.testing.assert_allclose(made.texels[made.which], values, atol=16 / 255 / 2 * 1.0001)
    same = stepped(np.full((9, 2), 0.3, np.float32), [(0.3, 0.3), (0.0, 0.6)])
    np.testing.assert_allclose(same.texels, [[0.3, 0.3]], atol=1 / 510)
    assert (same.which == 0).all()


@given(st.floats(0, 2), st.floats(1e-3, 4))
def test_steps_are_short_and_texels_of_eight_bits_exact(low, width):
    step = step_of(low, low + width)
    assert width / 255 * 0.999 <= step < 2.001 * width / 255
    bits = np.arange(256, dtype=np.float32)[:, None] / np.float32(255)
    np.testing.assert_allclose(stepped(bits, [(0.0, 1.0)]).texels[:, 0], np.arange(256) / 255, atol=1e-12)


def lit(texture=None, roughness=1.0, lamp=True):
    textures = (("roughness", texture),) if texture is not None else ()
    nodes = [
        MeshObject(id="floor", geometry=floor(3.0), materials=("m",)),
        Environment(id="sky", image=sky()),
    ]
    if lamp:
        nodes.append(PointLamp(id="lamp", transform=Transform((0.4, 1.0, -0.3))))
    return of(shiny(*textures, roughness=roughness)).with_nodes(*nodes)


def shaded(scene, host, workers, backend="reference", **values):
    services = Services(workers, host)
    pipeline = Pipeline(list(host.get("backend", backend).stages(services)))
    view = dataclasses.replace(scene_view(scene, None, 48, 32), antialias=1)
    usual = {"directions": "4096" if backend == "reference" else "32768", "vertices": 700}
    params = backend_params(host.get("backend", backend), {**usual, **values})
    frame = Frame(scene, view, params, 1)
    pipeline.update(frame, Changes(), Job("shade"))
    return pipeline, frame


def terms_of(pipeline):
    radiance = pipeline.artifact(Radiance)
    return sum(layer.terms for layer in radiance.layers.values()), radiance.valid


@pytest.mark.parametrize("backend", ["reference", "cuts"])
def test_light_sums_are_those_of_the_roughness_at_the_vertex(host, workers, backend):
    """Halves of a floor with two roughnesses: each vertex as on a floor that has but its own."""
    pixels = np.repeat([[0.25, 0.6]], 4, axis=0).repeat(8, axis=1)
    pipeline, _ = shaded(lit(Texture(picture(pixels))), host, workers, backend)
    mesh = pipeline.artifact(Surfaces).unrefined.mesh
    terms, valid = terms_of(pipeline)
    terms, valid = terms[: len(mesh)], valid[: len(mesh)]
    u = mesh.uvs[:, 0]
    sums = {}
    for roughness, side in ((0.25, (u > 0.15) & (u < 0.35)), (0.6, (u > 0.65) & (u < 0.85))):
        plain, _ = shaded(lit(roughness=roughness), host, workers, backend)
        sums[roughness], other = terms_of(plain)
        rows = np.flatnonzero(valid & other[: len(mesh)] & side)
        assert len(rows) > 20
        scale = np.abs(sums[roughness][rows]).max()
        np.testing.assert_allclose(terms[rows], sums[roughness][rows], rtol=2e-2, atol=5e-3 * scale)
    assert np.abs(sums[0.25][: len(mesh)][valid] - sums[0.6][: len(mesh)][valid]).max() > 0.1


def test_a_changed_picture_shades_only_what_it_changed(host, workers):
    """Cuts: irradiance stays, and vertices whose row is the same are not summed again."""
    pixels = np.full((4, 64), 0.4, np.float32)
    pixels[:, 60:] = 0.6
    scene = lit(Texture(picture(pixels)))
    pipeline, frame = shaded(scene, host, workers, "cuts", refine=False)
    before = pipeline.artifact(Radiance)
    pixels[:, :16] = 0.5
    pixels[:, 40:44] = 0.1
    after_scene = scene.with_materials(shiny(("roughness", Texture(picture(pixels)))))
    again = dataclasses.replace(frame, scene=after_scene, revision=2)
    pipeline.update(again, diff(scene, after_scene), Job("shade"))
    after = pipeline.artifact(Radiance)
    assert 0 < after.counts["vertices_shaded"] < before.counts["vertices_shaded"]
    fresh, _ = shaded(after_scene, host, workers, "cuts", refine=False)
    made, expected = terms_of(pipeline)[0], terms_of(fresh)[0]
    # What was split for a sharper lobe stays split.
    np.testing.assert_allclose(made, expected, atol=5e-3 * np.abs(expected).max())


def test_points_between_vertices_have_the_texel_itself(host, workers):
    rng = np.random.default_rng(3)
    texture = Texture(picture(rng.uniform(0.2, 0.9, (32, 32))))
    scene = lit(texture)
    pipeline, frame = shaded(scene, host, workers)
    surfaces, hits = pipeline.artifact(Surfaces), pipeline.artifact(Hits)
    known = np.flatnonzero(hits.face >= 0)
    some = Hits(hits.view, 1, hits.face[known], hits.u[known], hits.v[known], hits.distance[known])
    uvs = surface_uvs(surfaces, some, np.asarray(frame.view.transform.translation))
    made = ShapeTable(host).at(scene, surfaces.materials, np.zeros(len(uvs), np.int32), uvs)
    wanted = Grey.of(texture.image).at(uvs, np.zeros(len(uvs), np.float32))
    assert isinstance(made, Shapes)
    found = np.sqrt(made.data[made.offset[made.row]])
    np.testing.assert_allclose(found, wanted, atol=1 / 510 + 1e-6)
    half = made.of_points(np.arange(0, len(uvs), 2))
    np.testing.assert_array_equal(half.row, made.row[::2])


def test_a_texture_of_the_shape_multiplies_the_value(host):
    texture = Texture(picture([[0.5, 1.0]]))
    resolved = resolve(shiny(("roughness", texture), roughness=0.4), host)
    assert resolved.textures == {}
    assert resolved.shaping == {"roughness": texture}
    assert resolved.values["roughness"] == 0.4
    assert resolved.typical()["roughness"] == pytest.approx(0.3)
    assert finite_shape(resolved.brdf, resolved.scaled([0.5]))[0] == pytest.approx(0.04)


def test_a_smooth_picture_is_nearly_as_true_as_its_sharpest_roughness(host, workers, monkeypatch):
    """The error of the picture against every pixel's own texel; with the picture's mean it is far off."""
    v, u = np.indices((64, 64)) / 64
    waves = 0.45 + 0.1 * np.sin(2 * np.pi * 2 * u) * np.cos(2 * np.pi * v)

    def error(texture, roughness=1.0):
        services = Services(workers, host)
        pipeline, frame = shaded(lit(texture, roughness), host, workers, vertices=4000)
        return ErrorMeter(services)(pipeline, frame, Job("measure"), 300).picture.relative_rmse

    plain, varied = error(None, 0.35), error(Texture(picture(waves)))
    monkeypatch.setattr(ShapeTable, "__call__", lambda _, scene, names, mesh: shapes(scene, names, host))
    mean = error(Texture(picture(waves)))
    assert varied < 2 * plain, (plain, varied, mean)
    assert mean > 5 * varied, (plain, varied, mean)
