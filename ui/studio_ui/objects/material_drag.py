"""Materials that are dragged: from the scene's list, or from the library, onto a thing in the picture or in
the outliner.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Protocol

import numpy as np
from PySide6.QtCore import QMimeData

from studio_core.edits import Assign, Compound, Edit
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import MaterialId, MeshObject, NodeId, Scene
from studio_core.scene.transform import Transform
from studio_core.session import View
from studio_ui.canvas.projection import F64, eye_of, ray
from studio_ui.canvas.viewport import Probe
from studio_ui.context import Context
from studio_ui.objects.choosing import meshes_below

MIME = "application/x-lucarne-material"
LIBRARY_MIME = "application/x-lucarne-library-material"


class Probing(Protocol):
    """The part of a viewport that a drop needs."""

    def probe(self, x: float, y: float) -> Probe | None:
        """What lies under a point of the canvas, (x, y) in 0…1."""
        ...


def material_data(material: MaterialId) -> QMimeData:
    """What a drag carries."""
    made = QMimeData()
    made.setData(MIME, material.encode())
    return made


def dragged_material(data: QMimeData) -> MaterialId | None:
    """The material that a drag carries, if it carries one."""
    return bytes(data.data(MIME).data()).decode() if data.hasFormat(MIME) else None


def entry_data(key: str) -> QMimeData:
    """What a drag out of the library carries: the entry's key."""
    made = QMimeData()
    made.setData(LIBRARY_MIME, key.encode())
    return made


def dragged_entry(data: QMimeData) -> str | None:
    """The key of the library's entry that a drag carries, if it carries one."""
    return bytes(data.data(LIBRARY_MIME).data()).decode() if data.hasFormat(LIBRARY_MIME) else None


def assigned(
    scene: Scene, nodes: Iterable[NodeId], material: MaterialId, slot: int | None = None
) -> Edit | None:
    """The edit that gives all objects there a material (in one slot only, where they have it).

    None where there is nothing to assign to, or no such material.
    """
    meshes = [m for m in meshes_below(scene, nodes) if slot is None or slot < len(m.materials)]
    if material not in scene.materials or not meshes:
        return None
    whom = meshes[0].name if len(meshes) == 1 else f"{len(meshes)} objects"
    label = f"{scene.material(material).name} on {whom}"
    return Compound(label, tuple(Assign(mesh.id, material, slot) for mesh in meshes))


def drop_material(context: Context, viewport: Probing, material: MaterialId, x: float, y: float) -> bool:
    """Give a material to what is seen at a point of the canvas, in the slot of the face that lies there.

    One undo step; False where nothing is seen there that can have a material.
    """
    place = dropped_on(context, viewport, x, y)
    if place is None:
        return False
    edit = assigned(context.document.scene, (place[0],), material, place[1])
    return edit is not None and context.editing.apply(edit)


def dropped_on(context: Context, viewport: Probing, x: float, y: float) -> tuple[NodeId, int | None] | None:
    """The same as `object_at`; says so where there is none."""
    found = object_at(context, viewport, x, y)
    if found is None:
        context.journal.write("Drop the material on an object.")
    return found


def object_at(context: Context, viewport: Probing, x: float, y: float) -> tuple[NodeId, int | None] | None:
    """The object that is seen at a point of the canvas, and the slot there if it has several."""
    probe = viewport.probe(x, y)
    scene = context.document.scene
    node = scene.nodes.get(probe.node) if probe is not None and probe.node is not None else None
    if not isinstance(node, MeshObject):
        return None
    slot = slot_at(node.geometry, scene.world(node.id), context.session.view, x, y)
    return node.id, slot if len(node.materials) > 1 else None


def slot_at(geometry: Geometry, world: Transform, view: View, x: float, y: float) -> int | None:
    """Slot of the nearest face of a mesh under a point of the canvas; None where the ray misses it.

    Möller & Trumbore 1997, over all faces at once.
    """
    local = world.inverse()
    start: F64 = local.matrix()[:3, :3] @ eye_of(view) + local.translation
    along: F64 = local.matrix()[:3, :3] @ ray(view, x, y)
    a, b, c = (geometry.positions[geometry.faces[:, i]].astype(np.float64) for i in range(3))
    ab, ac = b - a, c - a
    across = np.cross(along, ac)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 / np.einsum("fi,fi->f", ab, across)
        away = start - a
        u = np.einsum("fi,fi->f", away, across) * scale
        turned = np.cross(away, ab)
        v = (turned @ along) * scale
        distance = np.einsum("fi,fi->f", ac, turned) * scale
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
    if not hit.any() or geometry.slots is None:
        return None
    return int(geometry.slots[np.argmin(np.where(hit, distance, np.inf))])
