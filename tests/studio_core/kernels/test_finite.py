"""What shading kernels promise of any input: finite, never negative, and no larger than the light allows."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.kernels.background import FAR_AWAY, background_hits
from studio_core.kernels.compose import AFFINE, CONSTANT, GENERAL, RECORD, face_texels, shade_hits
from studio_core.kernels.directions import direction_set
from studio_core.kernels.facing import shown_sides
from studio_core.kernels.radiance import environment_terms, lamp_terms
from studio_core.params import defaults
from studio_core.scene.tangents import arbitrary_tangents
from studio_core.scene.transform import looking, rotation_matrix
from studio_core.session import View
from studio_core.shading.artifacts import TERMS
from studio_core.shading.primary import pinhole

QUICK = settings(max_examples=60)
DIRECTIONS = direction_set(10)
MODELS = st.sampled_from(
    [
        ("lambert", {}),
        *[("ggx", {"roughness": r}) for r in (0.0, 1e-6, 0.01, 0.3, 1.0)],
        *[("phong", {"exponent": n}) for n in (1.0, 100.0, 1e5)],
        *[("blinn-phong", {"exponent": n}) for n in (1.0, 100.0, 1e5)],
    ]
)
RADIANCE = st.floats(-4, 6).map(lambda power: 10.0**power)
# Along the axes, within a float of grazing, and anything between.
NORMALS = st.one_of(
    st.sampled_from([(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, -1, 0), (1, 0, -0.0), (0, 0, 0)]),
    st.tuples(*[st.floats(-1, 1)] * 3),
)
TILTS = st.sampled_from([0.0, 1e-38, 1e-12, 1e-7, 1e-4, 0.1, 1.0, -1e-7, -1.0])
PLACES = st.one_of(st.just(0.0), st.floats(-1e4, 1e4))


def unit(vector):
    length = math.hypot(*vector)
    return np.array(vector if length < 1e-30 else [c / length for c in vector], np.float32)


def grazing(normal, tilt):
    """A unit direction whose cosine with the normal is about `tilt`."""
    aside = np.cross(normal, (0.3, 0.8, -0.5) if abs(normal[0]) > 0.5 else (1.0, 0.0, 0.0))
    return unit(unit(aside).astype(np.float64) + tilt * normal)


def tables(host, model):
    name, values = model
    brdf = host.brdf(name)
    shape = np.atleast_1d(brdf.shape(defaults(brdf.Params) | values)).astype(np.float32)
    address, terms = np.array([brdf.address], np.int64), np.array([brdf.terms], np.int64)
    return address, terms, np.zeros(1, np.int64), np.concatenate([shape, [0]]).astype(np.float32)


@given(MODELS, NORMALS, TILTS, RADIANCE, st.tuples(PLACES, PLACES, PLACES), st.booleans())
@QUICK
def test_environment_sums(host, model, normal, tilt, level, place, at_the_eye):
    n, position = unit(normal), np.array([place], np.float32)
    eye = position[0] if at_the_eye else (position[0] + 3 * grazing(n, tilt)).astype(np.float32)
    made = []
    for light in (level, 1.0):
        out, irradiance = np.zeros((1, TERMS, 3), np.float32), np.zeros((1, 3), np.float32)
        bits = np.full((1, DIRECTIONS.size // 64), np.uint64(0xFFFFFFFFFFFFFFFF))
        leaves = np.full((DIRECTIONS.size, 3), light, np.float32)
        where = (
            np.zeros(1, np.int64),
            position,
            n[None],
            arbitrary_tangents(n[None]),
            np.zeros(1, np.int32),
            eye,
            bits,
        )
        sums = (DIRECTIONS.directions, leaves, DIRECTIONS.solid_angle, *tables(host, model))
        environment_terms(0, 1, *where, *sums, out, irradiance)
        made.append((out, irradiance))
    (out, irradiance), (unit_out, _) = made
    assert np.isfinite(out).all()
    assert (out >= 0).all()
    assert (irradiance <= 1.05 * np.pi * level).all()
    np.testing.assert_allclose(out, unit_out * level, rtol=1e-3, atol=1e-30)


@given(MODELS, NORMALS, TILTS, TILTS, st.floats(-4, 12), st.tuples(PLACES, PLACES, PLACES))
@QUICK
def test_lamp_sums(host, model, normal, tilt, towards_tilt, power, place):
    n, position, weight = unit(normal), np.array([place], np.float32), np.float32(10.0**power)
    eye = (position[0] + grazing(n, tilt)).astype(np.float32)
    towards = grazing(n, towards_tilt)[None, None]
    out, irradiance = np.zeros((1, TERMS, 3), np.float32), np.zeros((1, 3), np.float32)
    where = (
        np.zeros(1, np.int64),
        position,
        n[None],
        arbitrary_tangents(n[None]),
        np.zeros(1, np.int32),
        eye,
    )
    light = (towards, np.full((1, 1), weight), np.ones((1, 3), np.float32), np.ones((1, 1), np.bool_))
    lamp_terms(0, 1, *where, *light, *tables(host, model), out, irradiance)
    assert np.isfinite(out).all()
    assert (out >= 0).all()
    assert (irradiance <= 1.0001 * weight).all()
    if towards_tilt < -1e-6:
        assert not out.any()


COORDINATES = st.one_of(
    st.sampled_from([0.0, 1.0, 1e-30, -1e-30, 1e4, 3e38, -3e38]), st.floats(-1e5, 1e5, width=32)
)
TRIANGLES = st.lists(st.tuples(COORDINATES, COORDINATES, COORDINATES), min_size=3, max_size=3)
KINDS = st.sampled_from([CONSTANT, AFFINE, GENERAL])
UVS = st.lists(st.tuples(COORDINATES, COORDINATES), min_size=3, max_size=3)
PIXELS = np.random.default_rng(0).random((9, 9)).astype(np.float32)


@given(TRIANGLES, UVS, RADIANCE, st.floats(0, 1e30), st.sampled_from([0.0, 1e-6, 1.0, 1e30]), KINDS)
@QUICK
def test_samples_of_any_triangle(corners, uvs, level, distance, density, kind):
    faces, place = np.array([[0, 1, 2]], np.uint32), np.array(corners, np.float32)
    material, kinds = np.zeros(1, np.int32), np.array([kind])
    shown, height, texels = np.empty((1, 3), np.uint32), np.empty(1, np.float32), np.empty(1, np.float32)
    shown_sides(0, 1, place, faces, faces, np.array([1.0, 2.0, 3.0]), shown, height)
    first, size = np.array([[0, 4, 0, 0]]), np.array([[[2, 2], [1, 1], [0, 0], [0, 0]]])
    laid = np.array([[1, 0, 0, 0, 1, 0]], np.float32)
    face_texels(0, 1, place, np.array(uvs, np.float32), faces, material, kinds, size, laid, texels)
    assert np.isfinite(texels).all()
    record = np.zeros((3, RECORD), np.float32)
    record[:, :6], record[:, 6:] = level, uvs
    sums, out = np.full((3, 9), level, np.float32), np.full((1, 3), -1, np.float32)
    hit = (np.zeros(1, np.int32), *np.array([[0.2], [0.3]], np.float32), np.array([distance], np.float32))
    for met in (texels, np.array([density], np.float32)):
        given_faces = (shown, height, met, material)
        maps = (kinds, record, sums, PIXELS[:5, :3].copy(), PIXELS[:5], first, size, np.array([2]), laid)
        shade_hits(0, 1, *hit, *given_faces, *maps, 0.01, PIXELS[:0, :3], PIXELS[:0, :3], out)
        assert np.isfinite(out).all()
        assert (out >= 0).all()
        assert (out <= 4.001 * level).all()  # a plain part and three textured ones


PLACE = st.tuples(*[st.floats(-20, 20)] * 3)


@given(RADIANCE, st.floats(0.01, 179.9), st.tuples(*[st.floats(-1, 1)] * 3), st.integers(1, 4), PLACE)
@QUICK
def test_background_of_any_view(level, fov, target, rows, place):
    aim = unit(target) if any(abs(c) > 1e-6 for c in target) else np.array([0, 1, 0], np.float32)
    view = View(looking((0, 0, 0), aim), fov=fov, width=5, height=5, antialias=1)
    pixels = (level * np.random.default_rng(rows).random((rows, 2 * rows, 3))).astype(np.float32)
    out = np.full((25, 3), -1, np.float32)
    nothing = np.full(25, -1, np.int32)
    turn, gain = rotation_matrix(view.transform.rotation).astype(np.float32), np.ones(3, np.float32)
    every, dome = np.zeros(0, np.int64), np.array([*place, 1.6, 6.0, *np.eye(3).ravel()])
    for ground in (FAR_AWAY, dome):
        background_hits(0, 25, pinhole(view), every, nothing, turn, ground, pixels, gain, out)
        assert np.isfinite(out).all()
        assert (out >= 0).all()
        assert (out <= 1.0001 * pixels.max()).all()
