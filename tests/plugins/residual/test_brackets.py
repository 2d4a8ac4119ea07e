"""Photographs of cameras that nobody calibrated become light again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studio.bench.lab import LabShots, Rig, row, shoot
from studio.bench.lab_cameras import Camera, Name, flat_name, folder_name, write_bracketed
from studio.bench.lab_surfaces import library
from studio.bench.phone_response import Curve
from studio_core.errors import InputError
from studio_core.imaging.encode import write_png
from studio_plugins.residual.pictures import Pictures, read_folder
from studio_plugins.residual.samples import Ball

FOUR = (-6.0, -4.0, -2.0, 0.0)


@pytest.fixture(scope="module")
def shots() -> LabShots:
    rig = Rig(size=(84, 80), ball=Ball(42.3, 39.6, 35.0), white=1e9)
    return shoot(library()["two-lobes"], row(0.0).some([1, 9]), rig)


def compared(read: Pictures, shots: LabShots) -> tuple[float, float]:
    """nMSE of the light over what is not clipped, but for one scale; and how far scales of lamps differ."""
    order = [int(np.argmax(shots.told.directions @ d)) for d in read.lights.directions]
    truth = shots.pictures[order]
    use = ~read.clipped & (truth.min(axis=-1) > 0.003)
    a, b = (np.where(use[..., None], v, 0).astype(np.float64) for v in (read.light, truth))
    each = (a * b).sum(axis=(1, 2, 3)) / (a * a).sum(axis=(1, 2, 3))
    scale = (a * b).sum() / (a * a).sum()
    return float(((scale * a - b) ** 2).sum() / (b**2).sum()), float(np.ptp(each) / scale)


@pytest.mark.parametrize(
    ("camera", "name", "most"),
    [
        (Camera(), flat_name, 1e-3),
        (Camera(bits=16), flat_name, 1e-7),
        (Camera(Curve("per channel"), 16, evs=FOUR), folder_name, 2e-3),
    ],
)
def test_light_comes_back(tmp_path: Path, shots: LabShots, camera: Camera, name: Name, most: float) -> None:
    write_bracketed(shots, tmp_path, camera, name)
    error, apart = compared(read_folder(tmp_path), shots)
    assert error < most
    assert apart < 0.03


def test_a_wrong_exposure_is_found_and_said(tmp_path: Path, shots: LabShots) -> None:
    evs = (-6.0, -4.0, -2.5, 0.0)
    write_bracketed(shots, tmp_path, Camera(Curve("filmic"), evs=evs, listed=FOUR), folder_name)
    read = read_folder(tmp_path)
    error, apart = compared(read, shots)
    assert error < 6e-3
    assert apart < 0.03
    assert any("IMG_0003.jpg was exposed otherwise than listed" in note for note in read.notes)


def test_lamps_with_exposures_of_their_own_are_made_comparable(tmp_path: Path, shots: LabShots) -> None:
    for i, ev in enumerate((0.0, -1.0)):
        one = replace(shots, pictures=shots.pictures[i : i + 1], told=shots.told.some([i]))
        write_bracketed(one, tmp_path, Camera(bits=8, full=2.0, evs=(ev,), listed=(ev,)))
    read = read_folder(tmp_path)
    assert compared(read, shots)[1] < 0.01
    assert any("different exposures" in note for note in read.notes)


def test_numbers_may_be_said_to_be_linear(tmp_path: Path, shots: LabShots) -> None:
    write_bracketed(shots, tmp_path, Camera(Curve("linear"), 16))
    assert compared(read_folder(tmp_path), shots)[0] > 0.05
    assert compared(read_folder(tmp_path, response="linear"), shots)[0] < 1e-7
    with pytest.raises(InputError, match="no response 'log'"):
        read_folder(tmp_path, response="log")


def test_white_is_balanced_by_a_colour_or_a_spot(tmp_path: Path, shots: LabShots) -> None:
    grey = replace(shots, pictures=shots.pictures.mean(axis=-1, keepdims=True).repeat(3, axis=-1))
    write_bracketed(grey, tmp_path, Camera(bits=16, full=2.0, white=(1.3, 1.0, 0.6)))
    read = read_folder(tmp_path)
    spot = read.spot(42, 40, 6)
    assert np.allclose(spot / spot[1], [1.3, 1.0, 0.6], rtol=1e-3)
    for white in (spot.tolist(), (1.3, 1.0, 0.6)):
        light = read.balanced(white).light[~read.clipped]
        assert np.abs(np.ptp(light, axis=-1)).max() < 2e-3 * light.max()
        assert light.mean() == pytest.approx(read.light[~read.clipped].mean(), rel=0.3)
    with pytest.raises(InputError, match="no light there"):
        read.spot(1, 1, 0)
    with pytest.raises(InputError, match="above zero"):
        read.balanced((1, 0, 1))


def test_what_is_damaged_is_left_out_as_long_as_it_is_little(tmp_path: Path, shots: LabShots) -> None:
    write_bracketed(shots, tmp_path, Camera(evs=(-2.0, 0.0), listed=(-2.0, 0.0)), folder_name)
    (tmp_path / "m50/IMG_0001.jpg").write_bytes(b"\xff\xd8\xff\xe0 no picture")
    read = read_folder(tmp_path)
    assert len(read.lights) == 2
    assert any("IMG_0001.jpg" in note and "left out" in note for note in read.notes)
    for path in tmp_path.rglob("*.jpg"):
        path.write_bytes(b"")
    with pytest.raises(InputError, match=r"IMG_0001\.jpg cannot be read"):
        read_folder(tmp_path)


def test_light_of_the_room_is_taken_off_and_large_pictures_shrink(tmp_path: Path, shots: LabShots) -> None:
    room = np.linspace(0.1, 0.3, 84, dtype=np.float32)[None, :, None]
    lit = replace(shots, pictures=shots.pictures + room)
    write_bracketed(lit, tmp_path, Camera(bits=16, full=4.0))
    assert compared(read_folder(tmp_path), shots)[0] > 0.1
    none = replace(shots, pictures=0 * shots.pictures[:1] + room, told=shots.told.some([0]))
    write_bracketed(none, tmp_path, Camera(bits=16, full=4.0), lambda *_: "dark")
    read = read_folder(tmp_path)
    assert compared(read, shots)[0] < 1e-6
    small = read_folder(tmp_path, most=read.light.nbytes // 3)
    assert small.factor == 2
    assert small.light.shape == (2, 40, 42, 3)
    assert np.allclose(small.light[:, 10, 10], read.light[:, 20:22, 20:22].mean(axis=(1, 2)), rtol=1e-3)


def test_a_mask_is_read(tmp_path: Path, shots: LabShots) -> None:
    write_bracketed(shots, tmp_path, Camera())
    disc = np.hypot(*np.mgrid[-39.5:40.5, -41.5:42.5]) < 30
    write_png(tmp_path / "mask.png", (disc[..., None] * np.uint8(255)).repeat(3, axis=2))
    read = read_folder(tmp_path)
    assert read.mask is not None
    assert np.array_equal(read.mask, disc)
    write_png(tmp_path / "mask.png", np.zeros((80, 84, 3), np.uint8))
    with pytest.raises(InputError, match="mask is bright where"):
        read_folder(tmp_path)
