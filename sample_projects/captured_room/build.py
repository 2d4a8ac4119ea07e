"""The living room in captured materials."""

from __future__ import annotations

import dataclasses

from studio_core.arrays import frozen_map
from studio_core.scene.nodes import Material, MaterialId, MeshObject, Scene
from studio_core.scene.pattern import PatternRuler, with_size
from studio_core.scene.unwrap import unwrapped

from ..living_room import build as living_room
from . import swatches

SOFA, FLOOR = "material-grey-blue-wool", "material-oak-planks"
YARNS, SLAB = 0.14, 1.1
"""How wide the pictures are, metres."""


def build() -> Scene:
    """The room with other materials on the sofa and the floor."""
    scene = living_room.build()
    bare = [node for node in scene.of(MeshObject) if SOFA in node.materials and node.geometry.uvs is None]
    made = [dataclasses.replace(node, geometry=unwrapped(node.geometry).geometry) for node in bare]
    scene = scene.with_nodes(*made)
    scene = laid(scene, SOFA, swatches.cloth(), YARNS)
    return laid(scene, FLOOR, swatches.stone(), SLAB)


def laid(scene: Scene, instead: MaterialId, material: Material, width: float) -> Scene:
    """The scene with a material in another's place, its pictures `width` metres wide."""
    lengths = PatternRuler().lengths(scene, instead)
    assert lengths is not None
    textures = {name: with_size(one, lengths, (width, width)) for name, one in material.textures.items()}
    return scene.with_materials(dataclasses.replace(material, id=instead, textures=frozen_map(textures)))
