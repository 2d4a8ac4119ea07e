"""The preview's geometry, halves and tools, against slow and obvious versions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PySide6.QtCore import QPointF, Qt
from pytestqt.qtbot import QtBot

from studio_core.capturing.settings import Patch
from studio_core.capturing.standing import user_turn
from studio_core.imaging.latlong import direction_to_uv, equirect_direction
from studio_core.imaging.projection import KANNALA_BRANDT, Circle, Lens
from studio_ui.capture.preview import picture_view
from studio_ui.capture.preview.histogram import histogram
from studio_ui.capture.preview.picture import Mark, Shown
from studio_ui.capture.preview.picture_view import PictureView
from studio_ui.capture.preview.pyramid import Pyramid, halved
from studio_ui.capture.preview.sight import LARGEST, Part, Sight, fitted, part_seen
from studio_ui.capture.preview.tone import displayed, natural_exposure
from studio_ui.capture.preview.turned import turned
from studio_ui.capture.tools.ring import LEAST, at_ring, dragged, drawn, grip_at, inside, ring_points
from studio_ui.capture.turning import between

sizes = st.tuples(st.integers(50, 3000), st.integers(50, 3000))
shares = st.floats(0, 1)
degrees = st.floats(-180, 180)


@given(sizes, sizes, shares, shares, st.floats(0.2, 5))
def test_zooming_keeps_what_is_under_the_cursor(size, picture, x, y, factor) -> None:
    sight = fitted(size, picture)
    at = x * size[0], y * size[1]
    near = sight.zoomed(factor, at, size, picture)
    before, after = sight.to_picture(*at, size), near.to_picture(*at, size)
    over = all(0 <= p <= s for p, s in zip(before, picture, strict=True))
    if over and factor >= 1 and near.scale < LARGEST:  # further away the picture is kept from getting lost
        assert after == pytest.approx(before, abs=1e-6 * max(picture))
    assert near.to_widget(*after, size) == pytest.approx(at, abs=1e-6 * max(size))


@given(sizes, sizes, st.floats(-1e5, 1e5), st.floats(-1e5, 1e5))
def test_a_picture_is_never_lost(size, picture, dx, dy) -> None:
    moved = fitted(size, picture).moved(dx, dy, size, picture)
    left, top = moved.to_widget(0, 0, size)
    right, bottom = moved.to_widget(*picture, size)
    assert left < size[0]
    assert top < size[1]
    assert right > 0
    assert bottom > 0


@given(sizes, sizes, st.floats(-3, 2), shares, shares, st.sampled_from([1.0, 1.5, 2.0]))
def test_all_that_is_seen_is_shown_and_little_else(size, picture, zoom, x, y, ratio) -> None:
    scale = fitted(size, picture).scale * 10**zoom
    sight = Sight(x * picture[0], y * picture[1], scale)
    part = part_seen(sight, size, picture, ratio)
    assert part is not None  # its middle lies in the picture
    step = 1 << part.level
    x0, y0 = sight.to_picture(0, 0, size)
    x1, y1 = sight.to_picture(*size, size)
    assert part.left * step <= max(x0, 0)
    assert part.top * step <= max(y0, 0)
    assert min(part.right * step, picture[0] // step * step) >= min(x1, picture[0]) - 2 * step
    assert min(part.bottom * step, picture[1] // step * step) >= min(y1, picture[1]) - 2 * step
    if part.level:
        assert scale * ratio * step <= 1  # a sample for every pixel of the display
    shown = (part.right - part.left) * (part.bottom - part.top)
    assert shown <= (2 * ratio * size[0] + 130) * (2 * ratio * size[1] + 130)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_halves_are_means(dtype) -> None:
    rng = np.random.default_rng(1)
    pixels = (rng.random((51, 70, 3)) * 200).astype(dtype)
    pyramid = Pyramid(pixels)
    part = Part(1, 3, 2, 20, 11)
    assert np.array_equal(pyramid.part(part), pixels[4:22:2, 6:40:2])  # until the halves are made
    expected = pixels[4:22, 6:40].reshape(9, 2, 17, 2, 3).mean(axis=(1, 3))
    assert np.allclose(halved(pixels)[2:11, 3:20], expected, atol=0.51 if dtype != np.float32 else 1e-4)


def test_a_lamp_of_one_pixel_stays_marked() -> None:
    mask = np.zeros((700, 900), bool)
    mask[333, 777] = True
    pyramid = Pyramid(mask)
    pyramid.build()
    assert pyramid.complete
    for level in range(3):
        found = pyramid.part(Part(level, 0, 0, 900 >> level, 700 >> level))
        assert found.shape == (700 >> level, 900 >> level)
        assert found.sum() == 1


def test_natural_exposure_brings_light_to_the_middle() -> None:
    light = np.random.default_rng(2).lognormal(5, 1, (200, 300, 3)).astype(np.float32)
    light[:, :60] = 0
    shown = displayed(light, natural_exposure(light))
    assert 90 < np.median(shown[:, 60:]) < 150
    assert natural_exposure(np.zeros((9, 9, 3), np.float32)) == 0


def test_the_histogram_counts_every_pixel_once() -> None:
    light = np.random.default_rng(3).lognormal(0, 2, (90, 70, 3)).astype(np.float32)
    light[:9] = 0
    found = histogram(light)
    assert found.counts.sum(axis=1) == pytest.approx([0.9] * 3)
    assert found.black == pytest.approx(0.1)


# turning


@given(st.floats(0.01, 0.99), st.floats(0.02, 0.98), st.floats(0.01, 0.99), st.floats(0.02, 0.98))
def test_what_is_dragged_comes_to_the_hand(u0, v0, u1, v1) -> None:
    turn = between((u0, v0), (u1, v1), level=False)
    assert np.allclose(turn @ equirect_direction(u0, v0), equirect_direction(u1, v1), atol=1e-9)
    level = between((u0, v0), (u1, v1), level=True)
    assert np.allclose(level @ (0, 1, 0), (0, 1, 0), atol=1e-12)


def test_a_turned_picture_is_that_of_turned_directions() -> None:
    pixels = np.random.default_rng(4).random((60, 120, 3)).astype(np.float32)
    rotation = user_turn(20, 10, 40)
    u, v = (np.arange(13) + 0.5) / 13, (np.arange(7) + 0.5) / 7
    shown = turned(pixels, rotation, u, v)
    for i, v_ in enumerate(v):
        for j, u_ in enumerate(u):
            from_u, from_v = direction_to_uv(rotation.T @ equirect_direction(u_, v_))
            assert np.array_equal(shown[i, j], pixels[int(from_v * 60), int(from_u * 120) % 120])


# the ring

lenses = st.sampled_from([Lens(), Lens("equisolid", 200.0), Lens(KANNALA_BRANDT, 185.0, (0.02,))])
patches = st.builds(
    lambda a, w, i, d: Patch("front", a, w, i, i + d),
    st.floats(0, 359.9),
    st.floats(LEAST, 200),
    st.floats(60, 80),
    st.floats(LEAST, 12),
)


@given(lenses, st.floats(0, 359.9), st.floats(5, 92))
def test_places_of_the_ring_and_back(lens, azimuth, theta) -> None:
    circle = Circle(310.0, 244.0, 190.0)
    x, y = ring_points(lens, circle, azimuth, theta)
    found = at_ring(lens, circle, float(x), float(y))
    assert math.cos(math.radians(found[0] - azimuth)) == pytest.approx(1, abs=1e-6)
    assert found[1] == pytest.approx(theta, abs=0.01)


def test_right_is_right_and_up_is_up() -> None:
    circle = Circle(100.0, 100.0, 80.0)
    right, up = (ring_points(Lens(), circle, azimuth, 60.0) for azimuth in (0.0, 90.0))
    assert right[0] > 140
    assert right[1] == pytest.approx(100)
    assert up[1] < 60
    assert up[0] == pytest.approx(100)


@given(
    patches,
    st.sampled_from(["start", "end", "inner", "outer", "body"]),
    st.floats(-170, 170),
    st.floats(-60, 60),
)
def test_rectangles_stay_rectangles(patch, grip, azimuth, theta) -> None:
    made = dragged(patch, grip, azimuth, theta, 95.0)
    assert 0 <= made.azimuth < 360 or made.azimuth == pytest.approx(360)
    assert LEAST - 1e-9 <= made.width <= 360 + 1e-9
    assert -1e-9 <= made.inner <= made.outer - LEAST + 1e-9
    assert made.outer <= 95 + 1e-9
    if grip == "body":
        assert made.width == patch.width
        assert made.outer - made.inner == pytest.approx(patch.outer - patch.inner)
    if grip == "start":
        end = (made.azimuth + made.width) % 360
        assert math.cos(math.radians(end - patch.azimuth - patch.width)) == pytest.approx(1, abs=1e-6)


@given(st.floats(0, 359.9), st.floats(-120, 120), st.floats(60, 94), st.floats(60, 94))
def test_a_drawn_rectangle_holds_both_corners(azimuth, turn, one, other) -> None:
    start, end = (azimuth, one), ((azimuth + turn) % 360, other)
    made = drawn("back", start, end, 95.0)
    assert made.side == "back"
    for place in (start, end):
        assert inside(made, *place, margin=1e-6)


def test_grips_are_found_where_they_are_seen() -> None:
    patch = Patch("front", 350.0, 30.0, 80.0, 95.0)
    assert grip_at(patch, 349.5, 88.0, 1.0, 0.5) == "start"
    assert grip_at(patch, 20.5, 88.0, 1.0, 0.5) == "end"
    assert grip_at(patch, 5.0, 80.2, 1.0, 0.5) == "inner"
    assert grip_at(patch, 5.0, 95.2, 1.0, 0.5) == "outer"
    assert grip_at(patch, 5.0, 88.0, 1.0, 0.5) == "body"
    assert grip_at(patch, 45.0, 88.0, 1.0, 0.5) == ""


# the widget


class Elsewhere:
    """Work that waits until it is asked for."""

    def __init__(self) -> None:
        self.waiting: list = []

    def __call__(self, work, done) -> None:
        self.waiting.append((work, done))

    def go(self) -> None:
        waiting, self.waiting = self.waiting, []
        for work, done in waiting:
            work()
            done()


def test_only_what_is_seen_is_made_for_the_screen(qtbot: QtBot, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    real = picture_view.displayed

    def counted(pixels, exposure):
        made.append(pixels.shape[0] * pixels.shape[1])
        return real(pixels, exposure)

    monkeypatch.setattr(picture_view, "displayed", counted)
    elsewhere = Elsewhere()
    view = PictureView(elsewhere)
    qtbot.addWidget(view)
    view.resize(400, 240)
    view.show()
    pixels = np.ones((1024, 2048, 3), np.float32)
    clipped = np.zeros((1024, 2048), bool)
    view.show_picture(Shown("a", "A", pixels, (Mark("Clipped", clipped, (255, 0, 0)),)))
    view.grab()  # before the halves are made
    elsewhere.go()
    view.grab()
    view.zoom(6, QPointF(100, 100))
    view.grab()
    assert made
    screen = 400 * 240 * view.devicePixelRatioF() ** 2
    assert max(made) < 5 * screen
    count = len(made)
    view.show_marks({"Clipped"})
    view.grab()
    assert len(made) == count  # nothing is made twice


def test_the_very_pixels_are_shown(qtbot: QtBot) -> None:
    view = PictureView(lambda work, done: None)
    qtbot.addWidget(view)
    view.resize(300, 200)
    view.show()
    pixels = np.random.default_rng(5).integers(0, 255, (40, 60, 3)).astype(np.uint8)
    before = 255 - pixels
    view.show_picture(Shown("a", "A", pixels, before=before))
    view.zoom(4 / view.seen.scale)
    for point, source in ((QPointF(20.5, 20.5), before), (QPointF(45.5, 20.5), pixels)):
        at = view.to_widget(point.x(), point.y()).toPoint()
        shown = view.grab().toImage().pixelColor(at * view.devicePixelRatioF())
        assert shown.getRgb()[:3] == tuple(source[20, int(point.x())])
    qtbot.keyClick(view, Qt.Key.Key_BracketLeft)
    assert view.wipe == pytest.approx(0.45)


def test_another_picture_of_the_same_kind_keeps_the_zoom(qtbot: QtBot) -> None:
    view = PictureView(lambda work, done: None)
    qtbot.addWidget(view)
    one, other = (np.zeros((50, 80, 3), np.uint8) for _ in range(2))
    view.show_picture(Shown("front", "Front", one))
    view.zoom(3)
    held = view.sight
    view.show_picture(Shown("front", "Front", other))
    assert view.sight == held
    view.show_picture(Shown("joined", "Joined", other))
    assert view.sight is None
