"""Which objects have no texture coordinates, and the edit that gives them some."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from studio_core.edits import Compound, SetGeometry
from studio_core.errors import EditError
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import MaterialId, MeshObject, NodeId, Scene
from studio_core.scene.room import Room
from studio_core.scene.unwrap import Unwrapped, unwrapped
from studio_core.shading.job import Job


def has_coordinates(geometry: Geometry) -> bool:
    """Whether a picture would be seen on it: there are coordinates, and not all are one."""
    uvs = geometry.uvs
    if uvs is None or not len(uvs):
        return False
    few = uvs[:: max(len(uvs) // 64, 1)]  # nearly always enough
    return bool((few != uvs[0]).any() or (uvs != uvs[0]).any())


def bare_objects(
    scene: Scene, nodes: Iterable[NodeId] | None = None, material: MaterialId | None = None
) -> tuple[MeshObject, ...]:
    """Objects (at and under some nodes, with a material) that have faces and no texture coordinates.

    Rooms are not among them: their meshes follow from their sizes, and have coordinates.
    """
    top = scene.nodes if nodes is None else (below for node in nodes for below in scene.subtree(node))
    found = (scene[node] for node in dict.fromkeys(top))
    return tuple(
        node
        for node in found
        if isinstance(node, MeshObject)
        and not isinstance(node, Room)
        and (material is None or material in node.materials)
        and len(node.geometry.faces)
        and not has_coordinates(node.geometry)
    )


@dataclass(frozen=True)
class Coordinates:
    """The edit, and sentences about meshes that were projected instead of cut into charts."""

    edit: Compound
    notes: tuple[str, ...]


def coordinates_for(scene: Scene, objects: Iterable[MeshObject], job: Job | None = None) -> Coordinates:
    """Texture coordinates in metres of the world for objects; instances of one size share theirs.

    Raises EditError where there are no objects, Cancelled.
    """
    chosen = tuple(objects)
    if not chosen:
        raise EditError("everything that was chosen has texture coordinates")
    found: dict[tuple[str, float], Unwrapped] = {}
    edits, notes = [], []
    for number, node in enumerate(chosen):
        if job is not None:
            job.checkpoint(number, len(chosen))
        scale = scene.world(node.id).scale
        key = node.geometry.key, round(scale, 9)
        if key not in found:
            found[key] = unwrapped(node.geometry, scale=scale, job=job)
            if found[key].projected:
                notes.append(f"{node.name} was projected from its sides: {found[key].projected}.")
        edits.append(SetGeometry(node.id, found[key].geometry))
    what = chosen[0].name if len(chosen) == 1 else f"{len(chosen)} objects"
    return Coordinates(Compound(f"Texture coordinates of {what}", tuple(edits)), tuple(notes))


__all__ = ["Coordinates", "bare_objects", "coordinates_for", "has_coordinates"]
