"""Texture coordinates for meshes that have none: charts in metres, all upright.

xatlas (Jonathan Young, after thekla_atlas) cuts the surface into charts that are nearly flat and unrolls
each, in a process of its own (`unwrap_child`). Where it fails, takes too long, is not there or the mesh is
large, each face is projected along the axis that it faces most; slanted faces are stretched, by 1.7 at most.

Either way coordinates are metres: each chart has the area of its surface, is turned so that v runs up the
wall (on floors and ceilings u along x), and is moved to where a projection along its mean normal would be,
so that rows of bricks go on around a corner where surfaces allow it. Charts lie over each other in the
plane: they are for patterns that repeat, not for painting on.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.scene.geometry import Geometry
from studio_core.scene.topology import components
from studio_core.shading.job import Job

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

MOST_FACES = 60_000
"""Larger meshes are projected: xatlas takes half a minute for as many, and much longer beyond."""
SECONDS = 120.0
LYING = 0.9  # of a normal's length upward: floors and ceilings
_BOOT = (
    "import sys, json; sys.path[:] = json.loads(sys.argv[1]);"
    " from studio_core.scene.unwrap_child import main; main()"
)
_POLL = 0.1


@dataclass(frozen=True)
class Unwrapped:
    """A mesh with coordinates, how many charts it has, and why it was projected (empty: it was not)."""

    geometry: Geometry
    charts: int
    projected: str = ""


def unwrapped(
    geometry: Geometry,
    *,
    scale: float = 1.0,
    most: int = MOST_FACES,
    seconds: float = SECONDS,
    job: Job | None = None,
) -> Unwrapped:
    """The mesh with texture coordinates in metres, where one of its units is `scale` metres.

    Faces keep their order and slots, corners their positions and normals; positions are doubled where charts
    meet. Raises InputError for a mesh without faces, Cancelled.
    """
    if not len(geometry.faces):
        raise InputError("a mesh without faces has no surface to lay a picture on")
    points = geometry.positions.astype(np.float64)
    faces = geometry.faces.astype(np.int64)
    normals = _face_normals(points, faces)
    area = np.linalg.norm(normals, axis=1)
    whole = area > 1e-12 * max(float(area.max(initial=0.0)), 1e-300)
    why = "it has many faces" if len(faces) > most else ""
    found: tuple[I64, I64, F64] | str = why or _charts(points, faces[whole], seconds, job)
    if isinstance(found, str):
        return _boxed(geometry, normals, scale, found)
    source, corners, uvs = found
    every = np.empty_like(faces)
    every[whole] = corners
    lost = np.flatnonzero(~whole)  # faces without an area: corners of their own, anywhere
    every[lost] = len(source) + np.arange(3 * len(lost)).reshape(-1, 3)
    source = np.concatenate([source, faces[lost].reshape(-1)])
    uvs = np.concatenate([uvs, np.zeros((3 * len(lost), 2))])
    chart = _charts_of(every, len(source))
    laid = _laid(points[source], every, uvs, normals, chart)
    made = _with(geometry, source, every, laid * scale)
    return Unwrapped(made, len(np.unique(chart[corners])))


def _face_normals(points: F64, faces: I64) -> F64:
    corners = points[faces]
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def _charts(points: F64, faces: I64, seconds: float, job: Job | None) -> tuple[I64, I64, F64] | str:
    """(V,) positions, (F, 3) corners, (V, 2) coordinates from xatlas; or why there are none."""
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    size = float(np.abs(points - middle).max(initial=0.0))
    used, local = np.unique(faces, return_inverse=True)
    sent = ((points[used] - middle) / max(size, 1e-300)).astype(np.float32)
    asked = json.dumps({"positions": len(used), "faces": len(faces)}).encode() + b"\n"
    body = asked + sent.tobytes() + local.astype(np.uint32).tobytes()
    answer = _asked(body, seconds, job)
    if isinstance(answer, str):
        return answer
    line, _, rest = answer.partition(b"\n")
    try:
        said = json.loads(line)
        if "error" in said:
            return str(said["error"])
        count = int(said["vertices"])
        source = np.frombuffer(rest, np.uint32, count).astype(np.int64)
        corners = np.frombuffer(rest, np.uint32, 3 * len(faces), 4 * count).astype(np.int64).reshape(-1, 3)
        uvs = np.frombuffer(rest, np.float32, 2 * count, 4 * count + 12 * len(faces)).astype(np.float64)
    except (ValueError, KeyError, TypeError):
        return "xatlas gave no answer"
    if source.max(initial=0) >= len(used) or corners.max(initial=0) >= count or not np.isfinite(uvs).all():
        return "xatlas gave charts that cannot be"
    if not np.array_equal(used[source][corners], faces):
        return "xatlas changed the faces"
    return used[source], corners, uvs.reshape(-1, 2)


def _asked(body: bytes, seconds: float, job: Job | None) -> bytes | str:
    """What the child answers; or why it does not."""
    where = json.dumps([str(Path(entry).resolve()) for entry in sys.path])
    child = subprocess.Popen(
        [sys.executable, "-P", "-c", _BOOT, where],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
    )
    answer: list[bytes] = []

    def talk() -> None:
        try:
            answer.append(child.communicate(body)[0])
        except (OSError, ValueError):
            return

    talking = threading.Thread(target=talk, name="unwrap", daemon=True)
    talking.start()
    ends = time.monotonic() + seconds
    try:
        while talking.is_alive() and time.monotonic() < ends:
            talking.join(_POLL)
            if job is not None:
                job.checkpoint(job.done, job.total)
        late = talking.is_alive()
    finally:
        if talking.is_alive():
            child.kill()
        talking.join()
    if late:
        return f"xatlas took more than {seconds:g} s"
    return answer[0] if answer and child.returncode == 0 else "xatlas failed"


def _charts_of(faces: I64, count: int) -> I64:
    """(V,) a number for each connected part, 0 …"""
    a = np.concatenate([faces[:, 0], faces[:, 1]])
    b = np.concatenate([faces[:, 1], faces[:, 2]])
    label = components(count, a, b)
    return np.asarray(np.unique(label, return_inverse=True)[1].reshape(-1), np.int64)


def _laid(points: F64, faces: I64, uvs: F64, normals: F64, chart: I64) -> F64:
    """Charts as large as their surface, not mirrored, turned and moved onto the projection of each."""
    count = int(chart.max()) + 1
    of_face = chart[faces[:, 0]]
    one, other = uvs[faces[:, 1]] - uvs[faces[:, 0]], uvs[faces[:, 2]] - uvs[faces[:, 0]]
    signed = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    size = np.linalg.norm(normals, axis=1)
    in_map = np.bincount(of_face, np.abs(signed), count)
    on_surface = np.bincount(of_face, size, count)
    mirrored = np.bincount(of_face, signed, count) < 0
    scale = np.sqrt(on_surface / np.maximum(in_map, 1e-300)) * (in_map > 0)
    mean: F64 = np.stack([np.bincount(of_face, n, count).astype(np.float64) for n in normals.T], axis=1)
    right, up = _frames(mean)
    target = np.stack([(points * right[chart]).sum(axis=1), (points * up[chart]).sum(axis=1)], axis=1)
    grown = uvs * scale[chart, None]
    grown[mirrored[chart], 0] *= -1
    # corners weighted by their faces' area; then the rotation nearest to the projection (Procrustes)
    weight = np.bincount(faces.reshape(-1), np.repeat(size, 3), len(points)) + 1e-300
    total = np.bincount(chart, weight, count)
    centres = [
        np.stack([np.bincount(chart, weight * values[:, axis], count) / total for axis in (0, 1)], axis=1)
        for values in (grown, target)
    ]
    a, b = grown - centres[0][chart], target - centres[1][chart]
    cosine = np.bincount(chart, weight * (a * b).sum(axis=1), count)
    sine = np.bincount(chart, weight * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), count)
    length = np.hypot(cosine, sine)
    cosine, sine = np.where(length > 0, (cosine, sine) / np.maximum(length, 1e-300), [[1.0], [0.0]])
    c, s = cosine[chart], sine[chart]
    turned = np.stack([c * a[:, 0] - s * a[:, 1], s * a[:, 0] + c * a[:, 1]], axis=1)
    return np.asarray(turned + centres[1][chart])


def _frames(normals: F64) -> tuple[F64, F64]:
    """(N, 3) right and up in the plane of each normal: up the wall; on what lies flat right is along x."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    unit = np.where(length > 0, normals / np.maximum(length, 1e-300), (0.0, 1.0, 0.0))
    lying = np.abs(unit[:, 1]) > LYING
    up = np.where(lying[:, None], np.array([0.0, 0.0, -1.0]) * np.sign(unit[:, 1:2]), [0.0, 1.0, 0.0])
    up = up - (up * unit).sum(axis=1, keepdims=True) * unit
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    return np.cross(up, unit), up


def _boxed(geometry: Geometry, normals: F64, scale: float, why: str) -> Unwrapped:
    """Each face projected along the axis that it faces most."""
    axis = np.abs(normals).argmax(axis=1)
    side = axis + 3 * (np.take_along_axis(normals, axis[:, None], axis=1)[:, 0] < 0)
    faces = geometry.faces.astype(np.int64)
    keys, corners = np.unique((faces * 6 + side[:, None]).reshape(-1), return_inverse=True)
    source, of_side = keys // 6, keys % 6
    sides: F64 = np.concatenate([np.eye(3), -np.eye(3)])
    right, up = _frames(sides)
    points = geometry.positions[source].astype(np.float64)
    uvs = np.stack([(points * right[of_side]).sum(axis=1), (points * up[of_side]).sum(axis=1)], axis=1)
    corners = corners.reshape(-1, 3)
    made = _with(geometry, source, corners, uvs * scale)
    return Unwrapped(made, len(np.unique(_charts_of(corners, len(source)))), why)


def _with(geometry: Geometry, source: I64, faces: I64, uvs: F64) -> Geometry:
    normals = geometry.normals[source] if geometry.normals is not None else None
    return Geometry(
        geometry.positions[source], faces.astype(np.uint32), normals, uvs.astype(np.float32), geometry.slots
    )


__all__ = ["MOST_FACES", "SECONDS", "Unwrapped", "unwrapped"]
