"""Half and difference angles: there and back, symmetric, and as the database's own code has them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import merl as oracle

from studio_core.brdfs.half_difference import centres, filled, from_angles, grid, to_angles

angle = st.floats(1e-3, np.pi / 2 - 1e-3)


@given(theta_h=angle, theta_d=angle, phi_d=st.floats(1e-3, np.pi - 1e-3))
def test_there_and_back(theta_h: float, theta_d: float, phi_d: float) -> None:
    wi, wo = from_angles(*(np.array(a) for a in (theta_h, theta_d, phi_d)))
    assert np.linalg.norm(wi) == pytest.approx(1)
    assert np.linalg.norm(wo) == pytest.approx(1)
    np.testing.assert_allclose(to_angles(wi, wo), (theta_h, theta_d, phi_d), atol=1e-9)
    np.testing.assert_allclose(
        oracle.half_difference(tuple(wi), tuple(wo)), (theta_h, theta_d, phi_d), atol=1e-6
    )


@given(seed=st.integers(0, 2**32))
@settings(max_examples=40)
def test_directions_may_be_exchanged_and_turned(seed: int) -> None:
    rng = np.random.default_rng(seed)
    wi, wo = rng.normal(size=(2, 20, 3))
    for w in (wi, wo):
        w[:, 2] = np.abs(w[:, 2])
        w /= np.linalg.norm(w, axis=1)[:, None]
    there, back = to_angles(wi, wo), to_angles(wo, wi)
    np.testing.assert_allclose(there[:2], back[:2], atol=1e-12)
    np.testing.assert_allclose(np.sin(there[2] - back[2]), 0, atol=1e-9)
    c, s = np.cos(turn := rng.uniform(0, 7)), np.sin(turn)
    spin = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turned = to_angles(wi @ spin.T, wo @ spin.T)
    np.testing.assert_allclose(there[:2], turned[:2], atol=1e-9)
    np.testing.assert_allclose(np.sin(there[2] - turned[2]), 0, atol=1e-6)


def test_the_middle_of_a_cell_lies_in_it() -> None:
    wi, wo = grid((90, 90, 180))
    for i, j, k in ((0, 0, 0), (7, 3, 91), (45, 12, 179), (89, 0, 60), (3, 88, 90)):
        assert oracle.index(tuple(wi[i, j, k]), tuple(wo[i, j, k])) == k + 180 * (j + 90 * i)
    theta_h, theta_d, phi_d = centres((90, 90, 180))
    assert np.degrees(theta_h[0]) == pytest.approx(90 * (0.5 / 90) ** 2)
    assert np.degrees([theta_d[0], phi_d[0]]) == pytest.approx([0.5, 0.5])


def test_gaps_are_filled_from_smaller_angles() -> None:
    values = np.random.default_rng(1).random((6, 5, 4, 3))
    known = np.ones((6, 5, 4), np.bool_)
    known[:, 3:] = False  # towards grazing
    known[2, :2] = False  # the start of a line
    known[4] = False  # a whole θ_h
    made = filled(values, known)
    assert made.dtype == np.float32
    np.testing.assert_array_equal(made[known], values[known].astype(np.float32))
    np.testing.assert_array_equal(made[0, 4], made[0, 2])
    np.testing.assert_array_equal(made[2, 0], made[2, 2])
    np.testing.assert_array_equal(made[4], made[3])
    only = np.zeros_like(known)
    only[1, 2, 3] = True
    np.testing.assert_array_equal(filled(values, only), np.broadcast_to(made[1, 2, 3], made.shape))
    with pytest.raises(ValueError, match="nothing"):
        filled(values, np.zeros_like(known))
