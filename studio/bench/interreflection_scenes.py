"""The scenes of `lucarne bench interreflection`; the same call gives the same scene.

`teapot`: the paper's first scene rebuilt: a glossy pot (Phong n = 10, 3,241 vertices) on a matte floor of
4,096 under an area light. `room`: its second: six objects, about 25,000 vertices, walls that light a glossy
bunny, sixteen lamps. `sample`: the sample room, lit through its windows. `furniture`: shared furniture in a
room without a front, under two area lamps and a map. `bleeding`: a red cabinet beside a white wall.
`furnace-…`: a closed box, and a closed room without edges, of one albedo.
"""

from __future__ import annotations

import dataclasses
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio.bench.interreflection_meshes import (
    box,
    bunny,
    inside_out,
    shell,
    slab,
    star,
    teapot,
    vase,
)
from studio.headless import Headless
from studio_core.arrays import frozen_map
from studio_core.params import Colour, Value
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import (
    AreaLamp,
    Camera,
    Environment,
    Group,
    Light,
    Material,
    MeshObject,
    Node,
    NodeId,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_core.shading.surfaces import SurfaceParams

Point = tuple[float, float, float]
CASES = ("teapot", "room", "sample", "furniture", "bleeding")
FURNACES = (0.5, 0.8, 0.9)
AS_MADE = 500
"""A budget of vertices that leaves meshes about as they are."""
WHITE, WALL = (0.8, 0.8, 0.8), (0.75, 0.74, 0.7)
CENTIMETRE = 0.01
RED: Colour = (0.62, 0.06, 0.05)


@dataclass(frozen=True)
class Setting:
    """A scene and what somebody does in it.

    `budget` is the backend's `vertices`; `movable` are nodes that are moved, all of them standing between the
    corners `low` and `high` (x, z) of a floor; `painted` is a material whose shape is edited (`field` of it),
    `light` one that is dimmed and coloured. `fixed` are the nodes of the room itself,
    `tinted` is a material on which other things leave their colour.
    """

    name: str
    scene: Scene
    budget: int
    movable: tuple[NodeId, ...]
    low: tuple[float, float]
    high: tuple[float, float]
    painted: str
    field: str
    light: NodeId
    fixed: tuple[NodeId, ...] = ("walls", "floor", "group-room")
    tinted: str = ""

    def count(self) -> int:
        """How many vertices the scene is shaded at."""
        from studio_core.scene.diff import everything
        from studio_core.shading.frame import Frame
        from studio_core.shading.job import Job
        from studio_core.shading.offline import scene_view
        from studio_core.shading.pipeline import Pipeline
        from studio_core.shading.surfaces import SurfaceStage

        params = SurfaceParams(self.budget)
        frame = Frame(self.scene, scene_view(self.scene, None, 16, 9), params)
        made = Pipeline([SurfaceStage()]).update(frame, everything(self.scene), Job("counting"))
        return len(made.mesh.positions)


def setting(name: str, program: Headless) -> Setting | None:
    """The scene of one of CASES; None where it needs shared data that is absent."""
    makers: Mapping[str, Callable[[], Setting | None]] = {
        "teapot": pot_on_floor,
        "room": room,
        "sample": sample_room,
        "furniture": lambda: furniture(program),
        "bleeding": bleeding,
    }
    return makers[name]()


def pot_on_floor() -> Setting:
    """The paper's figure 9 (a)."""
    pot = _phong("pot", (0.45, 0.3, 0.12), (0.4, 0.36, 0.25), 10.0)
    floor = _matte("floor", (0.55, 0.6, 0.7))
    lamp = AreaLamp(
        id="lamp",
        name="Area light",
        transform=looking((-0.55, 0.9, 0.35), (0.0, 0.0, 0.0)),
        width=0.4,
        height=0.4,
        intensity=18.0,
    )
    nodes = [
        _object("floor", slab(1.4, 1.4, 0.02, (63, 63)), ("floor",)),
        _object("pot", teapot(), ("pot",), Transform((0.0, 0.0, 0.05), axis_angle((0, 1, 0), 25))),
        lamp,
        _camera((0.25, 0.5, 0.85), (0.0, 0.07, 0.0), 38.0),
    ]
    scene = Scene().with_materials(pot, floor).with_nodes(*nodes)
    return Setting(
        "teapot", scene, AS_MADE, ("pot",), (-0.45, -0.55), (0.45, 0.35), "pot", "exponent", "lamp"
    )


def room() -> Setting:
    """The paper's figure 9 (b): what lights the front of the bunny are the walls."""
    materials = [
        _matte("floor", (0.5, 0.4, 0.3)),
        _matte("left", (0.65, 0.12, 0.08)),
        _matte("right", (0.1, 0.4, 0.15)),
        _matte("wall", WALL),
        _matte("ceiling", WHITE),
        _phong("bunny", (0.25, 0.23, 0.2), (0.5, 0.5, 0.5), 10.0),
        _phong("vase", (0.08, 0.16, 0.4), (0.35, 0.35, 0.35), 16.0),
        _matte("box", (0.7, 0.6, 0.35)),
        _phong("ball", (0.3, 0.12, 0.25), (0.4, 0.4, 0.4), 12.0),
        _matte("cabinet", (0.35, 0.5, 0.6)),
    ]
    walls = shell((-2.0, 0.0, -2.0), (2.0, 2.7, 2.0), 0.1, (50, 34, 50))
    cabinet = box((-0.45, 0.0, -0.25), (0.45, 1.1, 0.25), (16, 20, 9))
    stool = box((-0.3, 0.0, -0.3), (0.3, 0.42, 0.3), (17, 12, 17))
    ball = star(34, 48, lambda d: np.full(len(d), 0.28))
    nodes: list[Node] = [
        _object("walls", walls, ("floor", "left", "right", "wall", "ceiling", "wall")),
        _object("bunny", _standing(star(80, 84, bunny), 0.62), ("bunny",), _at(-0.35, 0.35, 20)),
        _object("vase", vase(48, 44, 0.8), ("vase",), _at(0.95, 0.55)),
        _object("stool", stool, ("box",), _at(0.55, -0.45, 30)),
        _object("ball", _standing(ball, 1.0), ("ball",), _at(-1.15, 0.9)),
        _object("cabinet", cabinet, ("cabinet",), _at(-0.8, -1.6)),
        *_ceiling_lamps(2.62),
        _camera((0.0, 1.55, 5.6), (0.0, 1.15, 0.0), 38.0),
    ]
    scene = Scene().with_materials(*materials).with_nodes(*nodes)
    movable = ("bunny", "vase", "stool", "ball", "cabinet")
    return Setting("room", scene, AS_MADE, movable, (-2, -2), (2, 2), "bunny", "exponent", "downlight-5")


def _ceiling_lamps(height: float) -> list[Light]:
    """Twelve spots, two bulbs and two area lamps, in rows."""
    made: list[Light] = []
    for k in range(12):
        x, z = -1.5 + (k % 4), -1.4 + 1.3 * (k // 4)
        warm = 2700.0 + 250.0 * (k % 4)
        made.append(
            SpotLamp(
                id=f"downlight-{k}",
                name=f"Downlight {k}",
                transform=looking((x, height, z), (x, 0.0, z + 0.01)),
                intensity=0.8,
                temperature=warm,
                cone=50.0,
                inner=25.0,
            )
        )
    for k, x in enumerate((-1.0, 1.0)):
        made.append(
            PointLamp(id=f"bulb-{k}", name=f"Bulb {k}", transform=Transform((x, 1.9, 0.2)), intensity=0.35)
        )
        place = looking((1.3 * x, height, 0.6), (0.9 * x, 0.0, 0.3))
        made.append(
            AreaLamp(
                id=f"panel-{k}", name=f"Panel {k}", transform=place, width=0.5, height=0.3, intensity=6.0
            )
        )
    return made


def bleeding() -> Setting:
    """A red cabinet in the white corner of a room, under one area light and a bulb."""
    materials = [
        _matte("floor", (0.55, 0.52, 0.48)),
        _matte("wall", WHITE),
        _matte("cabinet", RED),
        _phong("vase", (0.5, 0.5, 0.5), (0.3, 0.3, 0.3), 16.0),
    ]
    walls = shell((-1.6, 0.0, -1.5), (1.6, 2.4, 1.5), 0.1, (46, 34, 43))
    nodes: list[Node] = [
        _object("walls", walls, ("floor", "wall", "wall", "wall", "wall", "wall")),
        _object(
            "cabinet",
            box((-0.4, 0.0, -0.25), (0.4, 1.3, 0.25), (20, 32, 12)),
            ("cabinet",),
            _at(-1.1, -0.9, 90),
        ),
        _object("vase", vase(30, 32, 0.5), ("vase",), _at(0.5, -0.6)),
        AreaLamp(
            id="lamp",
            name="Area light",
            transform=looking((0.6, 2.3, 0.6), (-0.2, 0.0, -0.4)),
            width=0.6,
            height=0.6,
            intensity=18.0,
        ),
        PointLamp(id="bulb", name="Bulb", transform=Transform((0.3, 1.7, 1.0)), intensity=0.8),
        _camera((0.4, 1.4, 4.4), (-0.1, 1.05, -0.5), 38.0),
    ]
    scene = Scene().with_materials(*materials).with_nodes(*nodes)
    return Setting(
        "bleeding",
        scene,
        AS_MADE,
        ("cabinet", "vase"),
        (-1.6, -1.5),
        (1.6, 1.5),
        "vase",
        "exponent",
        "lamp",
        tinted="wall",
    )


def sample_room() -> Setting:
    """The sample room with what stands in it in glossy materials of its own."""
    from studio.samples import sample
    from studio_core.project.store import load

    scene = load(sample()).scene
    glossy = next(m for m in scene.materials.values() if m.model == "ggx")
    return Setting(
        "sample",
        scene,
        SurfaceParams().vertices,
        ("group-armchair", "group-coffee-table", "mesh-chair-at-the-back"),
        (-2.6, -2.3),
        (1.9, 1.3),
        glossy.id,
        "roughness",
        next(scene.of(Environment)).id,
    )


PIECES = {
    "armchair2": (0.9, -0.75, -40.0),
    "oakTable": (-0.55, 0.35, 0.0),
    "bedsideTable2": (-1.6, -1.3, 0.0),
    "chair2": (0.45, 0.95, -140.0),
}
"""Shared pieces: where they stand (x, z) and how they are turned."""


def furniture(program: Headless) -> Setting | None:
    """Four pieces in a room without a front, two area lamps and what a map gives through the front."""
    from studio_core.imaging.environment import load_environment

    root = Path(os.environ.get("LUCARNE_TEST_DATA") or Path(__file__).parents[3] / "shared" / "data") / "cc0"
    models = root / "furniture_blendswap_cc0"
    if not models.is_dir():
        return None
    scene = Scene()
    for name, (x, z, turn) in PIECES.items():
        scene = _with_piece(scene, name, models / name / f"{name}.obj", _at(x, z, turn), program)
    walls = shell((-2.3, 0.0, -1.9), (2.3, 2.5, 1.9), 0.1, (42, 23, 35))
    materials = [_matte(f"room-{k}", c) for k, c in enumerate(((0.4, 0.28, 0.18), WALL, (0.3, 0.45, 0.6)))]
    names = ("room-0", "room-2", "room-1", "room-1", "room-1", "room-1")
    lamps = [
        AreaLamp(
            id=f"panel-{k}",
            name=f"Panel {k}",
            transform=looking((x, 2.42, 0.2), (0.8 * x, 0.0, 0.0)),
            width=0.6,
            height=0.6,
            intensity=5.0,
        )
        for k, x in enumerate((-1.2, 1.2))
    ]
    day = load_environment(root / "hdri_polyhaven_cc0" / "courtyard.exr")[0]
    nodes = [
        _object("walls", walls, names),
        *lamps,
        Environment(id="day", name="Courtyard", image=day, azimuth=90.0, intensity=0.5),
        _camera((0.3, 1.5, 5.4), (-0.1, 0.95, 0.0), 40.0),
    ]
    scene = scene.with_materials(*materials).with_nodes(*nodes)
    glossy = next(m for m in scene.materials.values() if m.model in ("blinn-phong", "phong"))
    return Setting(
        "furniture", scene, AS_MADE, tuple(PIECES), (-2.3, -1.9), (2.3, 1.9), glossy.id, "exponent", "panel-0"
    )


def _with_piece(scene: Scene, name: str, path: Path, at: Transform, program: Headless) -> Scene:
    """The scene with a model under a group of that name; ids that do not change from run to run."""
    from studio.build_scene import load_model

    model = load_model(path, program.registry)
    materials = {old.id: f"{name}-material-{k}" for k, old in enumerate(model.materials)}
    nodes = {old.id: f"{name}-{k}" for k, old in enumerate(model.nodes)}
    group = Group(id=name, name=name, transform=dataclasses.replace(at, scale=CENTIMETRE))
    made: list[Node] = [group]
    for node in model.nodes:
        parent = name if node.parent is None else nodes[node.parent]
        moved = dataclasses.replace(node, id=nodes[node.id], parent=parent)
        if isinstance(moved, MeshObject):
            moved = dataclasses.replace(moved, materials=tuple(materials[m] for m in moved.materials))
        made.append(moved)
    own = [dataclasses.replace(material, id=materials[material.id]) for material in model.materials]
    return scene.with_materials(*own).with_nodes(*made)


def furnace(albedo: float, curved: bool = False) -> Scene:
    """A closed room of one matte material seen from inside, a bulb in its middle: a box, or a bent egg."""
    wall = _matte("wall", (albedo, albedo, albedo))
    if curved:
        inside = inside_out(star(40, 56, lambda d: 1.2 + 0.25 * d[:, 1] + 0.12 * np.sin(3 * d[:, 0])))
    else:
        inside = box((-1.5, -1.2, -1.0), (1.5, 1.2, 1.0), (15, 12, 10), inward=True)
    bulb = PointLamp(id="bulb", name="Bulb", intensity=1.0)
    return (
        Scene()
        .with_materials(wall)
        .with_nodes(
            _object("walls", inside, ("wall",)), bulb, _camera((0.6, 0.3, 0.4), (-1, -0.2, -0.5), 80.0)
        )
    )


def _matte(name: str, colour: Colour) -> Material:
    values: dict[str, Value] = {"base_color": colour}
    return Material(id=name, name=name, model="lambert", values=frozen_map(values))


def _phong(name: str, diffuse: Colour, specular: Colour, exponent: float) -> Material:
    values: dict[str, Value] = {"diffuse": diffuse, "specular": specular, "exponent": exponent}
    return Material(id=name, name=name, model="phong", values=frozen_map(values))


def _object(
    name: str, mesh: Geometry, materials: tuple[str, ...], place: Transform | None = None
) -> MeshObject:
    return MeshObject(
        id=name,
        name=name.capitalize(),
        geometry=mesh,
        materials=materials,
        transform=place or Transform(),
    )


def _camera(eye: Point, target: Point, fov: float) -> Camera:
    return Camera(
        id="camera",
        name="Camera",
        transform=looking(eye, target),
        fov=fov,
        focus=math.dist(eye, target),
    )


def _at(x: float, z: float, degrees: float = 0.0) -> Transform:
    return Transform((x, 0.0, z), axis_angle((0, 1, 0), degrees))


def _standing(mesh: Geometry, scale: float) -> Geometry:
    """Scaled, its lowest point on y = 0."""
    placed = mesh.positions * np.float32(scale)
    placed[:, 1] -= placed[:, 1].min()
    return Geometry(placed, mesh.faces, mesh.normals, mesh.uvs, mesh.slots)
