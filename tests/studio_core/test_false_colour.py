"""False colours: in order of brightness, and on the screen as meant."""

from __future__ import annotations

import numpy as np

from studio_core.colour import LUMINANCE
from studio_core.false_colour import false_colours, linear_colours
from studio_core.kernels.tonemap import tonemap


def test_more_is_brighter() -> None:
    ramp = linear_colours(np.linspace(0, 1, 200)) @ np.array(LUMINANCE, np.float32)
    assert (np.diff(ramp) > -1e-4).all()
    assert ramp[0] < 0.01
    assert ramp[-1] > 0.8


def test_a_colour_true_display_shows_them_as_they_are() -> None:
    values = np.array([[-1.0, 0.0, 0.1, 0.5], [0.77, 1.0, 3.0, np.nan]])
    shown = tonemap(linear_colours(values), 0.0, "srgb")
    np.testing.assert_array_equal(shown, false_colours(values))
    np.testing.assert_array_equal(shown[0, 0], shown[0, 1])
    np.testing.assert_array_equal(shown[1, 1], shown[1, 2])
