"""Texture coordinates for meshes without: in metres, upright, of any mesh."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import cube

from studio_core.errors import Cancelled, InputError
from studio_core.scene import unwrap
from studio_core.scene.geometry import Geometry
from studio_core.scene.pattern import face_lengths
from studio_core.scene.unwrap import unwrapped
from studio_core.shading.job import Job

xatlas = pytest.importorskip("xatlas", reason="xatlas has no wheel for this machine")


def ball(cells):
    steps = np.linspace(0, 1, cells + 1)
    turn, tilt = (a.ravel() for a in np.meshgrid(2 * np.pi * steps, np.pi * steps))
    at = np.stack([np.sin(tilt) * np.cos(turn), np.cos(tilt), np.sin(tilt) * np.sin(turn)], axis=1)
    i = np.arange(cells * (cells + 1)).reshape(cells, cells + 1)[:, :-1].ravel()
    faces = np.concatenate([np.c_[i, i + 1, i + cells + 2], np.c_[i, i + cells + 2, i + cells + 1]])
    return Geometry(at.astype(np.float32), faces.astype(np.uint32), normals=at.astype(np.float32))


def corners(geometry):
    return geometry.positions[geometry.faces]


def directions(geometry):
    """(F, 3) in which u and v run on each face, and its normal; faces without an area left out."""
    place = corners(geometry).astype(np.float64)
    good = np.linalg.norm(np.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]), axis=1) > 1e-9
    place, uvs = place[good], geometry.uvs[geometry.faces[good]].astype(np.float64)
    one, other = place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]
    (u1, v1), (u2, v2) = (uvs[:, 1] - uvs[:, 0]).T[:, :, None], (uvs[:, 2] - uvs[:, 0]).T[:, :, None]
    normal = np.cross(one, other)
    found = (one * v2 - other * v1, other * u1 - one * u2, normal)
    scale = u1 * v2 - u2 * v1
    u, v, n = found[0] / scale, found[1] / scale, found[2]
    return tuple((a / np.linalg.norm(a, axis=1, keepdims=True)) for a in (u, v, n))


@pytest.mark.parametrize("most", [unwrap.MOST_FACES, 1])
def test_a_box_has_its_sides_upright_in_metres(most):
    box = cube()
    bare = Geometry(box.positions, box.faces, slots=np.arange(len(box.faces)) % 3)
    made = unwrapped(bare, scale=2.5, most=most)
    assert made.charts == 6
    assert bool(made.projected) == (most == 1)
    np.testing.assert_allclose(face_lengths(made.geometry, 0)[:, :2], 1 / 2.5, rtol=1e-4)
    np.testing.assert_array_equal(corners(made.geometry), corners(bare))
    np.testing.assert_array_equal(made.geometry.slots, bare.slots)
    u, v, n = directions(made.geometry)
    lying = np.abs(n[:, 1]) > 0.5
    np.testing.assert_allclose(v[~lying], [[0, 1, 0]] * (~lying).sum(), atol=1e-4)
    np.testing.assert_allclose(u[lying], [[1, 0, 0]] * lying.sum(), atol=1e-4)
    np.testing.assert_allclose(np.cross(u, v), n, atol=1e-4)  # not mirrored


def test_a_ball_keeps_its_sizes_and_normals():
    bare = ball(24)
    made = unwrapped(bare)
    assert not made.projected
    assert made.charts > 3
    lengths = face_lengths(made.geometry, 0)
    assert np.percentile(lengths[:, :2], 2) > 0.8
    assert np.percentile(lengths[:, :2], 98) < 1.25
    np.testing.assert_array_equal(corners(made.geometry), corners(bare))
    np.testing.assert_array_equal(made.geometry.normals, made.geometry.positions)
    _, v, n = directions(made.geometry)
    side = np.abs(n[:, 1]) < 0.5
    assert np.median(v[side, 1]) > 0.85


def test_neighbouring_sides_go_on_at_the_same_height():
    box = cube()
    made = unwrapped(Geometry(box.positions, box.faces)).geometry
    _, _, n = directions(made)
    place, uvs = corners(made), made.uvs[made.faces]
    side = np.abs(n[:, 1]) < 0.5
    np.testing.assert_allclose(uvs[side][..., 1], place[side][..., 1], atol=1e-4)


@settings(max_examples=6)
@given(st.integers(0, 1000), st.sampled_from([1e-20, 1e-3, 1.0, 1e6, 1e18]), st.booleans())
def test_any_soup_of_triangles_has_coordinates(seed, size, flat):
    rng = np.random.default_rng(seed)
    points = (size * rng.standard_normal((12, 3))).astype(np.float32)
    if flat:
        points[:, 2] = 0
    faces = rng.integers(0, 12, (20, 3)).astype(np.uint32)
    faces[5], faces[6] = faces[4], faces[4][::-1]
    bare = Geometry(points, faces)
    made = unwrapped(bare)
    np.testing.assert_array_equal(corners(made.geometry), corners(bare))
    lengths = face_lengths(made.geometry, 0)[:, :2]
    assert np.median(lengths) == pytest.approx(1, rel=0.1) if len(lengths) else True


@pytest.mark.parametrize("points", [np.zeros((3, 3)), np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]])])
def test_what_has_no_area_has_coordinates_too(points):
    bare = Geometry(points.astype(np.float32), np.array([[0, 1, 2], [0, 0, 1]], np.uint32))
    made = unwrapped(bare)
    np.testing.assert_array_equal(corners(made.geometry), corners(bare))
    assert made.geometry.uvs is not None
    with pytest.raises(InputError, match="without faces"):
        unwrapped(Geometry(np.zeros((3, 3), np.float32), np.zeros((0, 3), np.uint32)))


@pytest.mark.parametrize(
    ("boot", "why"),
    [
        ("import os; os.abort()", "xatlas failed"),
        ("import sys; sys.stdin.buffer.read(); print('what')", "no answer"),
        ("import sys; sys.stdin.buffer.read(); print('{\"vertices\": 99}')", "no answer"),
        ('import sys; sys.stdin.buffer.read(); print(\'{"error": "it is not installed"}\')', "not installed"),
        ("pass", "no answer"),
    ],
)
def test_a_child_that_fails_leaves_a_projection(monkeypatch, boot, why):
    monkeypatch.setattr(unwrap, "_BOOT", boot)
    made = unwrapped(ball(8))
    assert why in made.projected
    assert made.geometry.uvs is not None


def test_a_child_that_never_ends_is_ended(monkeypatch):
    monkeypatch.setattr(unwrap, "_BOOT", "import threading; threading.Event().wait()")
    assert "took more than" in unwrapped(ball(8), seconds=0.3).projected
    job = Job("unwrap", lambda job: job.cancel())
    with pytest.raises(Cancelled):
        unwrapped(ball(8), job=job)
    assert not [thread for thread in threading.enumerate() if thread.name == "unwrap"]
