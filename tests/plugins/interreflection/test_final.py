"""The final gather: every term over rays of both kinds; lobes are drawn where they are needed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from studio_core.brdfs.calls import density, evaluate, sample
from studio_core.params import defaults
from studio_core.transport.hits import HitTable
from studio_core.transport.lobes import draw_lobes, spread_numbers, used_share
from studio_core.transport.patterns import cosine_pattern, variants_of
from studio_plugins.brdfs.ggx import MODEL as GGX
from studio_plugins.brdfs.lambert import MODEL as LAMBERT
from studio_plugins.brdfs.phong import MODEL as PHONG
from studio_plugins.interreflection.gather.final import add_flat_terms, gather_final

MODELS = {
    "phong 10": (PHONG, {"exponent": 10.0}),
    "phong 200": (PHONG, {"exponent": 200.0}),
    "ggx 0.3": (GGX, {"roughness": 0.3}),
    "ggx 0.8": (GGX, {"roughness": 0.8}),
}
NONE = np.zeros((0, 0, 3), np.float32)


def shape_of(model: Any, values: dict[str, float]) -> np.ndarray:
    return np.atleast_1d(np.asarray(model.shape({**defaults(model.Params), **values}), np.float32))


class Setting:
    """Receivers with frames of all kinds, one BRDF, each receiver with an eye of its own."""

    def __init__(self, name: str, receivers: int, cosine: int, lobes: int, seed: int = 1) -> None:
        rng = np.random.default_rng(seed)
        self.model, values = MODELS[name]
        self.shape = shape_of(self.model, values)
        self.count, self.cosine, self.lobes = receivers, cosine, lobes
        normals = rng.normal(size=(receivers, 3))
        self.normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
        along = np.cross(self.normals, rng.normal(size=(receivers, 3)))
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        self.tangents = np.concatenate([along, np.ones((receivers, 1))], axis=1).astype(np.float32)
        self.frames = (self.normals, self.tangents)
        self.positions = rng.normal(size=(receivers, 3)).astype(np.float32)
        self.row = np.zeros(receivers, np.int32)
        self.rows = np.arange(receivers)
        self.peaked = np.array([[t > 0 for t in range(self.model.terms)]])
        self.pattern = cosine_pattern(cosine, 32, 7)
        self.variant = variants_of(self.rows, 32)
        self.directions = np.zeros((receivers, lobes, 3), np.float32)
        self.wo = rng.normal(size=(receivers, 3))
        self.wo[:, 2] = np.abs(self.wo[:, 2]) + 0.2
        self.wo /= np.linalg.norm(self.wo, axis=1, keepdims=True)
        self._draw()

    def frame(self, i: int) -> np.ndarray:
        up, along = self.normals[i], self.tangents[i, :3]
        return np.stack([along, np.cross(up, along), up])

    def eye(self, i: int) -> np.ndarray:
        return (self.positions[i] + 3 * self.frame(i).T @ self.wo[i]).astype(np.float32)

    def _draw(self) -> None:
        numbers = spread_numbers(32, self.model.terms, self.lobes, 5)
        offset, sampler = np.zeros(1, np.int64), np.array([self.model.sampler])
        for i in range(self.count):
            given = (self.rows, self.variant, self.positions, *self.frames, self.row, self.eye(i))
            draw_lobes(i, i + 1, *given, offset, self.shape, sampler, self.peaked, numbers, self.directions)

    def gather(
        self, radiance: np.ndarray, of_cosine: HitTable, of_lobes: HitTable, along: Any = (None, None)
    ) -> tuple[Any, Any]:
        """Terms and irradiance, where each vertex of `radiance` (V, 3) is matte.

        Arrays `along` (R, N) get the light along rays of each kind.
        """
        terms = np.zeros((self.count, self.model.terms, 3), np.float32)
        irradiance = np.zeros((self.count, 3), np.float32)
        none, zero = np.zeros(0, np.float32), np.zeros(1, np.int64)
        brdf = (np.array([self.model.address]), np.array([self.model.terms]), zero, self.shape)
        lobes = (np.array([self.model.density]), self.peaked, np.zeros((1, self.model.terms), np.float32))
        sources = (radiance, np.full(len(radiance), -1), zero, zero, none, none)
        untold = np.zeros((0, 0), np.float32)
        for hits, pattern, world, told in (
            (of_cosine, self.pattern.directions, NONE, along[0]),
            (of_lobes, NONE, self.directions, along[1]),
        ):
            rays = (self.rows, self.rows, self.variant, hits.vertex, hits.cell, pattern, world)
            for i in range(self.count):
                places = (self.positions, *self.frames, *self.frames, self.row, self.eye(i))
                own = untold if told is None else told[i : i + 1]
                out = (*brdf, *lobes, *sources, terms, irradiance, own)
                gather_final(i, i + 1, float(self.cosine), self.lobes, *rays, *places, *out)
        return terms, irradiance


def hits(vertex: np.ndarray) -> HitTable:
    cell, distance = np.zeros(vertex.shape, np.uint16), np.ones(vertex.shape, np.float16)
    return HitTable(vertex.astype(np.uint32), cell, distance)


def albedo(model: Any, shape: np.ndarray, wo: np.ndarray) -> np.ndarray:
    """(terms,) ∫ b cosθ by many directions, half of them by the second term's own sampler."""
    rng, count = np.random.default_rng(3), 100_000
    u = rng.random((count, 2))
    r, phi = np.sqrt(u[:, 0]), 2 * np.pi * u[:, 1]
    a = np.stack([r * np.cos(phi), r * np.sin(phi), np.sqrt(1 - u[:, 0])], axis=1)
    b = sample(model, shape, wo, 1, rng.random((count, 2)))
    made = np.zeros(model.terms)
    for wi in (a, b[b[:, 2] > 0]):
        p = 0.5 * (wi[:, 2] / np.pi + density(model, shape, wo, wi)[:, 1])
        made += (evaluate(model, shape, wo, wi) * (wi[:, 2:] / p[:, None])).sum(axis=0) / (2 * count)
    return made


@pytest.mark.parametrize("name", MODELS)
def test_under_even_light_every_term_is_its_albedo(name: str) -> None:
    setting = Setting(name, 40, 256, 256)
    light = np.array([[1.0, 0.5, 0.25]], np.float32)
    met = (setting.directions != 0).any(axis=2)
    terms, irradiance = setting.gather(light, hits(np.zeros((40, 256))), hits(np.where(met, 0, 0xFFFFFFFF)))
    np.testing.assert_allclose(irradiance, np.pi * np.tile(light, (40, 1)), rtol=0.12)
    expected = np.array([albedo(setting.model, setting.shape, wo) for wo in setting.wo])
    made = terms[:, :, 0]
    scale = np.maximum(expected.mean(axis=0), 1e-3)
    assert np.abs((made.mean(axis=0) - expected.mean(axis=0)) / scale).max() < 0.02
    assert (np.sqrt(((made - expected) ** 2).mean(axis=0)) / scale).max() < 0.1
    np.testing.assert_allclose(terms[:, :, 1], 0.5 * made, rtol=1e-4)


def test_sums_over_rays_are_weighed_by_all_densities() -> None:
    """Against the same sums ray by ray, with light of its own along every ray."""
    setting = Setting("ggx 0.3", 12, 16, 13)
    rng = np.random.default_rng(9)
    radiance = rng.random((50, 3)).astype(np.float32)
    of_cosine, of_lobes = rng.integers(0, 50, (12, 16)), rng.integers(0, 50, (12, 13))
    of_cosine[0, 3], of_cosine[1, 2] = 0xFFFFFFFF, 0xFFFFFFFE
    terms, irradiance = setting.gather(radiance, hits(of_cosine), hits(of_lobes))
    peaked = int(setting.peaked.sum())
    shares = np.array([(13 - t + peaked - 1) // peaked for t in range(peaked)])
    assert shares.sum() == 13
    for i in range(12):
        local = [setting.pattern.directions[setting.variant[i]], setting.directions[i] @ setting.frame(i).T]
        wi, vertex = np.concatenate(local), np.concatenate([of_cosine[i], of_lobes[i]])
        there = (vertex < 50) & (wi[:, 2] > 0)
        wi, light = wi[there], radiance[vertex[there]].astype(np.float64)
        own = density(setting.model, setting.shape, setting.wo[i], wi)[:, setting.peaked[0]]
        p = 16 * wi[:, 2] / np.pi + own @ shares
        weight = light * (wi[:, 2] / p)[:, None]
        b = evaluate(setting.model, setting.shape, setting.wo[i], wi)
        np.testing.assert_allclose(irradiance[i], weight.sum(axis=0), rtol=2e-3)
        np.testing.assert_allclose(terms[i], b.T @ weight, rtol=5e-3, atol=1e-4)


def test_light_along_every_ray_is_told() -> None:
    setting = Setting("phong 10", 12, 16, 13)
    rng = np.random.default_rng(4)
    radiance = rng.random((50, 3)).astype(np.float32)
    met = [rng.integers(0, 50, (12, count)) for count in (16, 13)]
    met[0][0, 3], met[1][1, 2] = 0xFFFFFFFF, 0xFFFFFFFE
    along = [np.full(one.shape, np.nan, np.float32) for one in met]
    alone = setting.gather(radiance, *map(hits, met))
    told = setting.gather(radiance, *map(hits, met), along)
    for made, expected in zip(told, alone, strict=True):
        np.testing.assert_array_equal(made, expected)
    for one, vertex, directions in zip(
        along, met, (setting.pattern.directions, setting.directions), strict=True
    ):
        own = directions[setting.variant] if directions is not setting.directions else directions
        up = own[..., 2] if own is not directions else np.einsum("inc,ic->in", own, setting.normals)
        there = (vertex < 50) & (up > 1e-6)
        expected = np.where(there, radiance.sum(axis=1)[np.minimum(vertex, 49)], 0)
        np.testing.assert_allclose(one, expected, rtol=1e-5)


def test_matte_terms_need_no_lobes_and_peaks_do() -> None:
    assert used_share(LAMBERT.address, 1, shape_of(LAMBERT, {}))[0] == pytest.approx(1, abs=1e-3)
    sharp = used_share(PHONG.address, 2, shape_of(PHONG, {"exponent": 10.0}))
    assert sharp[0] == pytest.approx(1, abs=1e-3)
    assert sharp[1] < 0.4
    assert used_share(PHONG.address, 2, shape_of(PHONG, {"exponent": 1000.0}))[1] < 0.02


def test_flat_terms_are_irradiance_times_their_value() -> None:
    terms = np.zeros((4, 2, 3), np.float32)
    irradiance = np.arange(12, dtype=np.float32).reshape(4, 3)
    row, flat = np.array([0, -1, 0, 0], np.int32), np.array([[0.5, 0]], np.float32)
    add_flat_terms(0, 3, np.array([0, 1, 3]), row, flat, irradiance, terms)
    expected = np.zeros_like(terms)
    expected[[0, 3], 0] = 0.5 * irradiance[[0, 3]]
    np.testing.assert_array_equal(terms, expected)
