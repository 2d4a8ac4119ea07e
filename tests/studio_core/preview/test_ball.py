"""Balls of materials in the light of environments."""

from __future__ import annotations

import ctypes
import dataclasses
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from studio_core.imaging.latlong import pixel_directions, pixel_solid_angles
from studio_core.params import param
from studio_core.preview.ball import Balls, ball
from studio_core.preview.light import environment_light
from studio_core.preview.sphere import VIEW, along_u, disc, normals_of, over_disc, sphere
from studio_core.registry import PluginHost
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Environment, Material
from studio_core.shading.materials import resolve
from studio_plugins.brdfs import plugin

HOST = PluginHost([plugin])
SIZE = 48


def material(model: str = "lambert", **given: Any) -> Material:
    fields = {name: given.pop(name) for name in ("textures", "opacity") if name in given}
    return Material(id="m", name="M", model=model, values=given, **fields)


def environment(pixels: np.ndarray, **fields: Any) -> Environment:
    return Environment(id="e", name="E", image=Image(pixels.astype(np.float32)), **fields)


def sky(sun: float = 0.0) -> np.ndarray:
    """Bright above, a warm side at +x; and a sun of so much irradiance."""
    d = pixel_directions(64, 128)
    made = 0.3 + 0.6 * np.maximum(d[..., 1:2], 0) + np.maximum(d[..., :1], 0) ** 4 * [1.0, 0.6, 0.2]
    if sun:
        row, column = 15, 40
        made[row, column] += sun / pixel_solid_angles(64, 128)[row]
    return made


def brute_force(made: Material, pixels: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Radiance (3,) towards the eye: every pixel of the map by the model's formula in NumPy."""
    resolved = resolve(made, HOST)
    fine = np.repeat(np.repeat(pixels, 3, 0), 3, 1)
    wi = pixel_directions(*fine.shape[:2]).reshape(-1, 3)
    solid = np.repeat(pixel_solid_angles(*fine.shape[:2]), fine.shape[1])
    cosine = wi @ normal
    lit = cosine > 0
    first = VIEW - (VIEW @ normal) * normal
    first /= np.linalg.norm(first)
    axes = np.stack([first, np.cross(normal, first), normal])
    local, view = (wi[lit] @ axes.T), axes @ VIEW
    from studio_core.brdfs.calls import evaluate

    shape = np.asarray(resolved.brdf.shape(resolved.values), np.float32)
    terms = evaluate(resolved.brdf, shape, view, local).astype(float)
    values = {n: np.asarray(v, np.float32) for n, v in resolved.values.items()}
    reflect = terms @ np.asarray(resolved.brdf.coefficients(values), float)
    light = fine.reshape(-1, 3)[lit] * (cosine[lit] * solid[lit])[:, None]
    return np.asarray((reflect * light).sum(axis=0))


@pytest.mark.parametrize(
    "made",
    [
        material(base_color=(0.9, 0.5, 0.2)),
        material("ggx", roughness=0.45, base_color=(0.8, 0.2, 0.1)),
        material("ggx", roughness=0.6, metallic=1.0, base_color=(1.0, 0.8, 0.3)),
        material("blinn-phong", exponent=40.0),
    ],
    ids=["matte", "plastic", "metal", "blinn"],
)
@pytest.mark.parametrize("sun", [0.0, 3.0], ids=["overcast", "sunny"])
def test_a_ball_is_the_brute_force_sum(made: Material, sun: float) -> None:
    pixels = sky(sun)
    light = environment_light(environment(pixels))
    assert (light.sun is not None) == bool(sun)
    picture = ball(made, light, 160, HOST).pixels
    for row, column in ((80, 80), (50, 60), (110, 100), (40, 100)):
        x, y = (column + 0.5 - 80) / 79.5, -(row + 0.5 - 80) / 79.5
        up = np.cross(VIEW, [1.0, 0, 0])
        normal = x * np.array([1.0, 0, 0]) + y * up + np.sqrt(1 - x * x - y * y) * VIEW
        true = brute_force(made, pixels, normal)
        np.testing.assert_allclose(picture[row, column, :3], true, rtol=0.05, atol=0.01)


def test_in_even_light_a_white_matte_ball_is_as_bright_as_the_light() -> None:
    light = environment_light(environment(np.full((32, 64, 3), 0.7)))
    picture = ball(material(base_color=(1.0, 1.0, 1.0)), light, SIZE, HOST).pixels
    inside = picture[..., 3] == 1
    np.testing.assert_allclose(picture[inside][:, :3], 0.7, rtol=0.01)
    assert picture[0, 0, 3] == 0
    assert 0.7 < picture[..., 3].mean() < np.pi / 4 + 0.01


def test_a_mirror_shows_the_environment_where_it_is() -> None:
    pixels = np.full((64, 128, 3), 0.01)
    pixels[:, :64] += [0.8, 0, 0]  # u < 0.5 is +x: the right of the picture, for an eye at +z
    light = environment_light(environment(pixels))
    mirror = material("ggx", metallic=1.0, roughness=0.02, base_color=(1.0, 1.0, 1.0))
    picture = ball(mirror, light, SIZE, HOST).pixels
    assert picture[24, 40, 0] > 0.7
    assert picture[24, 7, 0] < 0.1
    turned = environment_light(environment(pixels, azimuth=180.0))
    assert ball(mirror, turned, SIZE, HOST).pixels[24, 7, 0] > 0.7


def test_a_change_of_colour_sums_no_light_and_one_of_roughness_looks_none_up() -> None:
    balls, light = Balls(HOST), environment_light(environment(sky()))
    balls.picture(material("ggx", roughness=0.3), light, SIZE)
    first = dict(balls.counts)
    red = balls.picture(material("ggx", roughness=0.3, base_color=(0.9, 0.0, 0.0)), light, SIZE).pixels
    assert balls.counts == first
    assert red[24, 24, 0] > 3 * red[24, 24, 1]
    balls.picture(material("ggx", roughness=0.4), light, SIZE)
    assert balls.counts["gathered"] == first["gathered"]
    assert balls.counts["summed"] == first["summed"] + 1
    assert balls.counts["kernels"] == first["kernels"] + 20  # one a ring, though it has 40 points


def test_pictures_lie_on_the_ball() -> None:
    stripes = np.zeros((8, 64, 3), np.uint8)
    stripes[:, :32] = 255
    texture = Texture(Image(stripes, "srgb"))
    light = environment_light(environment(np.ones((16, 32, 3))))
    made = material(base_color=(1.0, 1.0, 1.0), textures={"base_color": texture})
    plain = ball(made, light, SIZE, HOST).pixels
    assert sorted(plain[24, [14, 34], 0].round(1).tolist()) == [0.0, 1.0]
    shifted = dataclasses.replace(texture, offset=(0.5, 0.0))
    other = ball(dataclasses.replace(made, textures={"base_color": shifted}), light, SIZE, HOST).pixels
    np.testing.assert_allclose(plain[24, 14, 0] + other[24, 14, 0], 1.0, atol=0.05)


def test_pictures_of_roughness_count_as_their_mean() -> None:
    light = environment_light(environment(sky()))
    half = Texture(Image(np.full((4, 4, 3), 0.5, np.float32)))
    mapped = ball(material("ggx", roughness=0.8, textures={"roughness": half}), light, SIZE, HOST).pixels
    plain = ball(material("ggx", roughness=0.4), light, SIZE, HOST).pixels
    np.testing.assert_allclose(mapped, plain, rtol=1e-4, atol=1e-5)


def test_opacity_is_in_the_alpha_and_unknown_models_are_grey() -> None:
    light = environment_light(None)
    glass = ball(material(opacity=0.25), light, SIZE, HOST).pixels
    assert glass[24, 24, 3] == pytest.approx(0.25)
    grey, matte = (ball(material(model), light, SIZE, HOST).pixels for model in ("no-such-model", "lambert"))
    np.testing.assert_array_equal(grey, matte)


def test_suns_keep_their_light() -> None:
    """A white ball's light in all directions is the light it gets: compared with and without sun."""
    shining = environment_light(environment(sky(3.0)))
    dull = environment_light(environment(sky()))
    assert shining.sun is not None
    np.testing.assert_allclose((shining.average - dull.average) * 4 * np.pi, 3.0, rtol=0.02)


class Brushed:
    """b = the squared part of ω_i along the tangent; what balls need of a model."""

    id, label, terms, textures = "brushed", "Brushed", 1, ()

    @dataclasses.dataclass(frozen=True)
    class Params:
        across: bool = param(False, "Across the tangent")

    def __init__(self) -> None:
        pointer = ctypes.POINTER(ctypes.c_float)
        self._kept = ctypes.CFUNCTYPE(None, pointer, pointer, ctypes.c_int64, pointer, pointer)(self._eval)
        self.address = ctypes.cast(self._kept, ctypes.c_void_p).value

    @staticmethod
    def _eval(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
        axis = np.ctypeslib.as_array(wi, (3, count))[int(shape[0])]
        np.ctypeslib.as_array(out, (count,))[:] = axis**2

    def shape(self, values: Any) -> np.ndarray:
        return np.array([float(values["across"])], np.float32)

    def coefficients(self, values: Any) -> np.ndarray:
        return np.ones((1, 3), np.float32)


def test_grain_follows_the_texture_coordinates() -> None:
    model = Brushed()
    host: Any = SimpleNamespace(brdf=lambda name: model)
    d = pixel_directions(64, 128)
    light = environment_light(environment(np.repeat(d[..., :1] ** 2, 3, 2)))  # brightest at both sides
    along, across = (
        ball(material("brushed", across=across), light, SIZE, host).pixels[18:24, 24, 0].mean()
        for across in (False, True)
    )
    # at the front u runs sideways: ∫ x⁴ z dω is three times ∫ x² y² z dω
    assert along == pytest.approx(np.pi / 8, rel=0.06)
    assert across == pytest.approx(np.pi / 24, rel=0.06)


def test_another_model_of_the_same_name_is_another_ball() -> None:
    models = [Brushed(), Brushed()]
    models[1].coefficients = lambda values: np.full((1, 3), 0.5, np.float32)  # type: ignore[method-assign]
    host: Any = SimpleNamespace(brdf=lambda name: models[-1])
    balls, light = Balls(host), environment_light(None)
    half = balls.picture(material("brushed"), light, SIZE).pixels
    models.pop()
    whole = balls.picture(material("brushed"), light, SIZE).pixels
    assert balls.counts["summed"] == 2  # tables of a measured model are no part of its shape's numbers
    np.testing.assert_allclose(whole[..., :3], 2 * half[..., :3], rtol=1e-5)


def test_points_and_pixels_agree() -> None:
    points, at = sphere(20, 40), disc(40, 20, 40)
    np.testing.assert_allclose(
        np.einsum("rtij,rtkj->rtik", points.frames, points.frames)[3, 5], np.eye(3), atol=1e-6
    )
    np.testing.assert_allclose(
        points.frames[..., 2, :] @ VIEW, np.repeat(points.cosines[:, None], 40, 1), atol=1e-6
    )
    # normals are smooth enough that between points they are met: also across the middle of the ball
    between = over_disc(np.ascontiguousarray(points.frames[..., 2, :]), at)
    x, y = (at.columns + 0.5 - 20) / 19.5, -(at.rows + 0.5 - 20) / 19.5
    inside = np.hypot(x, y) < 0.95
    np.testing.assert_allclose(between[inside, 0], x[inside], atol=0.02)


@pytest.mark.parametrize("rotation", [0.0, 70.0])
@pytest.mark.parametrize("model", ["lambert", "ggx"])
def test_a_map_that_leans_one_way_shows_what_such_normals_see(model: str, rotation: float) -> None:
    """Against brute force at the leaning normals themselves; a flat map changes nothing."""
    lean = np.array([0.35, -0.2, 1.0]) / np.linalg.norm([0.35, -0.2, 1.0])
    texels = np.tile(((lean + 1) / 2).astype(np.float32), (4, 4, 1))
    texture = Texture(Image(texels, "data"), rotation=rotation)
    values: dict[str, Any] = {} if model == "lambert" else {"roughness": 0.6}
    light = environment_light(environment(sky()))
    flat = ball(material(model, **values), light, SIZE, HOST).pixels
    bumpy = ball(material(model, textures={"normal": texture}, **values), light, SIZE, HOST).pixels
    at = disc(SIZE, 20, 40)
    normals = normals_of(at)
    angle = np.radians(rotation)
    x = np.cos(angle) * lean[0] - np.sin(angle) * lean[1]
    y = np.sin(angle) * lean[0] + np.cos(angle) * lean[1]
    east = along_u(normals)
    turned = x * east + y * np.cross(normals, east) + lean[2] * normals
    inner = np.flatnonzero((at.coverage == 1) & (turned @ VIEW > 0.4))
    some = np.random.default_rng(2).choice(inner, 12, replace=False)
    for p in some:
        wanted = brute_force(material(model, **values), sky(), turned[p])
        np.testing.assert_allclose(bumpy[at.rows[p], at.columns[p], :3], wanted, rtol=0.06)
    assert np.abs(bumpy - flat)[at.rows[inner], at.columns[inner]].mean() > 0.03 * flat.mean()
    plain = Texture(Image(np.full((4, 4, 3), (0.5, 0.5, 1.0), np.float32), "data"))
    same = ball(material(model, textures={"normal": plain}, **values), light, SIZE, HOST).pixels
    inner = np.flatnonzero(normals @ VIEW > 0.5)  # at the edge the next pixels stand for those beyond
    inside = at.rows[inner], at.columns[inner]
    np.testing.assert_allclose(same[inside], flat[inside], rtol=2e-3)
