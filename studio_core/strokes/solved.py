"""The edit that solvers return: paint on objects, materials that can be painted, fields of strokes."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from studio_core.arrays import frozen_map
from studio_core.errors import EditError
from studio_core.scene.nodes import Material, MeshObject, Node, NodeId, Scene
from studio_core.scene.paint import Paint
from studio_core.strokes.stroke import Stroke


@dataclass(frozen=True)
class Solved:
    """Paint by object (None: bare), materials to be put in the place of those with their ids, and fields of
    strokes by their ids. What has gone meanwhile is an EditError.
    """

    label: str
    paints: Mapping[NodeId, Paint | None] = field(default_factory=frozen_map)
    materials: tuple[Material, ...] = ()
    strokes: Mapping[NodeId, Mapping[str, Any]] = field(default_factory=frozen_map)

    def __call__(self, scene: Scene) -> Scene:
        """See `studio_core.edits.Edit`."""
        for material in self.materials:
            scene.material(material.id)
        nodes: list[Node] = []
        for node_id, paint in self.paints.items():
            node = scene[node_id]
            if not isinstance(node, MeshObject):
                raise EditError(f"{node.name!r} has no surface to be painted")
            nodes.append(dataclasses.replace(node, paint=paint))
        for stroke_id, values in self.strokes.items():
            stroke = scene[stroke_id]
            if not isinstance(stroke, Stroke):
                raise EditError(f"{stroke.name!r} is no stroke")
            nodes.append(dataclasses.replace(stroke, **values))
        return scene.with_materials(*self.materials).with_nodes(*nodes)


__all__ = ["Solved"]
