"""Folders as people leave them: nested, with lists, masks, dark pictures and doubles among the pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studio_core.errors import InputError
from studio_plugins.residual.folder import look_through
from studio_plugins.residual.lights import read_list


def filled(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(b"")
    return folder


def test_nested_folders_are_one_lamp_each(tmp_path: Path) -> None:
    filled(tmp_path, *(f"{a}/IMG_{k}.jpg" for a in ("m30", "p10", "p40") for k in range(5)))
    found = look_through(tmp_path)
    assert [(g.name, len(g.paths)) for g in found.groups] == [("m30", 5), ("p10", 5), ("p40", 5)]
    towards = found.groups[0].direction
    assert towards is not None
    assert np.allclose(towards, [-0.5, 0, np.sqrt(0.75)])


def test_mask_dark_hidden_and_double_files_are_no_lamps(tmp_path: Path) -> None:
    names = ["mask.png", "dark.jpg", "ambient/1.jpg", "._az10.jpg", "__MACOSX/az20.jpg", ".thumbs/az30.jpg"]
    filled(tmp_path, *names, "az10.jpg", "az-10.jpg", "az10.exr", "az-10.exr")
    found = look_through(tmp_path)
    assert [g.name for g in found.groups] == ["az-10.exr", "az10.exr"]
    assert found.mask == tmp_path / "mask.png"
    assert found.dark is not None
    assert len(found.dark.paths) == 2
    assert "2 pictures are left out" in found.notes[0]


def test_a_list_among_the_pictures_is_used_where_names_tell_nothing(tmp_path: Path) -> None:
    filled(tmp_path, "DSC_1.jpg", "DSC_2.jpg")
    with pytest.raises(InputError, match=r"DSC_1\.jpg tells no light"):
        look_through(tmp_path)
    (tmp_path / "lights.csv").write_text("file;seconds;azimuth\nDSC_1.jpg;0.5;-20\nDSC_2.jpg;2;20\n")
    found = look_through(tmp_path)
    assert found.source == "list"
    assert [g.told[0].seconds for g in found.groups] == [0.5, 2.0]
    assert "lights.csv" in found.notes[0]


def test_a_few_other_pictures_among_them_are_left_out(tmp_path: Path) -> None:
    filled(tmp_path, *(f"cloth{a}.jpg" for a in (-30, -10, 20, 40)), "setup.jpg")
    found = look_through(tmp_path)
    assert [g.name for g in found.groups] == ["cloth-10.jpg", "cloth-30.jpg", "cloth20.jpg", "cloth40.jpg"]
    assert found.notes == ("setup.jpg: left out, for the name tells no light",)
    filled(tmp_path, "one.jpg", "two.jpg", "three.jpg")
    with pytest.raises(InputError, match=r"tells no light"):
        look_through(tmp_path)


def test_lists_may_name_folders_and_paths(tmp_path: Path) -> None:
    filled(tmp_path, *(f"lamp {c}/{k}.jpg" for c in "ab" for k in (1, 2)))
    listed = tmp_path / "where.csv"
    listed.write_text("name,azimuth,elevation\nlamp a,-20,5\nlamp b,20,5\n")
    assert [len(g.paths) for g in look_through(tmp_path, read_list(listed)).groups] == [2, 2]
    listed.write_text("name x y z\nlamp a/1.jpg 0 0 1\nlamp a/2.jpg 0 0 1\nlamp b/1.jpg 1 0 1\n")
    found = look_through(tmp_path, read_list(listed))
    assert [len(g.paths) for g in found.groups] == [2, 1]
    assert "1 pictures are left out" in found.notes[0]


def test_a_list_with_other_names_goes_by_order(tmp_path: Path) -> None:
    filled(tmp_path, "b.tif", "a.tif")
    listed = tmp_path / "dome.lp"
    listed.write_text("2\nDSC_7.JPG 0 0 1\nDSC_9.JPG 1 0 0\n")
    found = look_through(tmp_path, read_list(listed))
    assert [g.name for g in found.groups] == ["a.tif", "b.tif"]
    assert np.array_equal(
        np.stack([g.direction for g in found.groups if g.direction is not None])[1], [1, 0, 0]
    )
    assert "order of their names" in found.notes[0]
    filled(tmp_path, "c.tif")
    with pytest.raises(InputError, match="no photographs with a light"):
        look_through(tmp_path, read_list(listed))


def test_without_directions_folders_part_lamps(tmp_path: Path) -> None:
    filled(tmp_path, *(f"{c}/{k}.jpg" for c in "ab" for k in (1, 2)))
    assert [len(g.paths) for g in look_through(tmp_path, directions=False).groups] == [2, 2]
