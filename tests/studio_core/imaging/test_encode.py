"""Writing pictures whole or not at all."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studio_core.errors import InputError
from studio_core.imaging.encode import encode_png, write_exr, write_png


def test_writing_replaces_the_old_file_and_leaves_nothing_beside_it(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(b"old")
    write_png(path, np.zeros((3, 4, 3), np.uint8))
    assert path.read_bytes() == encode_png(np.zeros((3, 4, 3), np.uint8))
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_a_failed_write_names_the_file_and_keeps_the_old_one(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none.*a\.exr"):
        write_exr(tmp_path / "none" / "a.exr", np.zeros((3, 4, 3), np.float32))
    taken = tmp_path / "a.png"
    taken.mkdir()
    with pytest.raises(InputError, match=r"a\.png"):
        write_png(taken, np.zeros((3, 4, 3), np.uint8))
    assert [p.name for p in tmp_path.iterdir()] == ["a.png"]


def test_layers_of_different_size_and_floats_as_png_are_errors_of_the_caller(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="one size"):
        write_exr(tmp_path / "a.exr", {"a": np.zeros((2, 2, 3)), "b": np.zeros((3, 2, 3))})
    with pytest.raises(ValueError, match="bytes"):
        write_png(tmp_path / "a.png", np.zeros((2, 2, 3)))
