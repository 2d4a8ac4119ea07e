"""Edits that copy: nodes with all that hangs under them, and materials that others use too."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Container, Iterable, Mapping

from studio_core.edits import Add, AddMaterial, Assign, Compound, Edit
from studio_core.scene.nodes import Material, MaterialId, MeshObject, Node, NodeId, Scene, new_id
from studio_core.scene.transform import Transform


def duplicate(
    scene: Scene,
    nodes: tuple[NodeId, ...],
    *,
    offset: Transform | None = None,
    own_materials: bool = False,
) -> Add:
    """The edit that copies nodes with everything under them; meshes become instances.

    Materials are shared, unless `own_materials` gives the copies some of their own. Names are new ones.
    """
    roots = [n for n in nodes if not any(parent.id in nodes for parent in scene.ancestors(n))]
    fresh = {old: new_id(old.split("-")[0]) for root in roots for old in scene.subtree(root)}
    materials = _copied_materials(scene, fresh) if own_materials else {}
    taken = {node.name for node in scene.nodes.values()}
    made: list[Node] = []
    for old, new in fresh.items():
        node = scene[old]
        parent = fresh.get(node.parent, node.parent) if node.parent is not None else None
        copy = dataclasses.replace(node, id=new, parent=parent)
        if old in roots:
            moved = offset @ node.transform if offset is not None else node.transform
            copy = dataclasses.replace(copy, name=_copy_name(taken, node.name), transform=moved)
            taken.add(copy.name)
        made.append(_with_materials(copy, materials))
    return Add(tuple(made), tuple(materials.values()), label="Duplicate")


def with_own_materials(scene: Scene, nodes: Iterable[NodeId], label: str = "Make material its own") -> Edit:
    """The edit that gives objects at and under `nodes` copies of the materials that others use too.

    They share the copies among themselves.
    """
    inside = {below for node in nodes for below in scene.subtree(node)}
    others = {m for node in scene.of(MeshObject) if node.id not in inside for m in node.materials}
    materials = {m: copy for m, copy in _copied_materials(scene, inside).items() if m in others}
    meshes = [node for node in scene.of(MeshObject) if node.id in inside]
    edits: list[Edit] = [AddMaterial(copy) for copy in materials.values()]
    for node in meshes:
        for slot, material in enumerate(node.materials):
            if material in materials:
                edits.append(Assign(node.id, materials[material].id, slot))
    return Compound(label, tuple(edits))


def _copied_materials(scene: Scene, nodes: Iterable[NodeId]) -> dict[MaterialId, Material]:
    """A copy, under a new name, of every material of these nodes, by the id of the original."""
    meshes = [node for node in map(scene.__getitem__, nodes) if isinstance(node, MeshObject)]
    taken = {material.name for material in scene.materials.values()}
    made: dict[MaterialId, Material] = {}
    for material in dict.fromkeys(m for node in meshes for m in node.materials):
        old = scene.material(material)
        copy = dataclasses.replace(old, id=new_id("material"), name=_copy_name(taken, old.name))
        taken.add(copy.name)
        made[material] = copy
    return made


def _with_materials(node: Node, materials: Mapping[MaterialId, Material]) -> Node:
    if not materials or not isinstance(node, MeshObject):
        return node
    return dataclasses.replace(node, materials=tuple(materials[m].id for m in node.materials))


def _copy_name(taken: Container[str], name: str) -> str:
    stem, _, number = name.rpartition(" ")
    stem = stem if number.isdigit() and stem else name
    return next(f"{stem} {i}" for i in itertools.count(2) if f"{stem} {i}" not in taken)
