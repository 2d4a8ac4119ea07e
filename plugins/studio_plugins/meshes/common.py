"""What all mesh importers share: reading, cleaning of triangles, the finished model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import ImportedModel
from studio_core.errors import InputError
from studio_core.params import Colour
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Group, Material, MeshObject, Node, new_id
from studio_core.scene.transform import Transform, vec3

MOST_BYTES = 1 << 30
MOST_FACES = 20_000_000
PLAIN_GREY = 0.8
"""Base colour of surfaces without a material."""
FARTHEST = 1e9
"""Metres; positions beyond count as unreadable."""

Floats = npt.NDArray[np.floating[Any]]
Ints = npt.NDArray[np.integer[Any]]


@dataclass
class Notes:
    """Sentences for the person who imports; the same remark is counted, not repeated."""

    counts: Counter[str] = field(default_factory=Counter)
    sentences: dict[str, None] = field(default_factory=dict)

    def say(self, sentence: str) -> None:
        """Add a sentence once."""
        self.sentences.setdefault(sentence)

    def count(self, what: str, number: int) -> None:
        """Add to a count; nothing for 0."""
        if number:
            self.counts[what] += int(number)

    def told(self) -> tuple[str, ...]:
        """All of it."""
        return (*(f"{what}: {number}." for what, number in self.counts.items()), *self.sentences)


@dataclass(frozen=True)
class Part:
    """A mesh of the file before it has a place in the scene."""

    name: str
    geometry: Geometry
    translation: tuple[float, float, float]
    materials: tuple[str, ...]


def refuse(path: Path, cause: str) -> InputError:
    """The error that names file and cause."""
    return InputError(f"{path} cannot be imported: {cause}")


def read_bytes(path: Path) -> bytes:
    """A model file's bytes; InputError when it is missing, empty or huge."""
    try:
        if not path.is_file():
            raise refuse(path, "there is no such file")
        size = path.stat().st_size
        if size == 0:
            raise refuse(path, "it is empty")
        if size > MOST_BYTES:
            raise refuse(path, f"{size >> 20} MB are more than the {MOST_BYTES >> 20} MB that are accepted")
        return path.read_bytes()
    except OSError as error:
        raise refuse(path, error.strerror or str(error)) from None
    except ValueError as error:
        raise InputError(f"{str(path)!r} cannot be imported: {error}") from None


def clean_mesh(
    positions: Floats,
    faces: Ints,
    notes: Notes,
    normals: Floats | None = None,
    uvs: Floats | None = None,
    slots: Ints | None = None,
    recentre: bool = True,
) -> tuple[Geometry, tuple[float, float, float]] | None:
    """A finite mesh without degenerate or double faces, and where its origin lies; None when nothing is left.

    positions (P, 3) in metres; faces (F, 3) within them; normals of any length, zeros where unknown.
    Equal vertices are merged. A mesh far from the origin is recentred, so that float32 keeps its shape.
    """
    where = np.asarray(positions, dtype=np.float64)
    sound = within_reach(where)
    keep = np.asarray(sound[faces].all(axis=1))
    notes.count("Faces left out because their vertices are no finite numbers", int((~keep).sum()))
    faces = np.asarray(faces)[keep]
    slots = np.zeros(len(faces), np.uint16) if slots is None else slots[keep]
    if not len(faces):
        return None
    where = np.where(sound[:, None], where, 0.0)
    used = where[np.unique(faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    centre = (low + high) / 2
    far = recentre and float(np.abs(centre).max()) > 64 * float((high - low).max())
    offset = vec3(centre) if far else (0.0, 0.0, 0.0)
    points = (where - offset).astype(np.float32) + np.float32(0)  # no −0

    same = unique_rows(points)[1]
    keep = _sound_faces(points.astype(np.float64), same[faces], faces)
    notes.count("Degenerate faces left out", int((~keep).sum()))
    faces, slots = faces[keep], slots[keep]
    first = _first_of_each(same[faces])
    notes.count("Double faces left out", len(faces) - len(first))
    faces, slots = faces[first], slots[first]
    if not len(faces):
        return None

    columns = [points]
    if normals is not None and (made := _unit_normals(points, faces, normals)) is not None:
        columns.append(made)
    if uvs is not None:
        flat = np.where(np.isfinite(uvs) & (np.abs(uvs) < 1e6), uvs, 0.0).astype(np.float32)
        columns.append(flat + np.float32(0))
    rows = np.concatenate(columns, axis=1)
    used_rows, inverse = np.unique(faces, return_inverse=True)
    kept, merged = unique_rows(rows[used_rows])
    rows = rows[used_rows[kept]]
    geometry = Geometry(
        positions=rows[:, :3],
        faces=merged[inverse.reshape(faces.shape)].astype(np.uint32),
        normals=rows[:, 3:6] if columns[1:] and columns[1].shape[1] == 3 else None,
        uvs=rows[:, -2:] if uvs is not None else None,
        slots=slots.astype(np.uint16),
    )
    return geometry, offset


def within_reach(positions: Floats) -> npt.NDArray[np.bool_]:
    """(P,) which of the positions (P, 3) are finite and not absurdly far."""
    with np.errstate(invalid="ignore"):
        return np.asarray((np.abs(positions) <= FARTHEST).all(axis=1), dtype=bool)


def unique_rows(rows: Floats) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """First places of the distinct rows, in order of appearance, and for each row which it is."""
    bits = np.ascontiguousarray(rows, dtype=np.float32).view(np.uint32).astype(np.uint64)
    odd = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
    code = np.zeros(len(bits), np.uint64)
    for column in range(bits.shape[1]):  # a hash: sorting whole rows takes ten times longer
        code = (code ^ (bits[:, column] + odd[column % 3])) * odd[(column + 1) % 3]
        code ^= code >> np.uint64(29)
    _, first, inverse = np.unique(code, return_index=True, return_inverse=True)
    inverse = inverse.reshape(-1)
    if not np.array_equal(rows[first[inverse]], rows):  # two rows with one hash
        _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        inverse = inverse.reshape(-1)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return first[order], rank[inverse]


def _sound_faces(points: Floats, same: Ints, faces: Ints) -> npt.NDArray[np.bool_]:
    a, b, c = (points[faces[:, i]] for i in range(3))
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([((q - p) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    distinct = (same[:, 0] != same[:, 1]) & (same[:, 1] != same[:, 2]) & (same[:, 2] != same[:, 0])
    made: npt.NDArray[np.bool_] = distinct & (doubled > 1e-7 * longest) & (doubled > 1e-30)
    return made


def _first_of_each(same: Ints) -> npt.NDArray[np.intp]:
    """Places of faces that are not the repetition of one before, corners turned or not (not flipped)."""
    start = np.argmin(same, axis=1)
    turned = np.stack([same[np.arange(len(same)), (start + i) % 3] for i in range(3)], axis=1)
    _, first = np.unique(turned, axis=0, return_index=True)
    return np.sort(first)


def _unit_normals(points: Floats, faces: Ints, normals: Floats) -> npt.NDArray[np.float32] | None:
    """Unit normals; zero or unreadable ones become the mean of their faces'. None if most are so."""
    given = np.where(np.isfinite(normals).all(axis=1, keepdims=True), normals, 0).astype(np.float64)
    largest = np.abs(given).max(axis=1, keepdims=True)
    given = given / np.where(largest > 0, largest, 1)
    length = np.linalg.norm(given, axis=1)
    used = np.zeros(len(points), bool)
    used[faces.ravel()] = True
    bad = used & (length < 1e-6)
    if 2 * int(bad.sum()) > int(used.sum()):
        return None
    if bad.any():
        exact = points.astype(np.float64)
        a, b, c = (exact[faces[:, i]] for i in range(3))
        across = np.cross(b - a, c - a)
        total = np.zeros_like(exact)
        for i in range(3):
            np.add.at(total, faces[:, i], across)
        flat = np.linalg.norm(total, axis=1, keepdims=True)
        total = np.where(flat > 0, total / np.where(flat > 0, flat, 1), (0.0, 1.0, 0.0))
        given = np.where(bad[:, None], total, given)
        length = np.where(bad, 1.0, length)
    made: npt.NDArray[np.float32] = (given / np.maximum(length, 1e-6)[:, None]).astype(np.float32)
    return made + np.float32(0)


def model_of(path: Path, parts: Sequence[Part], materials: Sequence[Material], notes: Notes) -> ImportedModel:
    """One mesh object, or a group of them; materials that nothing uses are left out."""
    if not parts:
        raise refuse(path, "it holds no triangles" + (f" ({notes.told()[0][:-1]})" if notes.told() else ""))
    root = None if len(parts) == 1 else Group(id=new_id("group"), name=path.stem)
    nodes: list[Node] = [] if root is None else [root]
    for part in parts:
        nodes.append(
            MeshObject(
                id=new_id("mesh"),
                name=path.stem if root is None else part.name,
                parent=None if root is None else root.id,
                transform=Transform(part.translation),
                geometry=part.geometry,
                materials=part.materials,
            )
        )
    used = {material for part in parts for material in part.materials}
    return ImportedModel(tuple(nodes), tuple(m for m in materials if m.id in used), notes.told())


def drop_unused_slots(
    slots: Ints, materials: Sequence[str]
) -> tuple[npt.NDArray[np.uint16], tuple[str, ...]]:
    """Slots renumbered to the materials that faces use, and those."""
    used, made = np.unique(slots, return_inverse=True)
    return made.reshape(-1).astype(np.uint16), tuple(materials[int(slot)] for slot in used)


def colour(values: Sequence[float], low: float = 0.0, high: float = 1.0) -> Colour:
    """An RGB colour within bounds; what is no number becomes `low`."""
    red, green, blue = (min(max(float(v), low), high) if v == v else low for v in values)
    return (red, green, blue)


def share(diffuse: Colour, specular: Colour, coat: float = 0.04) -> tuple[Colour, Colour]:
    """Diffuse and specular that do not add up to more than 1 in any channel.

    The diffuse colour stays, as it is what one sees, but for what a coat of `coat` takes away.
    """
    shine = colour([max(s - max(d + s - 1, 0), min(s, coat)) for d, s in zip(diffuse, specular, strict=True)])
    return colour([d - max(d + s - 1, 0) for d, s in zip(diffuse, shine, strict=True)]), shine
