"""Columns of every region as it is, and at gloss levels that are tried: nodes between which changes lie."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.scene.nodes import Scene
from studio_core.shading.artifacts import Shapes, Surfaces
from studio_core.shading.job import Job
from studio_core.strokes.paintable import paintable
from studio_core.transport.exchange import Exchange
from studio_core.transport.reflectance import VertexCoefficients
from studio_core.transport.separable import Separator
from studio_plugins.slf.changeable import GLOSS, Changeable
from studio_plugins.slf.fixates import Rows
from studio_plugins.slf.further import Importance, term_albedos
from studio_plugins.slf.influence import Columns, Sight, columns
from studio_plugins.slf.receiving import Arrivals

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
TRIED = (3.0, 7.0, 11.0, 14.0, 16.0, 18.0)
"""Gloss levels: α of 0.70, 0.53, 0.37, 0.25, 0.17 and 0.09."""


@dataclass(frozen=True, eq=False)
class Node:
    """Columns with all regions at one gloss level, by each set of rays; level −1: as they are, in the models
    that they have.
    """

    level: float
    sides: tuple[Columns, ...]

    def pooled(self, share: npt.NDArray[np.float64]) -> Node:
        """Means of the rows, by shares (K, P)."""
        made = (
            Columns(np.einsum("kp,pgtc->kgtc", share, one.terms), np.einsum("kp,pgc->kgc", share, one.whole))
            for one in self.sides
        )
        return Node(self.level, tuple(made))


class Trials:
    """Owned by the compute thread; shapes that were tried before are known."""

    def __init__(self, services: Services) -> None:
        self._services = services
        self.separator = Separator()
        self._coefficients = VertexCoefficients(services)

    def __call__(
        self,
        scene: Scene,
        surfaces: Surfaces,
        known: Exchange,
        rows: Rows,
        sights: Sequence[Sight],
        regions: list[Changeable],
        region: I32,
        job: Job,
    ) -> list[Node]:
        """As they are, then at each of TRIED; where a region has no gloss its columns there are 0."""
        services, surface = self._services, known.surface
        some = np.any([sight.hit(len(region)) for sight in sights], axis=0) & (region >= 0)
        arrivals = Arrivals(known, surfaces, some, services.workers, job)
        importance = Importance(known, surfaces, sights, rows, job)
        light, own = arrivals.weighed(known.shapes, surface.row, surface.separated, surface.coefficients)
        far = importance.of(region, len(regions), surface, importance.albedos)
        seen = (columns(sight, region, len(regions), light, own, services, job) for sight in sights)
        nodes = [Node(-1.0, tuple(one.plus(far) for one in seen))]
        glossy = [number for number, one in enumerate(regions) if GLOSS in one.full.roles]
        if not glossy:
            return nodes
        shapes = _shapes(regions, glossy)
        separated = self.separator(shapes, *known.separation, job)
        albedos = term_albedos(separated)
        looks = self.looks(scene, surfaces)
        where = np.full(len(regions) + 1, -1, np.int32)
        where[glossy] = np.arange(len(glossy))
        for number, level in enumerate(TRIED):
            row = np.where(where[region] >= 0, where[region] * len(TRIED) + number, -1).astype(np.int32)
            light, tried = arrivals.weighed(shapes, row, separated, looks)
            far = importance.of(region, len(regions), dataclasses.replace(tried, row=row), albedos)
            seen = (columns(sight, region, len(regions), light, tried, services, job) for sight in sights)
            nodes.append(Node(level, tuple(one.plus(far) for one in seen)))
        return nodes

    def looks(self, scene: Scene, surfaces: Surfaces) -> F32:
        """(V, T, 3) coefficients with every material in a model that has all roles, where there is one."""
        other = [paintable(scene.material(name), self._services.registry) for name in surfaces.materials]
        return self._coefficients(scene.with_materials(*other), surfaces)


def _shapes(regions: list[Changeable], glossy: list[int]) -> Shapes:
    """Rows of the tried levels of each region with a gloss, one region after the other."""
    address, terms, offset, data, length = [], [], [], [], 0
    for number in glossy:
        look = regions[number].full
        for level in TRIED:
            shape = look.shape_at(level)
            address.append(look.resolved.brdf.address)
            terms.append(look.resolved.brdf.terms)
            offset.append(length)
            data.append(shape)
            length += len(shape)
    flat = np.concatenate([*data, np.zeros(1, np.float32)])
    return Shapes(np.array(address, np.int64), np.array(terms, np.int64), np.array(offset, np.int64), flat)


__all__ = ["TRIED", "Node", "Trials"]
