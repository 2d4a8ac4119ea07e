"""Mitsuba 3 export: a folder that anybody can render with an independent program, to check us.

scene.xml       cameras (the chosen one first), lights, materials, objects; takes $width, $height, $spp,
                $sampler and $max_depth
meshes/*.ply    one file a geometry and material; objects with the same mesh are instances
env.exr         the environment, gain included; textures/ what the materials use
bsdfs.py, emitters.py   reflectance models and lights that Mitsuba lacks, as its plugins
render.py       registers them and renders: `python render.py -o picture.exr --spp 256`
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Comment, Element, ElementTree, indent

import numpy as np
import numpy.typing as npt

from studio_core.contract import Registry
from studio_core.errors import InputError
from studio_core.scene.nodes import MaterialId, MeshObject, Scene
from studio_plugins.export.baking import baked
from studio_plugins.export.mitsuba_lights import add_cameras, add_lights
from studio_plugins.export.mitsuba_materials import Materials
from studio_plugins.export.mitsuba_xml import matrix, prop, put, ref
from studio_plugins.export.photographed import background_notes, without_catchers
from studio_plugins.export.shaded import ShadedPart, shaded_parts

SHIPPED = {
    "bsdfs.py": "mitsuba_bsdfs.py",
    "emitters.py": "mitsuba_emitters.py",
    "render.py": "mitsuba_render.py",
}


@dataclass(frozen=True)
class MitsubaExporter:
    """Satisfies `studio_core.contract.Exporter`. `max_depth` 2 is direct light alone, as the studio's."""

    width: int = 960
    height: int = 540
    spp: int = 64
    max_depth: int = 2
    camera: str | None = None
    label: str = "Mitsuba 3 scene (folder)"
    extensions: tuple[str, ...] = field(default=())

    def save(self, scene: Scene, path: Path, registry: Registry) -> tuple[str, ...]:
        """Write the folder `path`; files of an earlier export there are replaced.

        Returns what could not be expressed; raises InputError when the folder cannot be written.
        """
        folder = Path(path)
        try:
            (folder / "meshes").mkdir(parents=True, exist_ok=True)
            return self._save(scene, folder, registry)
        except OSError as error:
            raise InputError(f"{folder} cannot be written: {error.strerror or error}") from None

    def _save(self, scene: Scene, folder: Path, registry: Registry) -> tuple[str, ...]:
        scene, photograph = without_catchers(scene)
        scene, painted = baked(scene, registry)
        root = Element("scene", version="3.0.0")
        for name, value in (
            ("width", self.width),
            ("height", self.height),
            ("spp", self.spp),
            ("sampler", "independent"),
            ("max_depth", self.max_depth),
        ):
            root.append(Element("default", name=name, value=str(value)))
        materials = Materials(scene, registry, root, folder)
        _objects(root, scene, folder, materials)
        notes, visible = add_lights(root, scene, folder)
        notes += add_cameras(root, scene, self.camera, (self.width, self.height))
        integrator = put(root, "integrator", "path")
        prop(integrator, "integer", "max_depth", "$max_depth")
        prop(integrator, "boolean", "hide_emitters", not visible)
        notes = photograph + background_notes(scene) + painted + materials.notes + notes
        for note in notes:
            root.insert(0, Comment(re.sub(r"-+", "-", f" {note} ")))
        indent(root)
        ElementTree(root).write(folder / "scene.xml", encoding="utf-8", xml_declaration=True)
        for name, source in SHIPPED.items():
            text = resources.files("studio_plugins.export").joinpath(source).read_text(encoding="utf-8")
            (folder / name).write_text(text, encoding="utf-8")
        return tuple(notes)


def _objects(root: Element, scene: Scene, folder: Path, materials: Materials) -> None:
    """Write all shown objects."""
    uses: dict[tuple[str, tuple[MaterialId, ...]], list[MeshObject]] = {}
    for node in scene.of(MeshObject):
        if scene.shown(node.id):
            uses.setdefault((node.geometry.key, node.materials), []).append(node)
    files: dict[str, list[tuple[str, ShadedPart]]] = {}
    for number, ((key, slots), nodes) in enumerate(uses.items()):
        if key not in files:
            files[key] = _meshes(nodes[0], folder, len(files))
        if len(nodes) == 1:
            for file, part in files[key]:
                shape = _shape(root, file, part, slots, materials)
                matrix(shape, "to_world", scene.world(nodes[0].id).matrix())
            continue
        group = Element("shape", type="shapegroup", id=f"group-{number}")
        for file, part in files[key]:
            _shape(group, file, part, slots, materials)
        if not len(group):
            continue
        root.append(group)
        for node in nodes:
            instance = put(root, "shape", "instance")
            ref(instance, f"group-{number}")
            matrix(instance, "to_world", scene.world(node.id).matrix())


def _shape(
    parent: Element, file: str, part: ShadedPart, slots: tuple[MaterialId, ...], materials: Materials
) -> Element:
    shape = put(parent, "shape", "ply")
    prop(shape, "string", "filename", file)
    materials.use(shape, slots[min(part.slot, len(slots) - 1)], slots[min(part.back, len(slots) - 1)])
    return shape


def _meshes(node: MeshObject, folder: Path, number: int) -> list[tuple[str, ShadedPart]]:
    stem = re.sub(r"[^A-Za-z0-9]+", "-", node.name).strip("-").lower()[:40] or "mesh"
    made: list[tuple[str, ShadedPart]] = []
    for part in shaded_parts(node.geometry):
        file = f"meshes/{number:03}-{stem}-{len(made)}.ply"
        write_ply(folder / file, part)
        made.append((file, part))
    return made


def write_ply(path: Path, part: ShadedPart) -> None:
    """Binary little-endian PLY with normals, and u, v where there are any."""
    names = ["x", "y", "z", "nx", "ny", "nz"]
    columns: list[npt.NDArray[Any]] = [part.positions, part.normals]
    if part.uvs is not None:
        names += ["u", "v"]
        columns.append(part.uvs)
    faces = np.empty(len(part.faces), np.dtype([("count", "u1"), ("corner", "<i4", 3)]))
    faces["count"], faces["corner"] = 3, part.faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(part.positions)}",
        *(f"property float {name}" for name in names),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    with path.open("wb") as file:
        file.write("\n".join(header).encode())
        file.write(np.concatenate(columns, axis=1).astype("<f4").tobytes())
        file.write(faces.tobytes())


EXPORTER = MitsubaExporter()
