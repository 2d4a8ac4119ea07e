"""What the picture sees of the fields: the sum of all bounces at its vertices, towards its eye."""

from __future__ import annotations

from functools import partial

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.jit import kernel
from studio_core.kernels.radiance import local_view, surface_frame
from studio_core.scene.diff import Aspect
from studio_core.shading.artifacts import Indirect, Receivers, Shapes, Surfaces
from studio_core.shading.brute_force import blank_layer
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_core.shading.tilting import facings, gather_tilts
from studio_core.transport.cells import cell_of
from studio_plugins.interreflection.fields.bounces import Sent
from studio_plugins.interreflection.fields.transfer import receive, receivers

F32 = npt.NDArray[np.float32]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]


class FieldStage:
    """Light of the fields at the vertices that the picture needs, towards its eye."""

    needs: tuple[type, ...] = (Surfaces, Shapes, Receivers, Sent)
    gives = Indirect
    dirtied_by = Aspect.NONE

    def __init__(self, services: Services) -> None:
        self._services = services

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Indirect:
        """One layer, always as exact as the method can be."""
        surfaces, shapes, seen, sent = inputs[Surfaces], inputs[Shapes], inputs[Receivers], inputs[Sent]
        mesh, separated = surfaces.mesh, sent.separated
        points = np.flatnonzero(seen.seen)
        light = sent.sources.arriving(points, sent.bands, self._services, job)
        layer = blank_layer(mesh, shapes)
        eye = (seen.eye - mesh.origin).astype(np.float32)
        ways = facings(mesh, shapes, layer)
        for facing in ways:
            some = facing.some(points)
            own, arriving = points[some], light[some]
            if facing.leaning is None:
                vectors = sent.vectors[own]
            else:
                given = (facing.mesh, own, sent.row, sent.rows, sent.bands, self._services, job)
                vectors = receivers(*given)
            taken = receive(vectors, arriving, self._services, job)
            facing.irradiance[own] = taken[:, 0]

            run = partial(
                towards_eye,
                points=own,
                positions=facing.mesh.positions,
                normals=facing.mesh.normals,
                tangents=facing.mesh.tangents,
                row=sent.row,
                eye=eye,
                light=taken,
                matte=separated.matte,
                signed=separated.signed,
                count=separated.count,
                base=separated.base,
                first=separated.first,
                term=separated.term,
                outgoing=separated.outgoing,
                out=facing.terms,
            )
            self._services.workers.run(len(own), 1024, run, job)
        if layer.tilts is not None:
            gather_tilts(shapes, mesh, ways, layer.tilts)
        counts = {**sent.counts, "vertices_received": len(points)}
        return Indirect(surfaces, layer, seen.seen, True, counts, sent.facts)


@kernel
def towards_eye(
    start: int,
    stop: int,
    points: I64,
    positions: F32,
    normals: F32,
    tangents: F32,
    row: I32,
    eye: F32,
    light: F32,
    matte: F32,
    signed: npt.NDArray[np.bool_],
    count: I64,
    base: I64,
    first: I64,
    term: I32,
    outgoing: F32,
    out: F32,
) -> None:
    """Terms out (V, T, 3) of points[start:stop] from light (P, 1 + K, 3): equation 4 towards the eye."""
    axes, view = np.empty((3, 3)), np.empty(3, np.float32)
    for item in range(start, stop):
        vertex = points[item]
        own = row[vertex]
        if own >= len(count):
            continue
        for t in range(matte.shape[1]):
            for c in range(3):
                out[vertex, t, c] = matte[own, t] * light[item, 0, c]
        surface_frame(normals[vertex], tangents[vertex], axes)
        local_view(positions[vertex], eye, axes, view)
        place = base[own] + cell_of(view[0], view[1], view[2]) * count[own]
        for k in range(count[own]):
            g, t = outgoing[place + k], term[first[own] + k]
            for c in range(3):
                out[vertex, t, c] += g * light[item, 1 + k, c]
        for t in range(matte.shape[1]):
            if not signed[own, t]:
                for c in range(3):
                    out[vertex, t, c] = max(out[vertex, t, c], np.float32(0.0))


__all__ = ["FieldStage", "towards_eye"]
