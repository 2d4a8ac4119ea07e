"""Choosing by what things have in common."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from studio_core.scene.nodes import MaterialId, MeshObject, NodeId, Scene
from studio_ui.context import Context


def meshes_below(scene: Scene, nodes: Iterable[NodeId]) -> tuple[MeshObject, ...]:
    """The mesh objects among `nodes` and under them, each once."""
    found: dict[NodeId, MeshObject] = {}
    for node in nodes:
        for below in scene.subtree(node) if node in scene.nodes else ():
            mesh = scene[below]
            if isinstance(mesh, MeshObject):
                found[below] = mesh
    return tuple(found.values())


def users(scene: Scene, materials: Iterable[MaterialId]) -> tuple[NodeId, ...]:
    """All objects that have one of these materials."""
    wanted = set(materials)
    return tuple(mesh.id for mesh in scene.of(MeshObject) if not wanted.isdisjoint(mesh.materials))


def same_material(scene: Scene, nodes: Iterable[NodeId]) -> tuple[NodeId, ...]:
    """All objects that share a material with those."""
    return users(scene, (m for mesh in meshes_below(scene, nodes) for m in mesh.materials))


def instances(scene: Scene, nodes: Iterable[NodeId]) -> tuple[NodeId, ...]:
    """All objects that share a mesh with those."""
    shared = {id(mesh.geometry) for mesh in meshes_below(scene, nodes)}
    return tuple(mesh.id for mesh in scene.of(MeshObject) if id(mesh.geometry) in shared)


class Choosing:
    """The actions that choose more than what is chosen."""

    def __init__(self, context: Context) -> None:
        self._context = context

    def handlers(self) -> dict[str, Callable[[], object]]:
        """By action id."""
        return {
            "edit.select_material": lambda: self._choose(same_material),
            "edit.select_instances": lambda: self._choose(instances),
        }

    def conditions(self) -> dict[str, Callable[[], bool]]:
        """Whether there is an object among what is chosen."""
        return {"objects": lambda: bool(meshes_below(self._context.document.scene, self._chosen()))}

    def _chosen(self) -> tuple[NodeId, ...]:
        return self._context.session.selection

    def _choose(self, by: Callable[[Scene, Iterable[NodeId]], tuple[NodeId, ...]]) -> None:
        self._context.session.select(by(self._context.document.scene, self._chosen()))
