"""Strokes and what explains them as one step of the history; which strokes belong together.

Adding, removing, renaming, switching off and weighing strokes are the edits that all nodes have
(`studio_core.edits`: Add, Remove, SetFields). Strokes on objects that were deleted keep their marks.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from studio_core.edits import Add, Compound, Remove, SetPaint
from studio_core.scene.nodes import MeshObject, NodeId, Scene
from studio_core.strokes.solution import Solution
from studio_core.strokes.stroke import FIXATE, Stroke


def applied(label: str, strokes: Sequence[Stroke], solution: Solution) -> Compound:
    """New strokes with the edit that explains them, found in a scene that has them."""
    return Compound(label, (Add(tuple(strokes), label=label), solution.edit))


def removed(scene: Scene, strokes: Sequence[NodeId], label: str = "Delete stroke") -> Compound:
    """Without strokes; objects on which none is left lose their paint.

    What remains on other objects is for a solver to explain again (`concerned`).
    """
    remove = Remove(tuple(strokes), label)
    bare = bared(scene, remove(scene))
    return Compound(label, (remove, *(SetPaint(node, None) for node in bare)))


def bared(before: Scene, after: Scene) -> tuple[NodeId, ...]:
    """Painted objects whose last stroke has gone, or was switched off, between two scenes."""
    lost = _covered(before) - _covered(after)
    painted = (node for node in after.of(MeshObject) if node.paint is not None)
    return tuple(node.id for node in painted if node.id in lost)


def concerned(scene: Scene, changed: Iterable[Stroke]) -> tuple[NodeId, ...]:
    """The strokes of a scene that must be solved with some that have changed, in order.

    Those on the same objects, and so on from each of these; where one of them changes what is reflected, all
    that do so, and all that hold light as it is.
    """
    strokes = tuple(scene.of(Stroke))
    met = tuple(changed)
    objects = {node for stroke in met for node in stroke.objects}
    far = any(stroke.indirect for stroke in met)
    found: set[NodeId] = {stroke.id for stroke in met}
    while True:
        more = [
            stroke
            for stroke in strokes
            if stroke.id not in found
            and (not objects.isdisjoint(stroke.objects) or (far and _is_far(stroke)))
        ]
        if not more:
            return tuple(stroke.id for stroke in strokes if stroke.id in found)
        found |= {stroke.id for stroke in more}
        objects |= {node for stroke in more for node in stroke.objects}
        far = far or any(stroke.indirect for stroke in more)


def _is_far(stroke: Stroke) -> bool:
    return stroke.indirect or stroke.tool == FIXATE


def _covered(scene: Scene) -> set[NodeId]:
    shown = [stroke for stroke in scene.of(Stroke) if not stroke.hidden]
    return {node for stroke in shown for node in (*stroke.objects, *stroke.reached)}


__all__ = ["applied", "bared", "concerned", "removed"]
