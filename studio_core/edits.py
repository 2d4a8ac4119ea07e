"""Every way a scene can be changed: frozen values that make a new scene from an old one.

An edit holds ids and values, never live nodes of a document. It raises EditError and changes nothing when
it does not fit the scene.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.errors import EditError, InputError
from studio_core.params import ParamInfo, Value, check, param_infos
from studio_core.scene.geometry import Geometry, Image, Table, Texture
from studio_core.scene.nodes import Material, MaterialId, MeshObject, Node, NodeId, Scene
from studio_core.scene.paint import Paint
from studio_core.scene.transform import IDENTITY, Transform

T = TypeVar("T")


class Edit(Protocol):
    """A label for the history, and the change itself."""

    @property
    def label(self) -> str:
        """What the history calls it."""
        ...

    def __call__(self, scene: Scene) -> Scene:
        """The changed scene; the same object where nothing differs."""
        ...


@dataclass(frozen=True)
class Compound:
    """Several edits as one step."""

    label: str
    edits: tuple[Edit, ...]

    def __call__(self, scene: Scene) -> Scene:
        for edit in self.edits:
            scene = edit(scene)
        return scene


@dataclass(frozen=True)
class Add:
    """New nodes (parents first or already there) and materials."""

    nodes: tuple[Node, ...]
    materials: tuple[Material, ...] = ()
    label: str = "Add"

    def __call__(self, scene: Scene) -> Scene:
        _check_new("node", (node.id for node in self.nodes), scene.nodes)
        _check_new("material", (material.id for material in self.materials), scene.materials)
        made = scene.with_materials(*self.materials).with_nodes(*self.nodes)
        for node in self.nodes:
            _check_node(made, node)
        return made


@dataclass(frozen=True)
class Remove:
    """Nodes with everything under them."""

    nodes: tuple[NodeId, ...]
    label: str = "Delete"

    def __call__(self, scene: Scene) -> Scene:
        if not self.nodes:
            return scene
        gone = {below for node in self.nodes for below in scene.subtree(node)}
        kept = {node_id: node for node_id, node in scene.nodes.items() if node_id not in gone}
        return dataclasses.replace(scene, nodes=frozen_map(kept))


@dataclass(frozen=True)
class Move:
    """New transforms, each relative to its parent."""

    transforms: Mapping[NodeId, Transform]
    label: str = "Move"

    def __call__(self, scene: Scene) -> Scene:
        moved = [dataclasses.replace(scene[n], transform=t) for n, t in self.transforms.items()]
        return scene.with_nodes(*moved)


@dataclass(frozen=True)
class SetFields:
    """Fields of one node, checked against their ranges (name, hidden, intensity, fov, …)."""

    node: NodeId
    values: Mapping[str, Any]
    label: str = "Change"

    def __call__(self, scene: Scene) -> Scene:
        node = scene[self.node]
        made = _with_fields(node, self.values)
        _check_node(scene.with_nodes(made), made)
        return scene.with_nodes(made)


@dataclass(frozen=True)
class Reparent:
    """Hang nodes under another one (None: the top); they keep their place in the world."""

    nodes: tuple[NodeId, ...]
    parent: NodeId | None
    label: str = "Re-parent"

    def __call__(self, scene: Scene) -> Scene:
        for node_id in self.nodes:
            node = scene[node_id]
            if self.parent is not None and self.parent in scene.subtree(node_id):
                under = "itself" if self.parent == node_id else f"{scene[self.parent].name!r}, a part of it"
                raise EditError(f"{node.name!r} cannot hang under {under}")
            if node.parent == self.parent:
                continue
            try:
                with np.errstate(all="ignore"):
                    above = scene.world(self.parent).inverse() if self.parent is not None else IDENTITY
                    local = above @ scene.world(node_id)
            except ValueError as error:
                raise EditError(f"{node.name!r} cannot hang there: {error}") from None
            scene = scene.with_nodes(dataclasses.replace(node, parent=self.parent, transform=local))
        return scene


@dataclass(frozen=True)
class Order:
    """The order of the outliner: these nodes come right before `before` (None: last)."""

    nodes: tuple[NodeId, ...]
    before: NodeId | None
    label: str = "Reorder"

    def __call__(self, scene: Scene) -> Scene:
        moving = {node_id: scene[node_id] for node_id in self.nodes}
        if self.before is not None and (self.before in moving or self.before not in scene.nodes):
            raise EditError("nodes cannot be ordered before that place")
        made: dict[NodeId, Node] = {}
        for node_id, node in scene.nodes.items():
            if node_id == self.before:
                made |= moving
            if node_id not in moving:
                made[node_id] = node
        if self.before is None:
            made |= moving
        if tuple(made) == tuple(scene.nodes):
            return scene
        return dataclasses.replace(scene, nodes=frozen_map(made))


@dataclass(frozen=True)
class SetGeometry:
    """Another mesh for an object."""

    node: NodeId
    geometry: Geometry
    label: str = "Replace mesh"

    def __call__(self, scene: Scene) -> Scene:
        node = _mesh(scene, self.node)
        try:
            made = dataclasses.replace(node, geometry=self.geometry)
        except ValueError:  # a field that follows from others
            raise EditError(
                f"{node.name!r} cannot have another mesh: its own follows from its sizes"
            ) from None
        made_scene = scene.with_nodes(made)
        _check_node(made_scene, made)
        return made_scene


@dataclass(frozen=True)
class Assign:
    """A material for one slot of an object, or for all of them."""

    node: NodeId
    material: MaterialId
    slot: int | None = None
    label: str = "Assign material"

    def __call__(self, scene: Scene) -> Scene:
        node = _mesh(scene, self.node)
        scene.material(self.material)
        if self.slot is not None and not 0 <= self.slot < len(node.materials):
            raise EditError(f"{node.name!r} has no material slot {self.slot}")
        materials = tuple(
            self.material if self.slot in (None, i) else old for i, old in enumerate(node.materials)
        )
        return scene.with_nodes(dataclasses.replace(node, materials=materials))


@dataclass(frozen=True)
class SetPaint:
    """What strokes changed of an object's materials, or nothing any more."""

    node: NodeId
    paint: Paint | None
    label: str = "Paint"

    def __call__(self, scene: Scene) -> Scene:
        return scene.with_nodes(dataclasses.replace(_mesh(scene, self.node), paint=self.paint))


@dataclass(frozen=True)
class AddMaterial:
    """A new material."""

    material: Material
    label: str = "New material"

    def __call__(self, scene: Scene) -> Scene:
        return Add((), (self.material,))(scene)


@dataclass(frozen=True)
class RemoveMaterial:
    """A material that no object uses."""

    material: MaterialId
    label: str = "Delete material"

    def __call__(self, scene: Scene) -> Scene:
        scene.material(self.material)
        users = [node.name for node in scene.of(MeshObject) if self.material in node.materials]
        if users:
            raise EditError(f"the material is still used by {', '.join(users)}")
        kept = {m: value for m, value in scene.materials.items() if m != self.material}
        return dataclasses.replace(scene, materials=frozen_map(kept))


@dataclass(frozen=True)
class SetMaterial:
    """Parameters of a material; with `model`, another BRDF whose unnamed parameters are its defaults.

    Whether the values fit the model is for whoever holds the registry to check (`check_material`).
    """

    material: MaterialId
    values: Mapping[str, Value] = field(default_factory=frozen_map)
    model: str | None = None
    name: str | None = None
    opacity: float | None = None
    catches: bool | None = None
    label: str = "Change material"

    def __call__(self, scene: Scene) -> Scene:
        old = scene.material(self.material)
        keep = self.model is None or self.model == old.model
        values = {**old.values, **self.values} if keep else dict(self.values)
        fields = {"name": self.name, "opacity": self.opacity, "catches": self.catches}
        made = dataclasses.replace(old, model=self.model or old.model, values=frozen_map(values))
        return scene.with_materials(_with_fields(made, {k: v for k, v in fields.items() if v is not None}))


@dataclass(frozen=True)
class SetTexture:
    """A picture for a parameter of a material, or none."""

    material: MaterialId
    parameter: str
    texture: Texture | None
    label: str = "Change texture"

    def __call__(self, scene: Scene) -> Scene:
        old = scene.material(self.material)
        textures = _with_entry(old.textures, self.parameter, self.texture)
        return scene.with_materials(dataclasses.replace(old, textures=textures))


@dataclass(frozen=True)
class LayTextures:
    """Where the pictures of a material lie (`Texture`): all of them, or those of some parameters."""

    material: MaterialId
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    aspect: float = 1.0
    parameters: tuple[str, ...] = ()
    label: str = "Lay pictures"

    def __call__(self, scene: Scene) -> Scene:
        old = scene.material(self.material)
        chosen = self.parameters or tuple(old.textures)
        made = dict(old.textures)
        try:
            for name in chosen:
                laid = (self.scale, self.offset, self.rotation, self.aspect)
                made[name] = Texture(old.textures[name].image, *laid)
        except (KeyError, ValueError) as error:
            raise EditError(f"the pictures of {old.name!r} cannot lie so: {error}") from None
        same = made == dict(old.textures)
        return scene if same else scene.with_materials(dataclasses.replace(old, textures=frozen_map(made)))


@dataclass(frozen=True)
class SetTable:
    """Measured numbers for a material by the model's name for them, or none."""

    material: MaterialId
    slot: str
    table: Table | None
    label: str = "Change measurement"

    def __call__(self, scene: Scene) -> Scene:
        old = scene.material(self.material)
        tables = _with_entry(old.tables, self.slot, self.table)
        return scene.with_materials(dataclasses.replace(old, tables=tables))


def _with_entry(entries: Mapping[str, T], name: str, entry: T | None) -> Mapping[str, T]:
    """The same with another entry of that name, at the end, or with none."""
    others = {key: value for key, value in entries.items() if key != name}
    return frozen_map(others if entry is None else {**others, name: entry})


def _mesh(scene: Scene, node_id: NodeId) -> MeshObject:
    node = scene[node_id]
    if not isinstance(node, MeshObject):
        raise EditError(f"{node.name!r} is no mesh object")
    return node


def _with_fields(thing: Any, values: Mapping[str, Any]) -> Any:
    infos = param_infos(type(thing))
    names = {f.name for f in dataclasses.fields(thing)} - {
        "id",
        "parent",
        "transform",
        "geometry",
        "materials",
        "paint",
    }
    checked: dict[str, Any] = {}
    for name, value in values.items():
        if name not in names:
            raise EditError(f"{thing.name!r} has no property {name!r}")
        try:
            checked[name] = check(name, infos[name], value) if name in infos else _other(name, value)
        except InputError as error:
            raise EditError(str(error)) from None
    try:
        return dataclasses.replace(thing, **checked)
    except (ValueError, TypeError) as error:
        raise EditError(f"{thing.name!r} cannot be like that: {error}") from None


_SCALE = ParamInfo("number", "Calibration", low=1e-12, high=1e12)


def _other(name: str, value: Any) -> Any:
    """Fields that no form shows: an environment's picture and calibration."""
    if name == "luminance_scale" and value is not None:
        return check(name, _SCALE, value)
    if name == "image" and not isinstance(value, Image):
        raise EditError(f"{name} = {value!r} is no picture")
    return value


def _check_new(what: str, ids: Iterable[str], there: Container[str]) -> None:
    seen: set[str] = set()
    for ident in ids:
        if ident in there or ident in seen:
            raise EditError(f"{what} {ident!r} is already in the scene")
        seen.add(ident)


def _check_node(scene: Scene, node: Node) -> None:
    seen = {node.id}
    for parent in scene.ancestors(node.id):
        if parent.id in seen:
            raise EditError("a node cannot hang under itself")
        seen.add(parent.id)
    if isinstance(node, MeshObject):
        for material in node.materials:
            scene.material(material)
        slots = node.geometry.slots
        needed = int(slots.max()) + 1 if slots is not None and len(slots) else 1
        if len(node.materials) < needed:
            raise EditError(f"{node.name!r} needs {needed} materials, one a slot")
