"""Columns and the light behind them, against plain sums."""

from __future__ import annotations

import numpy as np
import pytest

from studio_core.brdfs.calls import evaluate_at
from studio_core.kernels.directions import direction_set
from studio_core.transport.patterns import grid_pattern
from studio_plugins.slf.columns import FAR, FINE, MIDDLE, sums_at
from studio_plugins.slf.incident import Arriving, arriving, averaged, sky_means
from studio_plugins.slf.ladder import alpha_of_level
from studio_plugins.slf.places import Places

CELLS = grid_pattern(32).directions[0]
PARTS = {side: grid_pattern(32 * side).directions[0].reshape(1024, -1, 3) for side in (2, 4)}
SOLID = 2 * np.pi / 1024
COUNT, ROWS, LAMPS = 5, 3, 4


def frames(rng, count):
    """(N, 3, 3) rows t, b, n."""
    made = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    made[:, 1] *= np.sign(np.linalg.det(made))[:, None]
    return made


def some_light(rng, sky):
    towards = rng.normal(size=(COUNT, LAMPS, 3))
    towards /= np.linalg.norm(towards, axis=2, keepdims=True)
    axes = frames(rng, ROWS)
    return Arriving(
        rng.integers(0, ROWS, COUNT),
        rng.uniform(0, 1, (ROWS, 1024, 3)).astype(np.float32),
        rng.uniform(size=(ROWS, 1024)) < (0.5 if len(sky) else 0.0),
        axes.astype(np.float32),
        towards.astype(np.float32),
        rng.uniform(0, 2, (COUNT, LAMPS, 3)).astype(np.float32),
        sky,
        0,
    )


def some_places(rng, light):
    """Near to the rows' frames, as marks are to their vertices'."""
    axes = light.axes[light.row].astype(np.float64)
    tilt = axes + 0.1 * rng.normal(size=axes.shape)
    normal = tilt[:, 2] / np.linalg.norm(tilt[:, 2], axis=1, keepdims=True)
    along = tilt[:, 0] - (tilt[:, 0] * normal).sum(axis=1, keepdims=True) * normal
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    made = np.stack([along, np.cross(normal, along), normal], axis=1)
    wo = rng.normal(size=(COUNT, 3))
    wo[:, 2] = np.abs(wo[:, 2]) + 0.2
    wo /= np.linalg.norm(wo, axis=1, keepdims=True)
    none = np.zeros(COUNT, np.int64)
    return Places(np.zeros((COUNT, 3)), made, wo, none, none, none, np.arange(COUNT))


def plainly(address, terms, shape, light, places, n, sharp):
    row = light.row[n]
    local = CELLS @ light.axes[row] @ places.axes[n].T
    cosine = local @ (places.wo[n] * [-1, -1, 1])
    directions, weights = [], []
    skies = {2: averaged(light.sky, 13), 4: averaged(light.sky, 15)} if len(light.sky) else {}
    for cell in range(1024):
        block = slice(cell // 4 * 4, cell // 4 * 4 + 4)
        if sharp and cosine[cell] > np.cos(MIDDLE):
            side = 4 if cosine[cell] > np.cos(FINE) else 2
            for part in PARTS[side][cell] @ light.axes[row]:
                seen = light.light[row, cell]
                if light.open[row, cell] and skies:
                    k = len(skies[side]).bit_length() - 1
                    seen = skies[side][direction_set(k).leaf_of(part)[0]]
                towards = places.axes[n] @ part
                directions.append(towards)
                weights.append(seen * max(towards[2], 0) * SOLID / side**2)
        elif cosine[block].max() < np.cos(FAR):
            if cell % 4 == 0:
                parts = light.light[row, block] * np.maximum(local[block, 2:], 0) * SOLID
                middle = parts.sum(axis=1) @ local[block]
                directions.append(middle / max(np.linalg.norm(middle), 1e-30))
                weights.append(parts.sum(axis=0))
        else:
            directions.append(local[cell])
            weights.append(light.light[row, cell] * max(local[cell, 2], 0) * SOLID)
    for c in range(LAMPS):
        directions.append(places.axes[n] @ light.towards[n, c])
        weights.append(light.strength[n, c] * max(directions[-1][2], 0))
    made = evaluate_at(address, terms, shape, places.wo[n], np.array(directions))
    return np.einsum("it,ic->tc", made, np.array(weights))


@pytest.mark.parametrize("open_", [False, True])
def test_columns_are_sums_over_cells_and_lamps(host, workers, open_):
    rng = np.random.default_rng(2)
    sky = rng.uniform(0, 3, (1 << 14 if open_ else 0, 3)).astype(np.float32)
    light = some_light(rng, sky)
    places = some_places(rng, light)
    model = host.brdf("specgloss")
    values = {"diffuse": (0.5, 0.5, 0.5), "specular": (0.2, 0.2, 0.2), "keep_energy": True}
    levels = np.arange(20)
    shapes = np.stack([model.shape({**values, "roughness": alpha_of_level(i) ** 0.5}) for i in levels])
    made = sums_at(model.address, model.terms, shapes, light, places, workers)
    for level in (0, 9, 15, 19):
        for n in range(COUNT):
            sharp = alpha_of_level(level) < 0.32
            true = plainly(model.address, model.terms, shapes[level], light, places, n, sharp)
            np.testing.assert_allclose(made[level, n], true, rtol=2e-3, atol=2e-4)


def test_a_cell_has_the_mean_of_the_sky_about_it():
    rng = np.random.default_rng(0)
    axes = frames(rng, 2).astype(np.float32)
    even = np.full((1 << 13, 3), 0.7, np.float32)
    open_ = rng.uniform(size=(2, 1024)) < 0.5
    out = np.zeros((2, 1024, 3), np.float32)
    offsets = np.array([[0.25, 0.25], [0.25, 0.75], [0.75, 0.25], [0.75, 0.75]], np.float32)
    sky_means(axes, CELLS, offsets, even, open_, out, 0, 2)
    np.testing.assert_allclose(out[open_], 0.7, rtol=1e-6)
    assert (out[~open_] == 0).all()
    slope = direction_set(13).directions[:, 1:2] + np.ones(3, np.float32)
    sky_means(axes, CELLS, offsets, slope.astype(np.float32), open_, out, 0, 2)
    world = np.einsum("ni,rij->rnj", CELLS, axes)
    np.testing.assert_allclose(out[open_], (1 + world[open_][:, 1:2]) * np.ones(3), atol=0.03)


def test_lamps_arrive_by_distance_and_angle_where_they_are_seen():
    place = np.array([[0.0, 2.0, 0.0, 1.0], [0.0, 1.0, 0.0, 0.0]])
    kind = np.array([1, 0], np.int8)
    positions = np.array([[0, 0, 0], [1, 0, 0]], np.float32)
    seen = np.array([[0b11], [0b10]], np.uint64)
    towards, strength = np.zeros((2, 2, 2, 3), np.float32)
    colour = np.array([[4.0, 2.0, 1.0], [0.5, 0.5, 0.5]], np.float32)
    arriving(positions, kind, place, np.zeros((2, 5)), colour, seen, towards, strength)
    np.testing.assert_allclose(strength[0], [[1.0, 0.5, 0.25], [0.5, 0.5, 0.5]], rtol=1e-6)
    np.testing.assert_allclose(strength[1, 0], 0)
    np.testing.assert_allclose(towards[0], [[0, 1, 0], [0, 1, 0]])
