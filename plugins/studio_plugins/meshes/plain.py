"""PLY and STL: triangles with little else, read by trimesh.

Neither format says which axis is up nor what its unit is; y up and the given unit are assumed.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from studio_core.contract import ImportedModel
from studio_core.scene.nodes import Material, new_id
from studio_plugins.meshes.common import (
    MOST_FACES,
    PLAIN_GREY,
    Notes,
    Part,
    clean_mesh,
    model_of,
    read_bytes,
    refuse,
)
from studio_plugins.meshes.polygons import triangulate


@dataclass(frozen=True)
class PlainImporter:
    """One mesh of one grey material; `kind` is trimesh's name of the format."""

    label: str
    extensions: tuple[str, ...]
    kind: str

    def load(self, path: Path, unit: float = 1.0) -> ImportedModel:
        """Metres from file units by `unit`; raises InputError in one sentence naming file and cause."""
        data = read_bytes(path)
        if self.kind == "ply":
            _check_ply(path, data)
        notes = Notes()
        positions, faces, normals, uvs = _read(path, data, self.kind, notes)
        with np.errstate(over="ignore"):
            cleaned = clean_mesh(positions * unit, faces, notes, normals, uvs)
        grey = Material(id=new_id("material"), name="Plain", values={"base_color": (PLAIN_GREY,) * 3})
        parts = [] if cleaned is None else [Part(path.stem, *cleaned, (grey.id,))]
        return model_of(path, parts, [grey], notes)


def _read(path: Path, data: bytes, kind: str, notes: Notes) -> tuple[Any, Any, Any, Any]:
    """Positions, faces, normals and uvs, in range but otherwise as the file has them."""
    from trimesh.exchange.ply import load_ply
    from trimesh.exchange.stl import load_stl

    try:
        with np.errstate(all="ignore"):
            found = load_ply(io.BytesIO(data)) if kind == "ply" else load_stl(io.BytesIO(data))
        positions = np.asarray(found.get("vertices", ()), dtype=np.float64).reshape(-1, 3)
        faces = found.get("faces")
        faces = np.zeros((0, 3), np.int64) if faces is None else np.asarray(faces)
        inside = np.asarray(((faces >= 0) & (faces < len(positions))).all(axis=1))
        faces = faces[inside].astype(np.int64)
        if faces.shape[1] > 3:
            sizes = np.full(len(faces), faces.shape[1])
            faces = faces.ravel()[triangulate(positions, faces.ravel(), sizes)[0]]
    except Exception as error:  # the reader raises whatever a damaged file provokes
        raise refuse(path, f"it is damaged ({type(error).__name__})") from None
    if len(faces) > MOST_FACES:
        raise refuse(path, f"more than {MOST_FACES // 10**6} million faces are not accepted")
    notes.count("Faces left out because they name vertices that do not exist", int((~inside).sum()))
    if any(found.get(colours) is not None for colours in ("vertex_colors", "face_colors")):
        notes.say("Colours of vertices and faces are not used.")
    normals = _fitting(found.get("vertex_normals"), (len(positions), 3))
    uvs = _fitting(getattr(found.get("visual"), "uv", None), (len(positions), 2))
    return positions, faces, normals, uvs


def _fitting(values: Any, shape: tuple[int, int]) -> Any:
    """Floats of that shape, or None."""
    if values is None or np.shape(values) != shape:
        return None
    return np.asarray(values, dtype=np.float64)


def _check_ply(path: Path, data: bytes) -> None:
    """Refuse counts that the file cannot hold: the reader allocates what the header asks for."""
    head, found, _ = data[: 1 << 16].partition(b"end_header")
    if not data.startswith(b"ply") or not found:
        raise refuse(path, "it is no PLY file")
    for count in re.findall(rb"^\s*element\s+\S+\s+(\S+)", head, re.MULTILINE):
        if not count.isdigit() or len(count) > 12 or int(count) > len(data):
            raise refuse(path, "its header asks for more than the file holds")


PLY = PlainImporter("PLY", (".ply",), "ply")
STL = PlainImporter("STL", (".stl",), "stl")
