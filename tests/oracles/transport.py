"""Rays of receivers followed by looping over triangles in float64: what each row of an operator holds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from oracles.raycast import nearest

from studio_core.scene.shading_mesh import NO_BACK
from studio_core.transport.hits import BLACK, NOTHING

RINGS, PARTS = 16, 64


class Rays(NamedTuple):
    """Of N rays the corners that may be met (N, 3), their weights and the cells that fit them, the distance,
    and how near an edge of its face each ray arrives."""

    corners: np.ndarray
    weights: np.ndarray
    cells: np.ndarray
    distance: np.ndarray
    margin: np.ndarray


def frame_of(mesh, vertex):
    normal, tangent = mesh.normals[vertex].astype(float), mesh.tangents[vertex].astype(float)
    return np.stack([tangent[:3], tangent[3] * np.cross(normal, tangent[:3]), normal])


def rows(mesh, opaque, vertices, directions, epsilon):
    """Of R·N rays; `directions` (R, N, 3) in the world, `opaque` (F,) which faces are met."""
    start = mesh.positions[vertices].astype(float) + mesh.inset[vertices] + epsilon * mesh.geometric[vertices]
    faces, back = mesh.faces[opaque], mesh.back_faces[opaque]
    starts = np.repeat(start, directions.shape[1], axis=0)
    directions = directions.reshape(-1, 3)
    met = nearest([(mesh.positions.astype(float), faces, np.eye(4))], starts, directions)
    corners = np.full((len(directions), 3), NOTHING)
    cells = np.zeros((len(directions), 3), int)
    weights = np.stack([1 - met.u - met.v, met.u, met.v], axis=1)
    for ray in np.flatnonzero(met.face >= 0):
        front = met.normal[ray] @ directions[ray] < 0
        corners[ray] = (faces if front else back)[met.face[ray]]
        for k, corner in enumerate(corners[ray]):
            if corner == NO_BACK:
                corners[ray] = BLACK
                break
            x, y, z = frame_of(mesh, corner) @ -directions[ray]
            ring = min(int(np.arccos(np.clip(z, 0, 1)) / (np.pi / 2) * RINGS), RINGS - 1)
            part = int(np.arctan2(y, x) % (2 * np.pi) / (2 * np.pi) * PARTS) % PARTS
            cells[ray, k] = ring * PARTS + part
    return Rays(corners, weights, cells, met.t, np.where(met.face >= 0, weights.min(axis=1), 1.0))
