"""GLB export: the furniture for other programs (glTF 2.0, one binary file).

Groups, objects, cameras and lamps keep their hierarchy; objects with the same mesh and materials share
one glTF mesh. Lamps become KHR_lights_punctual: candela and lux are radiance units times the calibrated
environment's cd/m², or times 1. Materials: see `gltf_materials`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio_core.contract import Registry
from studio_core.errors import InputError
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import (
    AreaLamp,
    Camera,
    DirectionalLamp,
    Environment,
    Light,
    MaterialId,
    MeshObject,
    Node,
    NodeId,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.scene.transform import IDENTITY, Transform
from studio_plugins.export.baking import baked
from studio_plugins.export.gltf_buffer import Buffer, write_glb
from studio_plugins.export.gltf_materials import Json, Materials
from studio_plugins.export.photographed import without_catchers
from studio_plugins.export.shaded import shaded_parts

LIGHTS = "KHR_lights_punctual"
SAMPLER = {"magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497}
NEAR = 0.01


@dataclass(frozen=True)
class GlbExporter:
    """Satisfies `studio_core.contract.Exporter`."""

    label: str = "glTF binary"
    extensions: tuple[str, ...] = (".glb",)

    def save(self, scene: Scene, path: Path, registry: Registry) -> tuple[str, ...]:
        """Write the file; what could not be expressed. InputError when it cannot be written."""
        scene, photograph = without_catchers(scene)
        scene, painted = baked(scene, registry)
        writer = _Writer(scene, registry)
        document = writer.document()
        try:
            write_glb(Path(path), document, writer.buffer)
        except OSError as error:
            raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
        return tuple(photograph + painted + writer.materials.notes + writer.notes)


class _Writer:
    """One export under way."""

    def __init__(self, scene: Scene, registry: Registry) -> None:
        self.scene = scene
        self.buffer = Buffer()
        self.materials = Materials(scene, registry, self.buffer)
        self.notes: list[str] = []
        self.cameras: list[Json] = []
        self.lights: list[Json] = []
        self.meshes: list[Json] = []
        self._mesh_of: dict[tuple[str, tuple[MaterialId, ...]], int | None] = {}
        self._parts_of: dict[str, list[tuple[int, Json]]] = {}
        shown = (e.luminance_scale for e in scene.of(Environment) if scene.shown(e.id))
        self.scale = next((s for s in shown if s), 1.0)

    def document(self) -> Json:
        """The whole glTF but for the buffer."""
        nodes = [node for node in self.scene.nodes.values() if self.scene.shown(node.id)]
        if len(nodes) < len(self.scene.nodes):
            self.notes.append("Hidden nodes were left out.")
        parents = {node.parent for node in nodes}
        placed = [node for node in nodes if not isinstance(node, Environment) or node.id in parents]
        for node in nodes:
            if isinstance(node, Environment):
                self.notes.append(f"{node.name}: glTF holds no environment; it was left out.")
        index = {node.id: number for number, node in enumerate(placed)}
        made = [self._node(node, index) for node in placed]
        used = self.materials.extensions | ({LIGHTS} if self.lights else set())
        return {
            "asset": {"version": "2.0", "generator": "Lucarne Studio"},
            "extensionsUsed": sorted(used),
            "scene": 0,
            "scenes": [_without_empty({"nodes": [index[n.id] for n in placed if n.parent not in index]})],
            "nodes": made,
            "meshes": self.meshes,
            "materials": self.materials.materials,
            "textures": self.materials.textures,
            "images": self.materials.images,
            "samplers": [SAMPLER] if self.materials.textures else [],
            "cameras": self.cameras,
            "extensions": {LIGHTS: {"lights": self.lights}} if self.lights else {},
        }

    def _node(self, node: Node, index: dict[NodeId, int]) -> Json:
        made: Json = {"name": node.name, **_placed(node.transform)}
        children = [index[child.id] for child in self.scene.children(node.id) if child.id in index]
        if children:
            made["children"] = children
        if isinstance(node, MeshObject):
            mesh = self._mesh(node)
            if mesh is not None:
                made["mesh"] = mesh
        elif isinstance(node, Camera):
            perspective = {"yfov": math.radians(node.fov), "znear": NEAR}
            self.cameras.append({"name": node.name, "type": "perspective", "perspective": perspective})
            made["camera"] = len(self.cameras) - 1
        elif isinstance(node, Light) and not isinstance(node, Environment):
            light = self._light(node)
            if light is not None:
                self.lights.append(light)
                made["extensions"] = {LIGHTS: {"light": len(self.lights) - 1}}
        return made

    def _mesh(self, node: MeshObject) -> int | None:
        key = (node.geometry.key, node.materials)
        if key not in self._mesh_of:
            if node.geometry.key not in self._parts_of:
                self._parts_of[node.geometry.key] = list(self._primitives(node.geometry))
            primitives = [
                {**part, "material": self.materials.use(node.materials[min(slot, len(node.materials) - 1)])}
                for slot, part in self._parts_of[node.geometry.key]
            ]
            if primitives:
                self.meshes.append({"name": node.name, "primitives": primitives})
            else:
                self.notes.append(f"{node.name}: the mesh has no faces; an empty node was written.")
            self._mesh_of[key] = len(self.meshes) - 1 if primitives else None
        return self._mesh_of[key]

    def _primitives(self, mesh: Geometry) -> Sequence[tuple[int, Json]]:
        """Attributes and indices by material slot."""
        if mesh.normals is None:
            return [
                (
                    part.slot,
                    {
                        "attributes": self._attributes(part.positions, part.normals, part.uvs),
                        "indices": self.buffer.indices(part.faces),
                    },
                )
                for part in shaded_parts(mesh)
            ]
        if not len(mesh.faces):
            return []
        attributes = self._attributes(mesh.positions, mesh.normals, mesh.uvs)
        assert mesh.slots is not None
        return [
            (
                int(slot),
                {"attributes": attributes, "indices": self.buffer.indices(mesh.faces[mesh.slots == slot])},
            )
            for slot in np.unique(mesh.slots)
        ]

    def _attributes(
        self,
        positions: npt.NDArray[np.float32],
        normals: npt.NDArray[np.float32],
        uvs: npt.NDArray[np.float32] | None,
    ) -> dict[str, int]:
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        unit = np.where(length > 1e-6, normals / np.maximum(length, 1e-6), np.array([0, 1, 0], np.float32))
        made = {
            "POSITION": self.buffer.vertices(positions, bounded=True),
            "NORMAL": self.buffer.vertices(unit),
        }
        if uvs is not None:
            made["TEXCOORD_0"] = self.buffer.vertices(np.stack([uvs[:, 0], 1 - uvs[:, 1]], axis=1))
        return made

    def _light(self, light: Light) -> Json | None:
        gain = np.array(light.gain())
        strength = float(gain.max())
        if strength <= 0:
            self.notes.append(f"{light.name}: the lamp gives no light; an empty node was written.")
            return None
        made: Json = {
            "name": light.name,
            "color": (gain / strength).tolist(),
            "intensity": strength * self.scale,
        }
        match light:
            case PointLamp():
                made["type"] = "point"
            case DirectionalLamp():
                made["type"] = "directional"
                if light.angle > 0:
                    self.notes.append(f"{light.name}: glTF's sun has no size; its shadows will be sharp.")
            case SpotLamp():
                outer = math.radians(min(light.cone, 90.0))
                inner = min(math.radians(light.inner), outer - 1e-4)
                made |= {"type": "spot", "spot": {"innerConeAngle": inner, "outerConeAngle": outer}}
            case AreaLamp():
                made["intensity"] *= light.width * light.height * self.scene.world(light.id).scale ** 2
                made |= {"type": "spot", "spot": {"innerConeAngle": 0.0, "outerConeAngle": math.pi / 2}}
                self.notes.append(f"{light.name}: glTF has no area lamps; a spot in its middle was written.")
            case _:
                self.notes.append(f"{light.name}: glTF has no such light; an empty node was written.")
                return None
        return made


def _placed(transform: Transform) -> Json:
    made: Json = {}
    if transform.translation != IDENTITY.translation:
        made["translation"] = list(transform.translation)
    if transform.rotation != IDENTITY.rotation:
        w, x, y, z = transform.rotation
        made["rotation"] = [x, y, z, w]
    if transform.scale != 1:
        made["scale"] = [transform.scale] * 3
    return made


def _without_empty(made: Json) -> Json:
    return {key: value for key, value in made.items() if value not in ([], {})}


EXPORTER = GlbExporter()
