"""Photographs in the project: what is kept tells nothing about people and places, and nothing is lost."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from photo_support import encoded, jpeg, picture, private_jpeg, shot_exif
from scenes import little_scene

from studio_core.capturing.edits import add_capture
from studio_core.capturing.keeping import keep, recall, take, take_all, thumbnail
from studio_core.document import Document
from studio_core.errors import Cancelled, InputError
from studio_core.imaging.encode import encode_exr
from studio_core.imaging.io import ImageDecoder
from studio_core.imaging.photograph import Photograph, ShotFacts
from studio_core.imaging.photograph_read import read_photograph
from studio_core.project.store import load, save
from studio_core.scene.capture import Capture
from studio_core.shading.job import Job

SECRETS = (b"WITNESS", b"Jane", b"secret-serial", b"GPSLatitude")


@pytest.fixture(scope="module")
def decoder() -> Iterator[ImageDecoder]:
    with ImageDecoder(timeout=60) as made:
        yield made


@pytest.mark.parametrize("orientation", [1, 6])
def test_a_kept_jpeg_tells_nothing_and_comes_back_bit_for_bit(
    decoder: ImageDecoder, orientation: int, tmp_path: Path
) -> None:
    path = tmp_path / "IMG_1.jpg"
    path.write_bytes(private_jpeg(picture(300, 400), orientation))
    photograph, kept = take(path, decoder)
    path.unlink()
    assert kept.data is not None
    assert not any(secret in kept.data.pixels.tobytes() for secret in SECRETS)
    back = recall(kept, tmp_path, decoder)
    np.testing.assert_array_equal(back.pixels, photograph.pixels)
    assert (back.facts, back.digest, back.notes) == (photograph.facts, photograph.digest, photograph.notes)
    assert back.facts.seconds == 1 / 50
    assert kept.size == photograph.size == ((300, 400) if orientation == 6 else (400, 300))
    assert max(kept.thumbnail.pixels.shape) == 160


def test_a_kept_png_tells_nothing_and_comes_back_bit_for_bit(decoder: ImageDecoder) -> None:
    data = encoded(picture(), "PNG", exif=b"Exif\0\0" + shot_exif(orientation=3, private=True)) + b"WITNESS"
    photograph = read_photograph(data, "a.png", decoder)
    kept = keep(data, photograph)
    assert kept.data is not None
    assert not any(secret in kept.data.pixels.tobytes() for secret in SECRETS)
    back = recall(kept, None, decoder)
    np.testing.assert_array_equal(back.pixels, photograph.pixels)
    assert back.facts == photograph.facts


def test_the_colours_of_a_kept_photograph_stay_those_of_its_profile(decoder: ImageDecoder) -> None:
    from PIL import ImageCms

    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    red = srgb.index(b"XYZ \0\0\0\0") + 8
    wide = srgb[:red] + (int(0.52 * 65536)).to_bytes(4, "big") + srgb[red + 4 :]
    data = jpeg(picture(), icc_profile=wide)
    photograph = read_photograph(data, "a.jpg", decoder)
    assert recall(keep(data, photograph), None, decoder).colour == photograph.colour


def test_a_project_file_holds_the_photographs_and_nothing_private(
    decoder: ImageDecoder, tmp_path: Path
) -> None:
    path = tmp_path / "IMG_1.jpg"
    path.write_bytes(private_jpeg(picture(300, 400)))
    photograph, kept = take(path, decoder, tell_path=False)
    document = Document(little_scene())
    document.apply(add_capture((kept,)))
    project = tmp_path / "room.lucarne"
    save(project, document.scene)
    data = project.read_bytes()
    assert not any(secret in data for secret in (*SECRETS, str(tmp_path).encode()))
    opened = next(load(project).scene.of(Capture)).photographs[0]
    assert opened.data is not None
    assert not any(secret in opened.data.pixels.tobytes() for secret in SECRETS)
    np.testing.assert_array_equal(recall(opened, tmp_path, decoder).pixels, photograph.pixels)
    assert opened.facts == photograph.facts


def test_other_files_stay_where_they_are(decoder: ImageDecoder, tmp_path: Path) -> None:
    light = np.random.default_rng(0).random((40, 60, 3)).astype(np.float32)
    path = tmp_path / "photos" / "a.exr"
    path.parent.mkdir()
    path.write_bytes(encode_exr(light))
    photograph, kept = take(path, decoder)
    assert kept.data is None
    assert kept.path == str(path)
    np.testing.assert_array_equal(recall(kept, tmp_path, decoder).pixels, photograph.pixels)
    beside = tmp_path / "a.exr"
    path.rename(beside)  # the photographs went along with the project
    np.testing.assert_array_equal(recall(kept, tmp_path, decoder).pixels, photograph.pixels)
    beside.write_bytes(encode_exr(light * 2))
    with pytest.raises(InputError, match=r"a\.exr is not the photograph any more"):
        recall(kept, tmp_path, decoder)
    beside.unlink()
    with pytest.raises(InputError, match=r"a\.exr cannot be found: put the photograph back"):
        recall(kept, tmp_path, decoder)
    data = encode_exr(light)
    untold = keep(data, read_photograph(data, "b.exr", decoder))
    with pytest.raises(InputError, match=r"^b\.exr is not in the project"):
        recall(untold, tmp_path, decoder)


def test_many_are_taken_and_the_unreadable_ones_named(decoder: ImageDecoder, tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(jpeg(picture()))
    (tmp_path / "b.jpg").write_bytes(b"no")
    taken, problems = take_all([tmp_path / "b.jpg", tmp_path / "a.jpg"], decoder)
    assert [kept.facts.name for _, kept in taken] == ["a.jpg"]
    assert [p.split(" cannot")[0] for p in problems] == [str(tmp_path / "b.jpg")]
    job = Job("taking")
    job.cancel()
    with pytest.raises(Cancelled):
        take_all([tmp_path / "a.jpg"], decoder, job)


def test_thumbnails_look_like_the_photograph() -> None:
    facts = ShotFacts("a")
    pixels = picture(320, 160)
    small = thumbnail(Photograph(pixels, facts, "1")).pixels
    assert small.shape == (160, 80, 3)
    np.testing.assert_allclose(small, pixels.reshape(160, 2, 80, 2, 3).mean(axis=(1, 3)), atol=1)
    deep = thumbnail(Photograph(pixels.astype(np.uint16) * 257, facts, "2")).pixels
    np.testing.assert_allclose(deep, small, atol=1)
    light = thumbnail(Photograph(np.full((40, 60, 3), 0.5, np.float32), facts, "3")).pixels
    assert (light == 188).all()
    green = np.zeros((40, 60, 3), np.uint8)
    green[:, :, 1] = 255
    wide = (1.22, -0.22, 0.0, -0.04, 1.04, 0.0, -0.02, -0.08, 1.1)
    assert tuple(thumbnail(Photograph(green, facts, "4", colour=wide)).pixels[0, 0]) == (0, 255, 0)
