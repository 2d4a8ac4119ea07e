"""Suns: taken out of a map without loss, and sampled where they are."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import light_tree as oracle

from studio_core.imaging.environment import load_environment
from studio_core.kernels.environment import integrate_environment, map_power
from studio_core.kernels.suns import ACROSS, SAMPLES, Sun, split_suns
from studio_core.parallel import Workers
from studio_core.shading.materials import linear_rgb

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]


def directions(height: int) -> F64:
    """(H, 2H, 3) towards the pixels of a map."""
    v, u = np.meshgrid(
        (np.arange(height) + 0.5) / height, (np.arange(2 * height) + 0.5) / (2 * height), indexing="ij"
    )
    theta, phi = np.pi * v, 2 * np.pi * (0.5 - u)
    return np.stack([np.sin(theta) * np.sin(phi), np.cos(theta), np.sin(theta) * np.cos(phi)], axis=2)


def disc(height: int, towards: F64, across: float, level: float, seed: int = 0) -> F32:
    """A noisy sky with a coloured disc, at least one pixel of it, that falls off towards its rim."""
    pixels = np.random.default_rng(seed).uniform(0.5, 1.5, (height, 2 * height, 3))
    near = directions(height) @ (towards / np.linalg.norm(towards))
    inside = np.arccos(np.clip(near, -1, 1)) <= across / 2
    inside.flat[near.argmax()] = True
    pixels[inside] += level * np.array([1.0, 0.8, 0.3]) * (0.5 + 0.5 * near[inside, None])
    return pixels.astype(np.float32)


def light_of(sun: Sun | None) -> F64:
    return sun.irradiance.sum(axis=0, dtype=np.float64) if sun is not None else np.zeros(3)


TOWARDS = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1).map(np.array)
SEAM = st.tuples(st.floats(-0.05, 0.05), st.floats(-1, 1)).map(lambda t: np.array([t[0], t[1], -1.0]))
POLES = st.tuples(st.floats(-0.05, 0.05), st.sampled_from([-1.0, 1.0]), st.floats(-0.05, 0.05)).map(np.array)


@settings(max_examples=40, deadline=None)
@given(
    height=st.integers(24, 200),
    towards=st.one_of(TOWARDS, SEAM, POLES),
    across=st.floats(0, 0.4),
    power=st.floats(0, 7),
    seed=st.integers(0, 5),
)
def test_taken_out_and_put_back_is_the_map(
    height: int, towards: F64, across: float, power: float, seed: int
) -> None:
    pixels = disc(height, towards, across, 10.0**power, seed)
    before = pixels.copy()
    rest, sun = split_suns(pixels)
    np.testing.assert_array_equal(pixels, before)
    assert (rest >= 0).all()
    assert (rest <= pixels).all()
    if sun is None:
        assert rest is pixels
        return
    assert len(sun.directions) <= SAMPLES
    taken = (pixels - rest).astype(np.float32)
    np.testing.assert_allclose(rest + taken, pixels, rtol=1e-6)
    np.testing.assert_allclose(light_of(sun), map_power(taken), rtol=1e-5)
    np.testing.assert_allclose(map_power(rest) + light_of(sun), map_power(pixels), rtol=1e-6)
    assert (sun.irradiance >= 0).all()
    np.testing.assert_allclose(np.linalg.norm(sun.directions, axis=1), 1, atol=1e-12)
    lit = directions(height)[taken.any(axis=2)]
    assert (sun.directions @ lit.T).max(axis=1).min() > math.cos(1.5 * math.pi / height)


@settings(max_examples=12, deadline=None)
@given(
    towards=st.one_of(TOWARDS, SEAM, POLES),
    across=st.floats(0, 0.08),
    power=st.floats(2, 7),
    seed=st.integers(0, 5),
)
def test_without_suns_no_leaf_holds_much(
    towards: F64, across: float, power: float, seed: int, workers: Workers
) -> None:
    pixels = disc(96, towards, across, 10.0**power, seed)
    rest, sun = split_suns(pixels)
    leaves = integrate_environment(rest, np.eye(3), 15, workers).astype(np.float64).sum(axis=1)
    total = map_power(pixels).sum()
    assert leaves.max() * 4 * math.pi / (1 << 15) < 0.01 * total
    if power > 4:
        assert sun is not None


@pytest.mark.parametrize("towards", [(0.3, 0.5, 0.8), (0.01, 0.1, -1), (0.02, 1, 0), (0, -1, 0.05)], ids=str)
@pytest.mark.parametrize("across", [0.0, 0.09])
def test_samples_light_as_the_map_does(towards: tuple[float, float, float], across: float) -> None:
    pixels = disc(90 if across else 40, np.array(towards), across, 1e4)
    rest, sun = split_suns(pixels)
    assert sun is not None
    assert len(sun.parts) == 2
    taken = (pixels - rest).astype(np.float64)
    expected = oracle.vector(taken)
    found = np.einsum("qc,qa->ca", sun.irradiance.astype(np.float64), sun.directions)
    np.testing.assert_allclose(found, expected, atol=3e-3 * np.abs(expected).max())


def test_turning_the_map_turns_its_sun() -> None:
    pixels = disc(64, np.array([0.0, 0.3, 1.0]), 0.1, 1e4)
    _, still = split_suns(pixels)
    assert still is not None
    for columns in (16, 64, 101):
        _, sun = split_suns(np.roll(pixels, columns, axis=1))
        assert sun is not None
        angle = -2 * math.pi * columns / 128
        c, s = math.cos(angle), math.sin(angle)
        turned = still.turned(np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]))
        for one in (sun, turned):
            assert list(one.parts) == list(still.parts)
        np.testing.assert_allclose(
            sun.irradiance.T.astype(np.float64) @ sun.directions,
            turned.irradiance.T.astype(np.float64) @ turned.directions,
            atol=1e-3 * float(still.irradiance.sum()),
        )


@pytest.mark.parametrize("angle", [0.0, 0.7, 2.0])
def test_an_edge_across_a_sun_covers_the_right_part(angle: float) -> None:
    """Shadow rays give penumbrae in fine steps: samples on one side of an edge hold that side's light."""
    height = 720
    middle = np.array([0.3, 0.4, 0.8]) / np.linalg.norm([0.3, 0.4, 0.8])
    pixels = disc(height, middle, 0.05, 1e4)
    rest, sun = split_suns(pixels)
    assert sun is not None
    taken = (pixels - rest).astype(np.float64).sum(axis=2)
    taken *= np.sin(np.pi * (np.arange(height) + 0.5) / height)[:, None]
    right = np.cross(middle, [0, 1, 0])
    edge = math.cos(angle) * right / np.linalg.norm(right)
    edge = edge + math.sin(angle) * np.cross(middle, edge / math.cos(angle))
    weight = sun.irradiance.astype(np.float64).sum(axis=1)
    for shift in np.linspace(-0.02, 0.02, 9):
        exact = taken[directions(height) @ edge > shift].sum() / taken.sum()
        found = weight[sun.directions @ edge > shift].sum() / weight.sum()
        assert abs(exact - found) < 0.6 / math.sqrt(len(weight))


@pytest.mark.parametrize("samples", [1, 7, 40, 1000])
def test_fewer_samples_hold_the_same_light(samples: int) -> None:
    pixels = disc(64, np.array([0.3, 0.5, 0.8]), 0.1, 1e3)
    pixels[50, 3] = 2e3
    _, sun = split_suns(pixels)
    assert sun is not None
    assert len(sun.parts) == 3
    fewer = sun.coarsened(samples)
    assert len(fewer.directions) <= max(samples + 1, 2)
    assert len(fewer.parts) == 3
    assert fewer.parts[-1] == len(fewer.directions)
    for i in range(2):
        whole, part = slice(*sun.parts[i : i + 2]), slice(*fewer.parts[i : i + 2])
        light = sun.irradiance[whole].astype(np.float64)
        np.testing.assert_allclose(fewer.irradiance[part].sum(axis=0), light.sum(axis=0), rtol=1e-5)
        found = fewer.irradiance[part].astype(np.float64).T @ fewer.directions[part]
        np.testing.assert_allclose(found, light.T @ sun.directions[whole], atol=2e-3 * light.sum())


def test_the_strongest_source_comes_first() -> None:
    pixels = disc(64, np.array([0.3, 0.5, 0.8]), 0.0, 3e4)
    pixels[50, 3] = 1e5
    _, sun = split_suns(pixels)
    assert sun is not None
    first, second = (sun.irradiance[a:b].sum() for a, b in zip(sun.parts[:-1], sun.parts[1:], strict=True))
    assert first > second
    assert len(sun.irradiance) <= SAMPLES


def test_windows_and_skies_are_no_suns() -> None:
    wide = disc(128, np.array([0.2, 0.3, 1.0]), 1.3 * ACROSS, 1e4)
    for pixels in (wide, np.ones((32, 64, 3), np.float32), np.zeros((32, 64, 3), np.float32)):
        rest, sun = split_suns(pixels)
        assert sun is None
        assert rest is pixels


def test_many_sparks_stay_within_the_samples() -> None:
    rng = np.random.default_rng(0)
    pixels = np.full((128, 256, 3), 0.01, np.float32)
    pixels[rng.integers(4, 120, 40), rng.integers(0, 256, 40)] = 1e4
    rest, sun = split_suns(pixels)
    assert sun is not None
    assert len(sun.directions) <= SAMPLES
    np.testing.assert_allclose(map_power(rest) + light_of(sun), map_power(pixels), rtol=1e-6)


@pytest.mark.parametrize(
    ("name", "share"),
    [
        ("cc0/hdri_polyhaven_cc0/courtyard.exr", 0.0),
        ("cc0/hdri_polyhaven_cc0/interior.exr", 0.31),
        ("cc0/hdri_polyhaven_cc0/studio.exr", 0.70),
        ("cc0/hdri_polyhaven_cc0/sunset.exr", 0.025),
        ("third_party/openexr_env/KernerEnvLatLong.exr", 0.19),
    ],
)
def test_real_maps(shared_data: Path, name: str, share: float, workers: Workers) -> None:
    pixels = linear_rgb(load_environment(shared_data / name)[0])
    rest, sun = split_suns(pixels)
    assert light_of(sun).sum() / map_power(pixels).sum() == pytest.approx(share, rel=0.03)
    leaves = integrate_environment(rest, np.eye(3), 15, workers).astype(np.float64).sum(axis=1)
    assert leaves.max() * 4 * math.pi / (1 << 15) < 0.01 * map_power(pixels).sum()
