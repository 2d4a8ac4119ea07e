"""Cleaning of meshes, splitting of energy, files beside the model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.exchange.pictures import beside
from studio_plugins.meshes.common import Notes, clean_mesh, colour, share, unique_rows

SQUARE = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])


def test_degenerate_double_and_unfinite_faces_go_and_are_counted() -> None:
    positions = np.concatenate([SQUARE, [[np.nan, 0, 0], [0.5, 0, 0], [1e30, 0, 0]]])
    faces = np.array([[0, 1, 2], [2, 0, 1], [0, 2, 1], [0, 2, 3], [0, 0, 1], [0, 5, 1], [0, 1, 4], [0, 1, 6]])
    notes = Notes()
    made = clean_mesh(positions, faces, notes)
    assert made is not None
    geometry, offset = made
    assert offset == (0, 0, 0)
    assert len(geometry.positions) == 4
    assert geometry.faces.tolist() == [[0, 1, 2], [0, 2, 1], [0, 2, 3]]  # the back side is another face
    told = notes.told()
    assert "Double faces left out: 1." in told
    assert "Degenerate faces left out: 2." in told
    assert "Faces left out because their vertices are no finite numbers: 2." in told


def test_equal_corners_become_one_and_different_ones_stay() -> None:
    positions = SQUARE[[0, 1, 2, 0, 2, 3]]
    faces = np.arange(6).reshape(2, 3)
    smooth = clean_mesh(positions, faces, Notes())
    assert smooth is not None
    assert len(smooth[0].positions) == 4
    uvs = np.array([[0, 0], [1, 0], [1, 1], [0.5, 0], [1, 1], [0, 1]], float)
    seam = clean_mesh(positions, faces, Notes(), uvs=uvs)
    assert seam is not None
    assert len(seam[0].positions) == 5
    np.testing.assert_array_equal(seam[0].uvs[seam[0].faces.ravel()], uvs)  # type: ignore[index]


def test_missing_normals_are_made_from_the_faces() -> None:
    normals = np.array([[0, 0, 2.0], [0, 0, 0], [np.nan, 0, 0], [0, 0, 1e-30]])
    made = clean_mesh(SQUARE, np.array([[0, 1, 2], [0, 2, 3]]), Notes(), normals)
    assert made is not None
    assert made[0].normals is not None
    np.testing.assert_allclose(made[0].normals, [[0, 0, 1]] * 4)
    most_wrong = clean_mesh(SQUARE, np.array([[0, 1, 2], [0, 2, 3]]), Notes(), np.zeros((4, 3)))
    assert most_wrong is not None
    assert most_wrong[0].normals is None


def test_a_mesh_far_away_keeps_its_shape() -> None:
    far = SQUARE * 0.3 + [3e6, 0, -5e5]
    made = clean_mesh(far, np.array([[0, 1, 2], [0, 2, 3]]), Notes())
    assert made is not None
    geometry, offset = made
    np.testing.assert_allclose(geometry.positions.astype(float) + offset, far, atol=1e-7)


def test_nothing_left_is_none() -> None:
    assert clean_mesh(SQUARE, np.zeros((0, 3), int), Notes()) is None
    assert clean_mesh(SQUARE + np.inf, np.array([[0, 1, 2]]), Notes()) is None


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), min_size=1, max_size=60))
def test_unique_rows_are_numpys(rows: list[tuple[int, int]]) -> None:
    table = np.array(rows, np.float32)
    first, inverse = unique_rows(table)
    assert (np.diff(first) > 0).all()
    np.testing.assert_array_equal(table[first][inverse], table)
    assert len(first) == len(np.unique(table, axis=0))


CHANNEL = st.floats(0, 1)


@given(st.tuples(CHANNEL, CHANNEL, CHANNEL), st.tuples(CHANNEL, CHANNEL, CHANNEL))
def test_shared_energy_never_exceeds_one(
    diffuse: tuple[float, float, float], specular: tuple[float, float, float]
) -> None:
    made, shine = share(diffuse, specular)
    for d, s, made_d, made_s in zip(diffuse, specular, made, shine, strict=True):
        assert made_d + made_s <= 1 + 1e-12
        assert made_d <= d
        assert min(s, 0.04) <= made_s + 1e-12 <= s + 2e-12
        if d + s <= 1:
            assert (made_d, made_s) == (d, s)


def test_colours_are_clamped() -> None:
    assert colour([2.0, -1.0, float("nan")]) == (1.0, 0.0, 0.0)


def test_files_are_found_in_any_writing_but_not_far_away(tmp_path: Path) -> None:
    folder = tmp_path / "models" / "chair"
    (folder / "Maps").mkdir(parents=True)
    (folder / "Maps" / "Dark Oak.JPG").write_bytes(b"1")
    (tmp_path / "models" / "shared.png").write_bytes(b"2")
    (tmp_path / "secret.png").write_bytes(b"3")
    for name in ("Maps/Dark Oak.JPG", "maps\\dark oak.jpg", '"MAPS/dark oak.JPG" ', "./Maps/Dark Oak.JPG"):
        assert beside(folder, name) == folder / "Maps" / "Dark Oak.JPG"
    assert beside(folder, "../shared.png") is not None
    assert beside(folder / "Maps", "C:\\Users\\Someone\\Dark Oak.jpg") == folder / "Maps" / "Dark Oak.JPG"
    for name in (
        "../../secret.png",
        str(tmp_path / "secret.png"),
        "",
        "Maps",
        "a\0b",
        "x" * 5000,
        "nothing.png",
    ):
        assert beside(folder, name) is None


def test_a_link_out_of_reach_is_not_followed(tmp_path: Path) -> None:
    folder = tmp_path / "models" / "chair"
    folder.mkdir(parents=True)
    (tmp_path / "secret.png").write_bytes(b"3")
    try:
        (folder / "link.png").symlink_to(tmp_path / "secret.png")
    except OSError:
        pytest.skip("this system makes no links")
    assert beside(folder, "link.png") is None
