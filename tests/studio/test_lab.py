"""The lab itself: its pictures show what its truth says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from studio.bench.lab import Rig, dome, row, scattered, shoot, truth_map
from studio.bench.lab_surfaces import Gloss, Surface, Waves, library, spread_light
from studio_plugins.residual.reflectance_map import reflectance_maps
from studio_plugins.residual.samples import Ball, Lights

RIG = Rig(size=(104, 100), ball=Ball(52.3, 49.6, 46.0))


@pytest.mark.parametrize("name", sorted(library()))
def test_pictures_show_the_truth(name: str) -> None:
    surface, lights = library()[name], row().some([1, 9])
    shots = shoot(surface, lights, replace(RIG, white=1e3))
    samples = reflectance_maps(shots.pictures, shots.clipped, RIG.ball, shots.told, 24)
    truth, lit = truth_map(surface, samples.normals, samples.views, lights)
    assert np.isfinite(truth).all()
    assert lit.any()
    off = np.median(np.abs(samples.values - truth)) / np.median(truth[lit])
    assert off < 0.02


def test_a_matte_ball_is_lamberts() -> None:
    n = Ball(0, 0, 1).normals(np.array([[0.1, -0.4]]), np.array([[0.3, 0.5]]))[0].astype(np.float32)
    light = Lights(np.array([[0.6, 0.0, 0.8]]), np.array([[2.0, 1.0, 0.5]]), ("one",))
    value, _ = truth_map(Surface((0.5, 0.4, 0.2)), n, np.broadcast_to(np.float32([0, 0, 1]), n.shape), light)
    wanted = np.maximum(n @ [0.6, 0, 0.8], 0)[..., None] * [1.0, 0.4, 0.1]
    assert np.allclose(value[0], wanted, atol=1e-6)


@pytest.mark.parametrize("kind", [Gloss("blinn", 30.0, (1.0,) * 3), Gloss("ggx", 0.4, (1.0,) * 3)])
def test_a_highlight_never_sends_back_more_than_it_got(kind: Gloss) -> None:
    lights = scattered(4000, 1, 89.9).directions.astype(np.float32)
    area = 2 * np.pi * (np.cos(np.radians(6.0)) - np.cos(np.radians(89.9))) / len(lights)
    n = np.broadcast_to(np.float32([0, 0, 1]), lights.shape)
    albedo = kind.value(n, n, lights)[:, 0].sum() / np.pi * area
    assert 0.5 < albedo <= 1.01


def test_bumps_tilt_normals_by_their_slope_and_throw_shadows() -> None:
    bumps = Waves.random(2, 0.3)
    surface = Surface((0.5,) * 3, bumps=bumps, height=0.01)
    rng = np.random.default_rng(0)
    n = rng.normal(size=(200, 3))
    n = (n / np.linalg.norm(n, axis=1, keepdims=True)).astype(np.float32)
    tilted = surface.tilted(n, n)
    side = np.cross(n, rng.normal(size=(200, 3))).astype(np.float32)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    step = 3e-3
    rise = 0.01 * (bumps.at(n + step * side) - bumps.at(n - step * side)) / (2 * step)
    assert np.allclose((tilted * side).sum(axis=1) / (tilted * n).sum(axis=1), -rise, atol=3e-3)
    wi = n * rng.uniform(0.02, 0.25, (200, 1)) + side
    wi = (wi / np.linalg.norm(wi, axis=1, keepdims=True)).astype(np.float32)
    free = np.ones(200, np.bool_)
    start = n * (1 + 0.01 * bumps.at(n))[:, None]
    for t in np.linspace(0.01, 0.7, 300):
        x = start + wi * np.float32(t)
        far = np.linalg.norm(x, axis=1)
        free &= 0.01 * bumps.at(x / far[:, None]) < far - 1 + 2e-4
    assert (~free).sum() > 10
    assert np.mean(surface.lit(n, n, wi) == free) > 0.95


def test_light_that_spreads_keeps_its_sum_and_passes_the_terminator() -> None:
    z = np.linspace(-1, 1, 2001, dtype=np.float32)
    wi = np.stack([np.sqrt(1 - z**2), 0 * z, z], axis=1)
    n = np.broadcast_to(np.float32([0, 0, 1]), wi.shape)
    made = spread_light(0.35)(n, n, wi)
    assert made.mean() == pytest.approx(0.25, abs=2e-3)  # mean of max(0, z)
    assert made[900] > 0.01
    assert (np.diff(made) >= -1e-5).all()


def test_every_fault_is_off_until_it_is_asked_for() -> None:
    told = dome((0.0, 30.0))
    shots = shoot(library()["matte"], told.some([0]), RIG, 1)
    assert np.array_equal(shots.were.directions, told.some([0]).directions)
    assert not shots.clipped.any()
    wrong = shoot(
        library()["matte"],
        told,
        replace(RIG, samples=1, direction_error=0.6, strength_error=0.03, drift=1.0),
        1,
    )
    off = np.degrees(np.arccos(np.clip((wrong.were.directions * told.directions).sum(axis=1), -1, 1)))
    assert 0.3 < off.mean() < 1.2
    assert 0.01 < np.std(np.log(wrong.were.strengths[:, 0])) < 0.06


def test_exposures_and_bits_are_what_a_camera_gives() -> None:
    surface = Surface((0.6,) * 3, gloss=(Gloss("blinn", 60.0, (0.3,) * 3),))
    lights = row().some([6])
    exact = shoot(surface, lights, replace(RIG, white=1e3)).pictures[0]
    one = shoot(surface, lights, replace(RIG, white=1.0, bits=8, full_well=4000, read_noise=8), 1)
    three = shoot(
        surface, lights, replace(RIG, white=1.0, bits=8, full_well=4000, read_noise=8, evs=(0, -3, 3)), 1
    )
    assert one.clipped.sum() > 50
    assert three.clipped.sum() < 0.2 * one.clipped.sum()
    dark = (exact > 0.005).all(axis=-1) & (exact < 0.05).all(axis=-1)
    errors = [np.std(shots.pictures[0][dark] - exact[dark]) for shots in (one, three)]
    assert 0 < errors[1] < 0.5 * errors[0]


def test_a_flat_sample_fills_the_picture() -> None:
    shots = shoot(library()["bumpy"], row().some([2, 7]), replace(RIG, size=(40, 30), flat=True, samples=1))
    assert (shots.pictures[0] > 0).mean() > 0.8
    assert shots.pictures.std() > 0.01
