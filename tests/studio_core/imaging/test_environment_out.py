"""Environments and cubes in files: read back they are the same, and nothing is left half written."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - its customary name
import pytest

from studio_core.errors import InputError
from studio_core.imaging import environment_out
from studio_core.imaging.cubemap import equirect_from_cube, face_directions
from studio_core.imaging.environment import load_environment
from studio_core.imaging.environment_out import (
    FACE_NAMES,
    LAYOUTS,
    OPENEXR,
    SIX,
    write_cube,
    write_environment,
)
from studio_core.imaging.io import ImageDecoder


@pytest.fixture(scope="module")
def decoder() -> Iterator[ImageDecoder]:
    with ImageDecoder(timeout=60) as made:
        yield made


def light(height: int = 16) -> np.ndarray:
    return (np.random.default_rng(2).random((height, 2 * height, 3)) ** 6 * 900).astype(np.float32)


def cube(n: int = 24) -> np.ndarray:
    d = face_directions(n)
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    return np.stack([2 + d[..., 0], 3 + d[..., 1] * d[..., 2], 4 - d[..., 2]], axis=-1).astype(np.float32)


def attributes(path: Path) -> dict[str, object]:
    source = oiio.ImageInput.open(str(path))
    assert source is not None
    told = {a.name: a.value for a in source.spec().extra_attribs}
    told["names"] = source.spec().channelnames
    source.close()
    return told


def test_an_environment_is_read_back_bit_for_bit(decoder: ImageDecoder, tmp_path: Path) -> None:
    pixels = light()
    unresolved = np.random.default_rng(1).integers(0, 4, pixels.shape[:2]).astype(np.uint8)
    write_environment(tmp_path / "room.exr", pixels, unresolved=unresolved, luminance_scale=181.5)
    image, notes = load_environment(tmp_path / "room.exr", decoder)
    np.testing.assert_array_equal(image.pixels, pixels)
    assert notes == ()
    told = attributes(tmp_path / "room.exr")
    assert told["whiteLuminance"] == 181.5
    assert told["names"] == ("R", "G", "B", "unresolved.Y")
    source = oiio.ImageInput.open(str(tmp_path / "room.exr"))
    np.testing.assert_array_equal(source.read_image(0, 0, 3, 4, oiio.FLOAT)[:, :, 0], unresolved)
    source.close()


def test_a_radiance_file_keeps_within_its_eight_bits(decoder: ImageDecoder, tmp_path: Path) -> None:
    pixels = light()
    write_environment(tmp_path / "room.hdr", pixels, luminance_scale=5.0)
    image, _ = load_environment(tmp_path / "room.hdr", decoder)
    brightest = pixels.max(axis=2, keepdims=True)
    assert (np.abs(image.pixels - pixels) <= brightest / 127).all()


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("suffix", [".exr", ".hdr"])
def test_every_layout_is_the_same_sphere(
    decoder: ImageDecoder, tmp_path: Path, layout: str, suffix: str
) -> None:
    if (layout, suffix) == (OPENEXR, ".hdr"):
        with pytest.raises(InputError, match=r"cube\.hdr.*\.exr"):
            write_cube(tmp_path / "cube.hdr", cube(), layout)
        return
    place = tmp_path / ("cube" if layout == SIX else f"cube{suffix}")
    written = write_cube(place, cube(), layout, luminance_scale=2.0, suffix=suffix)
    assert len(written) == (6 if layout == SIX else 1)
    image, _ = load_environment(place, decoder)
    wanted = equirect_from_cube(cube())
    np.testing.assert_allclose(image.pixels, wanted, atol=0.03 if suffix == ".hdr" else 0.02)
    if suffix == ".exr":
        assert all(attributes(path)["whiteLuminance"] == 2.0 for path in written)


def test_what_cannot_be_written_says_so_and_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match=r"room\.png.*\.exr or \.hdr"):
        write_environment(tmp_path / "room.png", light())
    with pytest.raises(InputError, match="no folder"):
        write_environment(tmp_path / "none" / "room.exr", light())
    with pytest.raises(InputError, match="faces end in"):
        write_cube(tmp_path / "six", cube(), SIX, suffix=".png")
    with pytest.raises(ValueError, match="no layout"):
        write_cube(tmp_path / "a.exr", cube(), "dice")
    (tmp_path / "taken").write_text("a file")
    with pytest.raises(InputError, match="taken"):
        write_cube(tmp_path / "taken", cube())

    written: list[Path] = []

    def full(path: Path, *rest: object) -> None:
        if len(written) == 3:
            raise InputError("the disk is full")
        path.write_bytes(b"x")
        written.append(path)

    monkeypatch.setattr(environment_out, "write_exr", full)
    with pytest.raises(InputError, match="full"):
        write_cube(tmp_path / "half", cube())
    assert list((tmp_path / "half").iterdir()) == []


def test_six_faces_replace_older_ones(tmp_path: Path) -> None:
    write_cube(tmp_path / "six", cube(8))
    write_cube(tmp_path / "six", cube(4))
    assert sorted(p.name for p in (tmp_path / "six").iterdir()) == sorted(f"{n}.exr" for n in FACE_NAMES)
