"""Looking through a lens: straight lines of real photographs, averaging, and what is not seen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from studio_core.capturing.artifacts import View
from studio_core.capturing.looking import camera_rays, look, perspective
from studio_core.imaging.io import read_image
from studio_core.imaging.ocam import read_ocam
from studio_core.imaging.projection import EQUIDISTANT, Circle, Lens, pixel_points, project, unproject

SIZE = 600
FLOAT = npt.NDArray[np.floating]


def turned(yaw: float) -> FLOAT:
    c, s = np.cos(np.radians(yaw)), np.sin(np.radians(yaw))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def grey(light: FLOAT) -> FLOAT:
    return np.log(light.mean(axis=2) + 0.02)


def trace(picture: FLOAT, first: tuple[int, int], last: tuple[int, int]) -> FLOAT:
    """Points (N, 2) of the strongest edge within 4 pixels of a line, to parts of a pixel."""
    import cv2

    a, b = np.array(first, float), np.array(last, float)
    along = (b - a) / np.linalg.norm(b - a)
    across = np.array([-along[1], along[0]])
    steps = np.arange(8, np.linalg.norm(b - a) - 8, 2.0)
    offsets = np.arange(-5, 5.01, 0.25)
    points = a + steps[:, None, None] * along + offsets[:, None] * across
    blurred = cv2.GaussianBlur(picture.astype(np.float32), (0, 0), 1.0)
    profile = cv2.remap(blurred, points.astype(np.float32), None, cv2.INTER_LINEAR)
    slope = np.abs(np.gradient(profile, axis=1))
    slope = np.where(slope > 0.5 * slope.max(axis=1, keepdims=True), slope, 0)
    slope *= np.exp(-0.5 * (offsets / 2) ** 2)
    place = (slope * offsets).sum(axis=1) / slope.sum(axis=1)
    found: FLOAT = a + steps[:, None] * along + place[:, None] * across + 0.5
    return found


def bend(points: FLOAT) -> float:
    """Median distance from the best line, times 1.48 (a standard deviation); pixels."""
    for _ in range(3):  # leave out what something in front of the edge hides
        middle = np.median(points, axis=0)
        _, _, axes = np.linalg.svd(points - points.mean(axis=0))
        distance = (points - middle) @ axes[1]
        distance -= np.median(distance)
        keep = np.abs(distance) <= np.percentile(np.abs(distance), 90)
        points = points[keep] if keep.sum() > 20 else points
    return 1.48 * float(np.median(np.abs(distance)))


def ocam_view(data: Path) -> View:
    folder = data / "third_party/fisheye_ocamcalib_mit/ocamcamera"
    lens, circle, _ = read_ocam(folder / "calib_results_0.txt")
    pixels = read_image(folder / "img0.jpg").pixels.astype(np.float32) / 255
    return View(pixels, np.ones(pixels.shape[:2], bool), circle, lens)


def luminance_view(data: Path) -> View:
    pixels = read_image(data / "third_party/radiance_bsd/testimage.hdr").pixels[..., :3]
    pixels = np.ascontiguousarray(pixels / np.percentile(pixels, 90), np.float32)
    return View(pixels, np.ones(pixels.shape[:2], bool), Circle(393, 393, 393), Lens(EQUIDISTANT, 182))


EDGES = (  # along walls, doors and window frames, in cuts of 100° and 600 × 600 pixels
    (ocam_view, 0, (141, 41), (159, 412)),
    (ocam_view, 0, (406, 402), (413, 68)),
    (ocam_view, -50, (171, 407), (178, 66)),
    (ocam_view, 50, (380, 67), (395, 408)),
    (luminance_view, 0, (0, 33), (284, 167)),
    (luminance_view, -50, (519, 598), (519, 1)),
    (luminance_view, 50, (79, 1), (81, 414)),
)


@pytest.mark.parametrize(("real", "yaw", "first", "last"), EDGES)
def test_straight_edges_of_real_photographs_become_straight(real, yaw, first, last, shared_data) -> None:
    view = real(shared_data)
    cut, _ = perspective(view, turned(yaw), 100, (SIZE, SIZE))
    points = trace(grey(cut), first, last)
    rays = camera_rays(100, SIZE, SIZE)
    step = rays[0, 1, 0] - rays[0, 0, 0]
    ways = np.column_stack(
        [(points[:, 0] - SIZE / 2) * step, (SIZE / 2 - points[:, 1]) * step, -np.ones(len(points))]
    )
    photographed, _ = project(view.lens, view.circle, ways @ turned(yaw).T)
    assert bend(points) < 0.4
    assert bend(photographed) > 6 * bend(points)


def test_a_flat_picture_is_seen_where_pinholes_see_it() -> None:
    lens, circle = Lens(EQUIDISTANT, 190), Circle(200.5, 199, 190)
    ways, seen = unproject(lens, circle, pixel_points(400, 400))
    light = np.where(seen[..., None], 2 + ways, 0).astype(np.float32)  # linear in the direction
    view = View(light, seen, circle, lens)
    cut, there = perspective(view, np.eye(3), 80, (160, 120))
    rays = camera_rays(80, 160, 120)
    assert there.all()
    wanted = 2 + rays / np.linalg.norm(rays, axis=2, keepdims=True)
    assert np.abs(cut - wanted).max() < 2e-3
    tiny, there = perspective(view, np.eye(3), 80, (16, 12))
    rays = camera_rays(80, 16, 12)
    assert there.all()
    assert np.abs(tiny - 2 - rays / np.linalg.norm(rays, axis=2, keepdims=True)).max() < 2e-2


def test_small_cuts_average_fine_patterns() -> None:
    lens, circle = Lens(EQUIDISTANT, 180), Circle(512, 512, 512)
    pattern = np.indices((1024, 1024)).sum(axis=0) % 2
    view = View(
        np.repeat(2.0 * pattern[..., None], 3, axis=2).astype(np.float32),
        np.ones((1024, 1024), bool),
        circle,
        lens,
    )
    cut, _ = perspective(view, np.eye(3), 60, (40, 40))
    assert np.abs(cut - 1).max() < 0.15


def test_what_is_not_usable_is_not_shown() -> None:
    lens, circle = Lens(EQUIDISTANT, 180), Circle(50, 50, 50)
    usable = np.ones((100, 100), bool)
    usable[:, :50] = False
    view = View(np.ones((100, 100, 3), np.float32), usable, circle, lens)
    light, seen = look(view, np.array([[[-1.0, 0, -1], [1, 0, -1], [0.1, 0, 1]]]))
    assert seen.tolist() == [[False, True, False]]
    assert light[0, :, 0].tolist() == [0, 1, 0]


@pytest.mark.parametrize("fov", [0, 180, 250])
def test_no_flat_picture_shows_everything(fov: float) -> None:
    with pytest.raises(ValueError, match="flat picture"):
        camera_rays(fov, 10, 10)
