"""Where a dropped model lands, and the edit that puts it there."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.contract import ImportedModel
from studio_core.edits import Add
from studio_core.scene.nodes import Group, Node, NodeId, Scene, new_id
from studio_core.scene.transform import Transform, Vec3, vec3
from studio_core.session import View
from studio_ui.canvas.projection import bounds, eye_of, ray
from studio_ui.canvas.viewport import Probe

F64 = npt.NDArray[np.float64]
_STEP = 0.004  # of the canvas, between the points that tell how a surface lies
_LEVEL = 0.5  # height of a unit normal: steeper surfaces are walls
_FURTHEST = 8.0  # times the distance of what is looked at: further down the floor nothing is meant
_GRID = 0.05  # metres

ProbeAt = Callable[[float, float], Probe | None]


@dataclass(frozen=True)
class Landing:
    """A point of a surface, its unit normal, and the object it belongs to (None: the floor, y = 0)."""

    point: Vec3
    normal: Vec3 = (0.0, 1.0, 0.0)
    node: NodeId | None = None

    @property
    def level(self) -> bool:
        """Whether something can stand there; walls have it stand before them."""
        return self.normal[1] >= _LEVEL


def landing(probe: ProbeAt, view: View, x: float, y: float) -> Landing | None:
    """What a point of the canvas, (x, y) in 0…1, lies on; None where it is the sky."""
    eye = eye_of(view)
    found = probe(x, y)
    if found is not None and found.node is not None and math.isfinite(found.distance):
        at = eye + found.distance * ray(view, x, y)
        return Landing(vec3(at), _normal(probe, view, x, y, at, found.node), found.node)
    towards = ray(view, x, y)
    if towards[1] >= -1e-3 or eye[1] <= 0:
        return None
    reach = -eye[1] / towards[1]
    if reach > _FURTHEST * max(view.focus, 1.0):
        return None
    return Landing(vec3(eye + reach * towards))


def _normal(probe: ProbeAt, view: View, x: float, y: float, at: F64, node: NodeId) -> Vec3:
    """Of the plane through three points of a surface; straight up where they do not make one."""
    ends = []
    for dx, dy in ((_STEP, 0.0), (0.0, _STEP)):
        for sign in (1.0, -1.0):
            found = probe(x + sign * dx, y + sign * dy)
            if found is not None and found.node == node and math.isfinite(found.distance):
                end = eye_of(view) + found.distance * ray(view, x + sign * dx, y + sign * dy)
                ends.append(sign * (end - at))
                break
    if len(ends) < 2:
        return (0.0, 1.0, 0.0)
    made = np.cross(ends[1], ends[0])
    length = float(np.linalg.norm(made))
    if length < 1e-12:
        return (0.0, 1.0, 0.0)
    made = made / length
    return vec3(made if float(made @ ray(view, x, y)) < 0 else -made)


def placed_model(
    scene: Scene,
    model: ImportedModel,
    name: str,
    where: Landing | Vec3,
    *,
    stand: bool = True,
    centre: bool = True,
) -> tuple[Add, NodeId]:
    """The edit that adds a model under one node, and that node's id.

    On a landing it stands upright, its middle over the point; before a wall on the floor, its box touching
    the wall. Otherwise the first model of a scene stays where its file has it, later ones come to the point
    that is looked at. Without `stand` and `centre` heights and places are the file's.
    """
    nodes: list[Node] = list(model.nodes)
    ids = {node.id for node in nodes}
    tops = [node for node in nodes if node.parent not in ids]
    if len(tops) != 1:
        group = Group(id=new_id("group"), name=name)
        nodes = [dataclasses.replace(n, parent=group.id) if n in tops else n for n in nodes]
        nodes.insert(0, group)
        top: Node = group
    else:
        top = tops[0]
    found = bounds(Scene().with_nodes(*nodes), (top.id,))
    if found is not None:
        low, high = found
        target = _target(scene, where, high - low)
        move = np.zeros(3)
        if stand:
            move[1] = target[1] - low[1]
        if centre and (isinstance(where, Landing) or bounds(scene) is not None):
            move[[0, 2]] = target[[0, 2]] - ((low + high) / 2)[[0, 2]]
        placed = dataclasses.replace(top, transform=Transform(vec3(move)) @ top.transform)
        nodes[nodes.index(top)] = placed
    return Add(tuple(nodes), model.materials, f"Import {name}"), top.id


def _target(scene: Scene, where: Landing | Vec3, size: F64) -> F64:
    """Where the middle of the model's foot comes to lie."""
    if not isinstance(where, Landing):
        at = np.round(np.array(where) / _GRID) * _GRID
        return np.array([at[0], 0.0, at[2]])
    point, normal = np.array(where.point), np.array(where.normal)
    if where.level:
        return point
    away = normal * (1.0, 0.0, 1.0)
    length = float(np.linalg.norm(away))
    if length < 1e-6:  # a ceiling: below it
        return np.array([point[0], 0.0, point[2]])
    away /= length
    half = float(np.abs(away[[0, 2]]) @ size[[0, 2]]) / 2
    return np.array([*(point + half * away)[:1], 0.0, *(point + half * away)[2:]])


def beside(where: Landing, view: View, metres: float) -> Landing:
    """A landing for the next of several models: that far to the right, as it is seen."""
    across = view.transform.matrix()[:3, 0] * (1.0, 0.0, 1.0)
    length = float(np.linalg.norm(across))
    if length < 1e-6:
        return where
    return dataclasses.replace(where, point=vec3(np.array(where.point) + metres * across / length))
