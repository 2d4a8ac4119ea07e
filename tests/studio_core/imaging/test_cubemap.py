"""Cube maps of equirectangular pictures, against a known function of direction and other people's pairs."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.imaging.cubemap import (
    edge_samples,
    equirect_from_cube,
    face_directions,
    faces_from_equirect,
    from_opengl,
    joined,
    split,
    to_opengl,
)
from studio_core.imaging.decode import Limits, decode_file
from studio_core.imaging.environment import load_environment
from studio_core.imaging.latlong import equirect_direction, pixel_directions
from studio_core.imaging.sphere import even_rows, with_border


def sky(directions: np.ndarray) -> np.ndarray:
    """A smooth radiance without symmetry."""
    d = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    return np.stack([2 + x + 0.3 * y * z, 2 + y + 0.3 * z * x, 2 + z + 0.3 * x * y], -1).astype(np.float32)


def picture(height: int) -> np.ndarray:
    return sky(pixel_directions(height, 2 * height))


def face_solid_angles(n: int) -> np.ndarray:
    """(n, n): exact solid angles of a face's pixels."""
    t = 2 * np.arange(n + 1) / n - 1
    b, a = np.meshgrid(t, t, indexing="ij")
    corner = np.arctan2(a * b, np.sqrt(a * a + b * b + 1))
    return corner[1:, 1:] - corner[1:, :-1] - corner[:-1, 1:] + corner[:-1, :-1]


@pytest.mark.parametrize("edge_aligned", [False, True])
@pytest.mark.parametrize("n", [16, 33])
def test_faces_show_what_lies_in_their_directions(n: int, edge_aligned: bool) -> None:
    faces = faces_from_equirect(picture(64), n, edge_aligned=edge_aligned)
    np.testing.assert_allclose(faces, sky(face_directions(n, edge_aligned)), atol=0.002)


@given(st.integers(0, 2**32 - 1), st.sampled_from([8, 12, 16]))
@settings(max_examples=20)
def test_noise_keeps_its_light_and_does_not_alias_at_the_poles(seed: int, n: int) -> None:
    noise = np.random.default_rng(seed).random((48, 96, 3)).astype(np.float32)
    faces = faces_from_equirect(noise, n)
    angles = face_solid_angles(n)
    assert angles.sum() * 6 == pytest.approx(4 * np.pi)
    rows = np.cos(np.pi * np.arange(49) / 48)
    wanted = ((rows[:-1] - rows[1:])[:, None] * noise.mean(axis=1)).sum(axis=0) * 2 * np.pi
    made = np.einsum("fijc,ij->c", faces.astype(np.float64), angles)
    np.testing.assert_allclose(made, wanted, rtol=0.03)
    assert (faces >= 0).all()
    assert faces.max() <= 1.0001
    top = faces[2, n // 2 - 1 : n // 2 + 1, n // 2 - 1 : n // 2 + 1]  # hundreds of the picture's pixels
    np.testing.assert_allclose(top, top.mean(axis=(0, 1), keepdims=True) + 0 * top, atol=0.25)


def test_a_pole_of_noise_is_averaged() -> None:
    noise = np.random.default_rng(3).random((256, 512, 1)).astype(np.float32)
    face = faces_from_equirect(noise, 16)[2]
    assert face[7:9, 7:9].std() < 0.03  # single samples would have 0.29


def test_going_there_and_back_changes_little() -> None:
    before = picture(64)
    faces = faces_from_equirect(before, 32)
    np.testing.assert_allclose(equirect_from_cube(faces), before, atol=0.006)


@given(st.integers(1, 7))
def test_opengls_faces_and_ours_are_inverse(n: int) -> None:
    faces = np.random.default_rng(n).random((6, n, n, 2)).astype(np.float32)
    np.testing.assert_array_equal(from_opengl(to_opengl(faces)), faces)
    np.testing.assert_array_equal(to_opengl(from_opengl(faces)), faces)


@given(st.integers(1, 7), st.sampled_from(["strip", "cross", "vertical cross"]))
def test_what_is_joined_is_taken_apart_again(n: int, layout: str) -> None:
    faces = np.random.default_rng(n).random((6, n, n, 3)).astype(np.float32)
    found = split(joined(faces, layout))
    assert found is not None
    np.testing.assert_array_equal(found, faces)


def test_edge_samples_are_equal_where_faces_meet() -> None:
    made = edge_samples(sky(face_directions(24)))
    np.testing.assert_allclose(made, sky(face_directions(24, edge_aligned=True)), atol=0.01)
    np.testing.assert_allclose(made[0][:, -1], made[4][:, 0], atol=1e-5)  # +x and +z share an edge


def test_a_border_goes_on_over_the_poles() -> None:
    wide = with_border(picture(16), 2)
    u = (np.arange(-2, 34) + 0.5) / 32
    v = (np.arange(-2, 18) + 0.5) / 16
    np.testing.assert_allclose(wide, sky(equirect_direction(u[None, :], v[:, None])), atol=1e-6)


@given(st.integers(0, 2**32 - 1), st.floats(0.01, 3.0))
@settings(max_examples=25)
def test_averaging_rows_keeps_their_mean(seed: int, step: float) -> None:
    pixels = np.random.default_rng(seed).random((10, 20, 3)).astype(np.float32)
    made = even_rows(pixels, step)
    np.testing.assert_allclose(made.mean(axis=1), pixels.mean(axis=1), rtol=1e-5)
    if step < 2 * np.pi / 20 * np.sin(np.pi * 0.05):
        np.testing.assert_array_equal(made, pixels)


def pair(shared_data: Path, name: str) -> tuple[np.ndarray, np.ndarray]:
    """The lat-long picture in our convention, and the faces of the cube (6, n, n, 3) as the file has them."""
    folder = shared_data / "third_party" / "openexr_env"
    if not folder.is_dir():
        pytest.skip(f"there is no folder {folder} of pairs")
    sphere = load_environment(folder / f"{name}LatLong.exr")[0].pixels
    cube, facts = decode_file(str(folder / f"{name}Cube.exr"), Limits())
    assert facts.envmap == "cube"
    assert facts.edge_aligned
    return sphere, np.maximum(cube[:, :, :3], 0).reshape(6, cube.shape[1], cube.shape[1], 3)


def apart(made: np.ndarray, wanted: np.ndarray) -> float:
    """Mean difference over the mean, both compressed so that a lamp does not decide."""
    a, b = np.log1p(made), np.log1p(wanted)
    return float(np.abs(a - b).mean() / b.mean())


@pytest.mark.parametrize(("name", "limit"), [("Orientation", 0.03), ("WavyLines", 0.12), ("KernerEnv", 0.03)])
def test_pairs_made_by_others_agree_both_ways(shared_data: Path, name: str, limit: float) -> None:
    """Faces, seams and poles of OpenEXR's own pairs (made by its reference filter, not ours)."""
    sphere, cube = pair(shared_data, name)
    n = cube.shape[1]
    faces = faces_from_equirect(sphere, n, edge_aligned=True)
    for face in range(6):
        right = apart(faces[face], cube[face])
        assert right < limit, (name, face)
        if name == "Orientation":  # every other turn or mirror image of the face is far worse
            turned = [np.rot90(cube[face], k) for k in (1, 2, 3)]
            turned += [np.rot90(cube[face][:, ::-1], k) for k in range(4)]
            assert min(apart(faces[face], other) for other in turned) > 2 * right
    if name == "Orientation":
        each = [[apart(faces[i], cube[j]) for j in range(6)] for i in range(6)]
        best = min(permutations(range(6)), key=lambda order: sum(each[i][order[i]] for i in range(6)))
        assert best == tuple(range(6))
    back = equirect_from_cube(cube, edge_aligned=True)
    step = back.shape[0] // sphere.shape[0]
    small = back.reshape(sphere.shape[0], step, sphere.shape[1], step, 3).mean(axis=(1, 3))
    assert apart(small, sphere) < 1.5 * limit
    for rows in (slice(0, 6), slice(-6, None)):
        assert apart(small[rows], sphere[rows]) < 2 * limit
    for columns in (slice(0, 6), slice(-6, None)):
        assert apart(small[:, columns], sphere[:, columns]) < 2 * limit
