"""Edits that bring a material into a scene, or give it to things there in the same step."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

from studio_core.edits import Add, AddMaterial, Compound, Edit
from studio_core.library.lucmat import alike
from studio_core.scene.nodes import Material, MaterialId, NodeId, Scene, new_id
from studio_ui.objects.material_drag import assigned


def free_name(scene: Scene, name: str) -> str:
    """That name, or the first with a number that no material of the scene has."""
    taken = {m.name for m in scene.materials.values()}
    stem = name.rstrip("0123456789 ") or name
    return next(n for n in (name, *(f"{stem} {i}" for i in range(2, 10**6))) if n not in taken)


def added(scene: Scene, materials: Sequence[Material]) -> tuple[tuple[MaterialId, ...], Edit]:
    """The edit that adds copies of materials, and their new ids."""
    made: list[Material] = []
    for material in materials:
        name = free_name(scene.with_materials(*made), material.name)
        made.append(dataclasses.replace(material, id=new_id("material"), name=name))
    what = made[0].name if len(made) == 1 else f"{len(made)} materials"
    return tuple(m.id for m in made), Add((), tuple(made), f"Add {what}")


def given(
    scene: Scene, nodes: Iterable[NodeId], material: Material, slot: int | None = None
) -> tuple[MaterialId, Edit] | None:
    """The edit that gives things a material from elsewhere, in one step, and its id in the scene.

    A material of that name that looks the same is taken instead of a copy of it. None where there is
    nothing to give it to.
    """
    old = twin(scene, material)
    made = old or dataclasses.replace(material, id=new_id("material"), name=free_name(scene, material.name))
    edit = assigned(scene.with_materials(made), nodes, made.id, slot)
    if edit is None:
        return None
    return made.id, edit if old is not None else Compound(edit.label, (AddMaterial(made), edit))


def twin(scene: Scene, material: Material) -> Material | None:
    """The scene's material of that name that looks the same."""
    return next((m for m in scene.materials.values() if alike(m, material)), None)


__all__ = ["added", "free_name", "given", "twin"]
