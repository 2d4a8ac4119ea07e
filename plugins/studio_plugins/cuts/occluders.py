"""What blocks light as one: objects alone, or the parts of a piece of furniture together.

A sofa of thirteen parts under one group is traced as one mesh and kept as one segment a vertex: fewer rays,
and a third of the memory. Parts that are moved by themselves are looked at alone from then on, and so is a
group that is spread out: whoever moves one chair of sixty should not pay for the others.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from typing import cast

import numpy as np
import numpy.typing as npt

from studio_core.arrays import content_hash
from studio_core.kernels.raycast import CasterObject, RayCaster
from studio_core.scene.nodes import Group, MeshObject, NodeId, Scene
from studio_core.scene.transform import IDENTITY, Transform
from studio_core.shading.artifacts import Casters, Surfaces

I32 = npt.NDArray[np.int32]
SPREAD = 1.7
"""A group is one occluder up to so many times the radius of its largest part."""


@dataclass(frozen=True, eq=False)
class Occluders:
    """n occluders: the caster of them, what makes each another one, where it stands, and of (objects,)
    which one each object of the surfaces belongs to."""

    caster: RayCaster
    keys: tuple[object, ...]
    transforms: tuple[Transform, ...]
    of: I32


def alone(surfaces: Surfaces, casters: Casters) -> Occluders:
    """Every object by itself."""
    keys = tuple(zip(surfaces.nodes, occluder_keys(surfaces, casters), strict=True))
    return Occluders(casters.shadow, keys, casters.transforms, np.arange(len(keys), dtype=np.int32))


def occluder_keys(surfaces: Surfaces, casters: Casters) -> list[tuple[str, Hashable]]:
    """What makes an object another occluder: its mesh, and which of its faces stop light."""
    opaque = [stops for _, stops in cast(Iterable[tuple[str, Hashable]], casters.meshes)]
    return [(source[1].key, stops) for source, stops in zip(surfaces.sources, opaque, strict=True)]


class OccluderTable:
    """Makes occluders, keeping merged meshes and what is known of parts that were moved alone."""

    def __init__(self) -> None:
        self._loose: set[NodeId] = set()
        self._within: dict[NodeId, Transform] = {}
        self._made: Occluders | None = None
        self._wanted: tuple[object, ...] = ()

    def __call__(self, scene: Scene, surfaces: Surfaces, casters: Casters) -> Occluders:
        """The occluders of a scene; the caster moves in place while they are the same."""
        within = {node: _within(scene, node) for node in surfaces.nodes}
        for node, before in self._within.items():
            if node in within and within[node] != before:
                self._loose.add(node)
        self._within = within
        groups = _groups(scene, surfaces, within, self._loose)
        if all(len(members) == 1 for members in groups):
            self._made, self._wanted = None, ()
            return alone(surfaces, casters)
        single = occluder_keys(surfaces, casters)
        keys = tuple(
            tuple((surfaces.nodes[i], single[i], within[surfaces.nodes[i]]) for i in members)
            if len(members) > 1
            else (surfaces.nodes[members[0]], single[members[0]])
            for members in groups
        )
        transforms = tuple(
            casters.transforms[members[0]]
            if len(members) == 1
            else scene.world(cast(NodeId, scene[surfaces.nodes[members[0]]].parent))
            for members in groups
        )
        of = np.zeros(len(surfaces.nodes), np.int32)
        for number, members in enumerate(groups):
            of[members] = number
        previous = self._made
        if previous is not None and self._wanted == keys:
            for number, (now, was) in enumerate(zip(transforms, previous.transforms, strict=True)):
                if now != was:
                    previous.caster.move(number, now.matrix())
            self._made = Occluders(previous.caster, keys, transforms, of)
            return self._made
        objects = [
            _merged(scene, surfaces, members, within, transform)
            for members, transform in zip(groups, transforms, strict=True)
        ]
        lend = previous.caster if previous is not None else casters.shadow
        self._made, self._wanted = Occluders(RayCaster(objects, previous=lend), keys, transforms, of), keys
        return self._made


def _within(scene: Scene, node: NodeId) -> Transform:
    """The way from a node to its group: its own transform, or none at the top."""
    return scene[node].transform if scene[node].parent is not None else IDENTITY


def _groups(
    scene: Scene, surfaces: Surfaces, within: Mapping[NodeId, Transform], loose: set[NodeId]
) -> list[list[int]]:
    """Objects that block as one, by their numbers."""
    mesh = surfaces.unrefined.mesh
    by_parent: dict[NodeId, list[int]] = {}
    made: list[list[int]] = []
    for index, node in enumerate(surfaces.nodes):
        parent = scene[node].parent
        if parent is None or node in loose or not isinstance(scene[parent], Group):
            made.append([index])
        else:
            by_parent.setdefault(parent, []).append(index)
    for members in by_parent.values():
        boxes = np.array([_box(mesh.positions[mesh.vertices_of(i)]) for i in members])
        low, high = boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)
        largest = np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1).max()
        if np.linalg.norm(high - low) <= SPREAD * largest:
            made.append(members)
        else:
            made.extend([index] for index in members)
    return sorted(made)


def _box(points: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    if not len(points):
        return np.zeros((2, 3), np.float32)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _merged(
    scene: Scene,
    surfaces: Surfaces,
    members: list[int],
    within: Mapping[NodeId, Transform],
    transform: Transform,
) -> CasterObject:
    positions, faces, opaque, key = [], [], [], []
    start = 0
    for index in members:
        node = scene[surfaces.nodes[index]]
        assert isinstance(node, MeshObject)
        mesh = node.geometry
        stops = np.array([scene.material(m).casts_shadow for m in node.materials], np.bool_)[mesh.slots]
        matrix = within[node.id].matrix() if len(members) > 1 else np.eye(4)
        positions.append(mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3])
        faces.append(mesh.faces.astype(np.uint32) + np.uint32(start))
        opaque.append(stops)
        key.append(f"{mesh.key} {matrix.tobytes().hex() if len(members) > 1 else ''}")
        start += len(mesh.positions)
    if len(members) == 1:
        return CasterObject(mesh.positions, mesh.faces, mesh.key, transform.matrix(), opaque[0])
    name = content_hash(np.frombuffer("\n".join(key).encode(), np.uint8))
    whole = np.concatenate(positions).astype(np.float32)
    return CasterObject(whole, np.concatenate(faces), name, transform.matrix(), np.concatenate(opaque))
