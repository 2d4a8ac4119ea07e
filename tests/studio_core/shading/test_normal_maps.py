"""Normal maps: how pictures are read and lie, what light sums make of them, and how true pictures are."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scenes import little_scene

from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.raster import PictureStage
from studio_core.scene.diff import diff, everything
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Environment, Material, PointLamp
from studio_core.scene.transform import Transform
from studio_core.shading.artifacts import ChosenPoints, LayerRadiance, Picture, Radiance, Shapes
from studio_core.shading.error_meter import ErrorMeter
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.materials import same_shapes, shapes
from studio_core.shading.normal_maps import (
    mean_slope,
    normal_texture,
    normals_at,
    slope_of,
    strength,
    unit_normals,
)
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.reliefs import ReliefTable
from studio_core.shading.tilting import turned_points

TEXELS = 48


def of_slopes(across, up):
    """A picture of the slopes ∂h/∂x, ∂h/∂y, rows from v = 0 up."""
    normals = np.stack([-across, -up, np.ones_like(across)], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return Image(((normals[::-1] + 1) / 2).astype(np.float32), "data")


def ripples(steep=0.4):
    v, u = (np.indices((TEXELS, TEXELS)) + 0.5) / TEXELS
    waves = steep * np.cos(2 * np.pi * (2 * u + v))
    return of_slopes(waves, 0.5 * waves)


def bumpy(image, model="ggx", strong=1.0, lay=(3.0, 3.0), **values):
    values = {"base_color": (0.6, 0.5, 0.4), **({"roughness": 0.6} if model == "ggx" else {}), **values}
    textures = frozen_map({} if image is None else {"normal": Texture(image, lay)})
    values = frozen_map({**values, **({} if strong == 1 else {"normal": strong})})
    return Material(id="matt", name="Bumpy", model=model, values=values, textures=textures)


def room(material):
    lamp = PointLamp(id="lamp", name="Lamp", transform=Transform((-1.0, 1.6, 0.8)), intensity=4.0)
    return little_scene(environment=None).with_materials(material).with_nodes(lamp)


def shaded(scene, host, workers, backend="cuts", **params):
    services = Services(workers, host)
    found = services.registry.get("backend", backend)
    pipeline = Pipeline([*found.stages(services), PictureStage(services)])
    asked = backend_params(found, {"vertices": 3000, **params})
    frame = Frame(scene, scene_view(scene, None, 120, 80), asked, 1)
    pipeline.update(frame, everything(scene), Job("shade"))
    return pipeline, frame


@given(arrays(np.uint8, (3, 4, 3)), st.floats(-3, 3))
def test_texels_are_read_as_gltf_says(pixels, strong):
    made = unit_normals(Image(pixels, "srgb"), strong)
    wanted = 2 * (pixels / 255.0) - 1
    wanted[..., 2] = np.maximum(wanted[..., 2], 0.05)
    wanted *= (strong, strong, 1)
    wanted /= np.linalg.norm(wanted, axis=2, keepdims=True)
    np.testing.assert_allclose(made, wanted, atol=1e-5)


@given(
    st.sampled_from([-2.0, -1.0, 1.0, 3.0]),
    st.sampled_from([-1.0, 1.0]),
    st.floats(-180, 180),
    st.floats(0.5, 2.0),
)
def test_a_picture_of_slopes_lies_on_the_surface_as_its_heights_do(wide, mirrored, rotation, aspect):
    """Heights in the picture, laid on as textures are, have the gradient that the normals say."""
    image = ripples()
    high = mirrored * wide  # texels as long as wide on a surface whose v is `aspect` times as long as u
    texture = Texture(image, (wide, high), (0.3, 0.1), rotation, aspect)

    def height(x, y):
        place = texture.placed(np.array([[x, y / aspect]], np.float64))[0]
        return 0.4 * np.sin(2 * np.pi * (2 * place[0] + place[1])) / (4 * np.pi) / abs(wide)

    rng = np.random.default_rng(1)
    for x, y in rng.random((4, 2)):
        step = 1e-4
        across = (height(x + step, y) - height(x - step, y)) / (2 * step)
        up = (height(x, y + step) - height(x, y - step)) / (2 * step)
        wanted = np.array([-across, -up, 1]) / np.linalg.norm([across, up, 1])
        found = normals_at(texture, 1.0, np.array([[x, y / aspect]], np.float32))[0]
        np.testing.assert_allclose(found, wanted, atol=0.02)


def test_slopes_are_those_of_the_picture_in_steps():
    found = [slope_of(bumpy(ripples(0.4), strong=strong)) for strong in (0.25, 0.5, 1.0, -1.0, 2.0)]
    mean = mean_slope(ripples(0.4))
    assert mean == pytest.approx(0.4 * np.sqrt(1.25 / 2), rel=1e-2)
    for slope, strong in zip(found, (0.25, 0.5, 1.0, 1.0, 2.0), strict=True):
        assert 2**-0.25 <= slope / (1.2 * mean * strong) <= 2**0.25
    assert slope_of(bumpy(ripples(), strong=1.0)) == slope_of(bumpy(ripples(), strong=1.02))


@pytest.mark.parametrize(
    "material",
    [
        bumpy(None),
        bumpy(ripples(), strong=0.0),
        bumpy(Image(np.full((4, 4, 3), (128, 128, 255), np.uint8), "data")),
        bumpy(Image(np.full((4, 4, 1), 0.5, np.float32), "data")),
        dataclasses.replace(bumpy(ripples()), catches=True),
    ],
)
def test_what_says_nothing_costs_nothing(host, material):
    scene = room(material)
    assert slope_of(material) == 0
    assert shapes(scene, ["matt", "paint"], host).tilt is None
    assert ReliefTable()([material]) is None


def test_strange_strengths_are_none():
    assert strength(bumpy(None, strong="much")) == 1
    assert strength(bumpy(None, strong=float("nan"))) == 1
    assert strength(bumpy(None, strong=1e9)) == 10
    assert normal_texture(bumpy(ripples(), strong=0.0)) is None


def test_shapes_with_other_slopes_are_others(host):
    one, same, other, none = (
        shapes(room(bumpy(image, strong=strong)), ["matt"], host)
        for image, strong in ((ripples(), 1.0), (ripples(), 1.01), (ripples(), 3.0), (None, 1.0))
    )
    assert same_shapes(one, same)
    assert not same_shapes(one, other)
    assert not same_shapes(one, none)


def test_maps_stay_while_pictures_do():
    table, material = ReliefTable(), bumpy(ripples())
    made = table([material, bumpy(None)])
    assert made.levels.tolist() == [6, 0]
    assert table([dataclasses.replace(material, name="Other"), bumpy(None)]) is made
    moved = table(
        [dataclasses.replace(material, textures=frozen_map({"normal": Texture(ripples())})), bumpy(None)]
    )
    assert moved is not made
    first = made.texels[: TEXELS * TEXELS].reshape(TEXELS, TEXELS, 3)
    np.testing.assert_allclose(first[..., :2], unit_normals(ripples())[::-1][..., :2], atol=1e-6)
    stronger = table([bumpy(ripples(), strong=2.0), bumpy(None)])
    assert stronger.texels is moved.texels
    assert stronger.laid[0, 10] == 2
    last = made.texels[made.first[0, 5]]
    np.testing.assert_allclose(last, first.mean(axis=(0, 1)), atol=1e-5)


@given(st.integers(0, 2**32 - 1))
def test_turned_points_have_frames(seed):
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(6, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    along = np.cross(normals, rng.normal(size=(6, 3)))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    sense = rng.choice([-1.0, 1.0], (6, 1))
    tangents = np.concatenate([along, sense], axis=1).astype(np.float32)
    rest = (normals.astype(np.float32), np.zeros((6, 3), np.float32), np.zeros(6, np.int32))
    points = ChosenPoints(np.zeros(3), rest[1], rest[0], tangents, *rest)
    leaning = rng.normal((0, 0, 1.5), 0.4, (6, 3))
    leaning = (leaning / np.linalg.norm(leaning, axis=1, keepdims=True)).astype(np.float32)
    made = turned_points(points, leaning)
    across = sense * np.cross(normals, along)
    back = [np.einsum("pc,pc->p", made.normals, axis) for axis in (along, across, normals)]
    np.testing.assert_allclose(np.stack(back, axis=1), leaning, atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(made.tangents[:, :3], axis=1), 1, atol=1e-5)
    np.testing.assert_allclose(np.einsum("pc,pc->p", made.tangents[:, :3], made.normals), 0, atol=1e-5)
    np.testing.assert_array_equal(made.tangents[:, 3:], sense)
    assert made.geometric is points.geometric


def layers_of(pipeline):
    radiance = pipeline.artifact(Radiance)
    return radiance, sum(layer.terms for layer in radiance.layers.values())


def test_both_backends_agree_on_tilts(host, workers):
    scene = room(bumpy(ripples()))
    cuts, _ = shaded(scene, host, workers, "cuts", refine=False)
    exact, _ = shaded(scene, host, workers, "reference", directions="32768")
    for node, layer in cuts.artifact(Radiance).layers.items():
        true = exact.artifact(Radiance).layers[node]
        rows = cuts.artifact(Radiance).valid & exact.artifact(Radiance).valid
        mean = true.terms[rows].mean(axis=0).max()
        wrong = np.sqrt(((layer.tilts - true.tilts)[rows] ** 2).mean(axis=(0, 2, 3)))
        assert (wrong < 0.05 * mean).all(), (node, wrong / mean)
        assert np.abs(true.tilts[rows]).max() > 0.5 * mean


def test_without_a_map_nothing_more_is_summed_kept_or_shown(host, workers):
    plain, _ = shaded(room(bumpy(None)), host, workers)
    mapped, _ = shaded(room(bumpy(ripples())), host, workers)
    radiance, terms = layers_of(plain)
    other, same = layers_of(mapped)
    assert all(layer.tilts is None for layer in radiance.layers.values())
    assert plain.artifact(Picture).colours.bend is None
    assert plain.artifact(Picture).colours.reliefs is None
    assert mapped.artifact(Picture).colours.bend is not None
    both = radiance.valid & other.valid if len(terms) == len(same) else None
    if both is not None:
        np.testing.assert_allclose(terms[both], same[both], rtol=1e-4, atol=1e-5)
    floor = plain.artifact(Shapes)
    assert floor.tilt is None
    assert 1 < other.counts["nodes"] / radiance.counts["nodes"] < 5.5


def test_only_a_much_stronger_map_asks_for_other_light(host, workers):
    scene = room(bumpy(ripples(), strong=1.0))
    pipeline, frame = shaded(scene, host, workers, refine=False)
    before, shown = pipeline.artifact(Radiance), pipeline.artifact(Picture).linear
    for number, (strong, same) in enumerate(((1.02, True), (3.0, False)), 2):
        after = scene.with_materials(bumpy(ripples(), strong=strong))
        again = dataclasses.replace(frame, scene=after, revision=number)
        pipeline.update(again, diff(scene, after), Job("shade"))
        assert (pipeline.artifact(Radiance) is before) == same
        assert np.abs(pipeline.artifact(Picture).linear - shown).max() > 1e-4
        scene, shown = after, pipeline.artifact(Picture).linear


def test_a_map_that_is_taken_away_leaves_the_picture_of_before(host, workers):
    scene, bare = room(bumpy(ripples())), room(bumpy(None))
    pipeline, frame = shaded(bare, host, workers, refine=False)
    before = pipeline.artifact(Picture).linear
    for number, (old, new) in enumerate(((bare, scene), (scene, bare)), 2):
        again = dataclasses.replace(frame, scene=new, revision=number)
        pipeline.update(again, diff(old, new), Job("shade"))
        if new is scene:
            assert np.abs(pipeline.artifact(Picture).linear - before).max() > 0.02
    np.testing.assert_allclose(pipeline.artifact(Picture).linear, before, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize(("model", "least"), [("lambert", 4), ("ggx", 2)])
def test_pictures_with_maps_are_nearly_as_true_as_plain_ones(host, workers, model, least):
    """Against each place's own normal; without the map they are several times as far off."""
    true, bare = room(bumpy(ripples(), model)), room(bumpy(None, model))
    errors = []
    for scene in (bare, true):
        pipeline, frame = shaded(scene, host, workers)
        frame = dataclasses.replace(frame, scene=true)
        errors.append(ErrorMeter(Services(workers, host))(pipeline, frame, Job("measure"), 300))
    flat, mapped = (error.picture.relative_rmse for error in errors)
    assert flat > least * mapped, (flat, mapped)
    assert mapped < 0.05


def test_layers_keep_tilts_when_their_width_changes():
    rng = np.random.default_rng(0)
    layer = LayerRadiance(
        rng.random((4, 2, 3), np.float32),
        rng.random((4, 3), np.float32),
        rng.random((4, 3, 2, 3), np.float32),
    )
    wide = layer.of_width(5)
    assert wide.tilts.shape == (4, 3, 5, 3)
    np.testing.assert_array_equal(wide.tilts[:, :, :2], layer.tilts)
    assert not wide.tilts[:, :, 2:].any()
    np.testing.assert_array_equal(wide.of_width(2).tilts, layer.tilts)


def test_what_shows_a_photograph_has_no_relief(host, workers):
    material = dataclasses.replace(bumpy(ripples()), catches=True)
    scene = room(material)
    sky = next(scene.of(Environment))
    assert sky.background
    pipeline, _ = shaded(scene, host, workers)
    assert pipeline.artifact(Picture).colours.bend is None
