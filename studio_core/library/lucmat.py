"""A material in a file of its own (`.lucmat`): a project that holds this material and nothing else.

So its pictures and tables are kept, checked, packed and brought up to date as those of a project are; tags
and a description lie beside it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from studio_core.errors import ProjectError
from studio_core.scene.geometry import Texture
from studio_core.scene.nodes import Material, Scene

SUFFIX = ".lucmat"
_IDENT = "material"
_MOST_TAGS, _LONGEST = 64, 4000


@dataclass(frozen=True)
class Kept:
    """A material with what it is found by. Tags are words in the user's language, `about` is free text."""

    material: Material
    tags: tuple[str, ...] = ()
    about: str = ""

    @property
    def name(self) -> str:
        """What it is called."""
        return self.material.name


def write(path: Path, kept: Kept) -> None:
    """Put a material in a file, whole or not at all; ProjectError in one sentence where that fails.

    The same material gives the same content, wherever its scene had it.
    """
    from studio_core.project.store import save

    scene = Scene().with_materials(replace(kept.material, id=_IDENT))
    beside = {"tags": list(_tags(kept.tags)), "about": kept.about[:_LONGEST]}
    save(path, scene, label=kept.name, session=beside, fresh=True, keep_revisions=False)


def read(path: Path) -> Kept:
    """The material of a file. ProjectError names the file where it is damaged or holds something else."""
    from studio_core.project.store import load

    try:
        found = load(path)
    except ProjectError as error:
        raise ProjectError(str(error).replace("a Lucarne project", "a Lucarne material")) from error
    materials = tuple(found.scene.materials.values())
    if len(materials) != 1 or found.scene.nodes:
        raise ProjectError(f"{path.name} holds no single material: it is a project, open it as one.")
    beside: Mapping[str, Any] = found.session or {}
    tags, about = beside.get("tags", ()), beside.get("about", "")
    words = tags if isinstance(tags, list | tuple) else ()
    return Kept(materials[0], _tags(tuple(words)), str(about)[:_LONGEST])


def alike(one: Material, other: Material) -> bool:
    """Whether materials have the same name, model, numbers, pictures and tables."""
    beside = replace(other, id=one.id, textures=one.textures, tables=one.tables)
    kinds = ("textures", "tables")
    if beside != one or any(getattr(one, kind).keys() != getattr(other, kind).keys() for kind in kinds):
        return False
    tables = (table.key == other.tables[name].key for name, table in one.tables.items())
    return all(_same(t, other.textures[name]) for name, t in one.textures.items()) and all(tables)


def _same(one: Texture, other: Texture) -> bool:
    laid = replace(other, image=one.image) == one
    return laid and (one.image is other.image or one.image.key == other.image.key)


def _tags(words: tuple[object, ...]) -> tuple[str, ...]:
    """Each once, in their order, without what is empty."""
    found = (str(word).strip() for word in words)
    return tuple(dict.fromkeys(word for word in found if word))[:_MOST_TAGS]


__all__ = ["SUFFIX", "Kept", "alike", "read", "write"]
