"""What differs between two scenes, found by identity.

Edits declare nothing: undo, redo and reopening invalidate exactly as the edit itself did.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import Flag, auto

from studio_core.arrays import frozen_map
from studio_core.scene.capture import Capture
from studio_core.scene.nodes import (
    Camera,
    Environment,
    Group,
    Light,
    MaterialId,
    MeshObject,
    Node,
    NodeId,
    Scene,
)
from studio_core.scene.room import Room
from studio_core.strokes.stroke import Stroke


class Aspect(Flag):
    """What kind of thing changed; stages name what dirties them.

    GAIN is the part of LIGHT that is linear (intensity, tint, temperature; whether it is seen): a weighted
    sum, no new light sum. NAME covers what no picture shows. VIEW, QUALITY and INDIRECT (how light between
    surfaces is computed, and whether it is looked at) are never part of the document.
    """

    NONE = 0
    STRUCTURE = auto()
    GEOMETRY = auto()
    TRANSFORM = auto()
    MATERIAL = auto()
    LIGHT = auto()
    GAIN = auto()
    STROKES = auto()
    VIEW = auto()
    QUALITY = auto()
    NAME = auto()
    INDIRECT = auto()


EVERYTHING = ~Aspect.NONE
_SEEN_FIELDS = ("background", "background_azimuth", "projection", "ground_height", "ground_radius")
_GAIN_FIELDS = ("intensity", "tint", "temperature", *_SEEN_FIELDS)
_NAME_FIELDS = ("name", "locked")
_MADE_FROM = {f.name for f in fields(Room)} - {f.name for f in fields(MeshObject)}  # the mesh tells


@dataclass(frozen=True)
class Changes:
    """Nodes by what changed on them, and materials.

    Added and removed nodes have STRUCTURE; cameras, captures and strokes only ever NAME: they light
    nothing, and what strokes change is paint.
    """

    nodes: Mapping[NodeId, Aspect] = field(default_factory=frozen_map)
    materials: frozenset[MaterialId] = frozenset()
    aspects: Aspect = Aspect.NONE

    def __bool__(self) -> bool:
        return bool(self.aspects)

    def __or__(self, later: Changes) -> Changes:
        """Both together, as one."""
        nodes = dict(self.nodes)
        for node, aspect in later.nodes.items():
            nodes[node] = nodes.get(node, Aspect.NONE) | aspect
        return Changes(frozen_map(nodes), self.materials | later.materials, self.aspects | later.aspects)

    def of(self, aspects: Aspect) -> tuple[NodeId, ...]:
        """Nodes on which one of `aspects` changed."""
        return tuple(node for node, changed in self.nodes.items() if changed & aspects)


def everything(scene: Scene) -> Changes:
    """As if the whole scene were new."""
    nodes = frozen_map(dict.fromkeys(scene.nodes, EVERYTHING))
    return Changes(nodes, frozenset(scene.materials), EVERYTHING)


def view_changed(aspect: Aspect = Aspect.VIEW) -> Changes:
    """A change outside the document: the view, or the quality."""
    return Changes(aspects=aspect)


def diff(before: Scene, after: Scene) -> Changes:
    """What differs; cost follows the number of nodes, arrays are never compared."""
    if before is after:
        return Changes()
    nodes: dict[NodeId, Aspect] = {}
    moved: list[NodeId] = []
    for node_id, new in after.nodes.items():
        old = before.nodes.get(node_id)
        if old is new:
            continue
        if old is None:
            aspect = _added(new)
        elif type(old) is not type(new):
            aspect = _added(old) | _added(new)
        else:
            aspect = _node_diff(old, new)
        if aspect:
            nodes[node_id] = aspect
        if aspect & Aspect.TRANSFORM:
            moved.append(node_id)
        if aspect & Aspect.STRUCTURE:
            moved.append(node_id)
    for node_id, old in before.nodes.items():
        if node_id not in after.nodes:
            nodes[node_id] = _added(old)
    for node_id in moved:  # what hangs below moves and hides with it
        for below in after.subtree(node_id):
            if below != node_id:
                inherited = nodes[node_id] & (Aspect.TRANSFORM | Aspect.STRUCTURE)
                nodes[below] = nodes.get(below, Aspect.NONE) | inherited | _light(after[below], inherited)
    for node_id in nodes:
        there = [scene.nodes[node_id] for scene in (before, after) if node_id in scene.nodes]
        if all(isinstance(node, Camera | Capture | Stroke) for node in there):
            nodes[node_id] = Aspect.NAME  # no light depends on it, and who looks through a camera has a view
    materials = {m for m, new in after.materials.items() if before.materials.get(m) is not new}
    materials |= before.materials.keys() - after.materials.keys()
    aspects = Aspect.MATERIAL if materials else Aspect.NONE
    if any(_casting_changed(before, after, m) for m in materials):
        aspects |= Aspect.STRUCTURE
    for aspect in nodes.values():
        aspects |= aspect
    if _environments(before) != _environments(after):  # the first that is shown gives the light
        aspects |= Aspect.LIGHT
    if not aspects and tuple(before.nodes) != tuple(after.nodes):
        aspects = Aspect.NAME
    return Changes(frozen_map(nodes), frozenset(materials), aspects)


def _environments(scene: Scene) -> list[NodeId]:
    return [node.id for node in scene.of(Environment)]


def _casting_changed(before: Scene, after: Scene, material: MaterialId) -> bool:
    old, new = before.materials.get(material), after.materials.get(material)
    return old is not None and new is not None and old.casts_shadow != new.casts_shadow


def _added(node: Node) -> Aspect:
    return Aspect.STRUCTURE | _light(node, Aspect.STRUCTURE)


def _light(node: Node, aspect: Aspect) -> Aspect:
    return Aspect.LIGHT | Aspect.GAIN if aspect and isinstance(node, Light) else Aspect.NONE


def _node_diff(old: Node, new: Node) -> Aspect:
    changed = {name for name in vars(new) if getattr(old, name) is not getattr(new, name)}
    changed = {
        name for name in changed if name in ("geometry", "image") or getattr(old, name) != getattr(new, name)
    }
    aspect = Aspect.NONE
    for name in changed:
        if name in _NAME_FIELDS or (name in _MADE_FROM and isinstance(new, Room)):
            aspect |= Aspect.NAME
        elif name == "hidden":
            aspect |= _added(new)
        elif name == "transform":
            aspect |= Aspect.TRANSFORM | _light(new, Aspect.TRANSFORM)
        elif name == "parent":
            aspect |= Aspect.STRUCTURE | Aspect.TRANSFORM | _light(new, Aspect.TRANSFORM)
        elif name == "paint":
            aspect |= Aspect.MATERIAL | Aspect.STROKES
        elif isinstance(new, MeshObject):
            aspect |= Aspect.GEOMETRY if name == "geometry" else Aspect.MATERIAL | Aspect.STRUCTURE
        elif isinstance(new, Light):
            if name in _GAIN_FIELDS:
                aspect |= Aspect.GAIN
            elif isinstance(new, Environment) and name == "luminance_scale":
                aspect |= Aspect.NAME
            else:
                aspect |= Aspect.LIGHT
        elif isinstance(new, Camera | Group):
            aspect |= Aspect.NAME
        else:
            aspect |= Aspect.STRUCTURE
    return aspect
