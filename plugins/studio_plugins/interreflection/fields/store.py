"""Fields by the content of what they are made of, so that instances share them and moves cost nothing.

Kept in memory while in use, and on disk. What all objects together may take is bounded: small objects get
coarser lattices until it fits, those of least surface first.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy.typing as npt

from studio_core.contract import Services
from studio_core.kernels.raycast import RayCaster
from studio_core.shading.job import Job
from studio_plugins.interreflection.fields.bases import Basis, principal_components, spread
from studio_plugins.interreflection.fields.body import Body
from studio_plugins.interreflection.fields.lattice import lattice_of
from studio_plugins.interreflection.fields.precompute import Field, precomputed
from studio_plugins.interreflection.fields.training import columns, light_places, lit

VERSION = 2
METHOD = "interreflection fields"
HALVED = 2
"""How often an object's lattice may be made coarser: half the layers and half the cells along a side."""
FEWEST_SHELLS, FEWEST_CELLS = 4, 6


@dataclass(frozen=True)
class Settings:
    """What a field depends on besides its object; the parameters of the method."""

    shells: int = 16
    cells: int = 20
    components: int = 16
    lights: int = 128
    rays: int = 256
    bands: int = 4

    def coarser(self, times: int) -> Settings:
        """With a lattice of half as many layers and cells along a side, so often."""
        shells = max(self.shells >> times, min(self.shells, FEWEST_SHELLS))
        cells = max(self.cells >> times, min(self.cells, FEWEST_CELLS))
        return Settings(shells, cells, self.components, self.lights, self.rays, self.bands)

    def bytes_of(self, body: Body) -> int:
        """About what a body's field takes."""
        places = self.shells * self.cells**2
        return 4 * body.reflection.functions * self.components * places * self.bands**2


def fitted(bodies: Sequence[Body], areas: Sequence[float], settings: Settings, most: int) -> list[Settings]:
    """Settings of each body, of surface `areas`, coarse enough that all take `most` bytes, if that can be.

    Equal bodies count once, and as the largest of them.
    """
    keys = [identity(body, settings) for body in bodies]
    largest: dict[str, float] = {}
    for key, area in zip(keys, areas, strict=True):
        largest[key] = max(area, largest.get(key, 0.0))
    of = dict(zip(keys, bodies, strict=True))
    level = dict.fromkeys(largest, 0)
    total = sum(settings.bytes_of(of[key]) for key in largest)
    for times in range(1, HALVED + 1):
        for key in sorted(largest, key=lambda key: (largest[key], key)):
            if total <= most:
                break
            total -= settings.coarser(level[key]).bytes_of(of[key])
            level[key] = times
            total += settings.coarser(times).bytes_of(of[key])
    return [settings.coarser(level[key]) for key in keys]


def identity(body: Body, settings: Settings) -> str:
    """A name of the field of a body with these settings."""
    return f"{VERSION} {body.content} {settings}"


class FieldStore:
    """Fields of bodies; owned by the compute thread. `made` counts those that were computed."""

    def __init__(self, services: Services) -> None:
        self._services = services
        self._known: OrderedDict[str, Field] = OrderedDict()
        self.made = 0

    def fields(
        self, bodies: Sequence[Body], settings: Sequence[Settings], lend: RayCaster | None, job: Job
    ) -> list[Field]:
        """Of each body; `lend` has their meshes. Others are forgotten. Cancelled, it keeps what is done."""
        keys = [identity(body, own) for body, own in zip(bodies, settings, strict=True)]
        for number, (key, body, own) in enumerate(zip(keys, bodies, settings, strict=True)):
            job.checkpoint(number, len(bodies))
            if key not in self._known:
                self._known[key] = self._read(key, body, own) or self._make(key, body, own, lend, job)
        used = set(keys)
        for key in [key for key in self._known if key not in used]:
            del self._known[key]
        return [self._known[key] for key in keys]

    def _make(self, key: str, body: Body, settings: Settings, lend: RayCaster | None, job: Job) -> Field:
        lattice = lattice_of(body.mesh, settings.shells, settings.cells, body.some)
        with body.caster(lend) as caster:
            lights = light_places(lattice, settings.lights)
            known = columns(body, *lit(body, caster, lights, self._services, job))
            few = principal_components(known, body.mesh.area[body.vertices], settings.components)
            basis = spread(few, body.vertices, len(body.mesh))
            made = precomputed(
                body, caster, lattice, basis, settings.rays, settings.bands, self._services, job
            )
        self.made += 1
        if self._services.cache is not None:
            arrays: dict[str, npt.NDArray[Any]] = {
                "values": made.values,
                "functions": basis.functions,
                "area": basis.area,
            }
            self._services.cache.put(arrays, METHOD, key)
        return made

    def _read(self, key: str, body: Body, settings: Settings) -> Field | None:
        found = None if self._services.cache is None else self._services.cache.get(METHOD, key)
        if found is None:
            return None
        lattice = lattice_of(body.mesh, settings.shells, settings.cells, body.some)
        if not {"values", "functions", "area"} <= set(found):
            return None
        values, functions, area = found["values"], found["functions"], found["area"]
        if functions.ndim != 2 or len(functions) != len(body.mesh) or area.shape != (len(body.mesh),):
            return None
        shape = (body.reflection.functions * functions.shape[1], len(lattice), settings.bands**2)
        if values.shape != shape:
            return None
        basis = Basis(functions, area)
        return Field(lattice, basis, values, settings.bands)


__all__ = ["FieldStore", "Settings", "fitted", "identity"]
