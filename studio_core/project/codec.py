"""Nodes, materials and scenes as canonical JSON with references to arrays, and back.

Classes are named by the tag in an explicit table; nothing in a file is ever evaluated or imported.
Models and parameters that no plugin of this machine knows are kept as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy.typing as npt

from studio_core.errors import ProjectError
from studio_core.project import pages
from studio_core.project.blobs import ArrayRef, array_ref, parse_ref
from studio_core.project.canonical import dumps, text_hash
from studio_core.project.fields import Record
from studio_core.project.memo import Memo
from studio_core.scene import nodes
from studio_core.scene.capture import Capture
from studio_core.scene.geometry import Geometry, Image, Table
from studio_core.scene.nodes import Material, Node, Scene
from studio_core.scene.room import Room
from studio_core.strokes.stroke import Stroke

TAGS: Mapping[str, type[Any]] = {
    "group": nodes.Group,
    "mesh": nodes.MeshObject,
    "room": Room,
    "camera": nodes.Camera,
    "environment": nodes.Environment,
    "point_lamp": nodes.PointLamp,
    "spot_lamp": nodes.SpotLamp,
    "directional_lamp": nodes.DirectionalLamp,
    "area_lamp": nodes.AreaLamp,
    "capture": Capture,
    "stroke": Stroke,
    "material": nodes.Material,
}
_TAG_OF = {cls: tag for tag, cls in TAGS.items()}
_RECORDS = {tag: Record(cls) for tag, cls in TAGS.items()}
_ENCODINGS = ("linear", "srgb", "data")
_MESH_PARTS: Mapping[str, tuple[str, tuple[int | None, ...]]] = {
    "positions": ("<f4", (None, 3)),
    "faces": ("<u4", (None, 3)),
    "slots": ("<u2", (None,)),
    "normals": ("<f4", (None, 3)),
    "uvs": ("<f4", (None, 2)),
}

Fetch = Callable[[ArrayRef, str, bool], npt.NDArray[Any]]  # (reference, part, may be packed) -> array


@dataclass(frozen=True)
class Blob:
    """An array that an item needs, and whether it is worth packing."""

    ref: ArrayRef
    array: npt.NDArray[Any]
    squeeze: bool


def _geometry_refs(geometry: Geometry) -> dict[str, ArrayRef]:
    return {name: array_ref(array) for name, array in geometry.parts()}


class _Outward:
    """Notes the arrays of what is written."""

    def __init__(self) -> None:
        self.blobs: list[Blob] = []

    def geometry_json(self, geometry: Geometry) -> Any:
        refs = geometry_refs(geometry)
        self.blobs += [Blob(refs[name], array, squeeze=False) for name, array in geometry.parts()]
        return {name: ref.json() for name, ref in refs.items()}

    def image_json(self, image: Image) -> Any:
        ref = image_ref(image)
        self.blobs.append(Blob(ref, image.pixels, squeeze=True))
        return {"pixels": ref.json(), "encoding": image.encoding}

    def table_json(self, table: Table) -> Any:
        ref = table_ref(table)
        self.blobs.append(Blob(ref, table.values, squeeze=True))
        return {"values": ref.json(), "name": table.name}


class Inward:
    """Makes scene values from JSON; equal meshes, pictures and tables become one object.

    `fetch` gives the checked array of a reference.
    """

    def __init__(self, fetch: Fetch) -> None:
        self._fetch = fetch
        self._geometries: dict[tuple[tuple[str, ArrayRef], ...], Geometry] = {}
        self._images: dict[tuple[ArrayRef, str], Image] = {}
        self._tables: dict[tuple[ArrayRef, str], Table] = {}

    def geometry(self, value: Any, part: str) -> Geometry:
        """The mesh of a JSON object of array references."""
        needed = {"positions", "faces", "slots"}
        if not isinstance(value, dict) or not needed <= set(value) <= set(_MESH_PARTS):
            raise ProjectError(f"{part} is damaged: no mesh")
        refs = {
            name: parse_ref(value[name], f"{part} ▸ {name}", (dtype,), tail)
            for name, (dtype, tail) in _MESH_PARTS.items()
            if name in value
        }
        key = tuple(refs.items())
        if key not in self._geometries:
            points, faces = refs["positions"].shape[0], refs["faces"].shape[0]
            if refs["slots"].shape[0] != faces or any(
                refs[name].shape[0] != points for name in ("normals", "uvs") if name in refs
            ):
                raise ProjectError(f"{part} is damaged: its arrays differ in length")
            arrays = {name: self._fetch(ref, f"{part} ▸ {name}", False) for name, ref in refs.items()}
            try:
                self._geometries[key] = Geometry(**arrays)
            except ValueError as error:
                raise ProjectError(f"{part} is damaged: {error}") from None
        return self._geometries[key]

    def image(self, value: Any, part: str) -> Image:
        """The picture of a JSON object with its pixels' reference."""
        if not isinstance(value, dict) or set(value) != {"pixels", "encoding"}:
            raise ProjectError(f"{part} is damaged: no picture")
        encoding = value["encoding"]
        if encoding not in _ENCODINGS:
            raise ProjectError(f"{part} is damaged: unknown encoding of a picture")
        ref = parse_ref(value["pixels"], part, ("<f4", "|u1"), (None, None, None))
        key = (ref, encoding)
        if key not in self._images:
            if ref.shape[2] not in (1, 3, 4) or 0 in ref.shape:
                raise ProjectError(f"{part} is damaged: a picture of shape {ref.shape}")
            pixels = self._fetch(ref, part, True)
            try:
                self._images[key] = Image(pixels, encoding)
            except ValueError as error:
                raise ProjectError(f"{part} is damaged: {error}") from None
        return self._images[key]

    def table(self, value: Any, part: str) -> Table:
        """The table of a JSON object with its numbers' reference."""
        if not isinstance(value, dict) or set(value) != {"values", "name"} or type(value["name"]) is not str:
            raise ProjectError(f"{part} is damaged: no table")
        ref = parse_ref(value["values"], part, ("<f4",), (None, None, None, None))
        key = (ref, value["name"])
        if key not in self._tables:
            if 0 in ref.shape:
                raise ProjectError(f"{part} is damaged: a table of shape {ref.shape}")
            try:
                self._tables[key] = Table(self._fetch(ref, part, True), value["name"])
            except ValueError as error:
                raise ProjectError(f"{part} is damaged: {error}") from None
        return self._tables[key]

    def item(self, value: dict[str, Any], part: str) -> Node | Material:
        """The node or material of a parsed item."""
        fields = dict(value)
        tag = fields.pop("type", None)
        if not isinstance(tag, str) or tag not in TAGS:
            raise ProjectError(f"{part} is of an unknown kind; a newer Lucarne or a plugin may have made it")
        name, ident = fields.get("name"), fields.get("id")
        if isinstance(name, str) and isinstance(ident, str):
            part = described(tag, name, ident)
        made: Node | Material = _RECORDS[tag].read(fields, self, part)
        return made


def described(tag: str, name: str, ident: str) -> str:
    """How an item is called in a message."""
    return f"the {tag.replace('_', ' ')} {name[:60]!r} ({ident[:40]})"


def encode_item(item: Node | Material) -> tuple[str, list[Blob]]:
    """Canonical text of a node or material and the arrays it refers to; ProjectError when it has no form."""
    tag = _TAG_OF.get(type(item))
    if tag is None:
        raise ProjectError(f"{item.name!r} cannot be saved: the project file has no {type(item).__name__}")
    part = described(tag, str(item.name), str(item.id))
    out = _Outward()
    try:
        value = _RECORDS[tag].write(item, out, part)
    except ProjectError as error:
        text = str(error)
        raise ProjectError(text if text.startswith(part) else f"{part}: {text}") from None
    return dumps({"type": tag, **value}, part), out.blobs


@dataclass(frozen=True)
class SceneForm:
    """A scene as addresses: the text of the scene itself and of its pages, and the items by address."""

    digest: str
    texts: Mapping[str, str]
    items: Mapping[str, Node | Material]


def scene_form(scene: Scene) -> SceneForm:
    """Addresses of everything in a scene; the scene's own text is `texts[digest]`."""
    items: dict[str, Node | Material] = {}
    texts: dict[str, str] = {}
    roots: list[str | None] = []
    for group in (scene.nodes.values(), scene.materials.values()):
        hashes = [item_hash(item) for item in group]
        items.update(zip(hashes, group, strict=True))
        root, made = pages.build(hashes)
        texts |= made
        roots.append(root)
    text = dumps({"type": "scene", "nodes": roots[0], "materials": roots[1]}, "the scene")
    digest = text_hash(text)
    return SceneForm(digest, {**texts, digest: text}, items)


def scene_digest(scene: Scene) -> str:
    """Hex content hash of a scene: equal nodes and materials in the same order give equal text.

    Cheap to ask again: items that live on between scenes are not hashed twice. ProjectError when the scene
    holds what a project file cannot (a number that is not finite, an unknown class).
    """
    return known_digest(scene)


# What follows remembers pure results for as long as the values live; nothing else is shared.
geometry_refs: Memo[dict[str, ArrayRef]] = Memo(_geometry_refs)
image_ref: Memo[ArrayRef] = Memo(lambda image: array_ref(image.pixels))
table_ref: Memo[ArrayRef] = Memo(lambda table: array_ref(table.values))
item_hash: Memo[str] = Memo(lambda item: text_hash(encode_item(item)[0]))
known_digest: Memo[str] = Memo(lambda scene: scene_form(scene).digest)
