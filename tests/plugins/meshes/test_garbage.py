"""No bytes whatever make an importer raise anything but InputError."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from gltf_writer import square
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from studio_core.contract import ImportedModel, Importer
from studio_core.errors import InputError
from studio_plugins.meshes.gltf import IMPORTER as GLTF
from studio_plugins.meshes.obj import IMPORTER as OBJ
from studio_plugins.meshes.plain import PLY, STL

OBJ_SEED = (
    b"mtllib a.mtl\no x\nv 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 1\nvn 0 0 1\nusemtl q\n"
    b"f 1/1/1 2/1/1 3/1/1\nf -1 -2 -3\n"
)
PLY_SEED = (
    b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    b"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)
PLY_BINARY = (
    b"ply\nformat binary_little_endian 1.0\nelement vertex 3\n"
    b"property float x\nproperty float y\nproperty float z\n"
    b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    + np.eye(3, dtype=np.float32).tobytes()
    + b"\3"
    + np.arange(3, dtype=np.int32).tobytes()
)
STL_SEED = bytes(80) + b"\1\0\0\0" + np.arange(12, dtype=np.float32).tobytes() + b"\0\0"
STL_TEXT = (
    b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    b"endloop\nendfacet\nendsolid\n"
)
SEEDS: dict[str, tuple[Importer, str, list[bytes]]] = {
    "obj": (OBJ, "a.obj", [OBJ_SEED]),
    "ply": (PLY, "a.ply", [PLY_SEED, PLY_BINARY]),
    "stl": (STL, "a.stl", [STL_SEED, STL_TEXT]),
    "glb": (GLTF, "a.glb", [square().glb()]),
    "gltf": (GLTF, "a.gltf", [square().gltf()]),
}


def check(importer: Importer, path: Path, data: bytes) -> None:
    path.write_bytes(data)
    try:
        model = importer.load(path)
    except InputError as error:
        assert path.name in str(error)
        return
    assert isinstance(model, ImportedModel)
    for node in model.objects:
        assert len(node.geometry.faces)
        assert np.isfinite(node.geometry.positions).all()
        assert node.geometry.slots is not None
        assert int(node.geometry.slots.max()) < len(node.materials)
        assert set(node.materials) <= {material.id for material in model.materials}


def damage(draw: Callable[..., object], seed: bytes) -> bytes:
    """Some bytes changed, a piece cut out or repeated."""
    made = bytearray(seed)
    changes = st.lists(st.tuples(st.integers(0, len(seed) - 1), st.integers(0, 255)), max_size=12)
    for place, value in draw(changes):  # type: ignore[attr-defined]
        made[place] = value
    start, stop = sorted((draw(st.integers(0, len(seed))), draw(st.integers(0, len(seed)))))  # type: ignore[type-var]
    how = draw(st.sampled_from(["keep", "keep", "cut", "end", "twice"]))
    if how == "cut":
        del made[start:stop]
    elif how == "end":
        del made[start:]
    elif how == "twice":
        made[stop:stop] = made[start:stop]
    return bytes(made)


@pytest.mark.parametrize("kind", SEEDS)
@settings(max_examples=120, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_damaged_files_give_a_sound_model_or_an_input_error(
    tmp_path: Path, kind: str, data: st.DataObject
) -> None:
    importer, name, seeds = SEEDS[kind]
    check(importer, tmp_path / name, damage(data.draw, data.draw(st.sampled_from(seeds))))


@pytest.mark.parametrize("kind", SEEDS)
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    garbage=st.binary(max_size=200),
    magic=st.sampled_from([b"", b"glTF", b"ply\n", b"solid ", b"PK\3\4", b"{"]),
)
def test_garbage_gives_an_input_error(tmp_path: Path, kind: str, garbage: bytes, magic: bytes) -> None:
    importer, name, _ = SEEDS[kind]
    check(importer, tmp_path / name, magic + garbage)


NUMBER = st.one_of(
    st.integers(-5, 9).map(str), st.floats().map(repr), st.sampled_from(["", "/", "1//", "x", "1/2/3/4"])
)
STATEMENT = st.tuples(
    st.sampled_from(["v", "vt", "vn", "f", "l", "usemtl", "mtllib", "o", "g", "s", "#"]),
    st.lists(NUMBER, max_size=7),
).map(lambda words: " ".join([words[0], *words[1]]))


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(STATEMENT, max_size=25))
def test_any_obj_statements_give_a_sound_model_or_an_input_error(tmp_path: Path, lines: list[str]) -> None:
    check(OBJ, tmp_path / "a.obj", "\n".join(lines).encode())
