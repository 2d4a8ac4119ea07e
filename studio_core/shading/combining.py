"""A backend's light and the light between surfaces become one radiance, at the vertices of the picture."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.kernels.refinement import spread
from studio_core.scene.diff import Aspect
from studio_core.scene.world_mesh import WorldMesh
from studio_core.session import INDIRECT
from studio_core.shading.artifacts import DirectRadiance, Indirect, LayerRadiance, Radiance
from studio_core.shading.frame import Frame
from studio_core.shading.interpolation import parents
from studio_core.shading.job import Job
from studio_core.shading.job_parts import InnerJob
from studio_core.shading.kept import Kept
from studio_core.shading.pipeline import Completing, Inputs, Refining, Stage

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


class DirectStage:
    """A backend's last stage; what it gives counts as light that comes straight from lamps and sky."""

    gives = DirectRadiance

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.needs, self.dirtied_by = stage.needs, stage.dirtied_by
        self._made: Kept[DirectRadiance] = Kept()

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> DirectRadiance:
        """What the stage gives, partial artifacts too."""
        made = self.stage.run(frame, inputs, InnerJob(job, _as_direct))
        return self._made(lambda: _as_direct(made), made)

    def again(self, frame: Frame, made: Any, rounds: int, job: Job) -> bool:
        """See `Refining`."""
        return isinstance(self.stage, Refining) and self.stage.again(frame, made, rounds, job)

    def abandon(self) -> None:
        """See `Refining`."""
        if isinstance(self.stage, Refining):
            self.stage.abandon()

    def complete(self, frame: Frame, job: Job) -> object:
        """See `Completing`."""
        return self.stage.complete(frame, job) if isinstance(self.stage, Completing) else None


class CombineStage:
    """The light that is looked at, as one radiance."""

    needs: tuple[type, ...] = (DirectRadiance, Indirect)
    gives = Radiance
    dirtied_by = Aspect.INDIRECT

    def __init__(self) -> None:
        self._lift = Lift()
        self._dark: Kept[DirectRadiance] = Kept()
        self._made: Kept[Radiance] = Kept()

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Radiance:
        """The backend's own where there is no light between surfaces."""
        direct, indirect = inputs[DirectRadiance], inputs.artifacts[Indirect]
        if frame.light == INDIRECT:
            direct = self._dark(lambda: dataclasses.replace(direct, layers={}, pixel=None), direct)
        if frame.bounced is None:
            return direct
        return self._made(lambda: self._combined(direct, indirect), direct, indirect)

    def _combined(self, direct: DirectRadiance, indirect: Indirect | None) -> Radiance:
        if indirect is None:  # it comes later
            return dataclasses.replace(direct, final=False)
        layer = self._lift(indirect, direct)
        if direct.layers:
            layer = layer.of_width(direct.width)
        counts = {**direct.counts, **{f"indirect_{name}": count for name, count in indirect.counts.items()}}
        final = direct.final and indirect.final
        return dataclasses.replace(direct, indirect=layer, final=final, counts=counts, facts=indirect.facts)


class Lift:
    """Light at the vertices of unrefined meshes, at those of refined ones: interpolated, as pixels do."""

    def __init__(self) -> None:
        self._places: Kept[tuple[I64, I64]] = Kept()
        self._layer: Kept[LayerRadiance] = Kept()

    def __call__(self, indirect: Indirect, to: Radiance) -> LayerRadiance:
        """(V, T, 3) at the vertices of `to`; 0 where nothing is known.

        Raises ValueError where its meshes are not refined ones of those of `indirect`.
        """
        base, mesh = indirect.surfaces.mesh, to.surfaces.mesh
        own, between = self._places(
            lambda: (unrefined_vertices(base, mesh), parents(mesh)),
            *(placed.mesh for placed in (*base.objects, *mesh.objects)),
        )
        if len(base) == len(mesh) and not (to.valid & ~indirect.valid).any():
            return indirect.layer
        return self._layer(lambda: _lifted(indirect, own, between), indirect, own, between)


def unrefined_vertices(base: WorldMesh, mesh: WorldMesh) -> I64:
    """(V,) the vertices of `mesh` that `base` had before refinement, in its order.

    Raises ValueError where other objects or coarser meshes are meant.
    """
    sizes, finer = np.diff(base.vertex_offsets), np.diff(mesh.vertex_offsets)
    if len(sizes) != len(finer) or (sizes > finer).any():
        raise ValueError("light between surfaces belongs to other meshes than the light it is added to")
    within = np.arange(len(base)) - np.repeat(base.vertex_offsets[:-1], sizes)
    return np.asarray(within + np.repeat(mesh.vertex_offsets[:-1], sizes), np.int64)


def _lifted(indirect: Indirect, own: I64, between: I64) -> LayerRadiance:
    def at_all(values: F32) -> F32:
        made = np.zeros((len(between), *values.shape[1:]), np.float32)
        made[own] = np.where(indirect.valid.reshape(-1, *[1] * (values.ndim - 1)), values, np.float32(0))
        known = np.zeros(len(between), np.bool_)
        known[own] = indirect.valid
        spread(between, known, made.reshape(len(between), -1))
        return made

    layer = indirect.layer
    tilts = None if layer.tilts is None else at_all(layer.tilts)
    return LayerRadiance(at_all(layer.terms), at_all(layer.irradiance), tilts)


def _as_direct(made: Radiance) -> DirectRadiance:
    if isinstance(made, DirectRadiance):
        return made
    return DirectRadiance(**{name.name: getattr(made, name.name) for name in dataclasses.fields(Radiance)})


__all__ = ["CombineStage", "DirectStage", "Lift", "unrefined_vertices"]
