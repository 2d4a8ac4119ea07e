"""Strokes by what they lie on: for each slot of an object, in which order its strokes are to be explained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from studio_core.scene.nodes import MaterialId, MeshObject, NodeId, Scene
from studio_core.strokes.marks import Marks
from studio_core.strokes.stroke import FIXATE, Stroke


@dataclass(frozen=True)
class Region:
    """A slot of an object."""

    node: NodeId
    slot: int

    def material(self, scene: Scene) -> MaterialId | None:
        """What it is made of; None where it is no more."""
        node = scene.nodes.get(self.node)
        if not isinstance(node, MeshObject) or not self.slot < len(node.materials):
            return None
        return node.materials[self.slot]


def regions_of(stroke: Stroke) -> tuple[Region, ...]:
    """What a stroke lies on, most of it first."""
    marks: Marks | None = stroke.marks
    if marks is None:
        return ()
    pairs, counts = np.unique(np.stack([marks.object, marks.slot]), axis=1, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    return tuple(
        Region(stroke.objects[which], int(slot))
        for which, slot in pairs[:, order].T.tolist()
        if 0 <= which < len(stroke.objects)
    )


def touched(scene: Scene, strokes: Sequence[Stroke]) -> tuple[Region, ...]:
    """All that is painted on objects on which one of the strokes wants a change: paint is an object's."""
    nodes = {region.node for stroke in strokes if _wants(stroke) for region in regions_of(stroke)}
    every = [*strokes, *scene.of(Stroke)]
    found = (region for stroke in every if _wants(stroke) for region in regions_of(stroke))
    return tuple(dict.fromkeys(region for region in found if region.node in nodes))


def _wants(stroke: Stroke) -> bool:
    return not stroke.indirect and stroke.tool != FIXATE


def steps(scene: Scene, regions: Sequence[Region]) -> Mapping[Region, tuple[tuple[Stroke, ...], ...]]:
    """For each region the strokes on it that count, those that are explained together side by side.

    What must stay as it is belongs to every step.
    """
    made: dict[Region, list[list[Stroke]]] = {region: [] for region in regions}
    kept: dict[Region, list[Stroke]] = {region: [] for region in regions}
    for stroke in scene.of(Stroke):
        if stroke.hidden or stroke.indirect or stroke.weight <= 0:
            continue
        for region in regions_of(stroke):
            if region not in made:
                continue
            if stroke.tool == FIXATE:
                kept[region].append(stroke)
            elif stroke.together and made[region]:
                made[region][-1].append(stroke)
            else:
                made[region].append([stroke])
    return {region: tuple((*step, *kept[region]) for step in found) for region, found in made.items()}


__all__ = ["Region", "regions_of", "steps", "touched"]
