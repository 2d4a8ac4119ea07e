"""Trials of `lucarne bench strokes`: an object whose material is changed, with pictures of before and after.

Pictures are by `reference`, not by a solver's own columns. Scenes are the sample room, and shared furniture
in the open where the shared test data is there. In `environment` the map alone gives light, in `lamp` two
rectangles above. The object has a material of its own (`specgloss`), of which one parameter is changed, or
two, or none.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio.bench.interreflection_scenes import box, furniture
from studio.headless import Headless
from studio_core.arrays import frozen_map
from studio_core.edits import Assign
from studio_core.params import Value
from studio_core.scene.bounds import exact_bounds
from studio_core.scene.nodes import AreaLamp, Environment, Light, Material, MeshObject, NodeId, Scene
from studio_core.scene.room import Room
from studio_core.scene.transform import looking
from studio_core.session import View
from studio_core.shading.artifacts import Picture
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params
from studio_core.strokes.session import Easel
from studio_core.strokes.solution import Lit

F64 = npt.NDArray[np.float64]

LIGHTS = ("environment", "lamp")
SINGLE = ("diffuse", "specular", "gloss")
PARAMETERS = (*SINGLE, "none", "mixed")
NAMES = {"diffuse": "diffuse", "specular": "specular", "gloss": "roughness"}
"""Of the model `specgloss`."""
MODEL, MATERIAL = "specgloss", "bench-material"
QUALITY = {"directions": "4096", "vertices": "30000"}
WIDTH, HEIGHT, FOV = 192, 128, 40.0
SMALLEST, LARGEST = 0.15, 2.0
"""Metres across of objects that are painted on."""
LEAST_SHARE, LEAST_LIGHT = 0.06, 0.03
"""Of the picture, and of luminance: what shows less of its object is no trial."""
TRIES = 40


@dataclass(frozen=True, eq=False)
class Trial:
    """One slot of an object, seen from one or two places.

    truth: the material's values by parameter of PARAMETERS, and which roles of these are new. before: a
    picture a view, after: likewise by parameter. `lit` is of the last picture before.
    """

    scene: Scene
    node: NodeId
    slot: int
    views: tuple[View, ...]
    before: tuple[Picture, ...]
    after: Mapping[str, tuple[Picture, ...]]
    truth: Mapping[str, tuple[Mapping[str, Value], frozenset[str]]]
    lit: Lit


def trials(light: str, count: int, program: Headless) -> Iterator[Trial]:
    """So many of a light; the same ones each time."""
    scenes = [one for one in (sample_scene(light), open_scene(light, program)) if one is not None]
    for number in range(count):
        rng = np.random.default_rng((LIGHTS.index(light), number))
        made = trial(scenes[number % len(scenes)], 1 + number // len(scenes) % 2, rng, program)
        if made is not None:
            yield made


def sample_scene(light: str) -> Scene:
    """The sample room."""
    from studio.samples import sample
    from studio_core.project.store import load

    return lit_by(load(sample()).scene, light, 2.2)


def open_scene(light: str, program: Headless) -> Scene | None:
    """Shared furniture on a floor, without its room; None where it is absent."""
    found = furniture(program)
    if found is None:
        return None
    kept = {node: one for node, one in found.scene.nodes.items() if not isinstance(one, AreaLamp)}
    walls = kept["walls"]
    assert isinstance(walls, MeshObject)
    floor = box((-4.0, -0.1, -4.0), (4.0, 0.0, 4.0), (32, 1, 32))
    kept["walls"] = dataclasses.replace(walls, geometry=floor, materials=walls.materials[:1])
    return lit_by(dataclasses.replace(found.scene, nodes=frozen_map(kept)), light, 2.4)


def lit_by(scene: Scene, light: str, height: float) -> Scene:
    """With the map's light alone, or with that of two lamps so high above."""
    nodes = [
        dataclasses.replace(node, hidden=not isinstance(node, Environment) or light == "lamp")
        for node in scene.of(Light)
    ]
    if light == "lamp":
        for number, (x, z) in enumerate(((-0.9, 0.6), (1.1, -0.4))):
            at = looking((x, height, z), (0.0, 0.0, 0.0))
            size = {"width": 0.5, "height": 0.5, "intensity": 12.0}
            nodes.append(AreaLamp(id=f"bench-lamp-{number}", name="Lamp", transform=at, **size))
    return scene.with_nodes(*nodes)


def trial(scene: Scene, views: int, rng: np.random.Generator, program: Headless) -> Trial | None:
    """One on an object that is drawn from a scene; None where none is well seen."""
    backend = program.registry.get("backend", "reference")
    job = Job("Trial")
    own = _objects(scene)
    for _ in range(TRIES):
        node, slot = own[int(rng.integers(len(own)))]
        values = base_values(rng)
        start = dressed(scene, node, slot, values)
        easel = Easel(backend, backend_params(backend, QUALITY), program.services)
        looks = [view_of(start, node, rng) for _ in range(views)]
        if not all(_well_seen(easel.picture(start, look, job), node, slot) for look in looks):
            continue
        truth = {name: changed(values, name, rng) for name in PARAMETERS}
        after = {
            name: tuple(easel.picture(dressed(scene, node, slot, then), look, job) for look in looks)
            for name, (then, _) in truth.items()
        }
        before = tuple(easel.picture(start, look, job) for look in looks)
        return Trial(start, node, slot, tuple(looks), before, after, truth, easel.lit())
    return None


def base_values(rng: np.random.Generator) -> dict[str, Value]:
    """A paint with a shine that can be seen."""
    red, green, blue = (float(c) for c in rng.uniform(0.12, 0.6, 3))
    shine = float(np.exp(rng.uniform(np.log(0.04), np.log(0.25))))
    return {
        "diffuse": (red, green, blue),
        "specular": (shine,) * 3,
        "roughness": float(rng.uniform(0.25, 0.6)),
    }


def changed(
    values: Mapping[str, Value], parameter: str, rng: np.random.Generator
) -> tuple[Mapping[str, Value], frozenset[str]]:
    """Other values of one role, two, or none; and which they are."""
    roles: tuple[str, ...] = () if parameter == "none" else (parameter,)
    if parameter == "mixed":
        roles = tuple(rng.choice(SINGLE, 2, replace=False).tolist())
    made = dict(values)
    for role in roles:
        made[NAMES[role]] = _other(role, values[NAMES[role]], rng)
    return made, frozenset(roles)


def _other(role: str, value: Value, rng: np.random.Generator) -> Value:
    if role == "diffuse":
        before = np.asarray(value, np.float64)
        while True:
            after = rng.uniform(0.05, 0.75, 3)
            if np.linalg.norm(after - before) > 0.4 * np.linalg.norm(before):
                red, green, blue = (float(c) for c in after)
                return (red, green, blue)
    if role == "specular":
        shine = float(np.asarray(value)[0])
        factor = float(rng.uniform(2.0, 4.0))
        return (float(np.clip(shine * factor if shine < 0.15 else shine / factor, 0.02, 0.9)),) * 3
    rough = float(np.asarray(value))
    factor = float(rng.uniform(1.4, 1.8))
    return rough / factor if rough > 0.4 else rough * factor


def dressed(scene: Scene, node: NodeId, slot: int, values: Mapping[str, Value]) -> Scene:
    """With a material of its own on a slot of an object."""
    made = Material(id=MATERIAL, name="Painted", model=MODEL, values=frozen_map(values))
    return Assign(node, MATERIAL, slot)(scene.with_materials(made))


def view_of(scene: Scene, node: NodeId, rng: np.random.Generator) -> View:
    """From above and aside, so near that the object fills the picture."""
    box_ = exact_bounds(scene, [node])
    assert box_ is not None
    low, high = box_
    turned, risen = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(15, 50))
    way = np.array([np.cos(risen) * np.sin(turned), np.sin(risen), np.cos(risen) * np.cos(turned)])
    centre, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    away = 0.95 * radius / np.sin(np.radians(FOV / 2))
    return View(looking(centre + away * way, centre), FOV, WIDTH, HEIGHT, away)


def pixels_of(picture: Picture, node: NodeId, slot: int) -> npt.NDArray[np.bool_]:
    """(H, W) which pixels show a slot of an object."""
    hits, mesh = picture.radiance.hits, picture.radiance.surfaces.mesh
    assert hits is not None
    index = mesh.index_of(node)
    own = mesh.faces_of(index)
    slots = np.full(len(mesh.faces) + 1, -1)  # the last: nothing is met
    slots[own] = mesh.objects[index].mesh.slots
    made: npt.NDArray[np.bool_] = slots[hits.face.reshape(*picture.node.shape, -1)[..., 0]] == slot
    return made


def _objects(scene: Scene) -> list[tuple[NodeId, int]]:
    """Objects of a size to be painted on, with each of their slots."""
    made = []
    for node in scene.of(MeshObject):
        box_ = exact_bounds(scene, [node.id]) if scene.shown(node.id) and not isinstance(node, Room) else None
        if box_ is not None and SMALLEST < float((box_[1] - box_[0]).max()) < LARGEST:
            made += [(node.id, slot) for slot in np.unique(node.geometry.slots).tolist()]
    return made


def _well_seen(picture: Picture, node: NodeId, slot: int) -> bool:
    own = pixels_of(picture, node, slot)
    return bool(own.mean() > LEAST_SHARE and picture.linear[own].mean() > LEAST_LIGHT)
