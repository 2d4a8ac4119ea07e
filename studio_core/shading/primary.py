"""What the camera sees at every sample of the picture, and which vertices that shows."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.kernels.camera import first_hits, sample_directions
from studio_core.kernels.raycast import RayCaster
from studio_core.scene.diff import Aspect
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.scene.transform import rotation_matrix
from studio_core.session import View
from studio_core.shading.artifacts import Casters, Hits, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs

CHUNK = 1 << 14
LAYERS = 6  # most transparent surfaces looked through


class PrimaryStage:
    """What the camera sees at every sample of the picture."""

    needs: tuple[type, ...] = (Surfaces, Casters)
    gives = Hits
    dirtied_by = Aspect.VIEW

    def __init__(self, services: Services) -> None:
        self._workers = services.workers

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Hits:
        """Primary rays, followed on through transparent surfaces."""
        surfaces, caster, view = inputs[Surfaces], inputs[Casters].primary, frame.view
        lens = pinhole(view)
        count = view.width * view.height * view.antialias**2
        face = np.empty(count, np.int32)
        u, v, distance = np.empty((3, count), np.float32)
        eye = caster.local(view.transform.translation)
        handles, offsets = caster.handles(), surfaces.mesh.face_offsets

        def look(start: int, stop: int) -> None:
            first_hits(
                handles.intersect8,
                handles.scene,
                eye,
                lens,
                handles.face_start,
                handles.face_ids,
                offsets,
                face,
                u,
                v,
                distance,
                start,
                stop,
            )

        self._workers.run(count, CHUNK, look, job)
        caster.count(count)
        seen = Hits(view, view.antialias, face, u, v, distance)
        everything = np.arange(count) if (surfaces.opacity < 1).any() else np.zeros(0, np.int64)
        return self._beyond(seen, surfaces, caster, everything, lens, 0, job)

    def _beyond(
        self,
        hits: Hits,
        surfaces: Surfaces,
        caster: RayCaster,
        samples: npt.NDArray[np.int64],
        lens: npt.NDArray[np.float64],
        depth: int,
        job: Job,
    ) -> Hits:
        """The hits with what is seen through those on transparent surfaces."""
        mesh = surfaces.mesh
        if depth == LAYERS or not len(samples):
            return hits
        met = np.flatnonzero(hits.face >= 0)
        through = met[surfaces.opacity[mesh.face_material[hits.face[met]]] < 1]
        if not len(through):
            return hits
        directions = np.empty((len(through), 3), np.float32)
        sample_directions(lens, samples[through], directions)
        gone = hits.distance[through].astype(np.float64) * (1 + 1e-5) + caster.epsilon
        origins = np.asarray(hits.view.transform.translation) + gone[:, None] * directions
        found = caster.closest(origins, directions, 0.0, np.inf, self._workers, job)
        hit = found.object >= 0
        face = np.where(hit, mesh.face_offsets[found.object] + found.face, -1).astype(np.int32)
        distance = (found.t + gone).astype(np.float32)
        rest = Hits(hits.view, hits.samples, face, found.u, found.v, distance)
        rest = self._beyond(rest, surfaces, caster, samples[through], lens, depth + 1, job)
        return dataclasses.replace(hits, behind=((through, rest),))


def pinhole(view: View) -> npt.NDArray[np.float64]:
    """A view as `kernels.camera` wants it."""
    up = np.tan(np.radians(view.fov) / 2)
    rotation = rotation_matrix(view.transform.rotation)
    size = (view.width, view.antialias, up * view.width / view.height, up, view.height)
    return np.array([*size, *rotation.ravel()], np.float64)


def visible_vertices(surfaces: Surfaces, hits: Hits) -> npt.NDArray[np.bool_]:
    """(V,) the corners of every face that a sample sees, on the side it sees."""
    seen = np.zeros(len(surfaces.mesh.positions), np.bool_)
    touched = np.zeros(len(surfaces.mesh.faces) + 1, np.bool_)
    touched[hits.face] = True  # -1, nothing, marks the one too many
    faces = np.flatnonzero(touched[:-1])
    seen[surfaces.mesh.faces[faces]] = True
    back = surfaces.mesh.back_faces[faces]
    seen[back[back[:, 0] != NO_BACK]] = True
    for _, rest in hits.behind:
        seen |= visible_vertices(surfaces, rest)
    return seen
