"""How sharp kernels are, asked of the kernels themselves."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from studio_core.jit import batch_function
from studio_core.kernels.brdf import SIGNATURE, carray
from studio_core.params import defaults
from studio_core.shading.artifacts import Shapes
from studio_plugins.cuts import lobes
from studio_plugins.cuts.lobes import LobeTable, probe


def lobe(brdf, **values):
    shape = np.atleast_1d(np.asarray(brdf.shape({**defaults(brdf.Params), **values}), np.float32))
    return probe(brdf.address, brdf.terms, shape)


def test_lambert_is_flat(host):
    found = lobe(host.brdf("lambert"))
    assert found.flat
    assert found.slope == 0


@pytest.mark.parametrize("alpha", [0.02, 0.05, 0.1, 0.25, 0.5])
def test_the_slope_of_ggx_is_about_its_alpha(host, alpha):
    """Beside a broad lobe the matt term counts: together they are broader than the lobe."""
    found = lobe(host.brdf("ggx"), roughness=alpha**0.5, metallic=1.0)
    assert not found.flat
    assert 0.8 * alpha < found.slope < (1.25 if alpha <= 0.1 else 2.5) * alpha


@pytest.mark.parametrize(("model", "name", "values"), [
    ("ggx", "roughness", (1.0, 0.7, 0.5, 0.3, 0.2, 0.1, 0.05)),
    ("phong", "exponent", (2.0, 10.0, 50.0, 200.0, 1000.0)),
    ("blinn-phong", "exponent", (2.0, 10.0, 50.0, 200.0, 1000.0)),
])  # fmt: skip
def test_sharper_materials_have_smaller_slopes(host, model, name, values):
    slopes = [lobe(host.brdf(model), **{name: value}).slope for value in values]
    assert all(a > b > 0 for a, b in itertools.pairwise(slopes))


def test_phong_s_exponent_and_slope(host):
    """A Phong lobe of exponent n falls by half at cos θ = 2^(-1/n); its half vector at half that angle."""
    for n in (20.0, 100.0, 500.0):
        half = np.arccos(0.5 ** (1 / n)) / 2
        expected = np.tan(half) / np.sqrt(np.sqrt(2) - 1)
        assert lobe(host.brdf("phong"), exponent=n).slope == pytest.approx(expected, rel=0.1)


@batch_function(SIGNATURE)
def hollow(shape, wo, count, wi, out):
    """Darkest where the mirror would be, brightest at the rim."""
    z, b = carray(wi, 3 * count)[2 * count :], carray(out, count)
    for i in range(count):
        b[i] = np.float32(1) - z[i]


@batch_function(SIGNATURE)
def velvet(shape, wo, count, wi, out):
    """Minnaert's: (z_i z_o)^(k-1)."""
    k, up = carray(shape, 1)[0], carray(wo, 3)[2]
    z, b = carray(wi, 3 * count)[2 * count :], carray(out, count)
    for i in range(count):
        b[i] = (up * z[i]) ** (k - np.float32(1))


@batch_function(SIGNATURE)
def black(shape, wo, count, wi, out):
    """Nothing comes back."""
    b = carray(out, count)
    for i in range(count):
        b[i] = np.float32(0)


@batch_function(SIGNATURE)
def steps(shape, wo, count, wi, out):
    """Two terms: a constant one, and a plateau with an edge."""
    z, b = carray(wi, 3 * count)[2 * count :], carray(out, 2 * count)
    for i in range(count):
        b[i] = np.float32(1)
        b[count + i] = np.float32(5) if z[i] > np.float32(0.99) else np.float32(0)


def test_kernels_of_other_plugins():
    assert probe(velvet.address, 1, np.ones(1, np.float32)).flat
    dark = probe(velvet.address, 1, np.full(1, 3.0, np.float32))
    assert not dark.flat
    assert dark.slope > 0.5  # broader than anything that needs splitting
    assert not probe(hollow.address, 1, np.zeros(0, np.float32)).flat
    assert probe(hollow.address, 1, np.zeros(0, np.float32)).slope == 0
    assert probe(black.address, 1, np.zeros(0, np.float32)).flat
    plateau = probe(steps.address, 2, np.zeros(0, np.float32))
    edge = np.tan(np.arccos(0.99) / 2) / np.sqrt(np.sqrt(2) - 1)
    assert plateau.slope == pytest.approx(edge, rel=0.1)


def test_the_table_asks_a_kernel_once_for_each_shape(host, monkeypatch):
    asked = []
    monkeypatch.setattr(lobes, "probe", lambda *given: asked.append(given) or probe(*given))
    ggx, lambert = host.brdf("ggx"), host.brdf("lambert")

    def shapes(roughness):
        own = np.atleast_1d(ggx.shape({**defaults(ggx.Params), "roughness": roughness})).astype(np.float32)
        flat = np.atleast_1d(lambert.shape(defaults(lambert.Params))).astype(np.float32)
        address = np.array([ggx.address, lambert.address, ggx.address], np.int64)
        terms = np.array([ggx.terms, lambert.terms, ggx.terms], np.int64)
        offset = np.array([0, len(own), len(own) + len(flat)], np.int64)
        return Shapes(address, terms, offset, np.concatenate([own, flat, own]))

    table = LobeTable()
    first = table(shapes(0.5))
    assert [one.flat for one in first] == [False, True, False]
    assert first[0] == first[2]
    count = len(asked)
    assert table(shapes(0.5)) == first
    assert len(asked) == count
    assert table(shapes(0.2))[0].slope < first[0].slope
    assert len(asked) > count
