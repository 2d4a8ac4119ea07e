"""Colours of the screen as light, there and back."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.kernels.tonemap import KINDS, tonemap
from studio_core.strokes.picking import radiance_of_display

bytes_ = st.tuples(*[st.integers(0, 255)] * 3)
exposures = st.floats(-12, 12)


def back(radiance, exposure, kind):
    return tonemap(np.array(radiance, np.float32).reshape(1, 1, 3), exposure, kind)[0, 0].astype(int)


def linear(display):
    return ((np.asarray(display) / 255 + 0.055) / 1.055) ** 2.4


@given(bytes_, exposures, st.sampled_from(KINDS))
def test_light_of_a_colour_shows_as_that_colour(colour, exposure, kind):
    radiance, exact = radiance_of_display(np.array(colour) / 255, exposure, kind)
    assert min(radiance) >= 0
    assert np.isfinite(radiance).all()
    if kind != "filmic" or exact:
        assert np.abs(back(radiance, exposure, kind) - colour).max() <= (kind == "filmic")
    assert exact == (max(colour) < 255) or kind == "filmic"


@given(st.tuples(*[st.floats(0, 0.9)] * 3), exposures, st.sampled_from(KINDS))
def test_light_that_a_picture_shows_is_found_again(light, exposure, kind):
    scaled = np.array(light) * 2.0**-exposure
    seen = back(scaled, exposure, kind)
    radiance, _ = radiance_of_display(seen / 255, exposure, kind)
    found = np.array(radiance) * 2.0**exposure
    assert np.abs(back(radiance, exposure, kind) - seen).max() <= (kind == "filmic")
    np.testing.assert_allclose(found, light, atol=0.06, rtol=0.06)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_too_bright_is_the_darkest_that_shows_so_and_is_said(kind):
    radiance, exact = radiance_of_display((1.0, 1.0, 1.0), 2.0, kind)
    assert not exact
    assert back(radiance, 2.0, kind).tolist() == [255, 255, 255]
    assert back(np.array(radiance) * 0.97, 2.0, kind).max() < 255 or kind == "filmic"


def test_colours_that_a_film_never_shows_are_as_near_as_can_be_and_said():
    """Its matrices alone would ask for negative light."""
    ladder = np.geomspace(1e-3, 30, 200)
    for colour, possible in zip(np.eye(3) * 0.9, (False, False, True), strict=True):
        radiance, exact = radiance_of_display(colour, 0.0, "filmic")
        assert exact == possible
        assert min(radiance) >= 0
        left = np.abs(back(radiance, 0.0, "filmic") - 255 * colour).max()
        assert (left < 1.5) == possible
        goal = linear(255 * colour)
        others = [linear(back(level * colour, 0.0, "filmic")) - goal for level in ladder]
        own = np.linalg.norm(linear(back(radiance, 0.0, "filmic")) - goal)
        assert own <= np.linalg.norm(others, axis=1).min() + 0.01


def test_other_views_are_refused():
    with pytest.raises(ValueError, match="there is no view"):
        radiance_of_display((0, 0, 0), 0, "agx")
