"""Scene, nodes and materials: frozen values, shared between versions.

Whatever can be edited is a field here; fields made with `param` appear in the properties panel.
"""

from __future__ import annotations

import dataclasses
import secrets
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TypeVar

from studio_core.arrays import frozen_map
from studio_core.colour import kelvin
from studio_core.errors import EditError
from studio_core.params import Colour, Value, param
from studio_core.scene.geometry import Geometry, Image, Table, Texture
from studio_core.scene.paint import Paint
from studio_core.scene.transform import IDENTITY, Transform, axis_angle, multiply

NodeId = str
MaterialId = str
WHITE: Colour = (1.0, 1.0, 1.0)
FAR_AWAY, ON_THE_GROUND = "far away", "on the ground"


def new_id(prefix: str) -> str:
    """A fresh id such as `mesh-3f9a1c07d2b4`."""
    return f"{prefix}-{secrets.token_hex(6)}"


@dataclass(frozen=True, kw_only=True)
class Material:
    """A BRDF of the registry by name, its parameters, textures by parameter name, and measured tables.

    Values that are not given have the model's defaults; tables that the model does not ask for are kept.
    Under `opacity` 0.5 the surface casts no shadow; under 1 it is drawn blended. What `catches` shadows
    belongs to the photographed room: it shows what is behind it, times the light it gets over the light it
    would get if nothing stood there.
    """

    id: MaterialId
    name: str = param("Material", "Name")
    model: str = "lambert"
    values: Mapping[str, Value] = field(default_factory=frozen_map)
    textures: Mapping[str, Texture] = field(default_factory=frozen_map)
    tables: Mapping[str, Table] = field(default_factory=frozen_map)
    opacity: float = param(1.0, "Opacity", "Below 0.5 the surface casts no shadow", low=0.0, high=1.0)
    catches: bool = param(
        False, "Catches shadows", "Shows the background, darker where furniture takes light away from it"
    )

    @property
    def casts_shadow(self) -> bool:
        """Whether light is stopped."""
        return self.opacity >= 0.5 and not self.catches


@dataclass(frozen=True, kw_only=True)
class Node:
    """What every node has; `transform` is relative to the parent."""

    id: NodeId
    name: str = param("Node", "Name")
    parent: NodeId | None = None
    transform: Transform = IDENTITY
    hidden: bool = param(False, "Hidden", "Not drawn, casts no shadow, gives no light")
    locked: bool = param(False, "Locked", "Cannot be picked or moved in the picture")


@dataclass(frozen=True, kw_only=True)
class Group(Node):
    """Holds other nodes together."""


@dataclass(frozen=True, kw_only=True)
class MeshObject(Node):
    """A mesh with one material a slot; nodes with the same `geometry` are instances.

    `paint` is what strokes changed of its materials on this object alone.
    """

    geometry: Geometry
    materials: tuple[MaterialId, ...]
    paint: Paint | None = None


@dataclass(frozen=True, kw_only=True)
class Camera(Node):
    """Looks along its local -z, +y up. `focus` is the distance of the point it orbits."""

    fov: float = param(45.0, "Field of view", "Vertical angle", unit="°", low=1.0, high=170.0)
    focus: float = param(3.0, "Orbit distance", unit="m", low=1e-3, high=1e5, advanced=True)


@dataclass(frozen=True, kw_only=True)
class Light(Node):
    """What every light has. Its layer of radiance is linear in `gain()`."""

    intensity: float = param(1.0, "Intensity", low=0.0, high=1e9, scale="log")
    tint: Colour = param(WHITE, "Tint", "Colour the light is multiplied with", low=0.0, high=1e3)
    temperature: float = param(
        0.0,
        "Temperature",
        "Black-body colour on top of the tint; 0 leaves it alone",
        unit="K",
        low=0.0,
        high=25000.0,
    )

    def gain(self) -> Colour:
        """RGB factor of the light's layer: intensity · tint · temperature's colour."""
        warm = kelvin(self.temperature) if self.temperature > 0 else WHITE
        red, green, blue = (self.intensity * t * w for t, w in zip(self.tint, warm, strict=True))
        return (red, green, blue)


@dataclass(frozen=True, kw_only=True)
class Environment(Light):
    """Light from all around: an equirectangular picture of radiance (OpenEXR's lat-long convention).

    The picture is tilted about x, then turned about y. `luminance_scale` is cd/m² for one unit of
    luminance, once calibrated. As a background it may be turned further, and projected on a ground: then it
    was photographed `ground_height` above the node's own place, and what is seen lies on the ground as far as
    `ground_radius`, beyond that on a dome.
    """

    image: Image
    azimuth: float = param(
        0.0, "Rotation", "Turns the light about the vertical", unit="°", low=-3600.0, high=3600.0
    )
    tilt: float = param(0.0, "Tilt", "Tips the light about the horizontal", unit="°", low=-180.0, high=180.0)
    background: bool = param(True, "Visible", "Shown behind the furniture")
    background_azimuth: float = param(
        0.0, "Turned", "Turns the background alone, not the light", unit="°", low=-3600.0, high=3600.0
    )
    projection: str = param(
        FAR_AWAY,
        "Projection",
        "Far away the background never comes nearer; on the ground, furniture stands in it",
        choices=(FAR_AWAY, ON_THE_GROUND),
    )
    ground_height: float = param(
        1.6, "Camera height", "How high above the floor it was photographed", unit="m", low=0.05, high=1e3
    )
    ground_radius: float = param(
        6.0,
        "Ground radius",
        "How far the photographed floor reaches before its walls begin",
        unit="m",
        low=0.5,
        high=1e4,
    )
    luminance_scale: float | None = None

    def rotation(self) -> Transform:
        """World from the picture's own frame."""
        turn, tip = axis_angle((0, 1, 0), self.azimuth), axis_angle((1, 0, 0), self.tilt)
        return Transform(rotation=multiply(turn, tip))

    def background_rotation(self) -> Transform:
        """World from the frame of the picture that is seen."""
        turn = axis_angle((0, 1, 0), self.background_azimuth)
        return Transform(rotation=multiply(turn, self.rotation().rotation))


@dataclass(frozen=True, kw_only=True)
class PointLamp(Light):
    """`intensity` is radiant intensity: radiance units · m² (W/sr)."""


@dataclass(frozen=True, kw_only=True)
class SpotLamp(Light):
    """A point lamp along its local -z that falls off smoothly between `inner` and `cone`."""

    cone: float = param(45.0, "Cone", "Half angle where the light ends", unit="°", low=0.5, high=90.0)
    inner: float = param(30.0, "Full cone", "Half angle of full light", unit="°", low=0.0, high=90.0)


@dataclass(frozen=True, kw_only=True)
class DirectionalLamp(Light):
    """Sunlight along its local -z from a disc; each part gives `intensity` to a surface that faces it."""

    angle: float = param(0.53, "Angular size", "Diameter of the disc", unit="°", low=0.0, high=90.0)


@dataclass(frozen=True, kw_only=True)
class AreaLamp(Light):
    """A rectangle in its local xy plane that gives light along -z; `intensity` is its radiance."""

    width: float = param(1.0, "Width", unit="m", low=1e-3, high=1e3)
    height: float = param(1.0, "Height", unit="m", low=1e-3, high=1e3)


N = TypeVar("N", bound=Node)


@dataclass(frozen=True)
class Scene:
    """Nodes and materials by id, in the order of the outliner."""

    nodes: Mapping[NodeId, Node] = field(default_factory=frozen_map)
    materials: Mapping[MaterialId, Material] = field(default_factory=frozen_map)

    def __getitem__(self, node: NodeId) -> Node:
        try:
            return self.nodes[node]
        except KeyError:
            raise EditError(f"there is no node {node!r} in the scene") from None

    def material(self, material: MaterialId) -> Material:
        """The material of that id; EditError when there is none."""
        try:
            return self.materials[material]
        except KeyError:
            raise EditError(f"there is no material {material!r} in the scene") from None

    def of(self, kind: type[N]) -> Iterator[N]:
        """All nodes of a kind, in order."""
        return (node for node in self.nodes.values() if isinstance(node, kind))

    def children(self, parent: NodeId | None) -> Iterator[Node]:
        """The nodes directly under `parent` (None: the top), in order."""
        return (self.nodes[node] for node in self._below.get(parent, ()))

    def ancestors(self, node: NodeId) -> Iterator[Node]:
        """The parents of a node from the nearest up."""
        parent = self[node].parent
        while parent is not None:
            found = self[parent]
            yield found
            parent = found.parent

    def subtree(self, node: NodeId) -> list[NodeId]:
        """The node and everything under it."""
        found = [self[node].id]
        for parent in found:
            found.extend(self._below.get(parent, ()))
        return found

    @cached_property
    def _below(self) -> Mapping[NodeId | None, list[NodeId]]:
        """Children by parent: of thousands of nodes, all are looked at once for a scene."""
        made: dict[NodeId | None, list[NodeId]] = {}
        for child in self.nodes.values():
            made.setdefault(child.parent, []).append(child.id)
        return made

    def world(self, node: NodeId) -> Transform:
        """World from the node's own frame."""
        made = self[node].transform
        for parent in self.ancestors(node):
            made = parent.transform @ made
        return made

    def shown(self, node: NodeId) -> bool:
        """Whether neither the node nor one of its parents is hidden."""
        return not self[node].hidden and not any(parent.hidden for parent in self.ancestors(node))

    def named(self, name: str) -> Node:
        """The first node of that name or id; EditError naming what exists otherwise."""
        for node in self.nodes.values():
            if name in (node.name, node.id):
                return node
        known = ", ".join(repr(node.name) for node in self.nodes.values()) or "nothing"
        raise EditError(f"there is no node named {name!r}; the scene has {known}")

    def with_nodes(self, *nodes: Node) -> Scene:
        """The scene with these nodes added or replaced; replaced ones keep their place.

        A node that equals the one that is there leaves it alone; so may the whole scene come back.
        """
        new = _differing(self.nodes, {n.id: n for n in nodes})
        return dataclasses.replace(self, nodes=frozen_map({**self.nodes, **new})) if new else self

    def with_materials(self, *materials: Material) -> Scene:
        """The scene with these materials added or replaced, as with nodes."""
        new = _differing(self.materials, {m.id: m for m in materials})
        return dataclasses.replace(self, materials=frozen_map({**self.materials, **new})) if new else self


T = TypeVar("T")


def _differing(there: Mapping[str, T], new: Mapping[str, T]) -> dict[str, T]:
    return {key: value for key, value in new.items() if key not in there or there[key] != value}
