"""Regions: the slots of objects whose material may be what changed, and coefficients after changes."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.contract import PaintableBrdf, Registry
from studio_core.params import ParamInfo, Value, param_infos
from studio_core.scene.nodes import Material, MeshObject, NodeId, Scene
from studio_core.scene.paint import Paint
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.materials import Resolved, finite_shape, linear_rgb, resolve
from studio_core.shading.painting import painted
from studio_core.strokes.paintable import material_roles, paintable
from studio_plugins.slf.ladder import alpha_of_level, level_of_alpha

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
DIFFUSE, SPECULAR, GLOSS = "diffuse", "specular", "gloss"


@dataclass(frozen=True, eq=False)
class Look:
    """A material as it is on one object, with its paint's mean: parameters and values by role."""

    material: Material
    resolved: Resolved
    roles: Mapping[str, str]

    @classmethod
    def of(cls, material: Material, changes: Mapping[str, F64], registry: Registry) -> Look:
        """With `changes` of parameters by name, as paint has them."""
        plain = resolve(material, registry)
        infos, values = param_infos(plain.brdf.Params), dict(material.values)
        for name, change in changes.items():
            if name in infos and name in plain.values and not isinstance(plain.values[name], str):
                values[name] = _value(painted(np.asarray(plain.values[name], float), change, infos[name]))
        made = dataclasses.replace(material, values=frozen_map(values)) if changes else material
        return cls(made, resolve(made, registry), material_roles(made, registry))

    @cached_property
    def infos(self) -> Mapping[str, ParamInfo]:
        """Of the model's parameters."""
        return param_infos(self.resolved.brdf.Params)

    @cached_property
    def means(self) -> Mapping[str, F64]:
        """Numbers and colours, where there are pictures their mean."""
        made = {}
        for name, value in self.resolved.values.items():
            if not isinstance(value, str | bool):
                number = np.asarray(value, np.float64)
                if name in self.resolved.textures:
                    mean = linear_rgb(self.resolved.textures[name].image).mean(axis=(0, 1), dtype=np.float64)
                    number = number * (mean[0] if number.ndim == 0 else mean)
                made[name] = number
        return made

    def at(self, role: str) -> F64:
        """The value of a role, () or (3,)."""
        return self.means[self.roles[role]]

    def coefficients(self, values: Mapping[str, F64]) -> F64:
        """(N, T, 3) for values by role, (N,) or (N, 3)."""
        given = {self.roles[role]: np.asarray(value, np.float32) for role, value in values.items()}
        count = len(next(iter(given.values())))
        every = {
            name: given.get(name, np.broadcast_to(np.asarray(mean, np.float32), (count, *mean.shape)))
            for name, mean in self.means.items()
        }
        return np.asarray(self.resolved.brdf.coefficients(every), np.float64)

    @cached_property
    def plain(self) -> F64:
        """(T, 3) coefficients as they are."""
        model = self.resolved.brdf
        made = model.coefficients({name: np.asarray(mean, np.float32) for name, mean in self.means.items()})
        return np.asarray(made, np.float64)

    @property
    def level(self) -> float:
        """The gloss level, or −1 without a gloss."""
        if GLOSS not in self.roles:
            return -1.0
        model = cast(PaintableBrdf, self.resolved.brdf)
        return float(level_of_alpha(model.alpha(float(self.at(GLOSS)))))

    def gloss_at(self, level: float) -> float:
        """The gloss parameter at a level, in its range."""
        info = self.infos[self.roles[GLOSS]]
        made = cast(PaintableBrdf, self.resolved.brdf).gloss(float(alpha_of_level(level)))
        return float(np.clip(made, info.low, info.high))

    def shape_at(self, level: float) -> F32:
        """What the model's kernel reads at a gloss level."""
        return self.shape_of(self.gloss_at(level))

    def shape_of(self, gloss: float) -> F32:
        """What it reads at a gloss."""
        values: dict[str, Value] = {**self.resolved.values, self.roles[GLOSS]: gloss}
        return finite_shape(self.resolved.brdf, values)

    @property
    def shiny(self) -> bool:
        """Whether it reflects at all but as matte paint does."""
        return SPECULAR in self.roles and bool(self.at(SPECULAR).max() > 0)

    def change(self, role: str, value: Any) -> F64:
        """What paint adds to the parameter of a role for it to become a value."""
        name = self.roles[role]
        now = np.asarray(self.resolved.values[name], np.float64)
        if name in self.resolved.textures:
            return np.asarray(value, np.float64) - self.means[name]
        if self.infos[name].scale == "log":
            return np.log(np.asarray(value, np.float64) / now)
        return np.asarray(value, np.float64) - now


@dataclass(frozen=True, eq=False)
class Changeable:
    """One slot of an object: its look `now`, and the same in a model that has all roles, where there is one.

    `material` is in that model what the object's material is without paint.
    """

    node: NodeId
    slot: int
    now: Look
    full: Look
    material: Material

    @property
    def name(self) -> tuple[NodeId, int]:
        """Object and slot."""
        return self.node, self.slot


def changeables_of(
    scene: Scene,
    surfaces: Surfaces,
    without: Sequence[tuple[NodeId, int]],
    registry: Registry,
) -> tuple[list[Changeable], I32]:
    """All but some and those without any role, and the number of each vertex' one (V,), −1: none."""
    mesh = surfaces.mesh
    number = np.full(len(mesh), -1, np.int32)
    made: list[Changeable] = []
    for index, placed in enumerate(mesh.objects):
        node, own = scene.nodes.get(placed.node), mesh.vertices_of(index)
        if not isinstance(node, MeshObject):
            continue
        slots = placed.mesh.slot
        for slot in np.unique(slots).tolist():
            if slot >= len(node.materials) or (node.id, slot) in without:
                continue
            region = _region(scene, node, slot, registry)
            if region.now.roles or region.full.roles:
                number[own][slots == slot] = len(made)
                made.append(region)
    return made, number


def _region(scene: Scene, node: MeshObject, slot: int, registry: Registry) -> Changeable:
    material = scene.material(node.materials[slot])
    changes = mean_paint(node.paint, slot)
    now = Look.of(material, changes, registry)
    other = paintable(now.material, registry)
    full = now if other.model == material.model else Look.of(other, {}, registry)
    return Changeable(node.id, slot, now, full, paintable(material, registry))


def mean_paint(paint: Paint | None, slot: int) -> dict[str, F64]:
    """Mean change of each parameter over an object's slot, by its points; nothing where there is none."""
    if paint is None:
        return {}
    own = np.flatnonzero(paint.slots == slot)
    if not len(own):
        return {}
    made = {}
    for name in paint.changes:
        mean = paint.change(name)[own].mean(axis=0, dtype=np.float64)
        if np.abs(mean).max() > 0:
            made[name] = mean if len(mean) > 1 else mean[0]
    return made


def _value(made: npt.NDArray[Any]) -> Value:
    if made.ndim == 0:
        return float(made)
    red, green, blue = (float(v) for v in made)
    return (red, green, blue)


__all__ = ["DIFFUSE", "GLOSS", "SPECULAR", "Changeable", "Look", "changeables_of", "mean_paint"]
