"""Wavefront OBJ with MTL: the furniture catalogues' format.

Objects (`o`) become parts; in files without objects the groups (`g`) do, unless there are very many.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio_core.contract import ImportedModel
from studio_core.exchange.pictures import Pictures, beside
from studio_core.scene.nodes import Material, new_id
from studio_plugins.meshes.common import (
    MOST_FACES,
    PLAIN_GREY,
    Notes,
    Part,
    clean_mesh,
    drop_unused_slots,
    model_of,
    read_bytes,
    refuse,
    within_reach,
)
from studio_plugins.meshes.mtl import Entry, material_of, parse_mtl
from studio_plugins.meshes.polygons import triangulate

Ints = npt.NDArray[np.int64]
MOST_GROUPS = 100
"""Groups that are kept apart in a file without objects."""
_SKIPPED = {
    "l": "Lines left out",
    "p": "Points left out",
    "curv": "Curves left out",
    "curv2": "Curves left out",
    "surf": "Free-form surfaces left out",
}


@dataclass
class Statements:
    """What an OBJ file says.

    `corners` holds (v, vt, vn) from 0, −1 for none, −2 for impossible; `polygons` their places. From the
    polygon that a run begins with, its object, group and material count (from 1, 0 for none).
    """

    positions: list[str] = field(default_factory=list)
    uvs: list[str] = field(default_factory=list)
    normals: list[str] = field(default_factory=list)
    corners: list[tuple[int, int, int]] = field(default_factory=list)
    polygons: list[int] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)
    objects: dict[str, int] = field(default_factory=dict)
    materials: dict[str, int] = field(default_factory=dict)
    groups: dict[str, int] = field(default_factory=dict)
    runs: list[tuple[int, int, int, int]] = field(default_factory=list)
    libraries: list[str] = field(default_factory=list)


class ObjImporter:
    """Wavefront OBJ."""

    label = "Wavefront OBJ"
    extensions = (".obj",)

    def load(self, path: Path, unit: float = 1.0) -> ImportedModel:
        """Metres from file units by `unit`; raises InputError in one sentence naming file and cause."""
        notes = Notes()
        said = parse_obj(_text(read_bytes(path)), notes)
        if len(said.polygons) > 4 * MOST_FACES:
            raise refuse(path, f"more than {MOST_FACES // 10**6} million faces are not accepted")
        with Pictures(path, notes.say) as pictures:
            materials = _materials(path, said, pictures, notes)
        return model_of(path, _parts(said, materials, unit, notes), materials, notes)


def _text(data: bytes) -> str:
    """The file's text: UTF-8 or else Latin-1, any line ends, continued lines joined."""
    data = data.removeprefix(b"\xef\xbb\xbf")
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    return text.replace("\\\n", " ")


def parse_obj(text: str, notes: Notes) -> Statements:
    """The statements of a file; what makes no sense is counted and passed over."""
    said = Statements()
    known: dict[str, int] = {}  # corner text -> corner; most corners occur several times
    current = [0, 0, 0]  # object, group, material
    names = {"o": (0, said.objects), "g": (1, said.groups), "usemtl": (2, said.materials)}
    coloured = False
    for line in text.split("\n"):
        if "#" in line:
            named = line.lstrip().startswith(("o ", "g ", "usemtl", "mtllib"))  # names may hold #
            line = line if named else line[: line.index("#")]
        words = line.split()
        if not words:
            continue
        key = words[0]
        if key == "v":
            said.positions += words[1:4] if len(words) > 3 else ("nan", "nan", "nan")
            coloured |= len(words) >= 7
        elif key == "f":
            if len(words) < 4:
                notes.count("Faces with fewer than three corners left out", 1)
                continue
            at = [known.get(word, -1) for word in words[1:]]
            if -1 in at:
                at = [_corner(word, said, known) for word in words[1:]]
            said.polygons += at
            said.sizes.append(len(at))
        elif key == "vt":
            said.uvs += (words[1], words[2] if len(words) > 2 else "0") if len(words) > 1 else ("nan", "nan")
        elif key == "vn":
            said.normals += words[1:4] if len(words) > 3 else ("0", "0", "0")
        elif key in names:
            index, known_names = names[key]
            name = line.strip()[len(key) :].strip()
            current[index] = known_names.setdefault(name, len(known_names) + 1)
            said.runs.append((len(said.sizes), current[0], current[1], current[2]))
        elif key == "mtllib":
            said.libraries.append(line.strip()[6:].strip())
        elif key in _SKIPPED:
            notes.count(_SKIPPED[key], 1)
    if coloured:
        notes.say("Colours of vertices are not used.")
    return said


def _corner(word: str, said: Statements, known: dict[str, int]) -> int:
    """The corner that `v/vt/vn` names; counted back from the last statement when negative."""
    if word in known:
        return known[word]
    pieces = word.split("/")
    found = [-1, -1, -1]
    counts = (len(said.positions) // 3, len(said.uvs) // 2, len(said.normals) // 3)
    relative = False
    for i, piece in enumerate(pieces[:3]):
        if not piece:
            continue
        try:
            index = int(piece) if len(piece) < 12 else 0
        except ValueError:
            index = 0
        relative |= index < 0
        found[i] = index - 1 if index > 0 else (counts[i] + index if -counts[i] <= index < 0 else -2)
    if found[0] == -1:
        found[0] = -2
    said.corners.append((found[0], found[1], found[2]))
    place = len(said.corners) - 1
    if not relative:
        known[word] = place
    return place


def _materials(path: Path, said: Statements, pictures: Pictures, notes: Notes) -> list[Material]:
    """One material for each name that `usemtl` gives, after the one of faces without a name."""
    entries: dict[str, Entry] = {}
    named = said.libraries
    if said.materials and not named:
        notes.say("The file names materials, but no file that describes them.")
        named = [f"{path.stem}.mtl"] if beside(path.parent, f"{path.stem}.mtl") else []
    for statement in dict.fromkeys(named):
        several = [name.replace("\\ ", " ") for name in re.split(r"(?<!\\)\s+", statement) if name]
        for name in [statement] if beside(path.parent, statement) else several:
            library = beside(path.parent, name)
            if library is None:
                notes.say(f"The material file {name!r} is missing.")
                continue
            try:
                for entry in parse_mtl(_text(library.read_bytes()), notes):
                    entries.setdefault(entry.name, entry)
            except OSError as error:
                notes.say(f"The material file {name!r} cannot be read: {error.strerror}.")
    made = [Material(id=new_id("material"), name="Plain", values={"base_color": (PLAIN_GREY,) * 3})]
    for name in said.materials:
        entry = entries.get(name, Entry(name))
        if name not in entries and entries:
            notes.say(f"The material {name!r} is described nowhere and became grey.")
        made.append(material_of(entry, pictures, notes))
    return made


def _floats(words: list[str], width: int, notes: Notes) -> npt.NDArray[np.float64]:
    try:
        made = np.array(list(map(float, words)), dtype=np.float64)
    except ValueError:
        made = np.array([_float(word) for word in words], dtype=np.float64)
        notes.count("Numbers that could not be read", int(np.isnan(made).sum()))
    return made.reshape(-1, width)


def _float(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return float("nan")


def _parts(said: Statements, materials: list[Material], unit: float, notes: Notes) -> list[Part]:
    positions = _floats(said.positions, 3, notes) * unit
    uvs, normals = _floats(said.uvs, 2, notes), _floats(said.normals, 3, notes)
    corners = np.array(said.corners, dtype=np.int64).reshape(-1, 3)
    lost = (corners[:, 0] < 0) | (corners[:, 0] >= len(positions))
    for column, count in ((1, len(uvs)), (2, len(normals))):
        wrong = (corners[:, column] < -1) | (corners[:, column] >= count)
        notes.count("Corners that name a normal or texture coordinate that does not exist", int(wrong.sum()))
        corners[wrong, column] = -1
    polygons, sizes = np.array(said.polygons, dtype=np.int64), np.array(said.sizes, dtype=np.int64)
    place = np.repeat(np.arange(len(sizes)), sizes)
    broken = _with_any(place, lost[polygons], len(sizes))
    notes.count("Faces left out because they name vertices that do not exist", int(broken.sum()))
    wild = ~within_reach(positions)
    if wild.any():
        far = ~broken & _with_any(place, wild[np.where(lost, 0, corners[:, 0])][polygons], len(sizes))
        notes.count("Faces left out because their vertices are no finite numbers", int(far.sum()))
        broken |= far
    polygons, kept = polygons[~broken[place]], np.flatnonzero(~broken)
    triangles, owner = triangulate(positions, corners[polygons, 0], sizes[kept])
    triangles, owner = polygons[triangles], kept[owner]

    objects, groups, surface = _runs(said, owner)
    names = ["", *said.objects]
    if not said.objects and len(said.groups) <= MOST_GROUPS:
        objects, names = groups, ["", *said.groups]
    made: list[Part] = []
    for which in np.unique(objects):
        chosen = np.flatnonzero(objects == which)
        used, faces = np.unique(triangles[chosen], return_inverse=True)
        corner = corners[used]
        slots, ids = drop_unused_slots(surface[chosen], [material.id for material in materials])
        cleaned = clean_mesh(
            positions[corner[:, 0]],
            faces.reshape(-1, 3),
            notes,
            _picked(normals, corner[:, 2]),
            _picked(uvs, corner[:, 1]),
            slots,
        )
        if cleaned is None:
            continue
        geometry, translation = cleaned
        made.append(Part(names[which] or f"Part {len(made) + 1}", geometry, translation, ids))
    return made


def _with_any(place: Ints, wrong: npt.NDArray[np.bool_], count: int) -> npt.NDArray[np.bool_]:
    """Which of `count` polygons have a wrong corner; `place` is each corner's polygon."""
    made: npt.NDArray[np.bool_] = np.bincount(place[wrong], minlength=count) > 0
    return made


def _runs(said: Statements, owner: Ints) -> tuple[Ints, Ints, Ints]:
    """Object, group and material of each triangle, from the statements before its polygon."""
    runs = np.array([(0, 0, 0, 0), *said.runs], dtype=np.int64)
    found = np.searchsorted(runs[:, 0], owner, side="right") - 1
    return runs[found, 1], runs[found, 2], runs[found, 3]


def _picked(values: npt.NDArray[np.float64], index: Ints) -> npt.NDArray[np.float64] | None:
    """Rows by index, zeros where it is −1; None when all are."""
    if not len(values) or (index < 0).all():
        return None
    return np.where(index[:, None] >= 0, values[index], 0.0)


IMPORTER = ObjImporter()
