"""Objects of a scene as sources of fields: their meshes with how each vertex reflects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.shading.artifacts import Casters, Shapes, Surfaces
from studio_core.shading.job import Job
from studio_core.transport.cells import CELLS
from studio_core.transport.separable import Separated
from studio_plugins.interreflection.fields.body import Body, Reflection
from studio_plugins.interreflection.fields.parts import parts, piece_of

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
Rows = npt.NDArray[np.signedinteger[Any]]


@dataclass(frozen=True, eq=False)
class Terms:
    """Which of a row's functions belong to which term: matte (R + 1, T), term (R + 1, K), −1 for none.

    incoming (R + 1, K, CELLS); the last row is that of vertices without a material.
    """

    matte: F32
    term: I64
    incoming: F32

    def matte_part(self, row: Rows, coefficients: F32) -> F32:
        """(V, 3) what irradiance is multiplied with, of coefficients (V, T, 3)."""
        return np.asarray(np.einsum("vt,vtc->vc", self.matte[row], coefficients), np.float32)

    def glossy_part(self, row: Rows, coefficients: F32) -> F32:
        """(V, K, 3) what each L_k is multiplied with."""
        term = self.term[row]
        found = np.take_along_axis(coefficients, np.maximum(term, 0)[..., None], axis=1)
        return np.asarray(np.where(term[..., None] < 0, np.float32(0), found), np.float32)


def terms_of(separated: Separated) -> Terms:
    """For all rows."""
    rows, most = len(separated.count), int(separated.count.max(initial=0))
    matte = np.concatenate([separated.matte, np.zeros((1, separated.matte.shape[1]), np.float32)])
    term = np.full((rows + 1, most), -1, np.int64)
    incoming = np.zeros((rows + 1, most, CELLS), np.float32)
    for row in range(rows):
        light, _, own = separated.functions(row)
        term[row, : len(own)] = own
        incoming[row, : len(own)] = light.T
    return Terms(matte, term, incoming)


@dataclass(frozen=True, eq=False)
class Cast:
    """Sources of a scene: bodies of the objects `index` (B,), and owner (V,) the source of each vertex."""

    terms: Terms
    bodies: tuple[Body, ...]
    index: tuple[int, ...]
    owner: I32


class Casting:
    """Makes the sources of scenes; knows which meshes are hollow. Owned by the compute thread."""

    def __init__(self, services: Services) -> None:
        self._services = services
        self._parts: dict[str, list[I64 | None]] = {}
        self._made: tuple[tuple[Any, ...], Cast] | None = None

    def __call__(
        self, surfaces: Surfaces, casters: Casters, shapes: Shapes, separated: Separated, job: Job
    ) -> Cast:
        """That of the last time while neither meshes nor reflectances are others."""
        mesh = surfaces.mesh
        row = np.asarray(shapes.rows(mesh))
        now = (separated, casters.meshes, tuple(id(o.mesh) for o in mesh.objects), row.tobytes())
        if self._made is not None and self._made[0] == now:
            return self._made[1]
        terms = terms_of(separated)
        bodies, index, owner = list[Body](), list[int](), np.full(len(mesh), -1, np.int32)
        known: dict[str, list[I64 | None]] = {}
        for number, body in enumerate(bodies_of(surfaces, casters, shapes, separated, terms)):
            job.checkpoint(number, len(mesh.objects))
            if not body.opaque.any():
                continue
            key = f"{body.key} {body.opaque.tobytes()!r}" if not body.opaque.all() else body.key
            known[key] = self._parts.get(key) or parts(body, self._services, job)
            for some in known[key]:
                part = body if some is None else piece_of(body, some)
                owner[mesh.vertices_of(number)][part.vertices] = len(bodies)
                bodies.append(part)
                index.append(number)
        self._parts = known
        self._made = now, Cast(terms, tuple(bodies), tuple(index), owner)
        return self._made[1]


def bodies_of(
    surfaces: Surfaces, casters: Casters, shapes: Shapes, separated: Separated, terms: Terms
) -> list[Body]:
    """One for each object of the unrefined meshes."""
    mesh = surfaces.mesh
    every = np.asarray(shapes.rows(mesh), np.int64)
    made = []
    for index, (placed, (key, stops)) in enumerate(zip(mesh.objects, _named(casters), strict=True)):
        used, row = np.unique(every[mesh.vertices_of(index)], return_inverse=True)
        count = int(separated.count[used[used >= 0]].max(initial=0))
        outgoing = np.zeros((len(used), count, CELLS), np.float32)
        for number, own in enumerate(used.tolist()):
            if own >= 0:
                out = separated.functions(own)[1]
                outgoing[number, : out.shape[1]] = out.T
        matte = bool(terms.matte[used].any())
        reflection = Reflection(row.astype(np.int64), matte, terms.incoming[used, :count], outgoing)
        slots = np.minimum(placed.mesh.slots, max(len(stops) - 1, 0))
        opaque = np.array(stops or (True,), np.bool_)[slots]
        made.append(Body(key, placed.mesh, opaque, reflection))
    return made


def _named(casters: Casters) -> Sequence[tuple[str, tuple[bool, ...]]]:
    """Key of each object's shading mesh, and which of its slots stop light."""
    return cast(Sequence[tuple[str, tuple[bool, ...]]], casters.meshes)


__all__ = ["Cast", "Casting", "Terms", "bodies_of", "terms_of"]
