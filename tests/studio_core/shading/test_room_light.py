"""Light and rooms: none comes into a closed one, and what comes in comes through its openings."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt
import pytest
from oracles.rooms import inside

from studio_core.contract import Services
from studio_core.edits import SetFields
from studio_core.rooms import new_room
from studio_core.scene.diff import Changes, diff
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, PointLamp, Scene
from studio_core.scene.room import Room
from studio_core.scene.room_plans import l_plan
from studio_core.scene.room_shape import Opening, Point
from studio_core.scene.transform import Transform, axis_angle
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view, shade
from studio_core.shading.pipeline import Pipeline

DOOR = Opening(kind="door", wall=1, sill=0.0, width=0.9, height=2.05)
ASKEW = Transform((103.7, 0.0, -55.1), axis_angle((0, 1, 0), 33.3))
BACKENDS = ("reference", "cuts")


@pytest.fixture(scope="module")
def services(host, workers):
    return Services(workers, host)


def scene_of(room: Room, lamp: Point = (3.5, 0.0)) -> Scene:
    """The room under a bright sky, a bright lamp beside it."""
    white = Image(np.full((8, 16, 3), 1000, np.float32))
    at = room.transform @ Transform((lamp[0], 1.5, lamp[1]))
    return Scene().with_nodes(
        Environment(id="sky", name="Sky", image=white), PointLamp(id="lamp", intensity=1e4, transform=at)
    )


def lit(services, host, backend: str, add, where: Transform) -> tuple[Room, npt.NDArray, npt.NDArray]:
    """The room, its vertices in its own frame, a little before their surface, and what reaches each."""
    scene = add(Scene())
    room = dataclasses.replace(next(scene.of(Room)), transform=where)
    scene = scene.with_nodes(room, *scene_of(room).nodes.values())
    chosen = host.get("backend", backend)
    params = backend_params(chosen, {"directions": "1024", "vertices": 1500, "everywhere": True})
    made = shade(scene, scene_view(scene, None, 32, 18), chosen, params, services)
    mesh = made.surfaces.mesh
    points = np.asarray(mesh.positions + mesh.origin + 1e-3 * mesh.geometric, np.float64)
    own = where.inverse().matrix()
    light = [layer.irradiance.sum(axis=1) for layer in made.layers.values()]
    assert len(light) == 2
    assert made.valid.all()
    return room, points @ own[:3, :3].T + own[:3, 3], np.sum(light, axis=0)


def within(room: Room, points: npt.NDArray) -> npt.NDArray[np.bool_]:
    """What lies in the air of the room: not in floor, skirting or wall."""
    shape = room.shape
    edge = shape.rim(-0.015 + 1e-4 if shape.baseboard else -1e-4)
    return inside(points[:, [0, 2]], edge) & (points[:, 1] > 0) & (points[:, 1] < room.height)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize("where", [Transform(), ASKEW], ids=["straight", "askew"])
@pytest.mark.parametrize(
    "change",
    [
        {"skirting": 0.0},
        {"openings": (DOOR,)},
        {"openings": (DOOR,), "thickness": 0.02},
        {"plan": l_plan(5, 4, 2, 1.5)},
        {"plan": ((0.0, -3.0), (3.0, 2.0), (-3.0, 3.0)), "openings": (DOOR,)},
    ],
    ids=["plain", "door", "thin", "l", "triangle"],
)
def test_no_light_comes_into_a_closed_room(services, host, backend, where, change):
    room, points, light = lit(services, host, backend, new_room(**change), where)
    air = within(room, points)
    assert air.sum() > 100
    assert (light[air] == 0).all()
    assert light[~air].max() > 1000


@pytest.mark.parametrize("backend", BACKENDS)
def test_light_comes_through_an_opening_and_falls_where_it_is_seen(services, host, backend):
    hole = Opening(kind="opening", wall=0, sill=1.0, width=1.0, height=1.0)
    room, points, light = lit(services, host, backend, new_room(openings=(hole,), skirting=0.0), Transform())
    air = within(room, points)
    floor = air & (points[:, 1] < 0.01)
    assert light[floor].max() > 0
    below = air & (np.abs(points[:, 2] + 2) < 0.01)  # the wall with the hole cannot look out of it
    assert below.sum() > 20
    assert (light[below] == 0).all()
    # A patch before the hole gets what the hole's solid angle lets through, on the wall that faces it.
    facing = np.flatnonzero(air & (np.abs(points[:, 2] - 2) < 0.01))
    middle = facing[np.hypot(points[facing, 0], points[facing, 1] - 1.5).argmin()]
    x, y = np.meshgrid((np.arange(64) + 0.5) / 64 - 0.5, (np.arange(64) + 0.5) / 64 + 1.0)
    far = room.depth + room.thickness  # the far rim of the hole is what limits the view
    offset = np.hypot(x - points[middle, 0], y - points[middle, 1])
    expected = 3 * 1000 * (far**2 / (far**2 + offset**2) ** 2).mean()
    assert light[middle] == pytest.approx(expected, rel=0.2)


def test_a_dragged_size_redoes_no_light_and_a_name_nothing(services, host):
    add = new_room(openings=(DOOR,), without=(2,))
    scene = add(Scene())
    scene = scene.with_nodes(*scene_of(next(scene.of(Room))).nodes.values())
    chosen = host.get("backend", "cuts")
    params = backend_params(chosen, {"directions": "1024", "vertices": 1500})
    pipeline = Pipeline(chosen.stages(services))
    view = scene_view(scene, None, 32, 18)
    pipeline.update(Frame(scene, view, params, 1), Changes(), Job("first"))

    def rebuilt(edit: SetFields, revision: int) -> set[str]:
        after = edit(scene)
        pipeline.update(Frame(after, view, params, revision, moving=True), diff(scene, after), Job("drag"))
        found = {run.name for run in pipeline.report if run.rebuilt}
        pipeline.update(Frame(scene, view, params, revision + 1), diff(after, scene), Job("back"))
        return found

    room = add.nodes[0].id
    assert rebuilt(SetFields(room, {"name": "Hall"}), 2) == set()
    assert rebuilt(SetFields(room, {"width": 5.0}), 4) == set()
    dragged = rebuilt(SetFields(room, {"width": 5.5}), 6)
    assert {"CasterStage", "VisibilityStage", "RadianceStage"} <= dragged
    assert "LightingStage" not in dragged
