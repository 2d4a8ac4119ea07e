"""Photographs: encoded numbers, facts, and files of every kind, sound or not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from photo_support import (
    encoded,
    exif_block,
    jpeg,
    picture,
    private_jpeg,
    shot_exif,
    with_segment,
)

from studio_core.errors import Cancelled, InputError
from studio_core.imaging.bare import strip
from studio_core.imaging.encode import encode_exr, write_hdr
from studio_core.imaging.io import ImageDecoder
from studio_core.imaging.photograph import in_rec709
from studio_core.imaging.photograph_read import read_photograph, read_photographs
from studio_core.imaging.transfer import to_rec709
from studio_core.shading.job import Job


@pytest.fixture(scope="module")
def decoder() -> Iterator[ImageDecoder]:
    with ImageDecoder(timeout=60) as made:
        yield made


def turned(pixels: np.ndarray, orientation: int) -> np.ndarray:
    """Exif's orientations by what their definition says of the 0th row and column."""
    flips = {1: [], 2: ["x"], 3: ["x", "y"], 4: ["y"], 5: ["t"], 6: ["t", "x"], 7: ["t", "x", "y"]}
    for step in flips.get(orientation, ["t", "y"]):
        pixels = {"x": pixels[:, ::-1], "y": pixels[::-1], "t": pixels.transpose(1, 0, 2)}[step]
    return pixels


@pytest.mark.parametrize("orientation", range(1, 9))
def test_jpeg_and_png_stand_upright(decoder: ImageDecoder, orientation: int) -> None:
    pixels = picture()
    exif = shot_exif(orientation=orientation)
    png = encoded(pixels, "PNG", exif=b"Exif\0\0" + exif)
    read = read_photograph(png, "a.png", decoder)
    np.testing.assert_array_equal(read.pixels, turned(pixels, orientation))
    plain = read_photograph(jpeg(pixels), "a.jpg", decoder).pixels
    read = read_photograph(jpeg(pixels, exif), "a.jpg", decoder)
    np.testing.assert_array_equal(read.pixels, turned(plain, orientation))
    assert read.facts.seconds == 1 / 50
    assert read.facts.name == "a.jpg"
    assert read.kind == "8 bit"


@pytest.mark.parametrize("form", ["TIFF", "WEBP"])
def test_other_files_tell_their_exposure_too(decoder: ImageDecoder, form: str) -> None:
    from PIL import Image

    exif = Image.Exif()
    exif.load(b"Exif\0\0" + shot_exif(seconds=(1, 8), orientation=3))
    pixels = picture()
    options = {"lossless": True} if form == "WEBP" else {}
    data = encoded(pixels, form, exif=exif, **options)
    read = read_photograph(data, "scan", decoder)
    if form == "TIFF":
        np.testing.assert_array_equal(read.pixels, turned(pixels, 3))
    assert read.facts.camera == "Acme Phone 3"
    assert read.facts.seconds == 1 / 8


def test_sixteen_bits_stay_encoded(decoder: ImageDecoder, tmp_path: Path) -> None:
    import cv2

    deep = np.random.default_rng(1).integers(0, 65535, (30, 20, 3), dtype=np.uint16)
    for name in ("a.png", "a.tif"):
        assert cv2.imwrite(str(tmp_path / name), deep[:, :, ::-1])
        read = read_photograph(tmp_path / name, decoder=decoder)
        assert read.kind == "16 bit"
        np.testing.assert_array_equal(read.pixels, deep)


def test_grey_becomes_colour_and_alpha_goes(decoder: ImageDecoder) -> None:
    grey = read_photograph(encoded(picture()[:, :, 0], "PNG"), "grey.png", decoder)
    np.testing.assert_array_equal(grey.pixels, np.repeat(picture()[:, :, :1], 3, axis=2))
    assert grey.notes == ("It is in shades of grey.",)
    alpha = np.concatenate([picture(), picture(seed=3)[:, :, :1]], axis=2)
    read = read_photograph(encoded(alpha, "PNG"), "alpha.png", decoder)
    np.testing.assert_array_equal(read.pixels, alpha[:, :, :3])


def test_linear_files_stay_linear(decoder: ImageDecoder, tmp_path: Path) -> None:
    light = np.random.default_rng(2).random((20, 40, 3)).astype(np.float32) * 50
    light[0, 0], light[0, 1], light[0, 2] = np.nan, np.inf, -3
    read = read_photograph(encode_exr(light), "a.exr", decoder)
    assert read.kind == "linear"
    np.testing.assert_array_equal(read.pixels[1:], light[1:])
    np.testing.assert_array_equal(read.pixels[0, :3, 0], [0, light[1:].max(), 0])
    write_hdr(tmp_path / "a.hdr", light[1:])
    assert read_photograph(tmp_path / "a.hdr", decoder=decoder).kind == "linear"


def test_the_primaries_of_a_phone_become_rec709(decoder: ImageDecoder) -> None:
    """A profile with Display P3's colorants as Apple writes them; the matrix against chromaticities."""
    import struct

    colorants = {b"rXYZ": (0.51512, 0.24120, -0.00105), b"gXYZ": (0.29198, 0.69225, 0.04189)}
    colorants[b"bXYZ"] = (0.15710, 0.06657, 0.78407)
    table, bodies, at = b"", b"", 132 + 12 * 3
    for name, xyz in colorants.items():
        body = b"XYZ \0\0\0\0" + struct.pack(">3i", *(round(v * 65536) for v in xyz))
        table += struct.pack(">4sII", name, at + len(bodies), len(body))
        bodies += body
    size = at + len(bodies)
    head = struct.pack(">I", size) + b"\0" * 8 + b"mntrRGB XYZ " + b"\0" * 12 + b"acsp" + b"\0" * 88
    profile = head + struct.pack(">I", 3) + table + bodies
    read = read_photograph(encoded(picture(), "PNG", icc_profile=profile), "a.png", decoder)
    p3 = (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290)
    np.testing.assert_allclose(np.reshape(read.colour, (3, 3)), to_rec709(p3), atol=2e-3)
    light = np.array([[[0.5, 0.5, 0.5], [0, 1, 0]]], np.float32)
    shown = in_rec709(light, read.colour)
    np.testing.assert_allclose(shown[0, 0], 0.5, atol=2e-3)
    assert shown.min() >= 0
    from PIL import ImageCms

    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    assert read_photograph(encoded(picture(), "PNG", icc_profile=srgb), "a.png", decoder).colour == ()


def test_small_faults_of_cameras_are_passed_over_and_damage_is_not(decoder: ImageDecoder) -> None:
    data = jpeg(picture(200, 300))
    sound = read_photograph(data, "a.jpg", decoder).pixels
    scan = data.index(b"\xff\xda")
    odd = bytearray(data)
    odd[scan + 12] = 0  # what some phones write: the end of the spectrum of a sequential picture
    for harmless in (bytes(odd), data[:scan] + b"\0\0\0" + data[scan:], data[:-2], data + b"\0" * 500):
        np.testing.assert_array_equal(read_photograph(harmless, "a.jpg", decoder).pixels, sound)
    many = encoded(picture(200, 300), progressive=True)
    scans = [place for place in range(len(many)) if many[place : place + 2] == b"\xff\xda"]
    cut = [many[: scans[-1]], many[: scans[2]], many[: len(many) * 2 // 3]]
    for harm in (*cut, data[: len(data) // 2], data[: scan + 40], data[:scan], data[:30]):
        with pytest.raises(InputError, match=r"^a\.jpg cannot be read: it is damaged or incomplete \("):
            read_photograph(harm, "a.jpg", decoder)


@pytest.mark.parametrize(
    ("data", "name", "why"),
    [
        (b"", "a.jpg", "the file is empty"),
        (b"Dear diary,\n", "a.jpg", "it is no photograph of a known format"),
        (b"\xff\xd8\xff", "a.jpg", "it is damaged or incomplete (no picture is in it)"),
        (b"\x89PNG\r\n\x1a\n", "a.png", "it is damaged or incomplete (no picture is in it)"),
        (encoded(picture(1, 1), "PNG"), "a.png", "1 × 1 pixels are no photograph"),
        (encoded(picture(9, 300), "PNG"), "a.png", "300 × 9 pixels are no photograph"),
    ],
)
def test_what_is_no_photograph_is_refused_in_a_sentence(
    decoder: ImageDecoder, data: bytes, name: str, why: str
) -> None:
    with pytest.raises(InputError) as caught:
        read_photograph(data, name, decoder)
    assert str(caught.value) in (f"{name} cannot be read: {why}", f"{name} cannot be used: {why}")


def test_many_are_read_and_the_unreadable_ones_named(decoder: ImageDecoder, tmp_path: Path) -> None:
    for name in ("b.jpg", "a.jpg"):
        (tmp_path / name).write_bytes(jpeg(picture(), shot_exif()))
    (tmp_path / "bad.jpg").write_bytes(b"no")
    paths = [tmp_path / name for name in ("b.jpg", "bad.jpg", "gone.jpg", "a.jpg")]
    found, problems = read_photographs(paths, decoder)
    assert [p.facts.name for p in found] == ["b.jpg", "a.jpg"]
    assert [p.split(" cannot")[0] for p in problems] == [str(paths[1]), str(paths[2])]
    assert found[0].digest == found[1].digest != read_photograph(jpeg(picture()), "c", decoder).digest
    job = Job("reading")
    job.cancel()
    with pytest.raises(Cancelled):
        read_photographs(paths, decoder, job)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_mutated_file_is_read_or_refused(decoder: ImageDecoder, data: st.DataObject) -> None:
    made = bytearray(data.draw(st.sampled_from([private_jpeg(picture()), encoded(picture(), "PNG")])))
    for _ in range(data.draw(st.integers(1, 6))):
        made[data.draw(st.integers(2, len(made) - 1))] = data.draw(st.integers(0, 255))
    end = data.draw(st.one_of(st.just(len(made)), st.integers(0, len(made))))
    try:
        read = read_photograph(bytes(made[:end]), "it.jpg", decoder)
    except InputError as error:
        assert str(error).startswith("it.jpg cannot be ")
        assert "\n" not in str(error)
    else:
        assert read.pixels.shape[2] == 3


@pytest.mark.parametrize("orientation", [1, 6])
@pytest.mark.parametrize("progressive", [False, True])
def test_bare_files_hold_the_same_picture_and_nothing_else(
    decoder: ImageDecoder, orientation: int, progressive: bool, tmp_path: Path
) -> None:
    from PIL import ImageCms

    icc = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    data = private_jpeg(picture(90, 70), orientation, progressive=progressive, icc_profile=icc)
    bare = strip(data)
    assert bare is not None
    for secret in (b"WITNESS", b"secret-serial", b"Jane", b"xap", b"MPF", b"Acme", b"\x88\x25"):
        assert secret in data
        assert secret not in bare.data
    assert icc in bare.data
    (tmp_path / "whole.jpg").write_bytes(data)
    whole = decoder.read(tmp_path / "whole.jpg").pixels  # by the decoder of plain pictures
    np.testing.assert_array_equal(decoder.decode(bare.data, "bare.jpg").pixels, whole)
    np.testing.assert_array_equal(read_photograph(data, "it.jpg", decoder).pixels, whole)
    again = strip(bare.data)
    assert again is not None
    assert again.data == bare.data


def test_a_bare_png_holds_the_picture_and_how_it_is_turned(decoder: ImageDecoder) -> None:
    from PIL.PngImagePlugin import PngInfo

    told = PngInfo()
    told.add_text("Comment", "WITNESS")
    told.add_itxt("XML:com.adobe.xmp", "WITNESS", zip=False)
    exif = b"Exif\0\0" + shot_exif(orientation=8, private=True)
    data = encoded(picture(), "PNG", exif=exif, pnginfo=told) + b"WITNESS"
    bare = strip(data)
    assert bare is not None
    assert b"WITNESS" in data
    assert not any(word in bare.data for word in (b"WITNESS", b"secret-serial", b"Jane", b"tEXt"))
    shown = decoder.decode(bare.data, "bare.png").pixels
    np.testing.assert_array_equal(shown, turned(picture(), 8))


def test_a_preview_within_the_header_goes(decoder: ImageDecoder) -> None:
    thumbnail = b"\x02\x02" + b"WITNESSWITNE"
    plain = jpeg(picture())
    body = b"JFIF\0\x01\x02\0\0\x01\0\x01" + thumbnail
    data = with_segment(plain[:2] + plain[20:], 0xE0, body)
    bare = strip(data)
    assert bare is not None
    assert b"WITNESS" not in bare.data
    np.testing.assert_array_equal(
        read_photograph(data, "a.jpg", decoder).pixels, read_photograph(plain, "a.jpg", decoder).pixels
    )
    assert strip(exif_block()) is None


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_stripping_ends_with_any_bytes_and_twice_is_once(data: st.DataObject) -> None:
    start = data.draw(st.sampled_from([b"\xff\xd8", b"\x89PNG\r\n\x1a\n", private_jpeg(picture(), 8)]))
    pieces = st.sampled_from(
        [b"\xff\xda\0\x04ab", b"\xff\xd9", b"\0\0\0\x02IDATxy....", b"\xff", b"\xff\xe1"]
    )
    bare = strip(start + b"".join(data.draw(st.lists(st.one_of(pieces, st.binary(max_size=20)), max_size=9))))
    if bare is not None:
        again = strip(bare.data)
        assert again is not None
        assert again.data == bare.data
