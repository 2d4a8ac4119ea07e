"""What the kinds of nodes are called and drawn with, and into which groups a filter sorts them."""

from __future__ import annotations

from studio_core.scene.capture import Capture
from studio_core.scene.nodes import (
    AreaLamp,
    Camera,
    DirectionalLamp,
    Environment,
    Group,
    Light,
    MeshObject,
    Node,
    PointLamp,
    SpotLamp,
)
from studio_core.scene.room import Room
from studio_core.strokes.stroke import Stroke

KINDS: dict[type[Node], tuple[str, str, str]] = {
    Group: ("group", "Group", "groups"),
    MeshObject: ("object", "Object", "objects"),
    Room: ("room", "Room", "rooms"),
    Camera: ("camera", "Camera", "cameras"),
    Environment: ("environment", "Environment", "environments"),
    Capture: ("capture", "Capture", "captures"),
    Stroke: ("stroke", "Stroke", "strokes"),
    PointLamp: ("lamp", "Point lamp", "point lamps"),
    SpotLamp: ("spot", "Spot lamp", "spot lamps"),
    DirectionalLamp: ("sun", "Sun", "suns"),
    AreaLamp: ("area", "Area lamp", "area lamps"),
    Light: ("lamp", "Light", "lights"),
    Node: ("object", "Object", "objects"),
}
"""Icon, name and plural of a kind; a class that is not here has those of the nearest it derives from."""

LISTED_APART = (Stroke,)
"""Kinds that have a list in a panel of their own: neither the outliner nor the palette shows them."""

FILTERS: dict[str, tuple[str, type[Node]]] = {
    "": ("Everything", Node),
    "objects": ("Objects", MeshObject),
    "groups": ("Groups", Group),
    "lights": ("Lights", Light),
    "cameras": ("Cameras", Camera),
}
"""What a list can be narrowed to: name and class."""


def _kind(kind: type[Node]) -> tuple[str, str, str]:
    return next(KINDS[base] for base in kind.__mro__ if base in KINDS)


def kind_icon(node: Node) -> str:
    """Name of the icon for a kind of node."""
    return _kind(type(node))[0]


def kind_name(node: Node) -> str:
    """What the kind is called."""
    return _kind(type(node))[1]


def kinds_name(nodes: list[Node]) -> str:
    """`Point lamp`, `3 point lamps`, `2 lights`, `4 things`: what these nodes are together."""
    if len(nodes) == 1:
        return kind_name(nodes[0])
    kinds = {type(node) for node in nodes}
    if len(kinds) == 1:
        return f"{len(nodes)} {_kind(kinds.pop())[2]}"
    lights = all(isinstance(node, Light) for node in nodes)
    return f"{len(nodes)} {'lights' if lights else 'things'}"
