"""Shapes, sky and light of the sample projects against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import solids

from sample_projects.modelling import equirect, mesh, radiosity, shapes, sky
from sample_projects.modelling.landscape import Landscape

LUMA = np.array([0.2126, 0.7152, 0.0722])
lengths = st.floats(0.05, 2.0)


def uses_of_edges(made: mesh.Mesh) -> set[int]:
    return solids.uses_of_edges(made.positions, made.faces)


def volume(made: mesh.Mesh) -> float:
    return solids.volume(made.positions, made.faces)


def agreement(made: mesh.Mesh) -> float:
    """Least cosine between a face's normal and the mean of its corners'."""
    flat = mesh.unit(mesh.face_normals(made.positions, made.faces))
    return float(np.einsum("ij,ij->i", flat, mesh.unit(made.normals[made.faces].sum(axis=1))).min())


@given(lengths, lengths, lengths, st.floats(0.05, 0.95), st.integers(1, 4), st.integers(1, 3))
@settings(max_examples=25, deadline=None)
def test_rounded_boxes_are_closed_and_lie_between_their_core_and_their_hull(
    width: float, height: float, depth: float, share: float, flat: int, arc: int
) -> None:
    radius = share * min(width, height, depth) / 2
    made = shapes.rounded_box((width, height, depth), radius, flat, arc)
    assert uses_of_edges(made) == {2}
    assert agreement(made) > 0.8
    hull = width * height * depth
    core = math.prod(s - 2 * radius for s in (width, height, depth))
    assert core < volume(made) < hull * (1 + 1e-9)
    assert np.abs(made.positions).max(axis=0) == pytest.approx(np.array([width, height, depth]) / 2)


def test_a_box_rounded_to_the_full_is_a_ball_with_exact_normals() -> None:
    made = shapes.rounded_box((2, 2, 2), 1.0, 1, 12)
    assert np.linalg.norm(made.positions, axis=1) == pytest.approx(1.0, abs=2e-3)
    assert np.einsum("ij,ij->i", made.normals, mesh.unit(made.positions)) == pytest.approx(1.0, abs=1e-5)
    assert volume(made) == pytest.approx(4 / 3 * math.pi, rel=0.02)


def test_bending_a_ball_to_an_ellipsoid_gives_the_ellipsoid_its_normals() -> None:
    axes = np.array([0.5, 1.0, 2.0])
    ball = shapes.rounded_box((2, 2, 2), 1.0, 1, 6)
    made = ball.bent(lambda p: p * axes)
    exact = mesh.unit(made.positions / axes**2)
    assert np.einsum("ij,ij->i", made.normals, exact).min() > 0.9999


def test_turned_swept_and_sewn_parts_are_closed_and_face_outwards() -> None:
    turned = shapes.lathe([[(0, 0), (0.5, 0)], [(0.5, 0), (0.5, 2)], [(0.5, 2), (0, 2)]], 96)
    bar = shapes.sweep(mesh.spline([(0, 0, 0), (0, 1, 0), (0.4, 1.5, 0.2)], 14), shapes.circle(9, 0.1, 0.06))
    frame = shapes.sweep(
        np.stack([a := shapes.circle(40)[:, 0], 0 * a, shapes.circle(40)[:, 1]], 1),
        shapes.rounded_rectangle(0.1, 0.06, 0.02),
        closed=True,
    )
    made = [
        turned,
        bar,
        frame,
        shapes.pillow(0.5, 0.4, 0.15),
        shapes.box((1, 2, 3)),
        shapes.leg((0, 0.5, 0), (0.1, 0, 0), 0.05, 0.03),
    ]
    for one in made:
        assert uses_of_edges(one) == {2}
        assert volume(one) > 0
        assert agreement(one) > 0.5
        assert uses_of_edges(one.mirrored()) == {2}
        assert volume(one.mirrored()) == pytest.approx(volume(one))
    assert volume(turned) == pytest.approx(math.pi * 0.25 * 2, rel=2e-3)
    assert volume(made[4]) == pytest.approx(6.0)


def test_leaves_and_planes_are_open_and_look_up() -> None:
    for one in (shapes.leaf(0.3, 0.1, 0.6, 0.3), shapes.plane(3, 2, (3, 2))):
        assert 1 in uses_of_edges(one)
        assert mesh.face_normals(one.positions, one.faces)[:, 1].min() > 0


def test_the_sky_straight_up_is_its_zenith_and_it_is_brightest_around_the_sun() -> None:
    clear = sky.Sky(2.5, sky.sun_at(50.0, 30.0))
    up = clear.radiance(np.array([[0.0, 1.0, 0.0]]))
    assert float((up @ LUMA)[0]) == pytest.approx(clear.zenith()[0], rel=1e-3)
    assert up[0, 2] > 1.5 * up[0, 0], "a clear zenith is blue"
    picture = equirect.painted(clear.radiance, 64, 1) @ LUMA
    row, column = np.unravel_index(picture[:32].argmax(), picture[:32].shape)
    brightest = equirect.directions(64, np.array([row + 0.5]), np.array([column + 0.5]))[0]
    assert brightest @ np.array(clear.sun) > math.cos(math.radians(5))
    assert clear.radiance(np.array([[0.6, -0.8, 0.0]])).min() > 0


@pytest.mark.parametrize(("elevation", "least", "most"), [(20.0, 15, 40), (45.0, 50, 80), (70.0, 75, 105)])
def test_daylight_has_the_illuminance_that_is_measured_outdoors(
    elevation: float, least: float, most: float
) -> None:
    scene = Landscape(sky.Sky(2.5, sky.sun_at(elevation, 0.0)))
    sun = float(scene.sunlight() @ LUMA) * math.sin(math.radians(elevation))
    assert least < sun < most  # klx on level ground, clear sky
    assert 8 < float(scene.skylight() @ LUMA) < 45
    red, _, blue = scene.sunlight()
    assert red > blue, "what the air scatters away is blue"


def test_colour_matching_integrates_to_the_standard_observer() -> None:
    nm = np.arange(360.0, 831.0)
    assert colour_sums(nm) == pytest.approx([106.9, 106.9, 106.9], rel=0.01)


def colour_sums(nm: np.ndarray) -> np.ndarray:
    return sky.colour_matching(nm).sum(axis=0)


@given(st.floats(-80.0, 80.0), st.floats(-180.0, 180.0), st.floats(0.2, 5.0))
@settings(max_examples=30, deadline=None)
def test_a_disc_keeps_its_energy_and_its_place(elevation: float, azimuth: float, diameter: float) -> None:
    towards, radius = np.array(sky.sun_at(elevation, azimuth)), math.radians(diameter / 2)
    height = 128
    made = equirect.add_disc(np.zeros((height, 2 * height, 3)), towards, radius, np.array([3.0, 2.0, 1.0]))
    energy = np.einsum("hwc,h->c", made, equirect.solid_angles(height))
    assert energy == pytest.approx(np.array([3, 2, 1]) * 2 * math.pi * (1 - math.cos(radius)), rel=1e-9)
    row, column = np.meshgrid(np.arange(height) + 0.5, np.arange(2 * height) + 0.5, indexing="ij")
    weights = made[..., 0] * equirect.solid_angles(height)[:, None]
    mean = np.einsum("hw,hwc->c", weights, equirect.directions(height, row, column))
    assert mean @ towards / np.linalg.norm(mean) > math.cos(math.radians(1.05))  # half a pixel's diagonal


def test_pictures_have_the_lat_long_layout_of_openexr() -> None:
    centre, quarter, top = equirect.directions(8, np.array([4.0, 4.0, 0.0]), np.array([8.0, 4.0, 3.0]))
    assert centre == pytest.approx([0, 0, 1], abs=1e-12)
    assert quarter == pytest.approx([1, 0, 0], abs=1e-12)
    assert top == pytest.approx([0, 1, 0], abs=1e-12)
    assert equirect.solid_angles(8).sum() * 16 == pytest.approx(4 * math.pi)
    white = np.ones((32, 64, 3))
    assert equirect.irradiance(white, np.array([0.0, 1.0, 0.0])) == pytest.approx([math.pi] * 3, rel=3e-3)


def test_painting_refines_where_neighbours_differ() -> None:
    def half(directions: np.ndarray) -> np.ndarray:
        return np.repeat((directions[:, 1:2] > 0.013).astype(float), 3, axis=1) + 0.1

    plain, fine = equirect.painted(half, 32, 1), equirect.painted(half, 32, 8)
    exact = 2 * math.pi * (1 - 0.013) + 0.1 * 4 * math.pi
    found = [float((p[..., 0] * equirect.solid_angles(32)[:, None]).sum()) for p in (plain, fine)]
    assert abs(found[1] - exact) < 0.2 * abs(found[0] - exact)


def test_form_factors_of_a_box_add_up_to_one() -> None:
    sides = radiosity.walls((-3, 0, -2.5), (3, 2.8, 2.5), 0.7)
    corners = np.concatenate([side.corners() for side in sides])
    for number, side in enumerate(sides):
        factors = radiosity.form_factors(side.points(side.centres()), side.normal, corners)
        ends = np.cumsum([0, *(math.prod(s.cells) for s in sides)])
        factors[:, ends[number] : ends[number + 1]] = 0
        assert factors.sum(axis=1) == pytest.approx(1.0, abs=1e-6)


def test_a_grey_furnace_is_as_bright_as_the_geometric_series_says() -> None:
    sides = radiosity.walls((0, 0, 0), (2, 3, 4), 0.9)
    counts = [math.prod(side.cells) for side in sides]
    direct, albedo = [np.full((n, 3), 2.0) for n in counts], [np.full((n, 3), 0.5) for n in counts]
    for solved in radiosity.bounced(sides, direct, albedo):
        assert solved == pytest.approx(2.0 / (1 - 0.5), rel=1e-9)


def test_interpolation_on_a_wall_goes_through_its_patches() -> None:
    side = radiosity.walls((0, 0, 0), (2, 3, 4), 0.5)[0]
    values = np.random.default_rng(1).uniform(0.5, 1.0, (math.prod(side.cells), 3))
    assert side.smooth(values, side.centres()) == pytest.approx(values)
