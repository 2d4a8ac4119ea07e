"""What registration leaves of gain, and glare, are found; reflections are not taken for either."""

from __future__ import annotations

import numpy as np
import pytest

from studio_plugins.capture.overlap_balance import Overlap, balance


def overlap(gain=1.0, veil=0.0, arc=0.0, seed=0):
    """A ring of 12° that both see; a reflection of `arc` stops in a third of the azimuths."""
    rng = np.random.default_rng(seed)
    rows, columns = 24, 360
    theta = np.radians(84 + (np.arange(rows) + 0.5) / 2)
    azimuth = (np.arange(columns) + 0.5) * 2 * np.pi / columns
    tone = np.cos(azimuth)[None] * 6 + np.cos(3 * azimuth + theta[:, None])  # bright and dark parts
    other = 2.0**tone
    veils = np.stack([4 + np.cos(azimuth - 1) + 0 * other, 3 + 0 * other])
    own = gain * other + veil * veils[0]
    inward = np.degrees(np.radians(96) - theta)[:, None]
    own = own * 2.0 ** (arc * (inward < 5) * (np.arange(columns) > 240))
    own = own * 2.0 ** rng.normal(0, 0.05, own.shape)
    return Overlap(
        own=own.astype(np.float32),
        other=other.astype(np.float32),
        known=np.ones(own.shape, bool),
        from_own=np.broadcast_to(inward, own.shape),
        from_other=np.broadcast_to(np.degrees(theta - np.radians(84))[:, None], own.shape),
        tilt=np.broadcast_to(2 * theta[:, None] - np.pi, own.shape),
        azimuth=azimuth,
        veils=veils,
    )


@pytest.mark.parametrize("arc", [0.0, 1.5])
@pytest.mark.parametrize("gain", [0.9, 1.1])
def test_gain_is_found_beside_reflections(gain, arc):
    made = balance(overlap(gain=gain, arc=arc))
    np.testing.assert_allclose(made.gain[:, :240], gain, rtol=0.04)


@pytest.mark.parametrize("arc", [0.0, 1.5])
def test_glare_is_found_beside_reflections(arc):
    given = overlap(veil=0.008, arc=arc)
    made = balance(given)
    truth = 0.008 * given.veils[0]
    assert (made.veil > 0.25 * truth).all()
    assert (made.veil < 1.2 * truth).all()
    assert (made.doubt >= made.veil).all()
    assert (balance(overlap(arc=arc)).veil < 0.25 * truth).all()


def test_nothing_in_common_leaves_all_as_it_is():
    given = overlap()
    blind = Overlap(**{**vars(given), "known": np.zeros_like(given.known)})
    made = balance(blind)
    np.testing.assert_array_equal(made.gain, 1)
    np.testing.assert_array_equal(made.veil, 0)
