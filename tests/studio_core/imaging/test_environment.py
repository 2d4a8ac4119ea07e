"""Environments from all layouts, against a known function of direction."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.errors import InputError
from studio_core.imaging.cubemap import equirect_from_cube, face_directions, face_of, from_opengl
from studio_core.imaging.encode import write_exr, write_png
from studio_core.imaging.environment import BRIGHTEST, load_environment
from studio_core.imaging.io import ImageDecoder
from studio_core.imaging.latlong import (
    direction_to_uv,
    equirect_direction,
    pixel_directions,
    pixel_solid_angles,
)

N = 32


@pytest.fixture(scope="module")
def decoder() -> Iterator[ImageDecoder]:
    with ImageDecoder(timeout=60) as made:
        yield made


def sky(directions: np.ndarray) -> np.ndarray:
    """A smooth radiance without symmetry, one colour an axis."""
    d = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    x, y, z = d[..., 0], d[..., 1], d[..., 2]
    return np.stack([2 + x + 0.3 * y * z, 2 + y + 0.3 * z * x, 2 + z + 0.3 * x * y], axis=-1).astype(
        np.float32
    )


def expected(height: int) -> np.ndarray:
    return sky(pixel_directions(height, 2 * height))


def opengl_faces(n: int = N) -> list[np.ndarray]:
    """The table of section 8.13 of the OpenGL specification, in our frame (its x is our −x)."""
    t, s = np.meshgrid(*[(2 * np.arange(n) + 1) / n - 1.0] * 2, indexing="ij")
    one = np.ones_like(s)
    table = [(one, -t, -s), (-one, -t, s), (s, one, t), (s, -one, -t), (s, -t, one), (-s, -t, -one)]
    return [sky(np.stack([-x, y, z], axis=-1)) for x, y, z in table]


def test_the_convention_is_openexrs() -> None:
    seen = equirect_direction([0.5, 0.25, 0.75, 0.0, 0.3], [0.5, 0.5, 0.5, 0.5, 0.0])
    np.testing.assert_allclose(seen, [(0, 0, 1), (1, 0, 0), (-1, 0, 0), (0, 0, -1), (0, 1, 0)], atol=1e-12)


@given(st.floats(0.001, 0.999), st.floats(0.001, 0.999), st.floats(1e-3, 1e3))
def test_directions_and_coordinates_are_inverse(u: float, v: float, length: float) -> None:
    back = direction_to_uv(length * equirect_direction(u, v))
    np.testing.assert_allclose(back, (u, v), atol=1e-9)


def test_a_pixels_middle_is_its_direction() -> None:
    whole = pixel_directions(3, 8)
    assert whole.shape == (3, 8, 3)
    np.testing.assert_allclose(whole[1, 5], equirect_direction(5.5 / 8, 0.5), atol=1e-12)
    np.testing.assert_array_equal(pixel_directions(3, 8, slice(1, 3), slice(4, 6)), whole[1:3, 4:6])


def test_solid_angles_cover_the_sphere() -> None:
    np.testing.assert_allclose(pixel_solid_angles(17, 40).sum() * 40, 4 * np.pi)


@given(st.integers(1, 9), st.booleans())
def test_every_sample_of_a_cube_is_found_where_it_is(n: int, edge_aligned: bool) -> None:
    directions = face_directions(n, edge_aligned)
    face, a, b = face_of(directions * 3.7)
    inside = (np.abs(a) < 1 - 1e-9) & (np.abs(b) < 1 - 1e-9)  # an edge belongs to two faces
    assert (face == np.arange(6)[:, None, None])[inside].all()
    t = 2 * np.arange(n) / max(n - 1, 1) - 1 if edge_aligned and n > 1 else (2 * np.arange(n) + 1) / n - 1
    if edge_aligned and n == 1:
        t = np.zeros(1)
    np.testing.assert_allclose(a[inside], np.broadcast_to(t[None, None, :], a.shape)[inside], atol=1e-12)
    np.testing.assert_allclose(b[inside], np.broadcast_to(t[None, :, None], b.shape)[inside], atol=1e-12)


@pytest.mark.parametrize("edge_aligned", [False, True])
def test_a_cube_becomes_the_same_sphere(edge_aligned: bool) -> None:
    made = equirect_from_cube(sky(face_directions(N, edge_aligned)), edge_aligned)
    assert made.shape == (2 * N, 4 * N, 3)
    np.testing.assert_allclose(made, expected(2 * N), atol=0.005)


def test_faces_of_one_sample_are_enough() -> None:
    faces = np.arange(6, dtype=np.float32).reshape(6, 1, 1, 1)
    made = equirect_from_cube(faces, edge_aligned=True)
    assert made.shape == (2, 4, 1)
    assert np.isfinite(made).all()


def layouts() -> dict[str, np.ndarray]:
    right, left, top, bottom, front, back = opengl_faces()
    blank = np.zeros_like(top)
    across = [[blank, top, blank, blank], [left, front, right, back], [blank, bottom, blank, blank]]
    down = [
        [blank, top, blank],
        [left, front, right],
        [blank, bottom, blank],
        [blank, back[::-1, ::-1], blank],
    ]
    return {
        "horizontal": _grid(across),
        "vertical": _grid(down),
        "row": np.concatenate([right, left, top, bottom, front, back], axis=1),
        "column": np.concatenate([right, left, top, bottom, front, back], axis=0),
    }


def _grid(rows: list[list[np.ndarray]]) -> np.ndarray:
    return np.concatenate([np.concatenate(row, axis=1) for row in rows], axis=0)


@pytest.mark.parametrize("name", ["horizontal", "vertical", "row", "column"])
def test_crosses_and_strips(decoder: ImageDecoder, tmp_path: Path, name: str) -> None:
    write_exr(tmp_path / "cube.exr", layouts()[name])
    image, notes = load_environment(tmp_path / "cube.exr", decoder)
    np.testing.assert_allclose(image.pixels, expected(2 * N), atol=0.005)
    assert any("cube map" in note for note in notes)


@pytest.mark.parametrize(
    "names",
    [
        ("px", "nx", "py", "ny", "pz", "nz"),
        ("sky_posx", "sky_negx", "sky_posy", "sky_negy", "sky_posz", "sky_negz"),
        ("room-right", "room-left", "room-top", "room-bottom", "room-front", "room-back"),
        ("SkyRight", "SkyLeft", "SkyUp", "SkyDown", "SkyFront", "SkyBack"),
    ],
)
def test_six_files_or_their_folder(decoder: ImageDecoder, tmp_path: Path, names: tuple[str, ...]) -> None:
    paths = [tmp_path / f"{name}.exr" for name in names]
    for path, face in zip(paths, opengl_faces(), strict=True):
        write_exr(path, face)
    (tmp_path / "readme.txt").write_text("none of the six")
    for source in (tmp_path, paths[::-1]):
        image, _ = load_environment(source, decoder)
        np.testing.assert_allclose(image.pixels, expected(2 * N), atol=0.005)


def test_incomplete_or_unequal_six_are_refused(decoder: ImageDecoder, tmp_path: Path) -> None:
    for name in ("px", "nx", "py", "ny", "pz"):
        write_exr(tmp_path / f"{name}.exr", np.ones((4, 4, 3), np.float32))
    with pytest.raises(InputError, match="no face nz"):
        load_environment(tmp_path, decoder)
    write_exr(tmp_path / "nz.exr", np.ones((4, 5, 3), np.float32))
    with pytest.raises(InputError, match=r"nz\.exr.*one size"):
        load_environment(tmp_path, decoder)
    write_exr(tmp_path / "back.exr", np.ones((4, 4, 3), np.float32))
    with pytest.raises(InputError, match="same face"):
        load_environment(tmp_path, decoder)


def test_an_ordinary_picture_is_refused_with_its_size(decoder: ImageDecoder, tmp_path: Path) -> None:
    noise = np.random.default_rng(0).random((30, 40, 3)).astype(np.float32)  # 4:3, but no empty corners
    write_exr(tmp_path / "photo.exr", noise)
    with pytest.raises(InputError, match=r"photo\.exr.*40 × 30"):
        load_environment(tmp_path / "photo.exr", decoder)


def test_eight_bits_are_accepted_and_said_to_be_no_hdr(decoder: ImageDecoder, tmp_path: Path) -> None:
    write_png(tmp_path / "ldr.png", np.full((8, 16, 1), 188, np.uint8))
    image, notes = load_environment(tmp_path / "ldr.png", decoder)
    assert image.pixels.shape == (8, 16, 3)
    assert image.encoding == "linear"
    np.testing.assert_allclose(image.pixels, 0.503, atol=0.002)
    assert any("not HDR" in note for note in notes)


def test_bad_radiance_is_repaired_and_counted(decoder: ImageDecoder, tmp_path: Path) -> None:
    pixels = np.full((8, 16, 4), 2.0, np.float32)
    pixels[1, 1, 0] = np.nan
    pixels[3, 3] = pixels[3, 4] = np.inf
    pixels[5, 5, 1] = -3890
    pixels[6, 6] = 1e30
    pixels[0, 0] = 7
    write_exr(tmp_path / "bad.exr", pixels)
    image, notes = load_environment(tmp_path / "bad.exr", decoder)
    got = image.pixels
    assert np.isfinite(got).all()
    assert got.min() == 0
    assert got.max() == 7 < BRIGHTEST
    assert got[1, 1, 0] == 2  # its neighbours' median
    assert (got[3, 3] == 7).all()
    assert got[5, 5].tolist() == [2, 0, 2]
    told = " ".join(notes)
    assert "1 pixel had no number" in told
    assert "3 pixels had infinite" in told
    assert "1 pixel had negative" in told


@given(
    st.lists(
        st.tuples(
            st.integers(0, 3), st.integers(0, 7), st.sampled_from([np.nan, np.inf, -np.inf, -1.0, 1e38, 0.0])
        ),
        max_size=40,
    )
)
def test_any_rubbish_becomes_finite_light(wrong: list[tuple[int, int, float]]) -> None:
    from studio_core.imaging.environment import _clean

    pixels = np.ones((4, 8, 3), np.float32)
    for row, column, value in wrong:
        pixels[row, column] = value
    made = _clean(pixels, [])
    assert np.isfinite(made).all()
    assert (made >= 0).all()
    assert made.max() <= BRIGHTEST
    good = np.isfinite(pixels) & (pixels >= 0) & (pixels <= BRIGHTEST)
    np.testing.assert_array_equal(made[good], pixels[good])


def test_a_picture_of_nothing_but_nan_is_black_and_says_so(decoder: ImageDecoder, tmp_path: Path) -> None:
    write_exr(tmp_path / "nan.exr", np.full((4, 8, 3), np.nan, np.float32))
    image, notes = load_environment(tmp_path / "nan.exr", decoder)
    assert not image.pixels.any()
    assert any("black" in note for note in notes)


def test_opengl_faces_are_unmirrored_seen_from_inside() -> None:
    """In the middle picture of a cross, what is right in the picture is right of the centre."""
    faces = np.zeros((6, 4, 4, 1), np.float32)
    faces[4, :, 3] = 1  # the right edge of the front
    made = equirect_from_cube(from_opengl(faces))
    brightest = np.argmax(made[made.shape[0] // 2, :, 0])
    assert made.shape[1] // 2 < brightest < made.shape[1] * 0.7
