"""Reads `.mtlx`: every material whose surface shader is known becomes a material of the nearest model."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from studio_core.arrays import frozen_map
from studio_core.contract import ImportedModel
from studio_core.errors import InputError
from studio_core.exchange.incoming import material_of
from studio_core.exchange.pictures import Pictures
from studio_core.scene.nodes import Material
from studio_plugins.materialx.graph import Graph
from studio_plugins.materialx.library import read
from studio_plugins.materialx.shaders import SHADERS
from studio_plugins.materialx.slots import Slots

MOST_MATERIALS = 1000


class MaterialXImporter:
    """Satisfies `studio_core.contract.Importer`; it gives materials alone."""

    label = "MaterialX"
    extensions = (".mtlx",)

    def load(self, path: Path, unit: float = 1.0) -> ImportedModel:
        """All materials of the file; `unit` has no meaning for them. InputError in one sentence."""
        document, text = read(path)
        notes: dict[str, None] = {}
        say = notes.setdefault
        if "<xi:include" in text:
            say("Files that it includes are not read.")
        found = _shaders(document)
        if not found:
            raise InputError(f"{path} cannot be imported: it holds no material")
        if len(found) > MOST_MATERIALS:
            say(f"Of {len(found)} materials the first {MOST_MATERIALS} are read.")
        graph, made = Graph(document, say), []
        with Pictures(path, say) as pictures:
            for name, node in found[:MOST_MATERIALS]:
                if node.getCategory() not in SHADERS:
                    known = ", ".join(SHADERS)
                    say(f"{name}: the shader {node.getCategory()[:40]} is not known here; known are {known}.")
                    continue
                made.append(_material(Slots(node, graph, pictures, name, say)))
        if not made:
            raise InputError(f"{path} cannot be imported: {next(iter(notes))[:-1]}")
        return ImportedModel((), tuple(made), tuple(notes))


def _shaders(document: Any) -> list[tuple[str, Any]]:
    """Name and surface shader of every material; shaders that no material names stand for themselves."""
    found, used = [], set()
    for material in document.getMaterialNodes():
        made = material.getInput("surfaceshader")
        name = "" if made is None else made.getAttribute("nodename")
        node = document.getNode(name) if name else None
        if node is not None:
            found.append(((material.getAttribute("uiname") or material.getName())[:200], node))
            used.add(node.getName())
    loose = [n for n in document.getNodes() if n.getCategory() in SHADERS and n.getName() not in used]
    return found + [(node.getName()[:200], node) for node in loose]


def _material(slots: Slots) -> Material:
    surface = SHADERS[slots.node.getCategory()](slots)
    opacity = min(max(surface.opacity, 0.0), 1.0)
    textures = frozen_map(slots.textures)
    return material_of(replace(surface, name=slots.name, opacity=opacity, textures=textures), slots.tell)


IMPORTER = MaterialXImporter()
