"""From named parts to nodes and materials of a scene, with ids that do not change from run to run."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from studio_core.arrays import frozen_map
from studio_core.params import Value
from studio_core.scene.geometry import Geometry, Texture
from studio_core.scene.nodes import Camera, Group, Material, MeshObject, Node, Scene
from studio_core.scene.transform import IDENTITY, Transform, axis_angle, looking

from .mesh import Mesh, Point


@dataclass(frozen=True)
class Part:
    """A piece of furniture under its name: a mesh and the material of each of its slots."""

    name: str
    mesh: Mesh
    materials: tuple[str, ...]
    textured: bool = False

    def geometry(self) -> Geometry:
        """The finished mesh."""
        return self.mesh.geometry(self.textured)


def slug(text: str) -> str:
    """`Seat cushion, left` becomes `seat-cushion-left`."""
    return re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-")


def placed(x: float, z: float, degrees: float = 0.0, y: float = 0.0) -> Transform:
    """Standing at (x, y, z), turned about the vertical."""
    return Transform((x, y, z), axis_angle((0.0, 1.0, 0.0), degrees))


def material(
    name: str, model: str, textures: Mapping[str, Texture] | None = None, **values: Value
) -> Material:
    """A material whose id follows from its name."""
    return Material(
        id=f"material-{slug(name)}",
        name=name,
        model=model,
        values=frozen_map(values),
        textures=frozen_map(textures or {}),
    )


class Stage:
    """Collects the nodes of a scene in the outliner's order."""

    def __init__(self, materials: Mapping[str, Material]):
        self.materials = materials
        self.nodes: list[Node] = []

    def group(self, name: str, at: Transform = IDENTITY, locked: bool = False) -> str:
        """Adds a group and gives its id."""
        made = Group(id=f"group-{slug(name)}", name=name, transform=at, locked=locked)
        self.nodes.append(made)
        return made.id

    def put(self, parts: Sequence[Part], group: str | None = None, at: Transform = IDENTITY) -> None:
        """Adds mesh objects, under `group` where one is given."""
        prefix = f"{group.removeprefix('group-')}-" if group else ""
        for part in parts:
            self.shape(part.name, part.geometry(), part.materials, group, at, prefix)

    def shape(
        self,
        name: str,
        geometry: Geometry,
        materials: tuple[str, ...],
        group: str | None = None,
        at: Transform = IDENTITY,
        prefix: str = "",
    ) -> None:
        """Adds one mesh object; the same geometry twice makes instances."""
        self.nodes.append(
            MeshObject(
                id=f"mesh-{prefix}{slug(name)}",
                name=name,
                parent=group,
                transform=at,
                geometry=geometry,
                materials=tuple(self.materials[m].id for m in materials),
            )
        )

    def camera(self, name: str, eye: Point, target: Point, fov: float) -> None:
        """Adds a camera that orbits what it looks at."""
        focus = sum((a - b) ** 2 for a, b in zip(eye, target, strict=True)) ** 0.5
        self.nodes.append(
            Camera(id=f"camera-{slug(name)}", name=name, transform=looking(eye, target), fov=fov, focus=focus)
        )

    def scene(self, *more: Node) -> Scene:
        """The scene, cameras and lights last; materials that nothing has are left out."""
        nodes = [*self.nodes, *more]
        used = {m for node in nodes if isinstance(node, MeshObject) for m in node.materials}
        kept = [m for m in self.materials.values() if m.id in used]
        return Scene().with_materials(*kept).with_nodes(*nodes)
