"""Columns of every region as it is, and at gloss levels that are tried: nodes between which changes lie."""

from __future__ import annotations

import dataclasses
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
from studio_plugins.slf.changeable import GLOSS, Region
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
    """Columns with all regions at one gloss level; level −1: as they are, in the models that they have."""

    level: float
    columns: Columns

    def pooled(self, share: npt.NDArray[np.float64]) -> Node:
        """Means of the rows, by shares (K, P)."""
        terms, whole = self.columns.terms, self.columns.whole
        return Node(
            self.level,
            Columns(np.einsum("kp,pgtc->kgtc", share, terms), np.einsum("kp,pgc->kgc", share, whole)),
        )


class Trials:
    """Owned by the compute thread; shapes that were tried before are known."""

    def __init__(self, services: Services) -> None:
        self._services = services
        self._separator = Separator()
        self._coefficients = VertexCoefficients(services)

    def __call__(
        self,
        scene: Scene,
        surfaces: Surfaces,
        known: Exchange,
        rows: Rows,
        sight: Sight,
        regions: list[Region],
        region: I32,
        job: Job,
    ) -> list[Node]:
        """As they are, then at each of TRIED; where a region has no gloss its columns there are 0."""
        services, surface = self._services, known.surface
        some = sight.hit(len(region)) & (region >= 0)
        arrivals = Arrivals(known, surfaces, some, services.workers, job)
        importance = Importance(known, surfaces, sight, rows, job)
        light, own = arrivals.weighed(known.shapes, surface.row, surface.separated, surface.coefficients)
        first = columns(sight, region, len(regions), light, own, services, job)
        nodes = [Node(-1.0, importance.add(first, region, surface, importance.albedos))]
        glossy = [number for number, one in enumerate(regions) if GLOSS in one.full.roles]
        if not glossy:
            return nodes
        shapes = _shapes(regions, glossy)
        separated = self._separator(shapes, *known.separation, job)
        albedos = term_albedos(separated)
        other = {m: paintable(scene.material(m), services.registry) for m in surfaces.materials}
        looks = self._coefficients(scene.with_materials(*other.values()), surfaces)
        where = np.full(len(regions) + 1, -1, np.int32)
        where[glossy] = np.arange(len(glossy))
        for number, level in enumerate(TRIED):
            row = np.where(where[region] >= 0, where[region] * len(TRIED) + number, -1).astype(np.int32)
            light, tried = arrivals.weighed(shapes, row, separated, looks)
            near = columns(sight, region, len(regions), light, tried, services, job)
            everywhere = dataclasses.replace(tried, row=row)
            nodes.append(Node(level, importance.add(near, region, everywhere, albedos)))
        return nodes


def _shapes(regions: list[Region], glossy: list[int]) -> Shapes:
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
