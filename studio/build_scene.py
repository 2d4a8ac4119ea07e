"""`lucarne new`: a scene from mesh files, an environment, a floor or a room, materials and a camera."""

from __future__ import annotations

import argparse
import dataclasses
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio.build_room import camera_in, room_from
from studio_core.arrays import frozen_map
from studio_core.contract import ImportedModel, Registry
from studio_core.edits import Add
from studio_core.errors import InputError, LucarneError
from studio_core.params import ParamInfo, Value, check, param_infos, parse
from studio_core.photographs import flat_floor, shadow_floor
from studio_core.scene.nodes import (
    FAR_AWAY,
    ON_THE_GROUND,
    Camera,
    Environment,
    Material,
    MeshObject,
    Scene,
    new_id,
)
from studio_core.scene.room import Room
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_core.session import View
from studio_core.shading.offline import scene_view

FARTHEST = 1e6  # metres from the middle of the world
SMALLEST, LARGEST = 1e-6, 1e6  # scale
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}


@dataclass(frozen=True)
class MeshRequest:
    """FILE[@x,y,z[,degrees_y[,scale]]]."""

    path: Path
    transform: Transform

    @classmethod
    def parse(cls, text: str) -> MeshRequest:
        """From the command line's text; a file may have @ in its name as long as numbers follow the last."""
        path, at, numbers = text.rpartition("@")
        if not at or _is_file(text):
            return cls(Path(text), Transform())
        parts = _numbers("--mesh", text, numbers)
        if not 3 <= len(parts) <= 5:
            raise InputError(f"--mesh {text!r}: after @ come x,y,z[,degrees[,scale]]")
        degrees = parts[3] if len(parts) > 3 else 0.0
        scale = parts[4] if len(parts) > 4 else 1.0
        place = (parts[0], parts[1], parts[2])
        if not SMALLEST <= scale <= LARGEST:
            raise InputError(f"--mesh {text!r}: expected a scale from {SMALLEST:g} to {LARGEST:g}")
        _check_place("--mesh", text, place)
        return cls(Path(path), Transform(place, axis_angle((0, 1, 0), degrees), scale))


def _is_file(text: str) -> bool:
    try:
        return Path(text).is_file()
    except (OSError, ValueError):  # too long, or with a null
        return False


def _numbers(option: str, text: str, numbers: str) -> list[float]:
    """The numbers of a part of an option's text."""
    try:
        parts = [float(part) for part in numbers.split(",")]
    except ValueError:
        raise InputError(
            f"{option} {text!r}: expected numbers separated by commas, not {numbers!r}"
        ) from None
    if not all(math.isfinite(part) for part in parts):
        raise InputError(f"{option} {text!r}: expected finite numbers, not {numbers!r}")
    return parts


def _check_place(option: str, text: str, place: Sequence[float]) -> None:
    if max(map(abs, place)) > FARTHEST:
        raise InputError(f"{option} {text!r}: expected places within {FARTHEST:g} metres")


def parse_camera(text: str) -> tuple[Transform, float, float]:
    """Transform, fov and focus from `from=x,y,z:to=x,y,z:fov=deg`."""
    given: dict[str, list[float]] = {}
    for part in text.split(":"):
        name, _, numbers = part.partition("=")
        if name not in ("from", "to", "fov"):
            raise InputError(f"--camera {text!r}: write from=x,y,z:to=x,y,z:fov=degrees")
        given[name] = _numbers("--camera", text, numbers)
    eye, target, fov = given.get("from", []), given.get("to", []), given.get("fov", [45.0])
    if len(eye) != 3 or len(target) != 3 or len(fov) != 1:
        raise InputError(f"--camera {text!r}: write from=x,y,z:to=x,y,z:fov=degrees")
    _check_place("--camera", text, (*eye, *target))
    check("--camera fov", param_infos(Camera)["fov"], fov[0])
    try:
        transform = looking(eye, target)
    except ValueError as error:
        raise InputError(f"--camera {text!r}: {error}") from None
    return transform, fov[0], float(np.linalg.norm(np.subtract(eye, target)))


def load_model(path: Path, registry: Registry, unit: float = 1.0) -> ImportedModel:
    """Read a model by its extension; InputError when no importer knows it."""
    from studio_core.exchange.files import importer_of

    return importer_of(registry, path).load(path, unit)


def floor(size: float) -> tuple[MeshObject, Material]:
    """A square floor at y = 0, facing up, textured once a metre."""
    geometry = flat_floor(size, size)
    material = Material(
        id=new_id("material"), name="Floor", model="lambert", values={"base_color": (0.5, 0.5, 0.5)}
    )
    return MeshObject(id=new_id("mesh"), name="Floor", geometry=geometry, materials=(material.id,)), material


def set_material(scene: Scene, text: str, registry: Registry) -> Scene:
    """The scene after NODE=KIND:key=value,…; the named node and all under it get the new material.

    Materials that nothing uses after that are left out.
    """
    name, equals, rest = text.partition("=")
    kind, _, settings = rest.partition(":")
    if not (name and equals and kind):
        raise InputError(f"--material {text!r}: write NODE=KIND:key=value,…")
    try:
        top = scene.named(name)
        brdf = registry.brdf(kind)
        values = _values(settings, kind, param_infos(brdf.Params))
    except LucarneError as error:
        raise InputError(f"--material {text!r}: {error}") from None
    material = Material(id=new_id("material"), name=f"{top.name} {kind}", model=kind, values=values)
    under = [scene[node] for node in scene.subtree(top.id)]
    changed = [
        dataclasses.replace(node, materials=(material.id,) * len(node.materials))
        for node in under
        if isinstance(node, MeshObject)
    ]
    if not changed:
        raise InputError(f"--material {text!r}: {top.name!r} has no mesh")
    made = scene.with_materials(material).with_nodes(*changed)
    used = {slot for node in made.of(MeshObject) for slot in node.materials}
    gone = {slot for node in scene.of(MeshObject) for slot in node.materials} - used
    kept = {slot: value for slot, value in made.materials.items() if slot not in gone}
    return dataclasses.replace(made, materials=frozen_map(kept))


def _values(settings: str, kind: str, infos: Mapping[str, ParamInfo]) -> Mapping[str, Value]:
    values: dict[str, Value] = {}
    for setting in filter(None, settings.split(",")):
        key, equals, value = setting.partition("=")
        if key not in infos:
            raise InputError(f"{kind} has no parameter {key!r}; known: {', '.join(infos) or 'none'}")
        if not equals:
            raise InputError(f"write {key}=VALUE")
        values[key] = parse(key, infos[key], value)
    return frozen_map(values)


def build(options: argparse.Namespace, registry: Registry) -> tuple[Scene, list[str]]:
    """The scene that the options of `lucarne new` describe, and notes in sentences."""
    scene, notes = Scene(), []
    for text in options.mesh:
        request = MeshRequest.parse(text)
        model = load_model(request.path, registry, UNITS[options.unit])
        notes += [f"{request.path.name}: {note}" for note in model.notes]
        scene = place(scene, model, request.transform)
    if options.floor is not None:
        if not 1e-3 <= options.floor <= 1e4:
            raise InputError(f"--floor {options.floor:g}: expected 0.001 to 10000 metres")
        node, material = floor(options.floor)
        scene = Add((node,), (material,))(scene)
    room = room_from(options)
    if room is not None:
        scene = room(scene)
    if options.env is not None:
        from studio_core.imaging.environment import load_environment

        image, told = load_environment(options.env)
        notes += [f"{options.env.name}: {note}" for note in told]
        seen = {"projection": ON_THE_GROUND if options.ground is not None else FAR_AWAY}
        if options.ground is not None:
            height = check("--ground", param_infos(Environment)["ground_height"], options.ground)
            seen["ground_height"] = height
        scene = scene.with_nodes(
            Environment(id=new_id("environment"), name=options.env.stem, image=image, **seen)
        )
    if options.shadow_floor:
        scene = shadow_floor(scene)(scene)
    for text in options.material:
        scene = set_material(scene, text, registry)
    inside = next(scene.of(Room), None) if not (options.camera or any(scene.of(Camera))) else None
    found = [camera_in(inside)] if inside is not None else cameras(scene, options.camera)
    made = {camera.id: camera for camera in found}
    return dataclasses.replace(scene, nodes=frozen_map({**made, **scene.nodes})), notes


def place(scene: Scene, model: ImportedModel, transform: Transform) -> Scene:
    """The scene with a model's top nodes moved by `transform`; a taken name gets a number."""
    taken = {node.name for node in scene.nodes.values()}
    nodes = []
    for node in model.nodes:
        if node.parent is None:
            name = _free(node.name, taken)
            node = dataclasses.replace(node, name=name, transform=transform @ node.transform)
        nodes.append(node)
    return Add(tuple(nodes), model.materials)(scene)


def cameras(scene: Scene, texts: Sequence[str]) -> list[Camera]:
    """One camera a text; without texts one that frames the scene, unless a model brought its own."""
    if texts:
        made = [parse_camera(text) for text in texts]
    elif any(True for _ in scene.of(Camera)):
        made = []
    else:
        view: View = scene_view(scene, None, 960, 540)
        made = [(view.transform, view.fov, view.focus)]
    taken = {node.name for node in scene.nodes.values()}
    found = []
    for transform, fov, focus in made:
        name = _free("Camera", taken)
        found.append(Camera(id=new_id("camera"), name=name, transform=transform, fov=fov, focus=focus))
    return found


def _free(name: str, taken: set[str]) -> str:
    """The name, with a number when it is taken; it is taken then."""
    made, number = name, 2
    while made in taken:
        made, number = f"{name} {number}", number + 1
    taken.add(made)
    return made
