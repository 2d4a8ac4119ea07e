"""Pictures as files: bands, bits, alpha, layers, what a file says of itself."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - its customary name
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from studio_core.errors import InputError
from studio_core.imaging.picture import Finish, PictureFile, channel_names, displayed, write_picture
from studio_core.imaging.rows import RowWriter
from studio_core.kernels.tonemap import KINDS, tonemap, tonemap16

LINEAR = np.random.default_rng(4).gamma(0.5, 1.0, (20, 9, 3)).astype(np.float32)


def read(path: Path) -> tuple[np.ndarray, oiio.ImageSpec]:
    as_it_is = oiio.ImageSpec()
    as_it_is.attribute("oiio:UnassociatedAlpha", 1)
    found = oiio.ImageInput.open(str(path), as_it_is)
    spec = found.spec()
    pixels = found.read_image(0, 0, 0, spec.nchannels, spec.format)
    found.close()
    return pixels, spec


@pytest.mark.parametrize(("name", "depth"), [("a.png", 8), ("a.png", 16), ("a.exr", 16), ("a.exr", 32)])
def test_a_file_in_bands_is_the_file_in_one_piece(tmp_path: Path, name: str, depth: int) -> None:
    finish = Finish(0.5, "filmic", depth)
    for folder, cuts in (("one", [20]), ("many", [1, 8, 3, 8])):
        (tmp_path / folder).mkdir()
        with PictureFile(tmp_path / folder / name, (9, 20), finish) as file:
            for rows in np.split(LINEAR, np.cumsum(cuts)[:-1]):
                file.write(rows)
    assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "many" / name).read_bytes()
    pixels, spec = read(tmp_path / "one" / name)
    expected = {8: tonemap(LINEAR, 0.5, "filmic"), 16: tonemap16(LINEAR, 0.5, "filmic"), 32: LINEAR}[depth]
    if name == "a.exr":
        expected = LINEAR.astype(np.float16 if depth == 16 else np.float32)
    np.testing.assert_array_equal(pixels, expected)
    assert (
        str(spec.format)
        == {"a.png": {8: "uint8", 16: "uint16"}, "a.exr": {16: "half", 32: "float"}}[name][depth]
    )


def test_what_half_floats_cannot_hold_becomes_their_largest(tmp_path: Path) -> None:
    bright = np.full((1, 2, 3), 1e6, np.float32)
    with PictureFile(tmp_path / "a.exr", (2, 1), Finish(depth=16)) as file:
        file.write(bright)
    assert (read(tmp_path / "a.exr")[0] == 65504).all()


def test_an_exception_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"old")
    with pytest.raises(KeyError), PictureFile(path, (9, 20)) as file:
        file.write(LINEAR[:4])
        raise KeyError
    with pytest.raises(ValueError, match="4 of 20 rows"), PictureFile(path, (9, 20)) as file:
        file.write(LINEAR[:4])
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_rows_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    rows = np.zeros((3, 9, 3), np.uint8)
    for wrong in (rows[:, 1:], rows[:, :, 1:], np.concatenate([rows, rows])):
        with (
            pytest.raises(ValueError, match="do not fit"),
            RowWriter(tmp_path / "a.png", 9, 4, ("R", "G", "B"), "uint8") as file,
        ):
            file.write(wrong)
    assert not list(tmp_path.iterdir())


def test_layers_by_light_are_channels(tmp_path: Path) -> None:
    with PictureFile(tmp_path / "a.exr", (9, 20), alpha=True, lights=("Sky", "Lamp.1")) as file:
        alpha = LINEAR[:, :, 0]
        file.write(LINEAR, alpha, {"Sky": 0.25 * LINEAR, "Lamp.1": 0.75 * LINEAR})
    pixels, spec = read(tmp_path / "a.exr")
    at = {name: pixels[:, :, index] for index, name in enumerate(spec.channelnames)}
    assert set(at) == {"R", "G", "B", "A", *(f"{light}.{c}" for light in ("Sky", "Lamp_1") for c in "RGB")}
    np.testing.assert_array_equal(at["A"], LINEAR[:, :, 0])
    np.testing.assert_array_equal(at["Lamp_1.G"], np.float32(0.75) * LINEAR[:, :, 1])


@given(st.lists(st.text(max_size=6), max_size=6).map(tuple))
def test_channel_names_differ_and_have_no_dots(names: tuple[str, ...]) -> None:
    made = channel_names(names)
    assert len(set(made)) == len(made) == len(names)
    assert all(name and "." not in name for name in made)


def test_a_png_has_straight_alpha(tmp_path: Path) -> None:
    alpha = np.linspace(0, 1, 9, dtype=np.float32)[None].repeat(20, axis=0)
    with PictureFile(tmp_path / "a.png", (9, 20), alpha=True) as file:
        file.write(LINEAR * alpha[:, :, None], alpha)
    pixels, _ = read(tmp_path / "a.png")
    opaque = tonemap(LINEAR)
    np.testing.assert_array_equal(pixels[:, :, 3], np.rint(alpha * 255))
    assert np.abs(pixels[:, 1:, :3].astype(int) - opaque[:, 1:]).max() <= 1
    assert not pixels[:, 0, :3].any()


@given(
    arrays.arrays(np.float32, (4, 3), elements=st.floats(-10, 1e6, width=32)),
    st.floats(-10, 10),
    st.sampled_from(KINDS),
)
def test_sixteen_bits_round_to_the_eight_that_are_shown(
    linear: np.ndarray, exposure: float, kind: str
) -> None:
    fine = tonemap16(linear[None], exposure, kind)
    assert np.abs(fine / 257 - tonemap(linear[None], exposure, kind)).max() <= 0.56


def test_sixteen_bits_of_no_number_are_black_and_of_infinity_white() -> None:
    odd = np.array([[[np.nan, np.inf, -1.0]]], np.float32)
    assert tonemap16(odd).tolist() == [[[0, 65535, 0]]]
    with pytest.raises(ValueError, match="no view"):
        tonemap16(odd, 0, "sepia")


def test_a_file_says_what_it_is(tmp_path: Path) -> None:
    for name in ("a.png", "a.exr"):
        facts = {"lucarne:camera": "Sofa", "lucarne:error": 0.02}
        with PictureFile(tmp_path / name, (9, 20), Finish(dpi=300), facts=facts) as file:
            file.write(LINEAR)
        _, spec = read(tmp_path / name)
        assert spec.getattribute("Software") == "Lucarne Studio"
        assert spec.getattribute("lucarne:camera") == "Sofa"
        assert spec.getattribute("XResolution") == pytest.approx(300, abs=0.05)


@pytest.mark.parametrize(
    ("name", "depth", "lights", "says"),
    [
        ("a.png", 32, False, "8 or 16"),
        ("a.exr", 8, False, "16 or 32"),
        ("a.png", 8, True, "OpenEXR"),
        ("a.gif", 0, False, "png"),
    ],
)
def test_what_no_file_can_have_is_said(
    tmp_path: Path, name: str, depth: int, lights: bool, says: str
) -> None:
    with pytest.raises(InputError, match=says):
        PictureFile(tmp_path / name, (9, 20), Finish(depth=depth), lights=("Sky",) if lights else ())


def test_bands_must_have_what_their_picture_has(tmp_path: Path) -> None:
    with (
        pytest.raises(ValueError, match="other layers"),
        PictureFile(tmp_path / "a.exr", (9, 20), alpha=True) as file,
    ):
        file.write(LINEAR)


def test_a_whole_picture_at_once(tmp_path: Path) -> None:
    write_picture(tmp_path / "a.png", LINEAR, exposure=1.0, kind="raw")
    np.testing.assert_array_equal(read(tmp_path / "a.png")[0], tonemap(LINEAR, 1.0, "raw"))
    np.testing.assert_array_equal(displayed(LINEAR, Finish(1.0, "raw")), tonemap(LINEAR, 1.0, "raw"))
