"""Stylising a scene: materials under which its light looks sharpened (unsharp masking, figure 22).

What is wanted is l_o + amount · (l_o − its mean over elements around, in the same direction of the world).
All elements are solved for it; the answer is paint on all objects: parameters times what albedos were
multiplied with, so that pictures, and what a material has beyond the paper's three numbers, stay as they are.
Paint that is there already is multiplied with the material under it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from studio_core.contract import Services
from studio_core.jit import kernel
from studio_core.params import ParamInfo, param
from studio_core.scene.nodes import Light, MeshObject, NodeId, Scene
from studio_core.scene.paint import Paint
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.job import Job
from studio_core.shading.materials import scalar
from studio_core.shading.painting import Coat, Coats
from studio_core.strokes.solution import Lit, Solution
from studio_core.strokes.solved import Solved
from studio_core.transport.cells import CELLS, PARTS, RINGS, cell_directions, cell_of
from studio_core.transport.reflectance import VertexCoefficients
from studio_plugins.slf.appearance import Appearance
from studio_plugins.slf.dressed import Dressed
from studio_plugins.slf.elements import ALIKE
from studio_plugins.slf.lumitexels import LightField
from studio_plugins.slf.series import series_of
from studio_plugins.slf.whole import Answer, Reflectances, Wanted, Whole

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U32 = npt.NDArray[np.uint32]

AROUND = 8
"""Elements around one that its light is compared with."""
LOOKED_AT = 20
MOST = 4.0
"""Times that a parameter may be changed by at most."""


@dataclass(frozen=True)
class Style:
    """How a scene is stylised."""

    amount: float = param(
        1.0, "Amount", "How much detail is strengthened; below 0 smoothed", low=-1.0, high=4.0
    )
    solver: str = param("mixed", "Solver", "Of the paper", choices=("l0", "mixed", "l2"), advanced=True)


def stylise(
    scene: Scene, lit: Lit, style: Style, services: Services, job: Job, whole: Whole | None = None
) -> Solution:
    """Paint on every object that sharpens the light of the whole scene; `whole` may be kept between calls."""
    surfaces, mesh = lit.surfaces.unrefined, lit.surfaces.unrefined.mesh
    whole = whole or Whole(services.workers)
    lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
    whole.update(surfaces, lit.casters, lit.lighting, lights, np.ones(len(mesh), np.bool_), job)
    at = whole.elements.vertex
    row = lit.shapes.rows(mesh)[at].astype(np.int64)
    now = Appearance().of(lit.shapes, row, VertexCoefficients(services)(scene, surfaces)[at])
    dark = whole.dark()
    wanted = unsharp(whole, whole.bounced(now, dark, job), neighbours(mesh, at), style.amount)
    made = whole.solve(wanted, now, dark, style.solver, job)  # type: ignore[arg-type]
    paints, notes = _paints(scene, mesh, at, now, made, services)
    return Solution(Solved("Stylise", paints), (), notes, made.counts)


def neighbours(mesh: WorldMesh, vertices: I64) -> I32:
    """(E, AROUND) the nearest others of the same object that face alike; itself where there are fewer."""
    near = min(LOOKED_AT, len(vertices))
    _, found = cKDTree(mesh.positions[vertices]).query(mesh.positions[vertices], k=near)
    found = found.reshape(len(vertices), near)
    other, own = vertices[found], np.arange(len(vertices))[:, None]
    good = (mesh.object[other] == mesh.object[vertices][:, None]) & (found != own)
    good &= np.einsum("ekc,ec->ek", mesh.normals[other], mesh.normals[vertices]) > ALIKE
    order = np.argsort(~good, axis=1, kind="stable")[:, :AROUND]
    chosen = np.where(np.take_along_axis(good, order, 1), np.take_along_axis(found, order, 1), own)
    return np.asarray(chosen, np.int32)


def unsharp(whole: Whole, field: LightField, around: I32, amount: float) -> Wanted:
    """Of what `field` sends: itself and `amount` times its difference from what is sent around."""

    def wanted(own: slice, sent: F32) -> F32:
        mean = np.zeros((own.stop - own.start, 3, RINGS, PARTS), np.float32)
        rows, light = np.empty((len(mean), CELLS), np.uint32), np.empty_like(mean)
        for which in range(around.shape[1]):
            across(own.start, whole.frames, around[:, which], cell_directions(), rows)
            field.read(rows, light)
            mean += light / around.shape[1]
        return np.asarray(sent + np.float32(amount) * (sent - series_of(mean)), np.float32)

    return wanted


@kernel
def across(start: int, frames: F32, other: I32, directions: F32, rows: U32) -> None:
    """rows (N, CELLS): where another element of each has the same directions of the world as cells."""
    for n in range(len(rows)):
        e, o = start + n, other[start + n]
        for i in range(len(directions)):
            x, y, z = directions[i, 0], directions[i, 1], directions[i, 2]
            wx = frames[e, 0, 0] * x + frames[e, 1, 0] * y + frames[e, 2, 0] * z
            wy = frames[e, 0, 1] * x + frames[e, 1, 1] * y + frames[e, 2, 1] * z
            wz = frames[e, 0, 2] * x + frames[e, 1, 2] * y + frames[e, 2, 2] * z
            u = frames[o, 0, 0] * wx + frames[o, 0, 1] * wy + frames[o, 0, 2] * wz
            v = frames[o, 1, 0] * wx + frames[o, 1, 1] * wy + frames[o, 1, 2] * wz
            w = frames[o, 2, 0] * wx + frames[o, 2, 1] * wy + frames[o, 2, 2] * wz
            rows[n, i] = o * CELLS + cell_of(u, v, w)


def _paints(
    scene: Scene, mesh: WorldMesh, at: I64, now: Reflectances, made: Answer, services: Services
) -> tuple[Mapping[NodeId, Paint | None], tuple[str, ...]]:
    paints: dict[NodeId, Paint | None] = {}
    notes: list[str] = []
    coats = Coats(services.registry)(scene, mesh)
    for index, placed in enumerate(mesh.objects):
        node = scene[placed.node]
        own = np.flatnonzero((mesh.object[at] == index) & ~made.flagged)
        if not isinstance(node, MeshObject) or not len(own):
            continue
        vertices = at[own] - mesh.vertex_offsets[index]
        slots = np.zeros(len(own), np.int64)
        changes = _painted(coats.get(index), vertices)
        for slot, number in enumerate(placed.materials):
            some = np.flatnonzero(mesh.material[at[own]] == number)
            material = scene.material(node.materials[slot]) if slot < len(node.materials) else None
            dressed = None if material is None else Dressed.of(material, services.registry)
            if dressed is None or not len(some):
                continue
            slots[some] = slot
            before = {name: change[some] for name, change in changes.items()}
            for name, delta in _changes(dressed, before, now, made.reflectances, own[some]).items():
                whole = changes.setdefault(name, np.zeros((len(own), delta.shape[1])))
                if whole.shape[1] == delta.shape[1]:
                    whole[some] = delta
        if not changes:
            notes.append(f"{node.name!r} has nothing that can be painted")
            continue
        places, normals = placed.mesh.positions[vertices], placed.mesh.normals[vertices]
        paints[node.id] = Paint.of(places, normals, slots, changes)
    return paints, tuple(notes)


def _painted(coat: Coat | None, vertices: I64) -> dict[str, F64]:
    """By parameter what an object's paint adds already at some of its vertices (N,): (N, 1) or (N, 3)."""
    if coat is None:
        return {}
    weights = coat.weights.some(vertices)
    return {name: weights(coat.paint.change(name)).astype(np.float64) for name in coat.paint.changes}


def _changes(
    dressed: Dressed, before: Mapping[str, F64], now: Reflectances, then: Reflectances, own: I64
) -> dict[str, F64]:
    """By parameter what paint adds at elements (N,), to which it adds `before` already: (N, 1) or (N, 3)."""
    made: dict[str, F64] = {}
    for role, old, new in (
        ("diffuse", now.diffuse[own], then.diffuse[own]),
        ("specular", now.specular[own], then.specular[own]),
    ):
        if role not in dressed.roles:
            continue
        name = dressed.roles[role]
        info: ParamInfo = dressed.infos[name]
        own_value = np.atleast_1d(np.asarray(dressed.resolved.values[name], np.float64))
        value = own_value + before.get(name, 0.0)
        ratio = np.clip(new / np.maximum(old, 1e-4), 1 / MOST, MOST)
        if len(own_value) == 1:
            ratio = ratio.mean(axis=1, keepdims=True)
        high = math.inf if info.high is None else float(info.high)
        made[name] = np.minimum(value * ratio, high) - own_value
    if "gloss" in dressed.roles:
        name = dressed.roles["gloss"]
        logarithmic = dressed.infos[name].scale == "log"
        gloss, added = scalar(dressed.resolved.values[name]), before.get(name, np.zeros((len(own), 1)))[:, 0]
        here = gloss * np.exp(added) if logarithmic else gloss + added
        step = then.level[own] - now.level[own]
        levels = np.array([dressed.level_of(float(one)) for one in here]) + step
        made_gloss = np.array([dressed.gloss_of(float(level)) for level in levels])
        made_gloss = np.where(np.abs(step) < 1e-9, here, made_gloss)
        delta = (
            np.log(np.maximum(made_gloss, 1e-12) / max(gloss, 1e-12)) if logarithmic else made_gloss - gloss
        )
        made[name] = delta[:, None]
    return made


__all__ = ["Style", "stylise"]
