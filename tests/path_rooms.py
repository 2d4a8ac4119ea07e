"""Scenes for path tracing, and the artifacts that it starts from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scenes import cube, floor

from studio_core.scene.diff import Changes
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Material, MeshObject, Node, Scene
from studio_core.scene.transform import Transform, axis_angle
from studio_core.shading.artifacts import Casters, Hits, Lighting, Shapes, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import scene_view
from studio_core.shading.path_world import PathWorld, PathWorlds
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.stages import SurfaceParams, common_stages


@dataclass(frozen=True)
class Stand:
    """What stages before the light made of a scene."""

    scene: Scene
    frame: Frame
    pipeline: Pipeline
    surfaces: Surfaces
    casters: Casters
    lighting: Lighting
    shapes: Shapes
    hits: Hits
    world: PathWorld


def stand(scene: Scene, services: Any, vertices: int = 1500) -> Stand:
    """Of a scene, seen by its first camera or by one that sees everything."""
    pipeline = Pipeline(common_stages(services))
    frame = Frame(scene, scene_view(scene, None, 48, 27), SurfaceParams(vertices), 1)
    pipeline.update(frame, Changes(), Job("stand"))
    found: list[Any] = [pipeline.artifact(kind) for kind in (Surfaces, Casters, Lighting, Shapes, Hits)]
    surfaces, casters, lighting, shapes, hits = found
    world = PathWorlds(services.registry)(scene, surfaces, casters, lighting)
    return Stand(scene, frame, pipeline, surfaces, casters, lighting, shapes, hits, world)


def inward(geometry: Geometry) -> Geometry:
    """Turned inside out."""
    assert geometry.normals is not None
    return Geometry(geometry.positions, geometry.faces[:, ::-1].copy(), -geometry.normals, geometry.uvs)


def globe(level: int = 3, radius: float = 1.0) -> Geometry:
    """A sphere seen from inside."""
    import trimesh

    made = trimesh.creation.icosphere(level)
    normals = np.asarray(made.vertices, np.float32)
    return Geometry(normals * np.float32(radius), np.asarray(made.faces[:, ::-1], np.uint32), -normals)


def box_room(size: float = 2.0) -> Geometry:
    """A cube seen from inside, its corners at ± size / 2."""
    return inward(cube(size))


def furnished(lights: Iterable[Node], *materials: Material) -> Scene:
    """A room of 4 m without a front and a ceiling, a cube in it; ids floor, side, back, box."""
    known = {m.id: m for m in (Material(id="wall", name="Wall", values={"base_color": (0.7, 0.6, 0.5)}),)}
    known |= {m.id: m for m in materials}
    paint = "paint" if "paint" in known else "wall"
    parts = [
        MeshObject(id="floor", name="Floor", geometry=floor(), materials=("wall",)),
        MeshObject(
            id="back", name="Back", geometry=floor(), materials=("wall",),
            transform=Transform((0, 2, -2), axis_angle((1, 0, 0), 90)),
        ),
        MeshObject(
            id="side", name="Side", geometry=floor(), materials=(paint,),
            transform=Transform((-2, 2, 0), axis_angle((0, 0, 1), -90)),
        ),
        MeshObject(
            id="box", name="Box", geometry=cube(), materials=(paint,),
            transform=Transform((-0.4, 0.5, -0.3), axis_angle((0, 1, 0), 30)),
        ),
    ]  # fmt: skip
    return Scene().with_materials(*known.values()).with_nodes(*parts, *lights)
