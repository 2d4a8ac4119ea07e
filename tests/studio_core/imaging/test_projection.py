"""Fisheye lenses: every model against its formula, the way there and back, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import fisheye

from studio_core.imaging.projection import (
    EQUIDISTANT,
    EQUISOLID,
    KANNALA_BRANDT,
    OCAM,
    ORTHOGRAPHIC,
    STEREOGRAPHIC,
    Circle,
    Lens,
    pixel_points,
    project,
    unproject,
)

POLYNOMIAL = (-0.5901, 0.0, 0.5877, -0.2408, 0.2957)  # of a real lens, about 186° across
AFFINE = (1.0003, -0.0003, -0.0009)
LENSES = (
    Lens(EQUIDISTANT, 190),
    Lens(EQUIDISTANT, 230),
    Lens(EQUISOLID, 200),
    Lens(STEREOGRAPHIC, 210),
    Lens(ORTHOGRAPHIC, 170),
    Lens(KANNALA_BRANDT, 195, (-0.02, 0.003, -0.0002, 0.0)),
    Lens(OCAM, 186, POLYNOMIAL, AFFINE),
)
fovs = st.floats(100, 240)
circles = st.builds(Circle, st.floats(-50, 4000), st.floats(-50, 4000), st.floats(20, 3000))


@st.composite
def lenses(draw: st.DrawFn) -> Lens:
    model = draw(st.sampled_from((EQUIDISTANT, EQUISOLID, STEREOGRAPHIC, ORTHOGRAPHIC, KANNALA_BRANDT, OCAM)))
    if model == OCAM:
        return Lens(OCAM, draw(st.floats(120, 186)), POLYNOMIAL, AFFINE)
    if model == KANNALA_BRANDT:
        return Lens(model, draw(fovs), (draw(st.floats(-0.03, 0.05)), draw(st.floats(0, 0.01))))
    return Lens(model, draw(st.floats(100, 170)) if model == ORTHOGRAPHIC else draw(fovs))


def direction(theta: float, azimuth: float) -> np.ndarray:
    return np.array(
        [math.sin(theta) * math.cos(azimuth), math.sin(theta) * math.sin(azimuth), -math.cos(theta)]
    )


@pytest.mark.parametrize("lens", LENSES[:-1], ids=lambda lens: f"{lens.model} {lens.fov:g}")
def test_points_lie_where_the_formula_says(lens: Lens) -> None:
    circle = Circle(700.5, 651.25, 600)
    for theta in np.linspace(0, lens.half, 23):
        for azimuth in (0.0, 0.7, math.pi / 2, 4.0):
            reach = 600 * fisheye.radius(lens.model, theta, lens.half, lens.coefficients)
            wanted = (700.5 + reach * math.cos(azimuth), 651.25 - reach * math.sin(azimuth))
            points, seen = project(lens, circle, 3.0 * direction(theta, azimuth))
            assert points == pytest.approx(wanted, abs=1e-3)
            assert seen


@given(lenses(), circles, st.floats(0, 0.999), st.floats(0, 2 * math.pi))
def test_there_and_back(lens: Lens, circle: Circle, share: float, azimuth: float) -> None:
    there = direction(share * lens.half, azimuth)
    points, seen = project(lens, circle, there)
    back, inside = unproject(lens, circle, points)
    assert seen
    assert inside
    assert np.linalg.norm(back) == pytest.approx(1, abs=2e-6)
    assert np.degrees(np.arccos(min(1.0, there @ back))) < 0.01


@given(lenses(), circles, st.floats(0, 0.999), st.floats(0, 2 * math.pi))
def test_back_and_there(lens: Lens, circle: Circle, share: float, azimuth: float) -> None:
    reach = share * circle.radius * float(lens.radius_of(lens.half))
    point = np.array([circle.x + reach * math.cos(azimuth), circle.y + reach * math.sin(azimuth)])
    back, _ = unproject(lens, circle, point)
    again, _ = project(lens, circle, back)
    assert np.abs(again - point).max() < 2e-5 * circle.radius


@given(lenses(), st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=2))
def test_every_point_has_a_finite_direction(lens: Lens, point: list[float]) -> None:
    found, _ = unproject(lens, Circle(10, 10, 5), np.array(point))
    assert np.isfinite(found).all()


@given(lenses(), st.lists(st.floats(-1e3, 1e3), min_size=3, max_size=3))
def test_every_direction_has_a_finite_point(lens: Lens, there: list[float]) -> None:
    points, _ = project(lens, Circle(10, 10, 5), np.array(there))
    assert np.isfinite(points).all()


def test_right_is_right_and_up_is_up() -> None:
    lens, circle = Lens(EQUIDISTANT, 180), Circle(100, 100, 90)
    points, seen = project(lens, circle, np.array([[0, 0, -1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 0]]))
    assert points[:3] == pytest.approx(np.array([[100, 100], [190, 100], [100, 10]]), abs=1e-4)
    assert seen.tolist() == [True, True, True, False, False]


def test_slanted_pictures_keep_their_shape() -> None:
    lens, circle = Lens(OCAM, 186, POLYNOMIAL, (1.1, 0.02, -0.03)), Circle(100, 90, 80)
    points = pixel_points(180, 200)[::17, ::19]
    directions, _ = unproject(lens, circle, points)
    assert directions.shape == (11, 11, 3)
    inside = np.hypot(points[..., 0] - 100, points[..., 1] - 90) < 70
    again, _ = project(lens, circle, directions)
    assert again[inside] == pytest.approx(points[inside], abs=1e-3)


def test_what_is_seen_ends_at_the_circle() -> None:
    for lens in LENSES:
        edge = float(lens.radius_of(lens.half)) * 500
        plain = Lens(lens.model, lens.fov, lens.coefficients)
        points = np.array([[500 + edge - 0.1, 500], [500 + edge + 0.1, 500], [500 - edge * 1.9, 500]])
        assert unproject(plain, Circle(500, 500, 500), points)[1].tolist() == [True, False, False]
        theta = np.array([lens.half - 1e-4, lens.half + 1e-3])
        ways = np.stack([np.sin(theta), 0 * theta, -np.cos(theta)], axis=-1)
        assert project(plain, Circle(500, 500, 500), ways)[1].tolist() == [True, False]


def test_opencv_draws_a_kannala_brandt_lens_alike() -> None:
    cv2 = pytest.importorskip("cv2")
    k = (-0.02, 0.004, -0.0005, 0.00002)
    lens, circle = Lens(KANNALA_BRANDT, 160, k), Circle(640, 480, 470)
    focal = 470 / fisheye.radius(KANNALA_BRANDT, lens.half, 1.0, k) / (1 + sum(k))
    rng = np.random.default_rng(3)
    there = rng.normal(size=(50, 3))
    there[:, 2] = -np.abs(there[:, 2]) - 0.5
    matrix = np.array([[focal, 0, 640], [0, focal, 480], [0, 0, 1.0]])
    turned = there * (1, -1, -1)  # its cameras look along +z with y down
    fisheyes = cv2.fisheye.projectPoints(
        turned[:, None], np.zeros(3), np.zeros(3), matrix, np.array(k, np.float64)
    )
    assert project(lens, circle, there)[0] == pytest.approx(fisheyes[0].reshape(-1, 2), abs=1e-3)


@pytest.mark.parametrize(
    ("model", "fov", "coefficients"),
    [
        ("cylindrical", 190, ()),
        (EQUIDISTANT, 5, ()),
        (EQUIDISTANT, 320, ()),
        (OCAM, 190, ()),
        (KANNALA_BRANDT, 190, (math.nan,)),
        (KANNALA_BRANDT, 190, (-0.5,)),
    ],
)
def test_impossible_lenses_are_refused(model: str, fov: float, coefficients: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        Lens(model, fov, coefficients)
