"""The decoder child: what it reads, and that a crash or hang in it is the file's failure alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from studio_core.errors import InputError
from studio_core.imaging import io
from studio_core.imaging.decode import Limits
from studio_core.imaging.encode import encode_exr, encode_png, write_exr, write_hdr, write_png
from studio_core.imaging.io import ImageDecoder, read_image
from studio_core.imaging.transfer import srgb_to_linear


@pytest.fixture(scope="module")
def decoder() -> Iterator[ImageDecoder]:
    with ImageDecoder(timeout=60) as made:
        yield made


def picture(channels: int, height: int = 5, width: int = 7) -> np.ndarray:
    return np.random.default_rng(channels).random((height, width, channels)).astype(np.float32)


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_exr_comes_back_bit_for_bit(decoder: ImageDecoder, channels: int, tmp_path: Path) -> None:
    pixels = picture(channels) * 1e5
    pixels[0, 2] = -1e-30
    read = read_image(encode_exr(pixels), "memory.exr", decoder)
    assert read.encoding == "linear"
    np.testing.assert_array_equal(read.pixels.view(np.uint32), pixels.view(np.uint32))
    pixels[0, 0], pixels[0, 1] = np.nan, np.inf
    (tmp_path / "wild.exr").write_bytes(encode_exr(pixels))
    found, _ = decoder.read_pixels(tmp_path / "wild.exr")
    np.testing.assert_array_equal(found.view(np.uint32), pixels.view(np.uint32))


def test_what_is_no_number_in_a_file_is_one_in_its_picture(decoder: ImageDecoder) -> None:
    pixels = picture(3)
    pixels[0, :3] = np.array([np.nan, np.inf, -np.inf])[:, None]
    found = read_image(encode_exr(pixels), "memory.exr", decoder).pixels
    brightest = pixels[np.isfinite(pixels)].max()
    np.testing.assert_array_equal(found[0, :3, 0], [0, brightest, 0])
    np.testing.assert_array_equal(found[1:], pixels[1:])


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_png_comes_back_byte_for_byte(decoder: ImageDecoder, channels: int) -> None:
    pixels = (picture(channels) * 255).astype(np.uint8)  # straight alpha: nothing is multiplied
    read = decoder.decode(encode_png(pixels), "memory.png")
    assert read.encoding == "srgb"
    np.testing.assert_array_equal(read.pixels, pixels)


def test_hdr_keeps_radiance_to_its_precision(decoder: ImageDecoder, tmp_path: Path) -> None:
    pixels = picture(3, 16, 32) * 1e4
    write_hdr(tmp_path / "a.hdr", pixels)
    read = decoder.read(tmp_path / "a.hdr").pixels
    assert np.abs(read - pixels).max() <= pixels.max() / 128
    assert read.dtype == np.float32


def test_sixteen_bits_become_linear_light(decoder: ImageDecoder, tmp_path: Path) -> None:
    import cv2

    values = np.linspace(0, 65535, 60).astype(np.uint16).reshape(4, 5, 3)
    assert cv2.imwrite(str(tmp_path / "deep.png"), values[:, :, ::-1])
    read = decoder.read(tmp_path / "deep.png")
    assert read.encoding == "linear"
    np.testing.assert_allclose(read.pixels, srgb_to_linear(values / 65535.0), atol=1e-6)


def test_a_wrong_extension_and_an_odd_name_do_not_matter(decoder: ImageDecoder, tmp_path: Path) -> None:
    pixels = (picture(3) * 255).astype(np.uint8)
    for name in ("really.png.jpg", "hash #1 100%.png", "bild größe.PNG", "no extension"):
        (tmp_path / name).write_bytes(encode_png(pixels))
        np.testing.assert_array_equal(decoder.read(tmp_path / name).pixels, pixels)


def test_an_exif_orientation_is_obeyed(decoder: ImageDecoder, tmp_path: Path) -> None:
    from PIL import Image as Pillow

    upright = np.zeros((20, 30, 3), np.uint8)
    upright[:10, :15] = 255  # bright top left
    exif = Pillow.Exif()
    exif[0x0112] = 6  # to be seen turned clockwise
    Pillow.fromarray(np.rot90(upright)).save(tmp_path / "turned.png", exif=exif)
    read = decoder.read(tmp_path / "turned.png").pixels
    np.testing.assert_array_equal(read, upright)


def test_layers_and_the_first_coloured_part_are_read(decoder: ImageDecoder, tmp_path: Path) -> None:
    lamp, sky = picture(3), picture(4)
    write_exr(tmp_path / "layers.exr", {"lamp": lamp, "": sky}, {"exposure": 1.5})
    np.testing.assert_array_equal(decoder.read(tmp_path / "layers.exr").pixels, sky)
    write_exr(tmp_path / "lamp.exr", {"lamp": lamp})
    np.testing.assert_array_equal(decoder.read(tmp_path / "lamp.exr").pixels, lamp)


def test_the_first_part_with_colour_is_read(decoder: ImageDecoder, tmp_path: Path) -> None:
    import OpenImageIO as oiio  # noqa: N813

    depth, colour = picture(1), picture(3)
    specs = []
    for name, pixels in (("depth", depth), ("beauty", colour)):
        spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], oiio.FLOAT)
        spec.attribute("oiio:subimagename", name)
        specs.append(spec)
    specs[0].channelnames = ("Z",)
    output = oiio.ImageOutput.create("parts.exr")
    assert output.open(str(tmp_path / "parts.exr"), specs)
    assert output.write_image(depth)
    assert output.open(str(tmp_path / "parts.exr"), specs[1], "AppendSubimage")
    assert output.write_image(colour)
    assert output.close()
    found, facts = decoder.read_pixels(tmp_path / "parts.exr")
    np.testing.assert_array_equal(found, colour)
    assert "Part 2" in facts.notes[0]


def test_a_data_window_is_put_into_its_display_window(decoder: ImageDecoder, tmp_path: Path) -> None:
    import OpenImageIO as oiio  # noqa: N813

    pixels = picture(3, 4, 6)
    spec = oiio.ImageSpec(6, 4, 3, oiio.FLOAT)
    spec.x, spec.y = -2, 1
    spec.full_x, spec.full_y, spec.full_width, spec.full_height = 0, 0, 5, 8
    output = oiio.ImageOutput.create("window.exr")
    assert output.open(str(tmp_path / "window.exr"), spec)
    assert output.write_image(pixels)
    assert output.close()
    found, facts = decoder.read_pixels(tmp_path / "window.exr")
    assert found.shape == (8, 5, 3)
    np.testing.assert_array_equal(found[1:5, :4], pixels[:, 2:])
    assert found[0].sum() == found[5:].sum() == found[:, 4].sum() == 0
    assert "display window" in facts.notes[0]


def test_radiance_headers_without_format_and_with_exposure(decoder: ImageDecoder, tmp_path: Path) -> None:
    rgbe = bytes((128, 64, 32, 129)) * 8
    head = b"#?RADIANCE\nEXPOSURE=2\nEXPOSURE= 4\n"
    (tmp_path / "odd.hdr").write_bytes(head + b"\n-Y 2 +X 4\n" + rgbe)
    found, facts = decoder.read_pixels(tmp_path / "odd.hdr")
    np.testing.assert_allclose(found[0, 0], [1.0, 0.5, 0.25], atol=0.01)
    assert facts.exposure == 8


@pytest.mark.parametrize(
    ("content", "cause"),
    [
        (b"", "no picture"),
        (b"hello, this is text", "no picture"),
        (b"\x76\x2f\x31\x01\x02\0\0\0", "cannot be read"),
        (b"\x89PNG\r\n\x1a\n\0\0", "cannot be read"),
    ],
)
def test_what_is_no_picture_is_refused_by_name(
    decoder: ImageDecoder, tmp_path: Path, content: bytes, cause: str
) -> None:
    path = tmp_path / "broken.exr"
    path.write_bytes(content)
    with pytest.raises(InputError, match=cause) as caught:
        decoder.read(path)
    assert "broken.exr" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_files_and_folders_are_refused(decoder: ImageDecoder, tmp_path: Path) -> None:
    for path in (tmp_path / "nothing.png", tmp_path):
        with pytest.raises(InputError, match="no such file"):
            decoder.read(path)
    with pytest.raises(InputError):
        decoder.read("a\0b.png")


def test_sizes_beyond_the_limit_are_refused(tmp_path: Path) -> None:
    write_png(tmp_path / "large.png", np.zeros((40, 50, 3), np.uint8))
    with ImageDecoder(Limits(pixels=1999)) as decoder, pytest.raises(InputError, match="50 × 40"):
        decoder.read(tmp_path / "large.png")


def test_a_truncated_picture_is_refused(decoder: ImageDecoder, tmp_path: Path) -> None:
    for suffix, write in ((".hdr", write_hdr), (".exr", write_exr)):
        path = tmp_path / f"cut{suffix}"
        write(path, picture(3, 64, 64))
        path.write_bytes(path.read_bytes()[:-2000])
        with pytest.raises(InputError, match=f"cut{suffix}"):
            decoder.read(path)


def test_a_crash_is_an_input_error_and_the_child_starts_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    write_png(tmp_path / "a.png", np.full((2, 2, 3), 9, np.uint8))
    with ImageDecoder() as decoder:
        with monkeypatch.context() as patch:
            patch.setattr(io, "_BOOT", "import sys, os; sys.stdin.readline(); os.abort()")
            with pytest.raises(InputError, match=r"a\.png .*crash"):
                decoder.read(tmp_path / "a.png")
        assert decoder.read(tmp_path / "a.png").pixels[0, 0, 0] == 9


def test_a_hang_is_an_input_error_and_the_child_starts_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    write_png(tmp_path / "a.png", np.full((2, 2, 3), 9, np.uint8))
    with ImageDecoder(timeout=0.3) as decoder:
        with monkeypatch.context() as patch:
            patch.setattr(io, "_BOOT", "import time; time.sleep(600)")
            with pytest.raises(InputError, match=r"a\.png .*more than 0.3 s"):
                decoder.read(tmp_path / "a.png")
        decoder.timeout = 60
        assert decoder.read(tmp_path / "a.png").pixels[0, 0, 0] == 9


def test_an_impossible_answer_is_an_input_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.zeros((2, 2, 3), np.uint8))
    for answer in (
        '{"shape": [99999999, 99999999, 3], "dtype": "float32", "facts": {}}',
        "[]",
        "nonsense",
        "{}",
    ):
        monkeypatch.setattr(io, "_BOOT", f"input(); print({answer!r})")
        with ImageDecoder() as decoder, pytest.raises(InputError, match=r"a\.png"):
            decoder.read(tmp_path / "a.png")


def test_a_closed_decoder_leaves_no_process(tmp_path: Path) -> None:
    write_png(tmp_path / "a.png", np.zeros((2, 2, 3), np.uint8))
    decoder = ImageDecoder()
    decoder.read(tmp_path / "a.png")
    child = decoder._child
    assert child is not None
    decoder.close()
    assert child.poll() is not None
    decoder.read(tmp_path / "a.png")  # and it may be used again
    decoder.close()


SEEDS = (
    encode_exr(picture(3)),
    encode_png((picture(4) * 255).astype(np.uint8)),
    b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 8\n" + bytes(range(64)),
)


@given(
    seed=st.sampled_from(SEEDS),
    changes=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), max_size=20),
    cut=st.integers(0, 400),
)
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_bytes_give_a_picture_or_an_input_error(
    decoder: ImageDecoder, seed: bytes, changes: list[tuple[int, int]], cut: int
) -> None:
    damaged = bytearray(seed[: len(seed) - cut] if cut < len(seed) else seed)
    for place, value in changes:
        damaged[place % len(damaged)] = value
    try:
        assert decoder.decode(bytes(damaged), "damaged.exr").pixels.size
    except InputError as error:
        assert "damaged.exr" in str(error)


@given(
    st.binary(max_size=300),
    st.sampled_from([b"\x76\x2f\x31\x01\x02\0\0\0", b"II*\0", b"\xff\xd8\xff", b"BM"]),
)
@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_garbage_gives_a_picture_or_an_input_error(
    decoder: ImageDecoder, garbage: bytes, magic: bytes
) -> None:
    try:
        assert decoder.decode(magic + garbage, "garbage").pixels.size
    except InputError as error:
        assert "garbage" in str(error)
