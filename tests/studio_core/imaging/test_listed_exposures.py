"""Listed exposures: what photographs tell, where it cannot be true, and what is guessed instead."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from studio_core.capturing.settings import BACK, FRONT
from studio_core.imaging.listed_exposures import Exposed, Listed, completed, listed_exposures
from studio_core.imaging.photograph import ShotFacts

STOPS = st.floats(-8, 8).map(lambda v: round(v, 3))


def told(ev: float, **facts: object) -> ShotFacts:
    values = {"seconds": 2.0**ev, "iso": 100.0, "aperture": 1.0} | facts
    return ShotFacts("a.jpg", **values)  # type: ignore[arg-type]


def one(shots: list[Exposed], step: float = 2.0) -> Listed:
    return listed_exposures({FRONT: shots}, step)[FRONT]


@given(st.lists(STOPS, min_size=1, max_size=9), st.lists(STOPS, min_size=1, max_size=9))
def test_told_exposures_keep_all_differences_within_and_across_sides(a: list[float], b: list[float]) -> None:
    sides = {FRONT: [Exposed(told(ev), ev) for ev in a], BACK: [Exposed(told(ev), ev) for ev in b]}
    made = listed_exposures(sides, 2.0)
    values = np.array(made[FRONT].evs + made[BACK].evs)
    if np.ptp(a) >= 0.8 and np.ptp(b) >= 0.8:  # else some may be denied by their brightness
        np.testing.assert_allclose(np.diff(values), np.diff(a + b), atol=1e-9)
        assert abs(np.median(values)) < 1e-9
        assert all(made[FRONT].certain + made[BACK].certain)


@given(st.lists(st.floats(-12, 0), min_size=2, max_size=16, unique=True), st.floats(0.1, 6))
def test_untold_exposures_rise_with_brightness(bright: list[float], step: float) -> None:
    made = one([Exposed(ShotFacts(f"{b}"), b) for b in bright], step)
    order = np.argsort(bright)
    rungs = np.diff(np.array(made.evs)[order])
    assert (rungs > -1e-9).all()
    np.testing.assert_allclose(rungs[rungs > 1e-9], step)
    assert not any(made.certain)
    assert len(made.notes) == 1


@given(st.lists(STOPS, min_size=2, max_size=9), st.data())
def test_typed_exposures_are_never_changed(evs: list[float], data: st.DataObject) -> None:
    typed = [data.draw(st.one_of(st.none(), STOPS)) for _ in evs]
    shots = [Exposed(told(ev), ev, t) for ev, t in zip(evs, typed, strict=True)]
    made = one(shots)
    for value, sure, t in zip(made.evs, made.certain, typed, strict=True):
        assert t is None or (value == t and sure)
    plain = one([Exposed(told(ev), ev) for ev in evs])
    assert all(v == p for v, p, t in zip(made.evs, plain.evs, typed, strict=True) if t is None)


def test_equal_exposures_that_brightness_denies_are_not_believed() -> None:
    """Some phones write the same numbers into every shot of a bracket."""
    made = one([Exposed(told(0), b) for b in (-4.0, -2.2, -6.1)])
    assert made.evs == (0, 2, -2)
    assert not any(made.certain)
    assert made.notes == (
        "The photographs of the front say that all were exposed alike, which their brightness denies:"
        " steps of 2 EV are assumed, in the order of brightness.",
    )
    alike = one([Exposed(told(0), b) for b in (-4.0, -4.1)])
    assert alike.evs == (0, 0)
    assert all(alike.certain)


def test_the_exposure_correction_stands_in() -> None:
    shots = [Exposed(ShotFacts("a.jpg", bias=b), 0.7 * b) for b in (0.0, -2.0, 2.0)]
    assert one(shots) == Listed((0, -2, 2), (True,) * 3)
    held = [Exposed(told(0, bias=b), 0.7 * b) for b in (0.0, -2.0, 2.0)]  # the ISO that varied is missing
    assert one(held).evs == (0, -2, 2)


def test_an_iso_that_one_shot_lacks_is_that_of_the_others() -> None:
    facts = [told(0), told(1, iso=None), told(2)]
    assert [f.iso for f in completed(facts)] == [100.0] * 3
    varied = completed([told(0, iso=50.0), told(0, iso=None), told(0, iso=200.0)])
    assert [f.ev is None for f in varied] == [False, True, False]
    shots = [Exposed(f, b) for f, b in zip(varied, (-6.0, -5.0, -4.0), strict=True)]
    made = one(shots)
    np.testing.assert_allclose(np.diff(made.evs), [1, 1])
    assert made.certain == (True, False, True)
    assert made.notes == ("a.jpg does not tell the exposure; it is guessed from the brightness.",)


def test_shots_that_tell_nothing_are_placed_by_those_that_do() -> None:
    bright = [-8.0, -6.0, -4.0, -2.0]
    facts = [ShotFacts("a"), told(-2), told(0), ShotFacts("b")]
    made = one([Exposed(f, b) for f, b in zip(facts, bright, strict=True)])
    np.testing.assert_allclose(np.diff(made.evs), 2)
    assert made.notes == ("a and b do not tell the exposure; it is guessed from the brightness.",)
