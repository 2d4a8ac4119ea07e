"""The brute-force sums against plain loops."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.radiance import light_sum

from studio_core.kernels.directions import direction_set
from studio_core.kernels.radiance import environment_terms, lamp_terms
from studio_core.params import defaults
from studio_core.scene.tangents import arbitrary_tangents
from studio_core.shading.artifacts import TERMS

MODELS = ("lambert", "phong", "blinn-phong", "ggx")


def _points(rng, count):
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return rng.uniform(-1, 1, (count, 3)).astype(np.float32), normals.astype(np.float32)


def _tables(host):
    brdfs = [host.brdf(name) for name in MODELS]
    shapes = [np.atleast_1d(brdf.shape(defaults(brdf.Params))) for brdf in brdfs]
    offsets = np.concatenate([[0], np.cumsum([len(s) for s in shapes])])[:-1].astype(np.int64)
    address = np.array([brdf.address for brdf in brdfs], np.int64)
    terms = np.array([brdf.terms for brdf in brdfs], np.int64)
    return brdfs, shapes, address, terms, offsets, np.concatenate([*shapes, [0]]).astype(np.float32)


def _words(visible):
    return np.packbits(visible, axis=1, bitorder="little").view(np.uint64)


def test_environment_sum_equals_the_oracle(host):
    rng = np.random.default_rng(3)
    brdfs, shapes, address, terms, offsets, data = _tables(host)
    directions = direction_set(10)
    count = 12
    positions, normals = _points(rng, count)
    material = np.arange(count, dtype=np.int32) % len(brdfs)
    visible = rng.random((count, directions.size)) < 0.6
    light = rng.gamma(0.5, 1.0, (directions.size, 3)).astype(np.float32)
    eye = np.array([0.3, 4.0, 1.0], np.float32)
    out, irradiance = np.zeros((count, TERMS, 3), np.float32), np.zeros((count, 3), np.float32)
    points = np.arange(count, dtype=np.int64)
    arguments = (
        positions,
        normals,
        arbitrary_tangents(normals),
        material,
        eye,
        _words(visible),
        directions.directions,
        light,
    )
    environment_terms(
        0, count, points, *arguments, directions.solid_angle, address, terms, offsets, data, out, irradiance
    )
    for p in range(count):
        m = material[p]
        expected, lit = light_sum(
            brdfs[m],
            shapes[m],
            positions[p],
            normals[p],
            eye,
            visible[p],
            directions.directions,
            light,
            directions.solid_angle,
        )
        np.testing.assert_allclose(out[p, : terms[m]], expected, rtol=2e-4, atol=1e-6)
        np.testing.assert_allclose(irradiance[p], lit, rtol=1e-5)
        assert not out[p, terms[m] :].any()


def test_only_the_wanted_points_are_written(host):
    rng = np.random.default_rng(4)
    _, _, address, terms, offsets, data = _tables(host)
    directions = direction_set(10)
    positions, normals = _points(rng, 5)
    points = np.array([3, 1], np.int64)
    bits = np.full((2, directions.size // 64), np.uint64(0xFFFFFFFFFFFFFFFF))
    light = np.ones((directions.size, 3), np.float32)
    out, irradiance = np.zeros((5, TERMS, 3), np.float32), np.zeros((5, 3), np.float32)
    environment_terms(
        0,
        2,
        points,
        positions,
        normals,
        arbitrary_tangents(normals),
        np.zeros(5, np.int32),
        np.zeros(3, np.float32),
        bits,
        directions.directions,
        light,
        directions.solid_angle,
        address,
        terms,
        offsets,
        data,
        out,
        irradiance,
    )
    assert list(np.flatnonzero(irradiance.any(axis=1))) == [1, 3]
    np.testing.assert_allclose(irradiance[[1, 3]], np.pi, rtol=0.02)


@pytest.mark.parametrize("samples", [1, 7, 256])
@pytest.mark.parametrize("kind", ["white lamp", "coloured lamp", "sun"])
def test_lamp_sum_equals_the_oracle(host, samples, kind):
    rng = np.random.default_rng(samples)
    brdfs, shapes, address, terms, offsets, data = _tables(host)
    count = 8
    positions, normals = _points(rng, count)
    material = np.arange(count, dtype=np.int32) % len(brdfs)
    rows, colours = (1 if kind == "sun" else count), (1 if kind == "white lamp" else samples)
    towards = rng.normal(size=(rows, samples, 3))
    towards = (towards / np.linalg.norm(towards, axis=2, keepdims=True)).astype(np.float32)
    weight = rng.random((rows, samples)).astype(np.float32)
    colour = rng.random((colours, 3)).astype(np.float32)
    seen = rng.random((count, samples)) < 0.7
    eye = np.array([1.0, 2.0, 3.0], np.float32)
    out, irradiance = np.zeros((count, TERMS, 3), np.float32), np.zeros((count, 3), np.float32)
    points = np.arange(count, dtype=np.int64)
    arguments = (
        positions,
        normals,
        arbitrary_tangents(normals),
        material,
        eye,
        towards,
        weight,
        colour,
        seen,
    )
    for start, stop in ((0, 3), (3, count)):
        lamp_terms(start, stop, points, *arguments, address, terms, offsets, data, out, irradiance)
    for p in range(count):
        m, row = material[p], p % rows
        light = weight[row, :, None] * np.broadcast_to(colour, (samples, 3))
        expected, lit = light_sum(
            brdfs[m], shapes[m], positions[p], normals[p], eye, seen[p], towards[row], light, 1.0
        )
        np.testing.assert_allclose(out[p, : terms[m]], expected, rtol=5e-4, atol=1e-6)
        np.testing.assert_allclose(irradiance[p], lit, rtol=1e-5, atol=1e-6)
