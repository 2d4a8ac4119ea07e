"""Meshes and pictures: checked when made, keyed by content, shared."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scenes import cube, floor

from studio_core.scene.geometry import Geometry, Image, Texture

TRIANGLE = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], np.float32)
FACE = np.array([(0, 1, 2)], np.uint32)


@pytest.mark.parametrize(
    ("arrays", "why"),
    [
        ({"faces": [(0, 1, 3)]}, "does not exist"),
        ({"positions": np.zeros((0, 3))}, "does not exist"),
        ({"faces": np.array([(0, 1, -1)])}, "does not exist"),
        ({"positions": np.zeros((3, 2))}, "shape"),
        ({"normals": np.zeros((2, 3))}, "normals and positions differ"),
        ({"uvs": np.zeros((4, 2))}, "uvs and positions differ"),
        ({"slots": np.zeros(2, np.uint16)}, "slots and faces differ"),
        ({"positions": TRIANGLE * np.nan}, "finite"),
        ({"normals": np.full((3, 3), np.inf)}, "finite"),
    ],
)
def test_what_does_not_fit_is_refused(arrays: dict, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        Geometry(**{"positions": TRIANGLE, "faces": FACE, **arrays})


def test_parts_have_the_types_that_kernels_expect() -> None:
    made = Geometry([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)])  # type: ignore[arg-type]
    assert {name: array.dtype for name, array in made.parts()} == {
        "positions": np.float32,
        "faces": np.uint32,
        "slots": np.uint16,
    }
    assert made.nbytes == 36 + 12 + 2
    assert not any(array.flags.writeable for _, array in made.parts())


def test_keys_follow_content() -> None:
    assert cube().key == cube().key
    assert len({cube().key, cube(0.5).key, floor().key}) == 3
    bare = Geometry(TRIANGLE, FACE)
    assert bare.key != Geometry(TRIANGLE, FACE, normals=np.tile((0, 0, 1), (3, 1))).key
    assert bare.key != Geometry(TRIANGLE, FACE, slots=np.ones(1, np.uint16)).key


def test_bounds() -> None:
    assert np.array_equal(cube(2).bounds, [(-1, -1, -1), (1, 1, 1)])
    assert np.array_equal(Geometry(np.zeros((0, 3)), np.zeros((0, 3))).bounds, np.zeros((2, 3)))


def test_the_cube_of_these_tests_faces_outwards() -> None:
    made = cube()
    a, b, c = (made.positions[made.faces[:, i]].astype(float) for i in range(3))
    assert np.allclose(np.cross(b - a, c - a), made.normals[made.faces[:, 0]])
    assert np.allclose(made.normals, np.sign(made.positions) * np.abs(made.normals))


@given(st.sampled_from([1, 3, 4]), st.sampled_from([np.uint8, np.float32, np.float64, np.float16]))
def test_pictures_are_bytes_or_floats(channels: int, dtype: type) -> None:
    made = Image(np.ones((2, 3, channels), dtype))
    assert made.pixels.dtype == (np.uint8 if dtype is np.uint8 else np.float32)
    assert made.nbytes == made.pixels.nbytes
    assert made.key != Image(np.ones((2, 3, channels), dtype), "data").key


@pytest.mark.parametrize("shape", [(2, 3, 2), (0, 3, 3), (2, 0, 3), (2, 3, 5), (2, 3), (1, 2, 3, 3)])
def test_pictures_of_other_shapes_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="shape"):
        Image(np.zeros(shape, np.float32))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_picture_is_finite(bad: float) -> None:
    pixels = np.ones((3, 4, 3), np.float32)
    pixels[1, 2, 0] = bad
    with pytest.raises(ValueError, match="finite"):
        Image(pixels)


def test_a_picture_is_turned_without_being_sheared():
    # 0.5 × 0.2 m on a surface whose u runs 2 m and whose v runs 3 m a unit, turned by 30°
    picture = Image(np.zeros((2, 5, 3), np.float32))
    laid = Texture(picture, (2 / 0.5, 2 / 0.2), (0.25, 0.5), 30.0, 3 / 2)
    turn = np.array([[np.cos(np.pi / 6), -np.sin(np.pi / 6)], [np.sin(np.pi / 6), np.cos(np.pi / 6)]])
    in_picture = np.random.default_rng(1).uniform(-2, 2, (20, 2))
    metres = ((in_picture - [0.25, 0.5]) * [0.5, 0.2]) @ turn.T
    uvs = (metres / [2, 3]).astype(np.float32)
    np.testing.assert_allclose(laid.placed(uvs), in_picture, atol=1e-5)
    assert laid.area == pytest.approx(2 * 3 / (0.5 * 0.2))


def test_quarters_of_a_turn_are_exact():
    picture = Image(np.zeros((2, 2, 3), np.float32))
    assert Texture(picture, (2.0, 3.0), rotation=90.0).affine == (0.0, 2.0, 0.0, -3.0, 0.0, 0.0)
    assert Texture(picture, (2.0, 3.0), rotation=-180.0).affine == (-2.0, 0.0, 0.0, 0.0, -3.0, 0.0)
    assert Texture(picture, (2.0, 3.0), (0.5, 0.0)).affine == (2.0, 0.0, 0.5, 0.0, 3.0, 0.0)
