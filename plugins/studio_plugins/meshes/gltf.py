"""glTF 2.0 and GLB: hierarchy, instances, materials.

Nodes keep their places in the hierarchy. Our transforms are rigid with one scale; what a node adds to
that (unequal scales, shear, mirroring) is baked into copies of the meshes below it.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import ImportedModel
from studio_core.errors import InputError
from studio_core.exchange.pictures import Pictures
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Group, MeshObject, Node, NodeId, new_id
from studio_core.scene.transform import Transform, normalized, quaternion, rotation_matrix, vec3
from studio_plugins.meshes.common import (
    FARTHEST,
    MOST_FACES,
    Notes,
    clean_mesh,
    read_bytes,
    refuse,
)
from studio_plugins.meshes.gltf_file import GltfFile, Json, as_index
from studio_plugins.meshes.gltf_materials import GltfMaterials

Matrix = npt.NDArray[np.float64]
DEEPEST = 200
MOST_NODES = 100_000
_POINTS_OR_LINES = (0, 1, 2, 3)
Piece = tuple[npt.NDArray[Any], npt.NDArray[np.int64], Matrix | None, Matrix | None, str]
Placed = tuple[Geometry, tuple[float, float, float], tuple[str, ...]]


class GltfImporter:
    """glTF 2.0, as text with its buffers or as one binary file; it may hold materials alone."""

    label = "glTF"
    extensions = (".glb", ".gltf")

    def load(self, path: Path, unit: float = 1.0) -> ImportedModel:
        """Metres from file units by `unit`; raises InputError in one sentence naming file and cause."""
        notes = Notes()
        file = GltfFile(path, read_bytes(path))
        with Pictures(path, notes.say) as pictures:
            found = GltfMaterials(file, pictures, notes)
            if not file.list_of("meshes") and file.list_of("materials"):
                return ImportedModel((), found.every(), notes.told())
            reader = _Reader(file, found, unit, notes)
            nodes = reader.read()
        used = {material for node in nodes if isinstance(node, MeshObject) for material in node.materials}
        materials = tuple(m for m in reader.materials.made.values() if m.id in used)
        return ImportedModel(tuple(nodes), materials, notes.told())


class _Reader:
    """One pass over the nodes of the scene."""

    def __init__(self, file: GltfFile, materials: GltfMaterials, unit: float, notes: Notes) -> None:
        self.file, self.materials, self.unit, self.notes = file, materials, unit, notes
        self.meshes: dict[tuple[int, bytes], Placed | None] = {}
        self.visited: set[int] = set()
        self.faces = 0

    def read(self) -> list[Node]:
        """A single mesh object, or a group with everything under it, parents first."""
        found: list[Node] = []
        for index in self._roots():
            self._visit(index, None, np.eye(3), found, 0)
        if not self.file.list_of("nodes"):
            found = self._unplaced()
        if self.file.list_of("animations"):
            self.notes.say("The animations are left out: the model stands still.")
        if self.file.list_of("skins"):
            self.notes.say("The skeleton is left out: the model has its rest pose.")
        meshes = [node for node in found if isinstance(node, MeshObject)]
        if not meshes:
            raise refuse(self.file.path, "it holds no triangles")
        if len(meshes) == 1:
            return [_alone(meshes[0], found)]
        found = _without_empty(found)
        tops = [node for node in found if node.parent is None]
        if len(tops) == 1 and isinstance(tops[0], Group):
            return found
        root = Group(id=new_id("group"), name=self.file.path.stem)
        return [root, *(replace(node, parent=root.id) if node.parent is None else node for node in found)]

    def _unplaced(self) -> list[Node]:
        """All meshes of a file without nodes."""
        found: list[Node] = []
        for index, source in enumerate(self.file.list_of("meshes")):
            if (placed := self._mesh(index, np.eye(3))) is not None:
                found.append(self._object(_name(source, f"Mesh {index + 1}"), None, Transform(), placed))
        if found:
            self.notes.say("The file places its meshes nowhere; all of them are at its origin.")
        return found

    def _object(self, name: str, parent: NodeId | None, transform: Transform, placed: Placed) -> MeshObject:
        geometry, offset, materials = placed
        return MeshObject(
            id=new_id("mesh"),
            name=name,
            parent=parent,
            transform=transform @ Transform(offset),
            geometry=geometry,
            materials=materials,
        )

    def _roots(self) -> list[object]:
        """The nodes of the default scene, or all that are no one's children."""
        scenes = self.file.list_of("scenes")
        if scenes:
            chosen = self.file.item("scenes", self.file.json.get("scene", 0))
            return self._indices(chosen, "nodes")
        nodes = self.file.list_of("nodes")
        children = {child for node in nodes for child in self._indices(node, "children")}
        return [index for index in range(len(nodes)) if index not in children]

    def _indices(self, source: Json, key: str) -> list[object]:
        found = source.get(key, [])
        indices: list[object] = [as_index(index) for index in found] if isinstance(found, list) else [None]
        if not all(type(index) is int for index in indices):
            raise self.file.bad(f"a list of {key} is damaged")
        return indices

    def _visit(
        self, index: object, parent: NodeId | None, pending: Matrix, found: list[Node], depth: int
    ) -> None:
        """Add a node and what is below; `pending` (3×3) is what its ancestors could not express."""
        source = self.file.item("nodes", index)
        index = int(str(as_index(index)))
        if index in self.visited:
            raise self.file.bad(f"node {index} has two parents or is its own ancestor")
        self.visited.add(index)
        if depth > DEEPEST or len(found) > MOST_NODES:
            raise self.file.bad("its nodes are nested too deeply or too many")
        linear, translation = self._matrix(source, index)
        transform, rest = _split(pending @ linear, pending @ translation * self.unit, self.file)
        name = _name(source, f"Node {index + 1}")
        children = self._indices(source, "children")
        mesh = self._mesh(source["mesh"], rest) if "mesh" in source else None
        if mesh is None or children:
            group = Group(id=new_id("group"), name=name, parent=parent, transform=transform)
            found.append(group)
            parent, transform = group.id, Transform()
        if mesh is not None:
            found.append(self._object(name, parent, transform, mesh))
        for child in children:
            self._visit(child, parent, rest, found, depth + 1)

    def _matrix(self, source: Json, index: int) -> tuple[Matrix, Matrix]:
        """Linear part and translation of a node."""
        if "matrix" in source:
            identity = tuple(float(v) for v in np.eye(4).ravel())
            whole = np.array(self.file.floats(source, "matrix", identity)).reshape(4, 4).T
            linear, translation = whole[:3, :3], whole[:3, 3]
        else:
            x, y, z, w = self.file.floats(source, "rotation", (0.0, 0.0, 0.0, 1.0))
            try:
                turn = rotation_matrix(normalized((w, x, y, z)))
            except (ValueError, OverflowError):
                raise self.file.bad(f"node {index} has no rotation but zeros") from None
            linear = turn * np.array(self.file.floats(source, "scale", (1.0,) * 3))
            translation = np.array(self.file.floats(source, "translation", (0.0,) * 3))
        if np.abs(linear).max() > FARTHEST or np.abs(translation).max() > FARTHEST:
            raise self.file.bad(f"node {index} is absurdly large or far")
        return linear, translation

    def _mesh(self, index: object, linear: Matrix) -> Placed | None:
        """A mesh after `linear`; the same arguments give the same geometry."""
        mesh = self.file.item("meshes", index)
        index = int(str(as_index(index)))
        key = (index, linear.tobytes())
        if key not in self.meshes:
            self.meshes[key] = self._build(mesh, index, linear)
        return self.meshes[key]

    def _build(self, mesh: Json, index: int, linear: Matrix) -> Placed | None:
        primitives = mesh.get("primitives")
        if not isinstance(primitives, list) or not all(isinstance(p, dict) for p in primitives):
            raise self.file.bad(f"mesh {index} has no primitives")
        pieces = [piece for p in primitives if (piece := self._primitive(p, index)) is not None]
        if not pieces:
            return None
        counts = np.cumsum([0, *(len(piece[0]) for piece in pieces)])
        faces = np.concatenate([piece[1] + start for piece, start in zip(pieces, counts, strict=False)])
        self.faces += len(faces)
        if self.faces > MOST_FACES:
            raise self.file.bad(f"more than {MOST_FACES // 10**6} million faces are not accepted")
        ids = tuple(dict.fromkeys(piece[4] for piece in pieces))
        slots = np.repeat([ids.index(piece[4]) for piece in pieces], [len(piece[1]) for piece in pieces])
        normals = _joined([piece[2] for piece in pieces], [len(piece[0]) for piece in pieces], 3)
        uvs = _joined([piece[3] for piece in pieces], [len(piece[0]) for piece in pieces], 2)
        positions = np.concatenate([piece[0] for piece in pieces]).astype(np.float64)
        if not np.array_equal(linear, np.eye(3)):
            with np.errstate(all="ignore"):
                positions = positions @ linear.T
                if normals is not None:
                    normals = normals @ _cofactors(linear).T
            if np.linalg.det(linear) < 0:
                faces = faces[:, ::-1]
                normals = None if normals is None else -normals
        with np.errstate(over="ignore"):
            positions = positions * self.unit
        cleaned = clean_mesh(positions, faces, self.notes, normals, uvs, slots)
        if cleaned is None:
            return None
        return *cleaned, ids

    def _primitive(self, source: Json, mesh: int) -> Piece | None:
        """Positions, faces, normals, uvs and material of a primitive; None when it has no triangles."""
        mode = self.file.whole(source, "mode", 4)
        if mode in _POINTS_OR_LINES:
            self.notes.count("Points and lines left out", 1)
            return None
        if mode > 6:
            raise self.file.bad(f"mesh {mesh} is drawn in an unknown mode {mode}")
        if "KHR_draco_mesh_compression" in (source.get("extensions") or {}):
            self.notes.say("A compressed mesh is read from its uncompressed copy.")
        attributes = source.get("attributes")
        if not isinstance(attributes, dict) or "POSITION" not in attributes:
            raise self.file.bad(f"mesh {mesh} has no positions")
        positions = self.file.accessor(attributes["POSITION"], ("VEC3",))
        count = len(positions)
        if "indices" in source:
            indices = self.file.accessor(source["indices"], ("SCALAR",))
            if indices.dtype.kind != "u" or int(indices.max()) >= count:
                raise self.file.bad(f"mesh {mesh} has faces that name vertices which do not exist")
            indices = indices.astype(np.int64)
        else:
            indices = np.arange(count)
        faces = _faces(indices, mode)
        if not len(faces):
            self.notes.count("Primitives without a triangle left out", 1)
            return None
        material, uv_set = self.materials.get(source.get("material"))
        normals = self._attribute(attributes, "NORMAL", "VEC3", count)
        uvs = self._attribute(attributes, f"TEXCOORD_{uv_set}", "VEC2", count)
        if uvs is not None:
            uvs = np.stack([uvs[:, 0], 1.0 - uvs[:, 1]], axis=1)
        if "COLOR_0" in attributes:
            self.notes.say("Colours of vertices are not used.")
        if source.get("targets"):
            self.notes.say("Morph targets are left out: the model has its first shape.")
        return positions, faces, normals, uvs, material.id

    def _attribute(self, attributes: Json, name: str, kind: str, count: int) -> Matrix | None:
        """An optional attribute; one that does not fit its vertices is left out."""
        if name not in attributes:
            return None
        try:
            found = self.file.accessor(attributes[name], (kind,))
        except InputError as error:
            self.notes.say(f"{name} was left out: {str(error).partition(': ')[2]}.")
            return None
        if len(found) != count:
            self.notes.say(f"{name} was left out: it does not fit the vertices.")
            return None
        return found.astype(np.float64)


def _name(source: Json, default: str) -> str:
    name = source.get("name")
    return name[:200] if isinstance(name, str) and name else default


def _faces(indices: npt.NDArray[np.int64], mode: int) -> npt.NDArray[np.int64]:
    """Triangles, strips and fans as (F, 3) (3.7.2.1); a rest that fills no triangle is left out."""
    if mode == 4:
        return indices[: len(indices) // 3 * 3].reshape(-1, 3)
    if len(indices) < 3:
        return np.zeros((0, 3), np.int64)
    if mode == 6:
        first = np.full(len(indices) - 2, indices[0])
        return np.stack([indices[1:-1], indices[2:], first], axis=1)
    odd = np.arange(len(indices) - 2) % 2 == 1
    second, third = indices[1:-1], indices[2:]
    return np.stack([indices[:-2], np.where(odd, third, second), np.where(odd, second, third)], axis=1)


def _joined(parts: list[Matrix | None], counts: list[int], width: int) -> Matrix | None:
    """One array of what the primitives have, zeros where one has none; None when none has."""
    if all(part is None for part in parts):
        return None
    filled = [np.zeros((n, width)) if p is None else p for p, n in zip(parts, counts, strict=True)]
    return np.concatenate(filled)


def _cofactors(linear: Matrix) -> Matrix:
    """What normals are multiplied with: det(M) M⁻ᵀ, also where M has no inverse."""
    a, b, c = linear.T
    return np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)


def _split(linear: Matrix, translation: Matrix, file: GltfFile) -> tuple[Transform, Matrix]:
    """The rigid part with one scale, and what is left for the meshes (identity: nothing)."""
    if np.abs(translation).max() > FARTHEST:
        raise file.bad("a node is absurdly far away")
    lengths = np.linalg.norm(linear, axis=0)
    scale = float(lengths.mean())
    if scale > 1e-12 and np.linalg.det(linear / scale) > 0:
        turn = linear / scale
        if np.abs(turn.T @ turn - np.eye(3)).max() < 1e-4:
            return Transform(vec3(translation), quaternion(turn), scale), np.eye(3)
    return Transform(vec3(translation)), linear


def _alone(mesh: MeshObject, nodes: list[Node]) -> MeshObject:
    """The only mesh object without its groups, in their place."""
    by_id = {node.id: node for node in nodes}
    transform, parent = mesh.transform, mesh.parent
    while parent is not None:
        transform = by_id[parent].transform @ transform
        parent = by_id[parent].parent
    return replace(mesh, parent=None, transform=transform)


def _without_empty(nodes: list[Node]) -> list[Node]:
    """Without the groups that hold no mesh; `nodes` has parents first."""
    needed: set[NodeId] = set()
    for node in reversed(nodes):
        if isinstance(node, MeshObject) or node.id in needed:
            needed.add(node.id)
            if node.parent is not None:
                needed.add(node.parent)
    return [node for node in nodes if node.id in needed]


IMPORTER = GltfImporter()
