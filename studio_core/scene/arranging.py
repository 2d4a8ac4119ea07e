"""Where things go: moved, turned, scaled, aligned, spread evenly. All give new local transforms.

What is passed in are nodes that do not hang under each other (`roots`); pass the result to `edits.Move`.
Axes of the world: 0 x (left to right), 1 y (floor to ceiling), 2 z (back to front).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Literal

import numpy as np
import numpy.typing as npt

from studio_core.scene.bounds import exact_bounds
from studio_core.scene.capture import Capture
from studio_core.scene.nodes import Environment, NodeId, Scene
from studio_core.scene.transform import Transform, axis_angle, vec3
from studio_core.strokes.stroke import Stroke

F64 = npt.NDArray[np.float64]
Side = Literal["low", "middle", "high"]
Placed = dict[NodeId, Transform]
UP = (0.0, 1.0, 0.0)
PLACELESS = (Environment, Capture, Stroke)
"""Kinds of nodes that stand nowhere: nothing moves, groups or copies them."""


def is_locked(scene: Scene, node: NodeId) -> bool:
    """Whether the node or one of its parents is locked."""
    return scene[node].locked or any(parent.locked for parent in scene.ancestors(node))


def roots(scene: Scene, nodes: Iterable[NodeId]) -> tuple[NodeId, ...]:
    """Those nodes that can move and do not hang under another one of them."""
    chosen = [node for node in nodes if node in scene.nodes and not isinstance(scene[node], PLACELESS)]
    free = [n for n in chosen if not any(above.id in chosen for above in scene.ancestors(n))]
    return tuple(n for n in free if not is_locked(scene, n))


def placed(scene: Scene, worlds: Mapping[NodeId, Transform]) -> Placed:
    """Local transforms that put nodes at places in the world."""
    made = {}
    for node, world in worlds.items():
        parent = scene[node].parent
        made[node] = world if parent is None else scene.world(parent).inverse() @ world
    return made


def shifted(scene: Scene, nodes: Iterable[NodeId], delta: npt.ArrayLike) -> Placed:
    """Local transforms that move nodes by `delta` metres in the world."""
    by = Transform(vec3(delta))
    return placed(scene, {node: by @ scene.world(node) for node in nodes})


def turned(
    scene: Scene,
    nodes: Iterable[NodeId],
    degrees: float,
    pivot: npt.ArrayLike,
    axis: npt.ArrayLike = UP,
) -> Placed:
    """Local transforms that turn nodes, right-handed, about an axis (the vertical) through `pivot`."""
    return _about(scene, nodes, pivot, Transform(rotation=axis_angle(axis, degrees)))


def scaled(scene: Scene, nodes: Iterable[NodeId], factor: float, pivot: npt.ArrayLike) -> Placed:
    """Local transforms that make nodes `factor` (> 0) times as large; `pivot` stays where it is."""
    return _about(scene, nodes, pivot, Transform(scale=factor))


def aligned(scene: Scene, nodes: Iterable[NodeId], axis: int, side: Side) -> Placed:
    """Local transforms that bring one side (or the middle) of each node's box to that of the box of all."""
    boxes = _boxes(scene, nodes)
    if not boxes:
        return {}
    low = min(box[0][axis] for box in boxes.values())
    high = max(box[1][axis] for box in boxes.values())
    goal = _at(side, low, high)
    return _slid(scene, axis, {n: goal - _at(side, b[0][axis], b[1][axis]) for n, b in boxes.items()})


def distributed(scene: Scene, nodes: Iterable[NodeId], axis: int) -> Placed:
    """Local transforms with equal gaps between the boxes along an axis; the outermost two stay.

    With fewer than three nodes nothing moves. Boxes that overlap more than there is room for overlap evenly.
    """
    boxes = _boxes(scene, nodes)
    order = sorted(boxes, key=lambda n: float(boxes[n][0][axis] + boxes[n][1][axis]))
    if len(order) < 3:
        return {}
    sizes = [float(boxes[n][1][axis] - boxes[n][0][axis]) for n in order]
    start, end = float(boxes[order[0]][0][axis]), float(boxes[order[-1]][1][axis])
    gap = (end - start - sum(sizes)) / (len(order) - 1)
    by: dict[NodeId, float] = {}
    at = start
    for node, size in zip(order, sizes, strict=True):
        by[node] = at - float(boxes[node][0][axis])
        at += size + gap
    by[order[0]] = by[order[-1]] = 0.0
    return _slid(scene, axis, by)


def stood(
    scene: Scene, nodes: Iterable[NodeId], floor: Callable[[NodeId, F64, F64], float] = lambda *_: 0.0
) -> Placed:
    """Local transforms that let each node's box stand at height `floor(node, low, high)`."""
    by = {node: floor(node, *box) - float(box[0][1]) for node, box in _boxes(scene, nodes).items()}
    return _slid(scene, 1, by)


def _boxes(scene: Scene, nodes: Iterable[NodeId]) -> dict[NodeId, tuple[F64, F64]]:
    found = {node: exact_bounds(scene, (node,)) for node in nodes}
    return {node: box for node, box in found.items() if box is not None}


def _at(side: Side, low: float, high: float) -> float:
    return {"low": low, "middle": (low + high) / 2, "high": high}[side]


def _slid(scene: Scene, axis: int, by: Mapping[NodeId, float]) -> Placed:
    made: Placed = {}
    for node, metres in by.items():
        if metres != 0.0:
            made |= shifted(scene, (node,), np.eye(3)[axis] * metres)
    return made


def _about(scene: Scene, nodes: Iterable[NodeId], pivot: npt.ArrayLike, change: Transform) -> Placed:
    centre = np.asarray(pivot, np.float64)
    about = Transform(vec3(centre)) @ change @ Transform(vec3(-centre))
    return placed(scene, {node: about @ scene.world(node) for node in nodes})
