"""Single materials out of files and into files of every kind that a plugin reads or writes.

`.lucmat` keeps everything. Other kinds go through the importers and exporters of scenes: what a file has
besides its materials is passed over, and a material goes out on a ball, as programs show materials.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from studio_core.contract import Exporter, Importer, Registry
from studio_core.errors import InputError, PluginError
from studio_core.library.lucmat import SUFFIX, Kept, read, write
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Material, MeshObject, Scene
from studio_core.scene.transform import Transform

RADIUS = 0.1
_RINGS, _TURNS = 32, 64
_APART = 0.25  # metres between balls


def importer_of(registry: Registry, path: Path) -> Importer:
    """The importer that reads files of that ending; InputError naming those that can be read."""
    known: list[str] = []
    for name in registry.names("importer"):
        try:
            importer: Importer = registry.get("importer", name)
        except PluginError:
            continue
        if path.suffix.lower() in importer.extensions:
            return importer
        known += importer.extensions
    raise InputError(f"{path.name} cannot be imported: known kinds are {', '.join(known) or 'none'}")


def materials_of(path: Path, registry: Registry) -> tuple[tuple[Kept, ...], tuple[str, ...]]:
    """All materials of a file, and in sentences what they lost. LucarneError names the file and the cause."""
    if path.suffix.lower() == SUFFIX:
        return (read(path),), ()
    model = importer_of(registry, path).load(path)
    if not model.materials:
        raise InputError(f"{path.name} holds no material.")
    kept = (Kept(m, ("measured",) if m.tables else (), f"From {path.name}") for m in model.materials)
    return tuple(kept), model.notes


def kinds(registry: Registry) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """What `write_materials` can write: label and endings; our own kind first."""
    found: list[tuple[str, tuple[str, ...]]] = [("Lucarne material", (SUFFIX,))]
    return (*found, *((one.label, tuple(one.extensions)) for one in _exporters(registry)))


def write_materials(path: Path, kept: Sequence[Kept], registry: Registry) -> tuple[str, ...]:
    """Write materials into a file by its ending, and say what it could not express.

    Raises InputError where no one writes that kind, or where a kind holds one material and several are given.
    """
    suffix = path.suffix.lower()
    if suffix == SUFFIX:
        if len(kept) != 1:
            raise InputError(f"{path.name}: a file of that kind holds one material, not {len(kept)}")
        write(path, kept[0])
        return ()
    for exporter in _exporters(registry):
        if suffix in exporter.extensions:
            return tuple(exporter.save(on_balls([one.material for one in kept]), path, registry))
    known = ", ".join(ending for _, endings in kinds(registry) for ending in endings)
    raise InputError(f"{path.name} cannot be written: known kinds are {known}")


def on_balls(materials: Sequence[Material]) -> Scene:
    """A scene of balls of 20 cm side by side, one a material, named like it."""
    mesh, scene = ball(), Scene()
    for number, material in enumerate(materials):
        own = replace(material, id=f"material-{number}", catches=False)
        scene = scene.with_materials(own).with_nodes(
            MeshObject(
                id=f"ball-{number}",
                name=material.name,
                geometry=mesh,
                materials=(own.id,),
                transform=Transform((number * _APART, RADIUS, 0.0)),
            )
        )
    return scene


def ball(rings: int = _RINGS, turns: int = _TURNS) -> Geometry:
    """A ball about its origin; its texture coordinates go round twice and once from pole to pole."""
    v, u = np.meshgrid(np.linspace(0, 1, rings + 1), np.linspace(0, 1, turns + 1), indexing="ij")
    polar, turn = np.pi * (1 - v), 2 * np.pi * u
    normals = np.stack([np.sin(polar) * np.sin(turn), np.cos(polar), np.sin(polar) * np.cos(turn)], axis=-1)
    uvs = np.stack([2 * u, v], axis=-1)
    corner = np.arange((rings + 1) * (turns + 1)).reshape(rings + 1, turns + 1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    lower, upper = np.stack([a, b, c], axis=-1)[1:], np.stack([a, c, d], axis=-1)[:-1]
    faces = np.concatenate([lower.reshape(-1, 3), upper.reshape(-1, 3)]).astype(np.uint32)
    flat = normals.reshape(-1, 3).astype(np.float32)
    return Geometry(flat * np.float32(RADIUS), faces, flat, uvs.reshape(-1, 2).astype(np.float32))


def _exporters(registry: Registry) -> list[Exporter]:
    found: list[Exporter] = []
    for name in registry.names("exporter"):
        try:
            one: Exporter = registry.get("exporter", name)
        except PluginError:
            continue
        if one.extensions:
            found.append(one)
    return found
