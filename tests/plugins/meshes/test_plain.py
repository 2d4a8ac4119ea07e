"""PLY and STL, written by trimesh or by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from studio_core.errors import InputError
from studio_plugins.meshes.plain import PLY, STL

HEAD = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
FACE = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
SQUARE = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"


@pytest.mark.parametrize(("name", "kind"), [("a.ply", "ply"), ("a.stl", "stl"), ("b.stl", "stl_ascii")])
def test_files_of_trimesh_come_back_welded(tmp_path: Path, name: str, kind: str) -> None:
    import trimesh

    box = trimesh.creation.box((1, 2, 3))
    box.export(tmp_path / name, file_type=kind)
    importer = PLY if kind == "ply" else STL
    (node,) = importer.load(tmp_path / name, 0.1).objects
    np.testing.assert_allclose(node.geometry.bounds, box.bounds * 0.1, atol=1e-6)
    assert len(node.geometry.positions) == 8
    assert len(node.geometry.faces) == 12
    assert node.geometry.normals is None
    assert node.name == Path(name).stem


def test_polygons_normals_and_colours_of_ply(tmp_path: Path) -> None:
    head = HEAD + "property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\n"
    head += "property uchar green\nproperty uchar blue\n"
    body = "".join(f"{line} 0 0 2 255 0 0\n" for line in SQUARE.splitlines())
    (tmp_path / "a.ply").write_text(head + FACE + body + "4 0 1 2 3\n")
    model = PLY.load(tmp_path / "a.ply")
    geometry = model.objects[0].geometry
    assert len(geometry.faces) == 2
    assert geometry.normals is not None
    np.testing.assert_allclose(geometry.normals, [[0, 0, 1]] * 4)
    assert any("Colours" in note for note in model.notes)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "ply\n",
        "nonsense",
        HEAD + FACE,
        HEAD + FACE + SQUARE + "3 0 1 99\n",
        HEAD + FACE + SQUARE + "3 0 1 -2\n",
        HEAD + FACE + SQUARE.replace("1 1 0", "nan nan nan") + "3 0 1 2\n",
        HEAD + "end_header\n" + SQUARE,
        (HEAD + FACE).replace("vertex 4", "vertex 99999999999") + SQUARE,
        (HEAD + FACE).replace("vertex 4", "vertex -4") + SQUARE,
    ],
)
def test_bad_ply_files_are_refused_in_one_sentence(tmp_path: Path, text: str) -> None:
    (tmp_path / "bad.ply").write_text(text)
    with pytest.raises(InputError, match=r"bad\.ply cannot be imported") as caught:
        PLY.load(tmp_path / "bad.ply")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"solid nothing\nendsolid\n",
        bytes(80) + b"\xff\xff\xff\xff" + bytes(50),
        bytes(84),
        bytes(80) + b"\1\0\0\0" + bytes(50),
    ],
)
def test_bad_stl_files_are_refused_in_one_sentence(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "bad.stl").write_bytes(data)
    with pytest.raises(InputError, match=r"bad\.stl cannot be imported") as caught:
        STL.load(tmp_path / "bad.stl")
    assert "\n" not in str(caught.value)


def test_a_zip_is_not_opened(tmp_path: Path) -> None:
    import zipfile

    with zipfile.ZipFile(tmp_path / "bomb.stl", "w") as archive:
        archive.writestr("a.stl", b"solid\nendsolid\n")
    with pytest.raises(InputError, match=r"bomb\.stl"):
        STL.load(tmp_path / "bomb.stl")
