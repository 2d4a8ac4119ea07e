"""Tangents of shading vertices: which way the x axis of a shading frame lies on the surface.

They follow the u direction of texture coordinates, ∂P/∂u, laid into the plane of the vertex normal and
averaged by the angle of the corners, as MikkTSpace does (Mikkelsen, "Simulation of Wrinkled Surfaces
Revisited", 2008): brushed metal runs along its picture, and moves with the object. A tangent is (x, y, z, s):
the frame's y axis is s · (normal × tangent), so s = −1 where a picture lies mirrored. Where there are no
coordinates, or they say nothing, it is a direction of the normal's own (Duff et al. 2017) with s = +1.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.scene.topology import Bools, Floats, Ints

F32 = npt.NDArray[np.float32]

DEGENERATE = 1e-6  # of the lengths of two sides in the picture: less area has no orientation
FAINT = 1e-3  # of what corners add up to that all say the same: less is no direction


def arbitrary_tangents(normals: npt.ArrayLike) -> F32:
    """(V, 4) tangents of unit normals (V, 3), those of `kernels.radiance.frame`."""
    x, y, z = np.asarray(normals, np.float64).T
    sign = np.where(z >= 0, 1.0, -1.0)
    a = -1.0 / (sign + z)
    made = np.stack([1.0 + sign * x * x * a, sign * x * y * a, -sign * x, np.ones_like(x)], axis=1)
    return made.astype(np.float32)


def orientation(uvs: Floats) -> Ints:
    """(F,) which way round triangles (F, 3, 2) lie in the picture: +1, −1, or 0 without an area."""
    one, other = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    area = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    sides = np.sqrt((one * one).sum(axis=1) * (other * other).sum(axis=1))
    return np.where(np.abs(area) > DEGENERATE * sides, np.sign(area), 0).astype(np.int64)


def mirrored(group: Ints, hand: Ints) -> Bools:
    """(C,) corners that must leave their group: they lie mirrored and others of it do not.

    hand (C,): `orientation` of a corner's face, turned with its side.
    """
    count = int(group.max(initial=-1)) + 1
    straight = np.bincount(group[hand > 0], minlength=count) > 0
    return np.asarray((hand < 0) & straight[group])


def vertex_tangents(
    points: Floats, corners: Ints, vertices: Ints, uvs: Floats, side: Ints, normals: Floats
) -> F32:
    """(V, 4) tangents, unit and perpendicular, of vertices with unit normals (V, 3) and uvs (V, 2).

    corners (F, 3) into points, vertices (F, 3) likewise into the vertices, side (F,) +1 or −1: faces seen
    from behind come with their back's vertices.
    """
    made = arbitrary_tangents(normals)
    picture = uvs[vertices]
    hand = orientation(picture)
    known = np.flatnonzero(hand)
    if not len(known):
        return made
    place, picture, vertices = points[corners[known]], picture[known], vertices[known]
    ahead, across = place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]
    one, other = picture[:, 1] - picture[:, 0], picture[:, 2] - picture[:, 0]
    along = (ahead * other[:, 1:] - across * one[:, 1:]) * hand[known, None]
    hand = hand[known] * side[known]
    doubled = np.linalg.norm(np.cross(ahead, across), axis=1)
    total, sense = np.zeros((len(normals), 3)), np.zeros(len(normals))
    for k in range(3):
        vertex = vertices[:, k]
        forth, back = place[:, (k + 1) % 3] - place[:, k], place[:, (k + 2) % 3] - place[:, k]
        angle = np.arctan2(doubled, (forth * back).sum(axis=1))
        flat = perpendicular(along, normals[vertex])
        for c in range(3):
            total[:, c] += np.bincount(vertex, angle * flat[:, c], minlength=len(total))
        sense += np.bincount(vertex, angle * hand, minlength=len(total))
    length = np.linalg.norm(total, axis=1)
    sure = np.flatnonzero((length > FAINT * np.abs(sense)) & (sense != 0))
    made[sure, :3] = total[sure] / length[sure, None]
    made[sure, 3] = np.sign(sense[sure])
    return made


def perpendicular(along: Floats, normals: Floats) -> Floats:
    """(P, 3) unit parts of directions that lie in the planes of normals; zero where none does."""
    square = (normals * normals).sum(axis=1, keepdims=True)
    flat = along - (along * normals).sum(axis=1, keepdims=True) / np.maximum(square, 1e-30) * normals
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    sure = length > FAINT * np.linalg.norm(along, axis=1, keepdims=True)
    return np.asarray(np.where(sure, flat / np.where(sure, length, 1), 0.0))


__all__ = ["arbitrary_tangents", "mirrored", "orientation", "perpendicular", "vertex_tangents"]
