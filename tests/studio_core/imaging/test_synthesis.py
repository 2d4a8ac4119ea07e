"""Pictures grown from samples: seams that do not show, tiling, periods, no repetition, all maps alike."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio.bench.materials_growing import correlation
from studio.bench.pattern_samples import bricks, felt, marble, waves, weave
from studio_core.errors import Cancelled, InputError
from studio_core.imaging.seams import Cutter
from studio_core.imaging.synthesis import FEATHER, Grown, fitting_size, grow, periods
from studio_core.shading.job import Job


def cheapest_by_trying(difference, kept, taken):
    """Least cost of any assignment of a small square's pixels."""
    height, width = difference.shape
    free = [at for at in np.ndindex(height, width) if not kept[at] and not taken[at]]
    best = np.inf
    for choice in itertools.product((False, True), repeat=len(free)):
        made = taken.copy()
        for at, new in zip(free, choice, strict=True):
            made[at] = new
        best = min(best, cost_of(difference, made))
    return best


def cost_of(difference, made):
    beside = (made[:, 1:] != made[:, :-1]) * (difference[:, 1:] + difference[:, :-1])
    below = (made[1:] != made[:-1]) * (difference[1:] + difference[:-1])
    return beside.sum() + below.sum()


@given(st.integers(0, 10_000))
def test_a_cut_is_the_cheapest(seed):
    rng = np.random.default_rng(seed)
    difference = rng.random((4, 4)).astype(np.float32) ** 3
    kept, taken = np.zeros((2, 4, 4), np.bool_)
    kept[0], taken[2:, 1:3] = True, True
    made = Cutter(4)(difference, kept, taken)
    assert not made[kept].any()
    assert made[taken].all()
    assert cost_of(difference, made) == pytest.approx(cheapest_by_trying(difference, kept, taken), rel=0.02)


def test_where_nothing_is_kept_all_is_taken():
    none, some = np.zeros((2, 5, 5), np.bool_)
    some = some.copy()
    some[2] = True
    assert Cutter(5)(np.ones((5, 5), np.float32), none, some).all()
    assert not Cutter(5)(np.ones((5, 5), np.float32), some, none).any()


@pytest.mark.parametrize(
    ("sample", "wanted"),
    [
        (weave(128, 16.0), (16.0, 16.0)),
        (weave(192, 12.7), (12.7, 12.7)),
        (bricks(192, 64, 24), (48.0, 64.0)),
        (marble(128), (0.0, 0.0)),
        (felt(128), (0.0, 0.0)),
    ],
)
def test_what_repeats_itself_has_periods(sample, wanted):
    assert periods(sample) == pytest.approx(wanted, rel=0.01)


def test_sizes_hold_whole_periods():
    height, width = fitting_size(weave(192, 12.7), (500, 380))
    for length, wanted in ((height, 500), (width, 380)):
        assert abs(length - wanted) <= 96
        assert abs(length / 12.7 - round(length / 12.7)) < 0.05
    assert fitting_size(marble(64), (150, 90)) == (150, 90)


@pytest.mark.parametrize("sample", [weave(96, 16.0), marble(96), bricks(128, 32, 16), felt(96)])
def test_seams_do_not_show_and_the_picture_tiles(sample):
    made = grow(sample, fitting_size(sample, (192, 208)))
    assert made.source.min() >= FEATHER
    assert (made.source.max(axis=(0, 1)) < np.array(sample.shape[:2]) - FEATHER).all()
    grown = made.of(sample)
    assert made.seam_ratio(sample) <= 1.05  # also where it meets itself
    np.testing.assert_allclose(grown.mean(axis=(0, 1)), sample.mean(axis=(0, 1)), rtol=0.01)
    assert grown.std() == pytest.approx(sample.std(), rel=0.1)


def test_threads_stay_in_step():
    sample = weave(128, 16.0)
    made = grow(sample, (256, 256))
    out = made.of(sample)
    down, across = ((np.roll(out, 16, axis=axis) - out) ** 2 for axis in (0, 1))
    inside = ((sample[16:] - sample[:-16]) ** 2).mean(), ((sample[:, 16:] - sample[:, :-16]) ** 2).mean()
    assert down.mean() <= 1.6 * inside[0]
    assert across.mean() <= 1.6 * inside[1]
    jumps = (
        made.source[1:, 1:] - made.source[:-1, :-1] - 1
    ) % 16  # by whole periods, or half of one and half
    assert ((jumps == 0).all(axis=2) | (jumps == 8).all(axis=2)).all()


def test_nothing_comes_back_at_a_distance():
    sample = marble(96, seed=3)
    made = grow(sample, (288, 288)).of(sample)
    assert correlation(made, 40.0, torus=True) <= 0.35
    assert correlation(np.tile(sample, (3, 3, 1)), 40.0, torus=True) > 0.99


def test_maps_are_grown_together_and_seeds_are_arrangements():
    sample = marble(80)
    made, again, other = (grow(sample, (160, 120), seed=seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(made.source, again.source)
    assert not np.array_equal(made.source, other.source)
    rows, columns = np.meshgrid(np.arange(80.0), np.arange(80.0), indexing="ij")
    np.testing.assert_array_equal(made.of(np.stack([rows, columns], axis=2), 0), made.source)
    bytes_ = (255 * sample).astype(np.uint8)
    assert made.of(bytes_).dtype == np.uint8
    assert np.abs(made.of(bytes_) / 255 - made.of(sample)).max() < 0.01


def test_without_seams_nothing_is_mixed():
    rows, columns = np.meshgrid(np.arange(3, 15), np.arange(4, 16), indexing="ij")
    made = Grown(np.stack([rows, columns], axis=2).astype(np.int32))
    sample = np.random.default_rng(0).random((20, 20, 2)).astype(np.float32)
    inner = made.of(sample)[2:-3, 2:-3]
    np.testing.assert_array_equal(inner, sample[5:12, 6:13])


@pytest.mark.parametrize(
    "sample",
    [
        np.full((40, 40, 1), 0.3),
        np.zeros((40, 64, 3)),
        np.random.default_rng(0).random((40, 40, 9)),
        1e-20 * np.random.default_rng(0).random((40, 40, 2)),
        1e20 * np.random.default_rng(0).random((40, 50, 1)),
        np.repeat(np.eye(48)[..., None], 3, axis=2),
        waves(np.random.default_rng(0), 48, 3.0)[..., None],
    ],
)
def test_odd_samples_are_grown(sample):
    sample = sample.astype(np.float32)
    made = grow(sample, (70, 90), mending=0.5).of(sample)
    assert made.shape == (70, 90, sample.shape[2])
    assert np.isfinite(made).all()
    assert sample.min() <= made.min()
    assert made.max() <= sample.max() * (1 + 1e-6)


def test_what_cannot_be_grown_is_said():
    with pytest.raises(InputError, match="too small"):
        grow(np.zeros((20, 80, 3), np.float32), (100, 100))
    with pytest.raises(InputError, match="cannot be grown"):
        grow(np.zeros((80, 80, 3), np.float32), (100, 10_000))
    broken = np.zeros((80, 80, 1), np.float32)
    broken[3, 4] = np.nan
    with pytest.raises(InputError, match="finite"):
        grow(broken, (100, 100))


def test_growing_can_be_cancelled_and_says_how_far_it_is():
    said = []
    job = Job("grow", lambda job: said.append(job.done / job.total) or (len(said) == 5 and job.cancel()))
    with pytest.raises(Cancelled):
        grow(felt(64), (160, 160), job=job)
    assert said == sorted(said)
    assert len(said) == 5
