"""Levelling: rooms are found level from their edges, and what has no upright edges is left alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from stitch_support import HALF_TURN, lens_view, smooth_sky, sphere, turn

from studio_core.capturing.artifacts import View
from studio_core.capturing.settings import StitchSettings
from studio_core.imaging.environment import load_environment
from studio_core.imaging.projection import Circle, Lens
from studio_core.shading.job import Job
from studio_plugins.capture.level import find_level, great_circles, vertical
from studio_plugins.capture.stitch import level_of, stitch, stitch_equirectangular, turned


def angle(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b)))


def striped(directions: np.ndarray) -> np.ndarray:
    """A room of boards: its walls change with the azimuth alone; ceiling and floor are plain."""
    d = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    azimuth = np.degrees(np.arctan2(d[..., 0], d[..., 2]))
    board = 0.3 + 0.7 * ((np.floor(azimuth / 12) * 5) % 7) / 6
    wall = np.abs(d[..., 1]) < 0.5
    return np.repeat(np.where(wall, board, 0.6)[..., None], 3, axis=-1).astype(np.float32)


@given(st.floats(0, 20), st.floats(0, 360))
@settings(max_examples=6)
def test_boards_are_set_upright(tilt: float, towards: float) -> None:
    axis = (np.cos(np.radians(towards)), 0.0, np.sin(np.radians(towards)))
    rotation = turn(axis, tilt)
    picture = striped(sphere(256) @ rotation)
    found = find_level(picture, np.ones((256, 512), np.bool_))
    assert found.rotation is not None
    assert angle(found.rotation @ rotation @ [0, 1, 0], np.array([0.0, 1, 0])) < 0.5
    assert found.tilt == pytest.approx(tilt, abs=0.5)
    np.testing.assert_allclose(found.rotation @ found.rotation.T, np.eye(3), atol=1e-12)
    assert "upright edges" in found.told


@given(st.integers(0, 2**32 - 1), st.integers(0, 400), st.floats(0, 25), st.floats(0, 6.28))
@settings(max_examples=30)
def test_uprights_are_found_among_other_edges(seed: int, others: int, tilt: float, towards: float) -> None:
    """80 upright edges with errors of a third of a degree, among edges in all directions."""
    rng = np.random.default_rng(seed)
    up = turn((np.cos(towards), 0, np.sin(towards)), tilt) @ [0, 1, 0]
    across = rng.normal(size=(80, 3))
    walls = np.cross(across, up)
    walls = walls / np.linalg.norm(walls, axis=1, keepdims=True) + rng.normal(0, 0.005, (80, 3))
    normals = np.concatenate([walls, rng.normal(size=(others, 3))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    found = vertical(normals, rng.uniform(0.05, 0.4, len(normals)))
    if others > 200 and found.rotation is None:
        return  # among so many it may refuse, but is never wrong
    assert found.rotation is not None
    assert angle(found.rotation @ up, np.array([0.0, 1, 0])) < 0.5
    assert found.uncertainty < 0.5


@given(st.integers(0, 2**32 - 1), st.integers(0, 800))
@settings(max_examples=30)
def test_edges_in_all_directions_have_no_vertical(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(count, 3))
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    found = vertical(normals, rng.uniform(0.05, 0.4, count))
    assert found.rotation is None
    assert "left as it is" in found.told


def test_one_wall_alone_does_not_tell_both_tilts() -> None:
    """Edges that are all seen in one direction are one great circle: it has no second coordinate."""
    rng = np.random.default_rng(0)
    normals = np.array([1.0, 0, 0]) + rng.normal(0, 0.003, (60, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert vertical(normals, np.full(60, 0.3)).rotation is None


def test_a_plain_sky_and_noise_are_left_alone() -> None:
    seen = np.ones((128, 256), np.bool_)
    noise = np.random.default_rng(0).random((128, 256, 3)).astype(np.float32)
    for picture in (smooth_sky(sphere(128)), noise, np.zeros((128, 256, 3), np.float32)):
        assert find_level(picture, seen).rotation is None
    assert find_level(noise, ~seen).rotation is None


def test_edges_of_what_was_not_seen_do_not_count() -> None:
    seen = np.ones((256, 512), np.bool_)
    seen[:, ::64] = seen[:, 1::64] = False
    picture = np.where(seen[..., None], smooth_sky(sphere(256)), np.float32(0))
    normals, _ = great_circles(picture, seen)
    assert len(normals) < 8


def test_a_stitched_room_is_levelled_and_what_is_turned_by_hand_comes_on_top() -> None:
    rotation = turn((1, 0, 0.4), 9.0)

    def sky(directions: np.ndarray) -> np.ndarray:
        return striped(directions @ rotation)

    views = {"front": lens_view(sky, Lens(fov=190.0), HALF_TURN, 400)}
    made = stitch(views, None, StitchSettings(width=512), Job("x"))
    assert made.levelled == pytest.approx(9.0, abs=0.6)
    up = made.upright @ HALF_TURN @ rotation @ [0, 1, 0]
    assert angle(up, np.array([0.0, 1, 0])) < 0.6
    by_hand = stitch(views, None, StitchSettings(width=512, pitch=10.0, roll=5.0), Job("x"))
    np.testing.assert_allclose(
        by_hand.upright, turned(StitchSettings(pitch=10, roll=5)) @ made.upright, atol=1e-9
    )
    known = level_of(views, None, Job("x"))
    again = stitch(views, None, StitchSettings(width=512), Job("x"), upright=known)
    np.testing.assert_array_equal(again.light, made.light)
    left = stitch(
        {"front": lens_view(smooth_sky, Lens(), HALF_TURN)}, None, StitchSettings(width=128), Job("x")
    )
    assert left.levelled is None
    np.testing.assert_array_equal(left.upright, HALF_TURN)
    assert "left as it is" in left.notes[0]


@pytest.mark.parametrize(
    ("name", "limit"), [("interior", 0.3), ("studio", 0.6), ("courtyard", 0.9), ("sunset", None)]
)
def test_rooms_tilted_by_fifteen_degrees(shared_data: Path, name: str, limit: float | None) -> None:
    """The maps' own up is taken for true, though it may be off itself by half a degree."""
    room = load_environment(shared_data / "cc0" / "hdri_polyhaven_cc0" / f"{name}.exr")[0].pixels
    whole = View(room, np.ones(room.shape[:2], np.bool_), Circle(1, 1, 1), Lens())
    for pitch, roll in ((15.0, 0.0), (-9.0, -12.0)):
        tilt = StitchSettings(width=1024, pitch=pitch, roll=roll, level=False)
        tilted = stitch_equirectangular(whole, tilt, Job("x"))
        found = find_level(tilted.light, ~tilted.unseen)
        if limit is None:
            assert found.rotation is None
        else:
            assert found.rotation is not None
            assert angle(found.rotation @ turned(tilt) @ [0, 1, 0], np.array([0.0, 1, 0])) < limit
