"""What has no surface but can be chosen: lamps and cameras as lines in the world."""

from __future__ import annotations

from collections.abc import Container
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import (
    AreaLamp,
    Camera,
    DirectionalLamp,
    Light,
    Node,
    NodeId,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.session import View

F64 = npt.NDArray[np.float64]
_SIZE = 0.18  # metres


@dataclass(frozen=True)
class Glyph:
    """Where to click (world, (3,)), and lines to draw (N, 2, 3)."""

    node: NodeId
    anchor: F64
    segments: F64
    light: bool


def glyphs(scene: Scene, view: View | None = None, chosen: Container[NodeId] = ()) -> list[Glyph]:
    """One for every shown lamp and for chosen cameras; not for a camera that is looked through."""
    made = []
    for node in scene.nodes.values():
        local = _lines(node)
        if local is None or not scene.shown(node.id):
            continue
        if isinstance(node, Camera) and node.id not in chosen:
            continue
        world = scene.world(node.id)
        anchor = np.array(world.translation)
        if view is not None and np.linalg.norm(anchor - view.transform.translation) < 0.05:
            continue
        matrix = world.matrix()[:3, :3] / world.scale
        made.append(Glyph(node.id, anchor, local @ matrix.T + anchor, isinstance(node, Light)))
    return made


def _lines(node: Node) -> F64 | None:
    if isinstance(node, PointLamp):
        return np.array([(-_SIZE * a / 2, _SIZE * a / 2) for a in np.eye(3)])
    if isinstance(node, SpotLamp):
        reach = 2.5 * _SIZE
        wide = reach * np.tan(np.radians(min(node.cone, 75.0)))
        rim = _circle(wide) - (0, 0, reach)
        return np.concatenate([_loop(rim), [(np.zeros(3), rim[i]) for i in range(0, 16, 4)]])
    if isinstance(node, DirectionalLamp):
        rim = _circle(_SIZE)
        shafts = [(rim[i], rim[i] + (0, 0, -4 * _SIZE)) for i in range(0, 16, 4)]
        return np.concatenate([_loop(rim), shafts])
    if isinstance(node, AreaLamp):
        x, y = node.width / 2, node.height / 2
        rim = np.array([(-x, -y, 0), (x, -y, 0), (x, y, 0), (-x, y, 0)])
        return np.concatenate([_loop(rim), [((0, 0, 0), (0, 0, -1.5 * _SIZE))]])
    if isinstance(node, Camera):
        top = np.tan(np.radians(node.fov) / 2) * 1.5 * _SIZE
        rim = np.array(
            [(s * 1.5 * top, t * top, -1.5 * _SIZE) for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        )
        return np.concatenate([_loop(rim), [(np.zeros(3), corner) for corner in rim]])
    return None


def _circle(radius: float) -> F64:
    angle = np.arange(16) * (2 * np.pi / 16)
    return radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(16)], axis=1)


def _loop(rim: F64) -> F64:
    return np.stack([rim, np.roll(rim, -1, axis=0)], axis=1)
