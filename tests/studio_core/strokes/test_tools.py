"""Each tool on small pictures, against what it says it does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.strokes.brush import Brush
from studio_core.strokes.stroke import TOOLS
from studio_core.strokes.tools import Gesture, Seen, ToolSettings, laid_over, wanted

WIDTH, HEIGHT = 60, 40
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


def seen(seed=0):
    """Two objects, one beside the other, the upper eighth background."""
    light = np.random.default_rng(seed).uniform(0.1, 2, (HEIGHT, WIDTH, 3)).astype(np.float32)
    surface = np.zeros((HEIGHT, WIDTH), np.int32)
    surface[:, WIDTH // 2 :] = 1
    surface[: HEIGHT // 8] = -1
    return Seen(light, surface)


def gesture(path=((0.2, 0.5), (0.8, 0.6)), **brush):
    return Gesture.of(Brush(**{"size": 0.3, "hardness": 0.8} | brush), path)


SETTINGS = ToolSettings(source=(0.5, 0.8))


@pytest.mark.parametrize("tool", TOOLS)
@pytest.mark.parametrize(
    "path", [[(0.5, 0.5)], [(0.0, 0.0), (1.0, 1.0)], [(-0.2, 0.3), (1.2, 0.3)], [(7, 7)]]
)
def test_outside_of_the_mask_nothing_is_wanted(tool, path):
    picture, hand = seen(), gesture(path)
    before = picture.light.copy()
    made = wanted(tool, picture, hand, SETTINGS)
    mask = hand.mask(picture)
    assert made.dtype == np.float32
    assert np.array_equal(made[mask == 0], before[mask == 0])
    assert np.array_equal(picture.light, before)
    assert not np.isinf(made).any()
    assert np.isfinite(made).all() or tool == "clone"


@given(st.sampled_from(TOOLS), st.floats(0, 1))
def test_opacity_is_how_far_it_goes(tool, opacity):
    picture = seen()
    full = wanted(tool, picture, gesture(), SETTINGS)
    some = wanted(tool, picture, gesture(opacity=opacity), SETTINGS)
    expected = picture.light + opacity * (full - picture.light)
    np.testing.assert_allclose(some, expected, rtol=1e-5, atol=1e-6)


def test_replace_is_the_colour_itself():
    picture, hand = seen(), gesture()
    made = wanted("replace", picture, hand, ToolSettings(colour=(0.7, 0.2, 0.1)))
    under = hand.mask(picture) > 0
    np.testing.assert_allclose(made[under], np.full((under.sum(), 3), (0.7, 0.2, 0.1)), rtol=1e-6)


def test_replace_keeps_shading_if_asked():
    picture, hand = seen(), gesture()
    mask = hand.mask(picture)
    made = wanted("replace", picture, hand, ToolSettings(colour=(0.7, 0.2, 0.1), shading=True))
    under = mask > 0
    level, before = made[under] @ LUMINANCE, picture.light[under] @ LUMINANCE
    np.testing.assert_allclose(level / before, level[0] / before[0], rtol=1e-4)
    mean = (made[under] * mask[under, None]).sum(axis=0) / mask[under].sum()
    np.testing.assert_allclose(mean, [0.7, 0.2, 0.1], rtol=1e-4)
    dark = Seen(np.zeros_like(picture.light), picture.surface)
    made = wanted("replace", dark, hand, ToolSettings(colour=(0.7, 0.2, 0.1), shading=True))
    np.testing.assert_allclose(made[under], np.full((under.sum(), 3), (0.7, 0.2, 0.1)), rtol=1e-6)


def test_brighten_and_darken_go_by_stops_and_undo_each_other():
    picture, hand = seen(), gesture()
    under = hand.mask(picture) > 0
    bright = wanted("brighten", picture, hand, ToolSettings(stops=1.0))
    np.testing.assert_allclose(bright[under], 2 * picture.light[under], rtol=1e-6)
    back = wanted("darken", Seen(bright, picture.surface), hand, ToolSettings(stops=1.0))
    np.testing.assert_allclose(back, picture.light, rtol=1e-6)


def test_blur_stays_in_its_object():
    picture, hand = seen(), gesture([(0.1, 0.3), (0.9, 0.3)], size=0.9)
    light = np.zeros_like(picture.light)
    light[picture.surface == 0] = (1, 0, 0)
    light[picture.surface == 1] = (0, 1, 0)
    light[picture.surface < 0] = 50
    made = wanted("blur", Seen(light, picture.surface), hand, ToolSettings(radius=0.1))
    np.testing.assert_allclose(made, light, rtol=1e-5, atol=1e-6)


def test_blur_is_a_gaussian_where_all_is_one_object():
    light = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    light[20, 30] = 1
    picture = Seen(light, np.zeros((HEIGHT, WIDTH), np.int32))
    made = wanted("blur", picture, gesture([(0.5, 0.5)], size=3.0), ToolSettings(radius=0.05))
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    expected = np.exp(-((y - 20) ** 2 + (x - 30) ** 2) / (2 * 2.0**2)) / (2 * np.pi * 2.0**2)
    np.testing.assert_allclose(made[..., 0], expected, atol=2e-4)


def test_one_pixel_that_is_no_number_is_not_spread():
    picture, hand = seen(), gesture()
    picture.light[20, 20] = np.nan
    for tool in ("blur", "sharpen", "smear"):
        assert np.isfinite(wanted(tool, picture, hand, SETTINGS)).all(axis=2).sum() >= WIDTH * HEIGHT - 1


def test_sharpen_takes_the_blur_away_and_never_below_black():
    picture, hand = seen(), gesture()
    under = hand.mask(picture) > 0
    blurred = wanted("blur", picture, hand, ToolSettings(radius=0.03))
    made = wanted("sharpen", picture, hand, ToolSettings(radius=0.03, amount=2.0))
    expected = np.maximum(picture.light + 2 * (picture.light - blurred), 0)
    np.testing.assert_allclose(made[under], expected[under], rtol=1e-4, atol=1e-5)


def test_clone_shows_what_is_at_the_source():
    picture, hand = seen(), gesture([(0.25, 0.5), (0.5, 0.5)])
    under = hand.mask(picture) > 0
    moved = ToolSettings(source=(0.25 + 10 / WIDTH, 0.5 - 5 / HEIGHT))
    made = wanted("clone", picture, hand, moved)
    expected = np.roll(picture.light, (5, -10), axis=(0, 1))
    np.testing.assert_allclose(made[under], expected[under], rtol=1e-4)


def test_clone_says_nothing_where_its_source_is_outside():
    picture, hand = seen(), gesture([(0.25, 0.5), (0.5, 0.5)])
    made = wanted("clone", picture, hand, ToolSettings(source=(0.0, 0.5)))
    under = hand.mask(picture) > 0
    empty = np.isnan(made).all(axis=2)
    assert empty.any()
    assert not empty[~under].any()
    x = np.nonzero(empty)[1]
    assert (x < WIDTH / 4).all()
    mask = hand.mask(picture)
    assert np.isfinite(laid_over(picture.light, made, mask)).all()
    with pytest.raises(ValueError, match="source"):
        wanted("clone", picture, hand, ToolSettings())


def test_smear_drags_colour_along():
    light = np.zeros((HEIGHT, WIDTH, 3), np.float32)
    light[:, :20] = (1, 0, 0)
    picture = Seen(light, np.zeros((HEIGHT, WIDTH), np.int32))
    hand = gesture([(10 / WIDTH, 0.5), (50 / WIDTH, 0.5)], size=0.4, hardness=1.0)
    made = wanted("smear", picture, hand, ToolSettings(amount=1.0))
    assert made[20, 40, 0] > 0.95, "all of it is carried on"
    carried = [
        wanted("smear", picture, hand, ToolSettings(amount=amount))[20, 20:, 0].sum()
        for amount in (0.0, 0.02, 0.1, 0.3, 0.7, 1.0)
    ]
    assert (np.diff(carried) > 0).all()
    assert carried[0] == 0
    still = wanted("smear", picture, gesture([(0.5, 0.5)]), ToolSettings(amount=1.0))
    assert np.array_equal(still, light)


def test_smear_from_outside_brings_nothing():
    picture = seen()
    hand = gesture([(-0.5, 0.5), (0.5, 0.5)])
    assert np.isfinite(wanted("smear", picture, hand, ToolSettings(amount=1.0))).all()


def test_fixate_wants_what_there_is():
    picture = seen()
    assert np.array_equal(wanted("fixate", picture, gesture(), ToolSettings()), picture.light)


def test_other_tools_are_refused():
    with pytest.raises(ValueError, match="there is no tool"):
        wanted("spray", seen(), gesture(), SETTINGS)
