"""What must hold between the items of a scene before it is written and after it is read."""

from __future__ import annotations

import numpy as np

from studio_core.errors import ProjectError
from studio_core.project.memo import Memo
from studio_core.scene.nodes import MeshObject, Scene

highest_slot: Memo[int] = Memo(lambda geometry: int(np.max(geometry.slots, initial=0)))


def check_scene(scene: Scene) -> None:
    """ProjectError naming the node or material when ids, parents, materials or slots do not fit."""
    for kind, group in (("node", scene.nodes), ("material", scene.materials)):
        for ident, item in group.items():
            if not ident or ident != item.id:
                raise ProjectError(f"the {kind} {item.name!r} stands under {ident!r} but is {item.id!r}")
    parents = {node.parent for node in scene.nodes.values()} - {None}
    for node in scene.nodes.values() if not parents <= scene.nodes.keys() else ():
        if node.parent is not None and node.parent not in scene.nodes:
            raise ProjectError(f"the parent {node.parent!r} of the node {node.name!r} does not exist")
    for node in scene.of(MeshObject):
        for material in node.materials:
            if material not in scene.materials:
                raise ProjectError(f"the material {material!r} of the mesh {node.name!r} does not exist")
        if len(node.geometry.faces) and highest_slot(node.geometry) >= len(node.materials):
            raise ProjectError(
                f"the mesh {node.name!r} has {len(node.materials)} materials, but a face uses "
                f"slot {highest_slot(node.geometry)}"
            )
    _check_parents(scene, parents)


def _check_parents(scene: Scene, parents: set[str | None]) -> None:
    safe: set[str | None] = {None}
    for start in parents:
        path: dict[str, None] = {}
        at = start
        while at not in safe:
            assert at is not None
            if at in path:
                raise ProjectError(f"the node {scene.nodes[at].name!r} is its own ancestor")
            path[at] = None
            at = scene.nodes[at].parent
        safe.update(path)
