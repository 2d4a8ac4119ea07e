"""The paper's choices by element: equations as printed, true minima, and a million systems of any kind."""

from __future__ import annotations

import numpy as np
import pytest

from studio_plugins.slf.mixed import choose_all
from studio_plugins.slf.paper import BOTH, DIFFUSE, KEPT, SPECULAR, Systems, choose, fits

LEVELS = 4


def systems(rng, count, condition=None):
    """Moments of random columns; with `condition`, of columns that are that nearly one."""
    samples = 12
    first = rng.uniform(0, 1, (count, samples))
    second = rng.uniform(0, 1, (count, LEVELS, samples))
    if condition is not None:
        second = first[:, None] + second / np.asarray(condition).reshape(-1, 1, 1)
    wanted = rng.uniform(0, 1, (count, samples))
    now = rng.dirichlet([1, 1, 1], count)[:, :2]
    return Systems(
        (first**2).sum(axis=1),
        np.einsum("ek,elk->el", first, second),
        (second**2).sum(axis=2),
        (first * wanted).sum(axis=1),
        np.einsum("elk,ek->el", second, wanted),
        (wanted**2).sum(axis=1),
        now,
        rng.integers(0, LEVELS, count),
    )


def cost(one, d, s, level):
    e = np.arange(len(one.c11))
    square = one.c11 * d * d + 2 * one.c12[e, level] * d * s + one.c22[e, level] * s * s
    return square - 2 * one.d1 * d - 2 * one.d2[e, level] * s + one.bb


def test_the_minimum_on_the_constraints_is_no_worse_than_any_other_place():
    rng = np.random.default_rng(0)
    one = systems(rng, 400)
    made = fits(one, False)
    for level in range(LEVELS):
        at = np.full(400, level)
        ours = cost(one, *made[:, level, BOTH].T, at)
        along_d = cost(one, *made[:, level, DIFFUSE].T, at)
        along_s = cost(one, *made[:, level, SPECULAR].T, at)
        for _ in range(60):
            d, s = rng.dirichlet([1, 1, 1], 400)[:, :2].T
            assert (cost(one, d, s, at) >= ours - 1e-9).all()
            assert (cost(one, d * (1 - one.now[:, 1]), one.now[:, 1], at) >= along_d - 1e-9).all()
            assert (cost(one, one.now[:, 0], s * (1 - one.now[:, 0]), at) >= along_s - 1e-9).all()


def test_equations_5_and_6_are_as_printed():
    rng = np.random.default_rng(1)
    one = systems(rng, 1)
    made = fits(one, True)[0, 2]
    c11, c12, c22 = one.c11[0], one.c12[0, 2], one.c22[0, 2]
    d1, d2, (rd, rs) = one.d1[0], one.d2[0, 2], one.now[0]
    five = (c11 * (d1 - c12 * rs) + c12 * (d2 - c22 * rs)) / (c11**2 + c12**2)
    six = (c12 * (d1 - c11 * rd) + c22 * (d2 - c12 * rd)) / (c12**2 + c22**2)
    np.testing.assert_allclose(made[DIFFUSE], np.array([five, rs]) / max(five + rs, 1))
    np.testing.assert_allclose(made[SPECULAR], np.array([rd, max(six, 0)]) / max(rd + max(six, 0), 1))


@pytest.mark.parametrize("literal", [False, True])
@pytest.mark.parametrize("solver", ["l0", "mixed", "l2"])
def test_solvers_change_as_many_parameters_as_they_may(solver, literal):
    one = systems(np.random.default_rng(2), 300)
    made = choose(one, solver, literal)
    changed = np.array([0, 1, 1, 2])[made.kind] + (made.level != one.level)
    if solver == "l0":
        assert (changed == 1).all()
    if solver == "l2":
        assert (made.kind == BOTH).all()
    least = choose(one, "l2", literal).residual
    if not literal:
        assert (least <= made.residual + 1e-9).all()


def million(rng, count=100_000):
    """A tenth of a million systems: conditions up to 1e16, some dark, some with numbers that are none."""
    one = systems(rng, count, 10.0 ** rng.uniform(0, 16, count))
    dark, broken = rng.random(count) < 0.05, rng.random(count) < 0.05
    for array in (one.c11, one.c12, one.c22, one.d1, one.d2, one.bb):
        array[dark] = 0
        array[broken & ~dark] = rng.choice([np.nan, np.inf, -np.inf])
    return one, dark | broken


def sound(made, one, flagged):
    assert np.isfinite(made.reflectance).all()
    assert (made.reflectance >= 0).all()
    assert (made.reflectance.sum(axis=1) <= 1 + 1e-9).all()
    assert np.isfinite(made.residual).all()
    np.testing.assert_array_equal(made.flagged, flagged)
    assert (made.kind[made.flagged] == KEPT).all()
    np.testing.assert_array_equal(made.reflectance[made.flagged], one.now[made.flagged])


def test_a_million_systems_of_any_condition_come_out_finite_and_feasible():
    rng = np.random.default_rng(3)
    for part in range(10):
        one, flagged = million(rng)
        for solver in ("l0", "mixed", "l2"):
            sound(choose_all(one, solver), one, flagged)
        if part < 3:
            sound(choose(one, ("l0", "mixed", "l2")[part], literal=True), one, flagged)


@pytest.mark.parametrize("may", [(1, 0, 0), (0, 1, 1), (0, 0, 1), (1, 1, 0)])
@pytest.mark.parametrize("solver", ["l0", "mixed", "l2"])
def test_only_what_may_change_does(solver, may):
    one, may = systems(np.random.default_rng(4), 300), tuple(map(bool, may))
    made = choose(one, solver, literal=True, may=may)
    assert may[0] or not np.isin(made.kind, (DIFFUSE, BOTH)).any()
    assert may[1] or not np.isin(made.kind, (SPECULAR, BOTH)).any()
    assert may[2] or (made.level == one.level).all()
    if solver == "l2":
        assert (made.kind == may[0] * DIFFUSE + may[1] * SPECULAR).all()
