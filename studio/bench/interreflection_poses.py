"""Poses of a scene's movable things: moved and turned over the floor without leaving it, some in contact.

Things keep apart by the convex hulls of their footprints; where hulls already meet (a chair under a table)
they may go on doing so. About every third thing is pushed along until it touches a wall or another.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from studio.bench.interreflection_scenes import Setting
from studio_core.scene.bounds import rows_in_world
from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_core.scene.transform import Transform, axis_angle, vec3

F64 = npt.NDArray[np.float64]
FLAT = 0.03  # metres: lower things are walked on
GAP = 1e-3  # metres between things that touch
CONTACT = 0.35  # share of things that are pushed until they touch
TRIES = 200
SLIDE, TWIST = 0.02, 1.5  # metres and degrees of a step of a drag
PARALLEL = 1e-12


def poses(setting: Setting, count: int = 20, seed: int = 7) -> list[Scene]:
    """`count` scenes that differ from the setting's in where its movable nodes stand."""
    rng = np.random.default_rng(seed)
    return [_posed(setting, rng) for _ in range(count)]


def slid(setting: Setting, scene: Scene, count: int, seed: int) -> list[Scene]:
    """`count` steps of a drag from a pose: a movable thing goes and turns a little further with each.

    Free of what stands about, as poses are; none where there is no way to go.
    """
    rng = np.random.default_rng(seed)
    for _ in range(TRIES):
        node = setting.movable[rng.integers(len(setting.movable))]
        angle, sign = float(rng.uniform(0, 2 * math.pi)), float(rng.choice([-1.0, 1.0]))
        start, way = _middle(scene, node), SLIDE * np.array([math.cos(angle), math.sin(angle)])
        made = [_turned(scene, node, start + step * way, sign * step * TWIST) for step in range(1, count + 1)]
        around = obstacles(dataclasses.replace(setting, scene=scene), node).values()
        hulls = [footprint(step, node) for step in made]
        if all(inside(hull, setting) and all(apart(hull, other) for other in around) for hull in hulls):
            return made
    return []


def footprint(scene: Scene, node: NodeId) -> F64:
    """(N, 2) convex hull of x and z of all meshes at and under a node, counter-clockwise."""
    points = []
    for name in scene.subtree(node):
        held = scene[name]
        if isinstance(held, MeshObject) and len(held.geometry.positions):
            points.append(rows_in_world(held.geometry.positions, scene.world(name).matrix())[[0, 2]].T)
    flat = np.concatenate(points)
    return np.asarray(flat[ConvexHull(flat).vertices], np.float64)


def room_to_go(moved: F64, still: F64, way: F64) -> float:
    """How far the convex `moved` can go along the unit vector `way` until it meets `still`; inf for never.

    The way in the Minkowski difference of both, cut by its sides; 0 where they overlap.
    """
    difference = (still[:, None] - moved[None]).reshape(-1, 2)
    sides = ConvexHull(difference).equations
    slope, level = sides[:, :2] @ way, sides[:, 2]
    towards, away = slope < -PARALLEL, slope > PARALLEL
    if (level <= 0).all():
        return 0.0
    if (~towards & (level > 0)).any():
        return math.inf
    enter = (level[towards] / -slope[towards]).max()
    leave = (level[away] / -slope[away]).min(initial=math.inf)
    return float(enter) if enter < leave else math.inf


def apart(first: F64, second: F64) -> bool:
    """Whether two convex outlines do not overlap."""
    return bool((ConvexHull((second[:, None] - first[None]).reshape(-1, 2)).equations[:, 2] > 0).any())


def inside(hull: F64, setting: Setting) -> bool:
    """Whether an outline lies on the setting's floor."""
    return bool((hull.min(axis=0) >= setting.low).all() and (hull.max(axis=0) <= setting.high).all())


def obstacles(setting: Setting, movable: NodeId) -> dict[NodeId, F64]:
    """Outlines of what a thing must keep clear of: top-level things but floors, rugs and rooms."""
    scene, found = setting.scene, {}
    for node in scene.children(None):
        if node.id == movable or node.id in setting.fixed or not _tall(scene, node.id):
            continue
        found[node.id] = footprint(scene, node.id)
    own = footprint(scene, movable)
    return {name: hull for name, hull in found.items() if apart(own, hull)}


def _tall(scene: Scene, node: NodeId) -> bool:
    held = [scene[name] for name in scene.subtree(node)]
    meshes = [mesh for mesh in held if isinstance(mesh, MeshObject) and len(mesh.geometry.positions)]
    heights = [rows_in_world(m.geometry.positions, scene.world(m.id).matrix())[1].max() for m in meshes]
    return max(heights, default=0.0) > FLAT


def _posed(setting: Setting, rng: np.random.Generator) -> Scene:
    scene = setting.scene
    for node in setting.movable:
        around = obstacles(dataclasses.replace(setting, scene=scene), node)
        start = scene[node].transform
        for _ in range(TRIES):
            moved = _thrown(scene, node, setting, rng)
            hull = footprint(moved, node)
            if inside(hull, setting) and all(apart(hull, other) for other in around.values()):
                if rng.random() < CONTACT:
                    moved = _pushed(moved, node, hull, setting, list(around.values()), rng)
                scene = moved
                break
        else:
            scene = scene.with_nodes(dataclasses.replace(scene[node], transform=start))
    return scene


def _thrown(scene: Scene, node: NodeId, setting: Setting, rng: np.random.Generator) -> Scene:
    """Turned by any angle, and put anywhere."""
    where = rng.uniform(setting.low, setting.high)
    return _turned(scene, node, where, float(rng.uniform(-180, 180)))


def _turned(scene: Scene, node: NodeId, where: F64, degrees: float) -> Scene:
    """Turned about the vertical through the middle of its outline, which is put at `where` (x, z)."""
    held, middle = scene[node], _middle(scene, node)
    away = Transform((-middle[0], 0.0, -middle[1]))
    turn = Transform((where[0], 0.0, where[1]), axis_angle((0, 1, 0), degrees))
    return scene.with_nodes(dataclasses.replace(held, transform=turn @ away @ held.transform))


def _middle(scene: Scene, node: NodeId) -> F64:
    hull = footprint(scene, node)
    return np.asarray((hull.min(axis=0) + hull.max(axis=0)) / 2)


def _pushed(
    scene: Scene,
    node: NodeId,
    hull: F64,
    setting: Setting,
    others: list[F64],
    rng: np.random.Generator,
) -> Scene:
    """Moved along a random way until it touches something."""
    angle = float(rng.uniform(0, 2 * math.pi))
    way = np.array([math.cos(angle), math.sin(angle)])
    free = min((room_to_go(hull, other, way) for other in others), default=math.inf)
    for axis in (0, 1):
        if way[axis] > 1e-9:
            free = min(free, (setting.high[axis] - hull[:, axis].max()) / way[axis])
        elif way[axis] < -1e-9:
            free = min(free, (setting.low[axis] - hull[:, axis].min()) / way[axis])
    step = way * max(free - GAP, 0.0)
    held = scene[node]
    place = vec3(np.add(held.transform.translation, (step[0], 0.0, step[1])))
    return scene.with_nodes(
        dataclasses.replace(held, transform=dataclasses.replace(held.transform, translation=place))
    )
