"""The sphere's geometry, and where it is found in pictures."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio.bench.lab import Rig, row, shoot
from studio.bench.lab_surfaces import library
from studio_core.errors import InputError
from studio_plugins.residual.ball import find_ball
from studio_plugins.residual.reflectance_map import reflectance_maps, slopes
from studio_plugins.residual.samples import Ball


@given(
    st.floats(0, 0.98), st.floats(0, 2 * np.pi), st.sampled_from([np.inf, 2.5, 8.0, 40.0]), st.floats(5, 900)
)
def test_positions_and_normals_are_each_others_inverse(
    share: float, turn: float, distance: float, radius: float
) -> None:
    ball = Ball(13.25, 400.5, radius, distance)
    x, y = ball.x + share * radius * np.cos(turn), ball.y + share * radius * np.sin(turn)
    n, v, inside = ball.normals(x, y)
    assert inside
    assert abs(np.linalg.norm(n) - 1) < 1e-9
    assert float(n @ v) > 0
    assert np.allclose(ball.views(n), v, atol=1e-7)
    assert np.allclose(ball.positions(n), (x, y), atol=1e-5 * radius)


@pytest.mark.parametrize(
    ("material", "ball"),
    [
        ("textured", Ball(60.37, 57.81, 48.6)),
        ("glossy", Ball(61.0, 55.5, 51.25, 9.0)),
    ],
)
def test_a_noisy_ball_is_found_to_a_tenth_of_a_pixel(material: str, ball: Ball) -> None:
    rig = Rig(size=(124, 116), ball=ball, bits=8, full_well=5000, read_noise=10, backdrop=0.01)
    shots = shoot(library()[material], row().some([0, 3, 8, 11]), rig, 3)
    found = find_ball(shots.pictures, ball.distance)
    assert abs(found.ball.x - ball.x) < 0.1
    assert abs(found.ball.y - ball.y) < 0.15
    assert abs(found.ball.radius - ball.radius) < 0.15


def test_a_ball_that_fills_the_picture_is_found() -> None:
    ball = Ball(60.4, 58.7, 56.0)
    shots = shoot(library()["textured"], row().some([0, 4, 8, 11]), Rig(size=(121, 118), ball=ball), 3)
    found = find_ball(shots.pictures).ball
    assert abs(found.x - ball.x) + abs(found.y - ball.y) + abs(found.radius - ball.radius) < 0.3


@pytest.mark.parametrize("what", ["nothing", "a corner", "a square"])
def test_no_ball_is_no_ball(what: str) -> None:
    pictures = np.zeros((1, 90, 120, 3), np.float32)
    if what == "a corner":
        pictures[:, :4, :4] = 1
    if what == "a square":
        pictures[:, 20:70, 10:110] = 1
    with pytest.raises(InputError, match="no ball"):
        find_ball(pictures)


def test_a_map_shows_each_slope_where_it_is() -> None:
    ball = Ball(100.2, 99.1, 80.0)
    x, y = np.meshgrid(np.arange(200) + 0.5, np.arange(200) + 0.5)
    n, _, inside = ball.normals(x, y)
    pictures = np.where(inside[..., None], n, 0).astype(np.float32)[None]
    clipped = np.zeros((1, 200, 200), np.bool_)
    clipped[0, 99, 100] = True
    samples = reflectance_maps(pictures, clipped, ball, row().some([0]), 64)
    assert np.abs(samples.values[0] - slopes(64)).max() < 2e-3
    assert 1 <= np.count_nonzero(~samples.usable) <= 9
    assert not samples.usable[0, 31:33, 31:33].all()


@pytest.mark.parametrize("backdrop", [0.12, 0.5])
def test_a_ball_before_something_that_is_not_dark(backdrop: float) -> None:
    rig = Rig(size=(150, 140), ball=Ball(76.3, 68.6, 55.0), backdrop=backdrop)
    shots = shoot(library()["textured"], row(), rig)
    uneven = np.linspace(1.2, 0.8, 150, dtype=np.float32)[None, None, :, None]
    behind = shots.pictures == np.float32(backdrop)
    pictures = np.where(behind, shots.pictures * uneven, shots.pictures)
    found = find_ball(pictures).ball
    assert max(abs(found.x - 76.3), abs(found.y - 68.6), abs(found.radius - 55)) < 0.4


def test_a_mask_says_where_the_ball_is() -> None:
    y, x = np.mgrid[:90, :100] + 0.5
    disc = np.hypot(x - 51.2, y - 44.1) < 33.3
    found = find_ball(np.random.default_rng(1).random((2, 90, 100, 3)).astype(np.float32), mask=disc).ball
    assert max(abs(found.x - 51.2), abs(found.y - 44.1), abs(found.radius - 33.3)) < 0.1
