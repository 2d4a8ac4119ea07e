"""Folders of photographs: what the lab wrote is what is read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studio.bench.lab import LabShots, Rig, row, shoot
from studio.bench.lab_files import write_shots
from studio.bench.lab_surfaces import library
from studio_core.errors import InputError
from studio_core.imaging.encode import write_exr
from studio_plugins.residual.lights import read_lights
from studio_plugins.residual.pictures import read_folder
from studio_plugins.residual.samples import Ball


@pytest.fixture(scope="module")
def shots() -> LabShots:
    rig = Rig(size=(40, 36), ball=Ball(20.2, 18.1, 15.5))
    return shoot(library()["two-lobes"], row(10.0).some([2, 6, 9]), rig)


@pytest.mark.parametrize("lights", ["names", "lp", "table"])
def test_linear_pictures_come_back_exactly(tmp_path: Path, shots: LabShots, lights: str) -> None:
    listed = write_shots(shots, tmp_path, lights=lights)
    read = read_folder(tmp_path, read_lights(listed) if listed else None)
    order = [int(np.argmax(shots.told.directions @ d)) for d in read.lights.directions]
    assert sorted(order) == [0, 1, 2]
    assert np.allclose(read.lights.directions, shots.told.directions[order], atol=1e-3)
    assert np.array_equal(read.light, shots.pictures[order])


def test_brackets_are_merged_and_clipping_is_known(tmp_path: Path, shots: LabShots) -> None:
    write_shots(shots, tmp_path, kind="png", times=(0.125, 0.5, 2.0))
    read = read_folder(tmp_path)
    order = [int(np.argmax(shots.told.directions @ d)) for d in read.lights.directions]
    truth = shots.pictures[order]
    assert read.light.shape == truth.shape
    safe = ~read.clipped & (truth.min(axis=-1) > 0.01)
    assert np.abs(read.light[safe] / truth[safe] - 1).max() < 0.08
    assert not read.clipped[truth.max(axis=-1) < 7.5].any()
    single = tmp_path / "single"
    single.mkdir()
    write_shots(shots, single, kind="png")
    one = read_folder(single)
    assert one.clipped[truth.min(axis=-1) > 1.01].all()
    assert one.clipped.any()


def test_what_a_folder_lacks_is_said(tmp_path: Path, shots: LabShots) -> None:
    with pytest.raises(InputError, match="no such folder"):
        read_folder(tmp_path / "nowhere")
    with pytest.raises(InputError, match="no photographs"):
        read_folder(tmp_path)
    write_shots(shots, tmp_path)
    write_exr(tmp_path / "az60.exr", np.ones((20, 20, 3), np.float32))
    assert any("az60.exr" in note and "20 × 20" in note for note in read_folder(tmp_path).notes)
    write_exr(tmp_path / "az60.exr", np.ones((36, 40, 3), np.float32))
    write_exr(tmp_path / "az60_b.exr", np.ones((36, 40, 3), np.float32))
    assert any("do not tell their exposures" in note for note in read_folder(tmp_path).notes)


def test_a_list_chooses_its_pictures(tmp_path: Path, shots: LabShots) -> None:
    listed = write_shots(shots, tmp_path, lights="lp")
    assert listed is not None
    write_exr(tmp_path / "white card.exr", np.ones((36, 40, 3), np.float32))
    read = read_folder(tmp_path, read_lights(listed))
    assert len(read.lights) == 3
    assert "1 pictures" in read.notes[0]
