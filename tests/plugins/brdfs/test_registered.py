"""What every registered reflectance model must hold: bundled ones, and those of installed plugins."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from brdf_models import MODELS
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.brdf import ORACLES, unit

from studio_core.brdfs.albedo import quadrature_albedo
from studio_core.brdfs.calls import evaluate
from studio_core.brdfs.quadrature import over_hemisphere
from studio_core.brdfs.ranges import at_fraction, colour_corners, shaped, shaping
from studio_core.params import defaults, param_infos
from studio_core.shading.materials import shape_textures

Float = npt.NDArray[np.float32]
GRID = 16
GOLDEN = np.pi * (3 - np.sqrt(5))
TOLERANCE = 3e-5  # of the integral over one box of some dozens
shaping_of = functools.cache(shaping)

every_model = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())
with_oracle = pytest.mark.parametrize(
    "model", [MODELS[name] for name in ORACLES if name in MODELS], ids=lambda m: m.id
)


def coefficients(model: Any, values: Any) -> Float:
    return model.coefficients({k: np.asarray(v, np.float32) for k, v in values.items()})


def anisotropic(model: Any) -> bool:
    return "direction" in param_infos(model.Params)


def grid(model: Any) -> tuple[list[float], npt.NDArray[np.float64], list[dict[str, Any]]]:
    """Shape fractions, wo, and every corner of what is not shape."""
    fractions = list(np.linspace(0, 1, GRID)) if shaping_of(model)[0] else [0.0]
    theta = np.radians(np.linspace(0, 89, GRID))
    turn = GOLDEN * np.arange(GRID) if anisotropic(model) else 0 * theta
    wo = np.stack([np.sin(theta) * np.cos(turn), np.sin(theta) * np.sin(turn), np.cos(theta)], -1)
    corners = list(colour_corners(model))
    return fractions, wo, corners


def grey(values: dict[str, Any]) -> dict[str, Any]:
    """Colours as one channel."""
    return {name: np.array(v[:1]) if isinstance(v, tuple) else v for name, v in values.items()}


@functools.cache
def kernel_albedo(model: Any) -> npt.NDArray[np.float64]:
    """(shapes, angles, terms) of the compiled kernel."""
    fractions, wo, _ = grid(model)
    shapes = [model.shape(shaped(model, fraction)) for fraction in fractions]
    return np.stack([quadrature_albedo(model, shape, wo, TOLERANCE) for shape in shapes])


@every_model
def test_returns_no_more_light_than_arrives(model: Any) -> None:
    found = kernel_albedo(model)
    for s, fraction in enumerate(grid(model)[0]):
        for corner in grid(model)[2]:
            c = coefficients(model, {**shaped(model, fraction), **corner}).astype(np.float64)
            furnace = found[s] @ c
            assert furnace.max() <= 1.001, (fraction, corner)
            assert furnace.min() >= 0, (fraction, corner)


@every_model
def test_returns_no_more_light_at_any_corner_of_its_shape(model: Any) -> None:
    names = shaping_of(model)[0]
    infos, corners = param_infos(model.Params), grid(model)[2]
    theta, turn = np.radians([0, 30, 60, 80, 89]), np.array([0, 0.4, 1.1, np.pi / 2, 2.2])
    wo = np.stack([np.sin(theta) * np.cos(turn), np.sin(theta) * np.sin(turn), np.cos(theta)], -1)
    for fractions in itertools.product((0.0, 1.0), repeat=len(names)):
        values = {
            **defaults(model.Params),
            **{n: at_fraction(infos[n], f) for n, f in zip(names, fractions, strict=True)},
        }
        found = quadrature_albedo(model, model.shape(values), wo, TOLERANCE)
        for corner in corners:
            furnace = found @ coefficients(model, {**values, **corner}).astype(np.float64)
            assert furnace.max() <= 1.001, (values, corner)
            assert furnace.min() >= 0, (values, corner)


@with_oracle
def test_albedo_is_the_float64_tables(model: Any) -> None:
    fractions, wo, corners = grid(model)
    corners = corners[:: max(1, (len(corners) - 1) // 3)]  # the first, the last and two between
    found = kernel_albedo(model)
    oracle = ORACLES[model.id]
    for s, fraction in enumerate(fractions):

        def f(row: int, wi: Float, around: dict[str, Any] = shaped(model, fraction)) -> Any:  # noqa: B008
            values = [{**around, **corner} for corner in corners]
            w = unit(wi)
            o = np.broadcast_to(wo[row], w.shape)
            return np.concatenate([oracle(grey(v), o, w) for v in values], -1) * w[:, 2:]

        table = over_hemisphere(f, wo, TOLERANCE)
        for k, corner in enumerate(corners):
            c = coefficients(model, {**shaped(model, fraction), **corner})[:, 0].astype(np.float64)
            np.testing.assert_allclose(
                found[s] @ c, table[:, k], rtol=5e-3, atol=TOLERANCE, err_msg=str(corner)
            )


def directions(rng: np.random.Generator, count: int) -> npt.NDArray[np.float64]:
    """Above the surface: all over, grazing, and near one another's mirror images."""
    all_over = unit(rng.normal(size=(count, 3)))
    all_over[:, 2] = np.abs(all_over[:, 2])
    all_over[: count // 8, 2] *= 1e-3
    all_over = unit(all_over)
    spread = 10.0 ** rng.uniform(-5, -0.5, size=(count, 1))
    mirrored = unit(all_over * [-1, -1, 1] + spread * rng.normal(size=(count, 3)))
    mirrored[:, 2] = np.abs(mirrored[:, 2])
    return np.concatenate([all_over, mirrored])


@every_model
@pytest.mark.parametrize("fraction", [0.0, 0.3, 0.7, 1.0])
def test_is_reciprocal(model: Any, fraction: float) -> None:
    shape = model.shape(shaped(model, fraction))
    w = directions(np.random.default_rng(5), 160).astype(np.float32)  # 51,360 pairs a shape
    there = np.stack([evaluate(model, shape, o, w) for o in w])
    back = there.transpose(1, 0, 2)
    assert there.max() > 0
    np.testing.assert_allclose(there, back, rtol=1e-4, atol=1e-6 * float(there.max()))


@with_oracle
@settings(max_examples=60, deadline=None)
@given(data=st.data(), seed=st.integers(0, 2**32 - 1))
def test_kernel_is_the_oracle(model: Any, data: Any, seed: int) -> None:
    infos = param_infos(model.Params)
    values = {name: at_fraction(info, data.draw(st.floats(0, 1), name)) for name, info in infos.items()}
    w = directions(np.random.default_rng(seed), 32).astype(np.float32)
    c = coefficients(model, values).astype(np.float64)
    # In float32 a mirrored pair that also grazes does not say where its half vector points.
    steep = np.minimum(w[:32, 2], w[32:, 2]) > 0.2
    for o, near in zip(w[:32][steep], w[32:][steep], strict=True):
        wi = np.concatenate([w[:8], near[None]])
        made = evaluate(model, model.shape(values), o, wi) @ c
        truth = ORACLES[model.id](values, np.broadcast_to(o, wi.shape).astype(np.float64), wi)
        cosine = wi[:, 2:]  # as light sums take it
        np.testing.assert_allclose(made * cosine, truth * cosine, rtol=1e-2, atol=2e-5)


tiny = st.sampled_from([0.0, 1e-45, 1e-38, 1e-30, 1e-20, 1e-12, 1e-7, 1e-4])
component = st.one_of(tiny, st.floats(-1, 1, width=32))


@st.composite
def any_direction(draw: Any) -> Float:
    """A unit vector, often grazing, sometimes below the surface."""
    x, y = draw(component), draw(component)
    z = draw(st.one_of(tiny, component))
    length = float(np.sqrt(x * x + y * y + z * z))
    return np.array([x, y, z] if length > 1e-3 else [1, 0, 0], np.float32) / np.float32(
        length if length > 1e-3 else 1
    )


@every_model
@settings(max_examples=150, deadline=None)
@given(data=st.data(), wo=any_direction(), wi=st.lists(any_direction(), min_size=1, max_size=9))
def test_is_finite_everywhere_and_dark_from_below(model: Any, data: Any, wo: Float, wi: list[Float]) -> None:
    infos = param_infos(model.Params)
    fraction = st.one_of(st.sampled_from([0.0, 1.0]), st.floats(0, 1))
    values = {name: at_fraction(info, data.draw(fraction, name)) for name, info in infos.items()}
    mirrored = [w * np.array([-1, -1, 1], np.float32) for w in [*wi, wo]]
    every = np.array([*wi, *mirrored, wo])
    made = evaluate(model, model.shape(values), wo, every)
    assert np.isfinite(made).all()
    assert (made >= 0).all()
    assert not made[every[:, 2] <= 0].any()
    if wo[2] <= 0:
        assert not made.any()


@every_model
def test_coefficients_are_per_texel(model: Any) -> None:
    rng = np.random.default_rng(2)
    infos = param_infos(model.Params)
    own = [name for name in model.textures if name in infos]  # others are maps, of bound models
    texels = {
        name: rng.uniform(0, 1, (4, 5, 3) if infos[name].kind == "colour" else (4, 5)).astype(np.float32)
        for name in own
    }
    plain = {k: np.asarray(v, np.float32) for k, v in defaults(model.Params).items()}
    made = model.coefficients({**plain, **texels})
    assert made.shape == (4, 5, model.terms, 3)
    assert made.dtype == np.float32
    one = {**plain, **{name: texel[2, 3] for name, texel in texels.items()}}
    np.testing.assert_array_equal(made[2, 3], model.coefficients(one))
    assert set(own) <= set(shaping_of(model)[1])


@every_model
def test_pictures_of_the_shape_are_of_its_numbers_and_colour_nothing(model: Any) -> None:
    infos, shaping = param_infos(model.Params), shaping_of(model)[0]
    for name in shape_textures(model):
        assert name in shaping
        assert infos[name].kind == "number"
        if name not in model.textures:
            varied = ({**defaults(model.Params), name: at_fraction(infos[name], f)} for f in (0, 0.6, 1))
            made = [coefficients(model, values) for values in varied]
            np.testing.assert_array_equal(made[0], made[1])
            np.testing.assert_array_equal(made[0], made[2])


@every_model
def test_roles_are_parameters_that_can_play_them(model: Any) -> None:
    infos = param_infos(model.Params)
    kinds = {"diffuse": {"colour"}, "specular": {"colour", "number"}, "gloss": {"number"}}
    roles = getattr(model, "roles", {})
    assert set(roles) <= set(kinds)
    assert len(set(roles.values())) == len(roles)
    for role, name in roles.items():
        assert infos[name].kind in kinds[role], role
        assert (name in shaping_of(model)[0]) == (role == "gloss"), role
    if "gloss" in roles:
        info = infos[roles["gloss"]]
        walk = [at_fraction(info, f) for f in np.linspace(0, 1, 41)]
        alphas = np.array([model.alpha(value) for value in walk])
        assert 0 <= alphas.min() <= alphas.max() <= 1
        rise = np.diff(alphas)
        assert (rise > 0).all() or (rise < 0).all()
        np.testing.assert_allclose([model.gloss(alpha) for alpha in alphas], walk, rtol=1e-9, atol=1e-12)


@every_model
def test_parameters_are_documented(model: Any) -> None:
    for name, info in param_infos(model.Params).items():
        assert info.label, name
        if info.kind in ("number", "integer", "colour"):
            assert np.isfinite([info.low, info.high]).all(), name
    assert model.Params() == model.Params()
