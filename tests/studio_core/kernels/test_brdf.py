"""The shared pieces of reflectance kernels against float64."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.kernels.brdf import (
    arc_cosine,
    dielectric_fresnel,
    exponential,
    power_of_complement,
    schlick_weight,
)


@settings(max_examples=400, deadline=None)
@given(t=st.one_of(st.floats(0, 2, width=32), st.floats(0, 2**-10, width=32)), n=st.floats(0, 1e5, width=32))
def test_powers_keep_their_digits_near_one(t: float, n: float) -> None:
    made = power_of_complement(np.float32(t), np.float32(1 - t), np.float32(n))
    truth = math.exp(n * math.log1p(-t)) if t < 1 else 0.0
    if truth > 1e-36:
        assert abs(made / truth - 1) < 2e-5
    else:
        assert 0 <= made < 1e-35


@settings(deadline=None)
@given(c=st.floats(-1, 1, width=32))
def test_schlick_weight(c: float) -> None:
    assert math.isclose(schlick_weight(np.float32(c)), (1 - c) ** 5, rel_tol=1e-5)


@settings(deadline=None)
@given(rest=st.floats(2**-40, 0.5, width=32), n=st.floats(0.5, 20, width=32))
def test_powers_keep_their_digits_near_zero(rest: float, n: float) -> None:
    made = power_of_complement(np.float32(1 - rest), np.float32(rest), np.float32(n))
    if rest**n > 1e-36:
        assert abs(made / rest**n - 1) < 2e-5


@settings(deadline=None)
@given(c=st.floats(0, 1, width=32))
def test_arc_cosine(c: float) -> None:
    assert abs(arc_cosine(np.float32(c)) - math.acos(c)) < 5e-7


@settings(deadline=None)
@given(y=st.floats(-200, 0, width=32))
def test_exponential(y: float) -> None:
    made = exponential(np.float32(y))
    if y > -85:
        assert abs(made / math.exp(y) - 1) < 3e-5
    else:
        assert 0 <= made < 1e-36


@settings(deadline=None)
@given(angle=st.floats(0, math.pi / 2), index=st.floats(1, 4))
def test_dielectric_fresnel_is_the_mean_of_both_polarisations(angle: float, index: float) -> None:
    c, inside = math.cos(angle), math.sqrt(1 - (math.sin(angle) / index) ** 2)
    across = (c - index * inside) / (c + index * inside) if c > 0 else -1.0
    along = (index * c - inside) / (index * c + inside) if c > 0 else -1.0
    made = dielectric_fresnel(np.float32(c), np.float32(index) ** 2)
    assert abs(made - (across**2 + along**2) / 2) < 3e-6 + 2e-5 * (index > 1) * made
    assert 0 <= made <= 1.000001
