"""Painted cells in the paper's least squares, against columns that are made and rows that are stacked."""

from __future__ import annotations

import math

import numpy as np
import pytest

from studio_core.transport.cells import CELLS, PARTS, RINGS, cell_directions
from studio_plugins.slf.ladder import LEVELS
from studio_plugins.slf.lobes import cell_weights, spectra
from studio_plugins.slf.moments import moments
from studio_plugins.slf.painted_rows import Columns, Rows, with_rows
from studio_plugins.slf.series import half_level, light_of, sent_of, series_of

W = np.repeat(cell_weights(), PARTS)
COUNT = 3


def made_columns(light):
    """(COUNT, 3) matte light, and (COUNT, 3, LEVELS, CELLS) of the lobes, cell by cell in float64."""
    series = np.fft.rfft(light.astype(np.float64), axis=-1) * cell_weights()[:, None]
    sent = np.einsum("lmij,ncjm->nclim", spectra(), series)
    shiny = np.fft.irfft(sent, PARTS, axis=-1).reshape(*light.shape[:2], LEVELS, CELLS)
    return (light.reshape(*light.shape[:2], CELLS) * W).sum(axis=2) / math.pi, shiny


@pytest.fixture(scope="module")
def light():
    return (np.random.default_rng(0).uniform(0, 1, (COUNT, 3, RINGS, PARTS)) ** 4).astype(np.float32)


@pytest.fixture(scope="module")
def rows():
    rng = np.random.default_rng(1)
    cells = np.array([0, 63, 32, 500, 1023, 700])  # also where the turn begins and ends
    return Rows(np.array([0, 0, 1, 1, 2, 2]), cells, 0.05 * rng.normal(size=(6, 3)), rng.uniform(0.2, 1, 6))


def test_columns_are_those_of_the_whole_operator(light, rows):
    made = Columns.of(series_of(light), rows)
    matte, shiny = made_columns(light)
    np.testing.assert_allclose(made.matte, matte[rows.element], rtol=1e-5)
    true = shiny[rows.element, :, :, rows.cell]
    np.testing.assert_allclose(made.shiny, true, atol=2e-6 * np.abs(true).max())


def test_moments_are_those_of_stacked_rows(light, rows):
    """W = I + σ_m diag(m): every direction as it is, painted ones as wanted and heavier."""
    series, strength = series_of(light), 700.0
    now = np.random.default_rng(2).uniform(0.1, 0.4, (COUNT, 3, 2))
    level = np.array([3, 9, 15])
    target = sent_of(series, now[..., 0], now[..., 1], half_level(level))
    columns = Columns.of(series, rows)
    sent = columns.sent(now[rows.element], level[rows.element])
    made = with_rows(moments(series, target, now, level), columns, rows, sent, strength)
    matte, shiny = made_columns(light)
    b = light_of(target).reshape(COUNT, 3, CELLS).astype(np.float64)
    weight = np.broadcast_to(W, b.shape).copy()
    b[rows.element, :, rows.cell] += rows.change
    weight[rows.element, :, rows.cell] *= 1 + strength * rows.weight[:, None]
    d = matte[..., None] * np.ones(CELLS)
    sums = {
        "c11": (weight * d * d).sum(axis=2),
        "d1": (weight * d * b).sum(axis=2),
        "bb": (weight * b * b).sum(axis=2),
        "c12": np.einsum("nck,nck,nclk->ncl", weight, d, shiny),
        "c22": np.einsum("nck,nclk->ncl", weight, shiny**2),
        "d2": np.einsum("nck,nck,nclk->ncl", weight, b, shiny),
    }
    for name, true in sums.items():
        np.testing.assert_allclose(getattr(made, name), true.reshape(COUNT * 3, *true.shape[2:]), rtol=2e-4)


def test_places_in_one_cell_are_one_row():
    way = cell_directions()[[40, 40, 41, 40]]
    change = np.array([[1.0, 1, 1], [3, 3, 3], [5, 5, 5], [np.nan, 1, 1]])
    made = Rows.of(np.array([7, 7, 7, 7]), way, change, np.array([1.0, 0.5, 0.2, 1.0]))
    assert made.element.tolist() == [7, 7]
    assert made.cell.tolist() == [40, 41]
    np.testing.assert_allclose(made.change[:, 0], [(1 + 1.5) / 1.5, 5])
    np.testing.assert_allclose(made.weight, [1.0, 0.2])
    assert not len(Rows.of(np.zeros(2, np.int64), way[:2], change[:2], np.zeros(2)))
