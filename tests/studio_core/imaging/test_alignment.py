"""Hand-held exposures of made-up rooms: motions against the truth, refusals where nothing is to be seen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio.bench.phone import Phone, Shots, shoot
from studio_core.capturing.artifacts import Motion
from studio_core.errors import Cancelled
from studio_core.imaging.alignment import align_frames
from studio_core.imaging.projection import Circle, Lens, pixel_points
from studio_core.imaging.warping import moved_points
from studio_core.shading.job import Job

SIZE = (360, 270)
Pixels = npt.NDArray[np.uint8]


def scene(points: npt.NDArray[np.float64], seed: int = 0) -> npt.NDArray[np.float64]:
    """Light of a wall with soft-edged pictures on it, at points (..., 2) of a plane."""
    rng = np.random.default_rng(seed)
    light = np.full(points.shape[:-1], 0.2)
    x, y = points[..., 0], points[..., 1]
    for _ in range(60):
        cx, cy = rng.uniform(-40, 400, 2)
        w, h = rng.uniform(5, 50, 2)
        edge = 1 / (1 + np.exp(np.clip((np.maximum(np.abs(x - cx) - w, np.abs(y - cy) - h)) / 0.7, -50, 50)))
        light = light * (1 - edge) + edge * rng.uniform(0.01, 1.0) * rng.choice([1, 1, 1, 8])
    return light * (1 + 0.1 * np.sin(x / 5) * np.sin(y / 7))


def photographed(
    light: npt.NDArray[np.float64], ev: float, seed: int, top: int = 255
) -> npt.NDArray[np.generic]:
    """(H, W, 3) numbers of a noisy sensor behind a power curve."""
    rng = np.random.default_rng(seed)
    exposure = np.repeat(light[..., None] * 2.0**ev, 3, axis=-1)
    noisy = exposure + rng.normal(0, 1, exposure.shape) * np.sqrt(exposure / 4000 + 1e-6)
    encoded = np.clip(noisy, 0, 1) ** (1 / 2.2)
    return np.rint(encoded * top).astype(np.uint8 if top == 255 else np.uint16)


def moved_scene(motion: Motion, seed: int = 0) -> npt.NDArray[np.float64]:
    """What a frame that is moved so against the reference shows."""
    points = pixel_points(SIZE[1], SIZE[0])
    centre = np.array(SIZE) / 2
    c, s = math.cos(math.radians(motion.degrees)), math.sin(math.radians(motion.degrees))
    back = (points - centre - np.array([motion.dx, motion.dy])) @ np.array([[c, -s], [s, c]]) + centre
    return scene(back, seed)


def furthest(found: Motion, truth: Motion, size: tuple[int, int] = SIZE) -> float:
    """Largest distance, pixels, between where both put points of the picture."""
    points = pixel_points(size[1], size[0])[::9, ::9]
    apart = moved_points(points, found, size) - moved_points(points, truth, size)
    return float(np.linalg.norm(apart, axis=-1).max())


HANDS = (
    Motion(7.3, -4.6, 1.2),
    Motion(-11.8, 9.1, -0.7),
    Motion(),
    Motion(20.4, 6.5, 0.4),
    Motion(-3.2, -17.7, 2),
)


@pytest.mark.parametrize("seed", [0, 1])
def test_five_exposures_are_aligned_to_a_tenth_of_a_pixel(seed: int) -> None:
    evs = (-5, -2.5, 0, 1.5, 2)
    frames = [
        photographed(moved_scene(m, seed), ev, i) for i, (m, ev) in enumerate(zip(HANDS, evs, strict=True))
    ]
    found = align_frames(frames)
    assert found[2] == Motion()
    for motion, truth, ev in zip(found, HANDS, evs, strict=True):
        assert motion.trusted
        assert furthest(motion, truth) < (
            0.5 if ev == 3 else 0.15
        )  # two pictures are left that are not white


@given(st.floats(-12, 12), st.floats(-12, 12), st.floats(-2, 2))
@settings(max_examples=6)
def test_any_small_motion_is_found(dx: float, dy: float, degrees: float) -> None:
    truth = Motion(dx, dy, degrees)
    found = align_frames([photographed(moved_scene(truth), -1, 1), photographed(scene(_rest()), 1, 2)])[0]
    assert found.trusted
    assert furthest(found, truth) < 0.12


def _rest() -> npt.NDArray[np.float64]:
    return pixel_points(SIZE[1], SIZE[0])


def test_enhanced_correlation_of_opencv_says_the_same() -> None:
    import cv2

    truth = Motion(6.2, -3.7, 0.9)
    first, second = photographed(scene(_rest()), 0, 1), photographed(moved_scene(truth), 0, 2)
    found = align_frames([first, second], reference=0)[1]
    start = np.eye(2, 3, dtype=np.float32)
    steps = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-7)
    _, warp = cv2.findTransformECC(
        first[..., 1], second[..., 1], start, cv2.MOTION_EUCLIDEAN, steps, np.ones(SIZE[::-1], np.uint8), 5
    )
    assert found.degrees == pytest.approx(math.degrees(math.atan2(warp[1, 0], warp[0, 0])), abs=0.02)
    middle = np.array([SIZE[0] / 2 - 0.5, SIZE[1] / 2 - 0.5])
    shift = warp[:, :2] @ middle + warp[:, 2] - middle
    assert found.dx == pytest.approx(shift[0], abs=0.05)
    assert found.dy == pytest.approx(shift[1], abs=0.05)


def test_twice_as_large_pictures_move_twice_as_far() -> None:
    import cv2

    frames = [photographed(moved_scene(HANDS[0]), -1, 1), photographed(scene(_rest()), 1, 2)]
    large = [cv2.resize(f, None, fx=2, fy=2, interpolation=cv2.INTER_CUBIC) for f in frames]
    small, found = align_frames(frames)[0], align_frames(large)[0]
    twice = replace(small, dx=2 * small.dx, dy=2 * small.dy)
    assert furthest(found, twice, (2 * SIZE[0], 2 * SIZE[1])) < 0.1


def test_sixteen_bits_and_linear_light_align_as_bytes_do() -> None:
    for frames in (
        [photographed(moved_scene(HANDS[1]), 0, 1, 65535), photographed(scene(_rest()), 2, 2, 65535)],
        [np.repeat(m[..., None], 3, 2).astype(np.float32) for m in (moved_scene(HANDS[1]), scene(_rest()))],
    ):
        found = align_frames(frames)[0]
        assert found.trusted
        assert furthest(found, HANDS[1]) < 0.1


def test_a_person_who_walks_on_does_not_pull() -> None:
    frames = []
    for index, motion in enumerate((HANDS[0], Motion(), HANDS[1])):
        light = moved_scene(motion)
        at = 60 + 90 * index
        light[70:, at : at + 60] = 0.1 * scene(_rest(), 9)[70:, 150:210]
        frames.append(photographed(light, 2 * index - 2, index))
    found = align_frames(frames)
    for motion, truth in zip(found, (HANDS[0], Motion(), HANDS[1]), strict=True):
        assert motion.trusted
        assert furthest(motion, truth) < 0.3


def test_featureless_walls_are_refused_and_not_invented() -> None:
    frames = [photographed(np.full(SIZE[::-1], 0.2), ev, i) for i, ev in enumerate((-1, 0, 1))]
    found = align_frames(frames)
    for motion in (found[0], found[2]):
        assert not motion.trusted
        assert (motion.dx, motion.dy, motion.degrees, motion.rotation) == (0, 0, 0, (0, 0, 0))


def test_pictures_of_different_rooms_are_refused() -> None:
    found = align_frames([photographed(scene(_rest(), 3), -1, 1), photographed(scene(_rest(), 4), 1, 2)])
    assert not found[0].trusted
    assert found[0].correlation < 0.6


def test_stripes_say_nothing_along_themselves() -> None:
    x = _rest()[..., 0]
    stripes = 0.3 + 0.2 * np.sin(x / 9) + 0.1 * np.sin(x / 23)
    found = align_frames([photographed(stripes, -1, 1), photographed(stripes, 0, 2)])
    assert not found[0].trusted


def test_a_frame_that_shows_nothing_is_refused_and_the_others_are_not() -> None:
    frames = [photographed(moved_scene(m), ev, 5) for m, ev in zip(HANDS[:3], (-14, -2, 0), strict=True)]
    found = align_frames(frames, reference=2)
    assert [m.trusted for m in found] == [False, True, True]
    assert furthest(found[1], HANDS[1]) < 0.15


def test_one_frame_none_and_different_sizes() -> None:
    frame = np.zeros((20, 30, 3), np.uint8)
    assert align_frames([]) == ()
    assert align_frames([frame]) == (Motion(),)
    assert not align_frames([frame, frame])[0].trusted
    with pytest.raises(ValueError, match="size"):
        align_frames([frame, frame[1:]])


def test_it_can_be_cancelled_and_reports() -> None:
    frames = [photographed(scene(_rest()), ev, 1)[:120, :120] for ev in (-2, 0, 2)]
    told: list[tuple[int, int]] = []
    job = Job("align", on_progress=lambda j: told.append((j.done, j.total)))
    align_frames(frames, job=job)
    assert told == sorted(told)
    assert told[-1][1] == 2
    job.cancel()
    with pytest.raises(Cancelled):
        align_frames(frames, job=job)


def _map(seed: int = 0) -> npt.NDArray[np.float32]:
    """An equirectangular room of pictures and lamps on walls, (H, 2H, 3)."""
    rng = np.random.default_rng(seed)
    room = np.full((384, 768, 3), 0.3, np.float32)
    for _ in range(260):
        x, y = rng.integers(768), rng.integers(384)
        w, h = rng.integers(8, 60), rng.integers(8, 50)
        light = rng.uniform(0.03, 0.9) * rng.uniform(0.7, 1.3, 3) * (30 if rng.random() < 0.04 else 1)
        room[y : y + h, x : x + w] = light
    return room


def _shaken(seed: int, **changes: object) -> Shots:
    phone = Phone(
        size=(420, 330),
        lens=Lens(fov=196.0),
        circle=Circle(214.3, 162.8, 148.0),
        shake=1.0,
        jpeg=92,
        glare=0.003,
    )
    return shoot(_map(seed), replace(phone, **changes), seed)  # type: ignore[arg-type]


def _apart(found: Motion, truth: Motion, guess: Lens) -> npt.NDArray[np.float64]:
    """Distances, pixels, inside nine tenths of the phone's circle."""
    size, circle = (420, 330), Circle(214.3, 162.8, 148.0)
    points = pixel_points(size[1], size[0])[::5, ::5].reshape(-1, 2)
    points = points[np.hypot(*(points - np.array([circle.x, circle.y])).T) < 0.9 * circle.radius]
    there = moved_points(points, found, size, circle, guess)
    return np.asarray(
        np.linalg.norm(there - moved_points(points, truth, size, circle, Lens(fov=196.0)), axis=-1)
    )


@pytest.mark.parametrize("seed", [1, 2])
def test_turns_behind_a_fisheye_are_found_with_a_lens_that_is_only_guessed(seed: int) -> None:
    shots = _shaken(seed)
    circle, guess = shots.truth.front.circle, Lens(fov=190.0)
    found = align_frames([p.pixels for p in shots.front], None, circle, guess)
    assert all(m.trusted for m in found)
    for motion, truth in zip(found, shots.truth.front.motions, strict=True):
        assert np.median(_apart(motion, truth, guess)) < 0.1
        assert _apart(motion, truth, guess).max() < 0.5


def test_a_turn_in_space_is_better_than_one_in_the_plane() -> None:
    shots = _shaken(3)
    frames, circle, lens = [p.pixels for p in shots.front], shots.truth.front.circle, Lens(fov=196.0)
    left, top = int(circle.x - circle.radius * 0.7), int(circle.y - circle.radius * 0.7)
    side = int(circle.radius * 1.4)
    flat = align_frames([f[top : top + side, left : left + side] for f in frames])
    found = align_frames(frames, None, circle, lens)
    for index in (0, 2):
        truth = shots.truth.front.motions[index]
        in_space = np.median(_apart(found[index], truth, lens))
        in_plane = np.median(_apart(flat[index], truth, lens))
        assert in_space < 0.1 * in_plane


def test_a_walker_and_white_that_drifts_do_not_mislead_behind_a_fisheye() -> None:
    shots = _shaken(4, mover=9.0, white_drift=0.05, evs=(-3.5, 0.0, 2.0))
    lens = Lens(fov=196.0)
    found = align_frames([p.pixels for p in shots.front], None, shots.truth.front.circle, lens)
    for motion, truth in zip(found, shots.truth.front.motions, strict=True):
        assert motion.trusted
        assert np.median(_apart(motion, truth, lens)) < 0.25
