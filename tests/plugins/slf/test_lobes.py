"""Lobes as operators on cells, against summing over many directions; what they return; reciprocity."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.lobe_convolution import convolved

from studio_core.transport.cells import PARTS, RINGS
from studio_plugins.slf.ladder import LEVELS
from studio_plugins.slf.lobes import FREQUENCIES, albedos, cell_weights, exponents, lobe, spectra


def sent(level, light):
    """(RINGS, PARTS) by the operator."""
    series = np.fft.rfft(light, axis=1) * cell_weights()[:, None]
    return np.fft.irfft(np.einsum("mij,jm->im", spectra()[level], series), PARTS, axis=1)


@pytest.mark.parametrize(("level", "fine"), [(0, 4), (12, 4), (17, 8), (19, 12)])
def test_light_that_is_sent_is_that_of_the_whole_convolution(level, fine):
    rng = np.random.default_rng(level)
    light = rng.uniform(0, 1, (RINGS, PARTS)) ** 4
    cells = rng.choice(RINGS * PARTS, 3, replace=False)
    made, true = sent(level, light).ravel()[cells], convolved(exponents()[level], light, cells, fine)
    assert np.abs(made - true).max() < 1e-3 * true.mean()


def test_no_lobe_returns_more_than_arrives_and_none_less_than_half():
    found = albedos(spectra())
    assert found.shape == (LEVELS, RINGS)
    assert found.max() <= 1 + 1e-12
    assert found.min() > 0.52


def test_lobes_are_reciprocal_and_nowhere_negative():
    kernels = spectra()
    assert kernels.shape == (LEVELS, FREQUENCIES, RINGS, RINGS)
    assert np.abs(kernels - kernels.swapaxes(2, 3)).max() == 0
    over_turns = np.fft.hfft(np.moveaxis(kernels, 1, 3), axis=-1)
    assert over_turns.min() > -1e-6 * over_turns.max()
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 100, 3))
    a, b = (np.abs(one) / np.linalg.norm(one, axis=1, keepdims=True) for one in (a, b))
    assert np.allclose(lobe(30.0, a, b), lobe(30.0, b, a), rtol=1e-12)


def test_twice_as_many_nodes_give_the_same():
    coarse, fine = spectra(), spectra(16, 512)
    assert np.abs(coarse - fine).max(axis=(1, 2, 3)) == pytest.approx(0, abs=1e-5 * fine.max())
