"""Shading vertices of a surface: where corners share one, where creases, seams and sides split them."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np

from studio_core.scene.surface import Surface
from studio_core.scene.tangents import mirrored, orientation
from studio_core.scene.topology import Bools, Floats, Ints, components, ranks

NONE = -1
SAME_NORMAL = math.cos(math.radians(1.0))
SAME_UV = 1e-5
FACING = 0.02  # least cosine between a vertex normal and the normals of its faces


@dataclass(frozen=True, eq=False)
class Fan:
    """Shading vertices and the faces between them, in float64 and welded indices.

    points (W, 3); weld (V,) a vertex' point; normals (V, 3) unit, to the vertex' own side; uvs (V, 2);
    slot (V,); side (V,) +1 or -1. faces (F, 3) and back (F, 3) into the vertices, corner by corner the same
    points; back is -1 where a face is not seen from behind. source (F,), slots (F,).
    """

    points: Floats
    weld: Ints
    normals: Floats
    uvs: Floats
    slot: Ints
    side: Ints
    faces: Ints
    back: Ints
    source: Ints
    slots: Ints

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(int(getattr(self, field.name).nbytes) for field in fields(self))


def fan(surface: Surface, crease_degrees: float) -> Fan:
    """The shading vertices of a surface.

    Corners around a point share a vertex across every edge that is smooth there: same material slot, same
    uv, and file normals within 1 degree, or, without file normals, faces that meet at less than the crease
    angle. File normals that look to the other side are turned to the face's. Where the picture turns back
    as a mirror image, each half has a vertex of the same normal: their tangents run against each other.
    """
    count = len(surface.faces)
    rear = np.flatnonzero(surface.two_sided)
    row_of = np.full((2, count), NONE, np.int64)  # sided face of a face, seen from the front and from behind
    row_of[0] = np.arange(count)
    row_of[1, rear] = count + np.arange(len(rear))
    flat = surface.doubled()
    doubled = np.linalg.norm(flat, axis=1)
    flat = flat / np.maximum(doubled, 1e-300)[:, None]

    face = np.concatenate([np.arange(count), rear])
    side = np.repeat([1, -1], [count, len(rear)])
    flat = flat[face] * side[:, None]
    corners = np.concatenate([surface.faces, surface.faces[rear]])
    uvs = np.concatenate([surface.uvs, surface.back_uvs[rear]])
    slots = np.concatenate([surface.slots, surface.back_slots[rear]])
    normals = _turned(np.concatenate([surface.normals, surface.back_normals[rear]]), flat)
    given = bool(surface.normals.any())

    a, b = _links(surface, row_of)
    one, other = a // 3, b // 3
    same = (slots[one] == slots[other]) & _close(uvs.reshape(-1, 2)[a], uvs.reshape(-1, 2)[b])
    if given:
        n = normals.reshape(-1, 3)
        same &= (n[a] * n[b]).sum(axis=1) >= SAME_NORMAL
    else:
        same &= (flat[one] * flat[other]).sum(axis=1) > math.cos(math.radians(crease_degrees))
    group = components(3 * len(corners), a[same], b[same])
    weight = np.ones(3 * len(corners)) if given else _corner_weights(surface.points, corners, doubled[face])
    group, mean = _means(group, normals.reshape(-1, 3), weight)
    group, mean = _split_hidden(group, mean, normals, flat)
    group, mean = _split_mirrored(group, mean, np.repeat(orientation(uvs) * side, 3))

    first, vertex = ranks(group)
    triples = vertex.reshape(-1, 3)
    back = np.full((count, 3), NONE, np.int64)
    back[rear] = triples[count:]
    return Fan(
        points=surface.points,
        weld=corners.reshape(-1)[first],
        normals=mean[group[first]],
        uvs=uvs.reshape(-1, 2)[first],
        slot=slots[first // 3],
        side=side[first // 3],
        faces=triples[:count],
        back=back,
        source=surface.source,
        slots=surface.slots,
    )


def _links(surface: Surface, row_of: Ints) -> tuple[Ints, Ints]:
    """Corners of sided faces (3 · row + k) at either end of every paired edge, on the same side of it."""
    half = np.flatnonzero(surface.partner > np.arange(len(surface.partner)))
    across = surface.partner[half]
    f, k = np.divmod(half, 3)
    g, m = np.divmod(across, 3)
    turned = surface.faces[f, k] == surface.faces[g, m]  # wound against each other: front continues as back
    ends = ((k, np.where(turned, m, (m + 1) % 3)), ((k + 1) % 3, np.where(turned, (m + 1) % 3, m)))
    a: list[Ints] = []
    b: list[Ints] = []
    for rear in (0, 1):
        one, other = row_of[rear][f], row_of[np.where(turned, 1 - rear, rear), g]
        both = (one != NONE) & (other != NONE)
        for here, there in ends:
            a.append((3 * one + here)[both])
            b.append((3 * other + there)[both])
    return np.concatenate(a), np.concatenate(b)


def _close(a: Floats, b: Floats) -> Bools:
    size = np.maximum(np.maximum(np.abs(a), np.abs(b)), 1.0)
    return np.asarray((np.abs(a - b) <= SAME_UV * size).all(axis=1), bool)


def _turned(normals: Floats, flat: Floats) -> Floats:
    """Unit corner normals (S, 3, 3) that look to their face's side; the face's own where there is none."""
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    unit = np.where(length > 1e-6, normals / np.maximum(length, 1e-6), flat[:, None])
    along = (unit * flat[:, None]).sum(axis=2)
    against = along.sum(axis=1) < 0  # the file's winding and normals disagree: turn all three
    unit[against] *= -1
    along[against] *= -1
    # A single corner that still looks away is mirrored at the face: continuous where it only just does.
    return np.asarray(unit - 2 * np.minimum(along, 0)[:, :, None] * flat[:, None])


def _corner_weights(points: Floats, corners: Ints, area: Floats) -> Floats:
    """(3S,) angle at the corner times the face's area: large flat faces keep their normal beside bevels."""
    p = points[corners]
    ahead, behind = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
    angle = np.arctan2(np.linalg.norm(np.cross(ahead, behind), axis=2), (ahead * behind).sum(axis=2))
    # Never zero, so that a vertex of needles alone has a normal too.
    return np.asarray(((angle + 1e-9) * area[:, None]).reshape(-1))


def _means(group: Ints, normals: Floats, weight: Floats) -> tuple[Ints, Floats]:
    """Groups numbered from 0 and the unit weighted mean normal of each."""
    first, number = ranks(group)
    total = np.stack(
        [np.bincount(number, weight * normals[:, k], minlength=len(first)) for k in range(3)], axis=1
    ).reshape(-1, 3)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    scale = np.bincount(number, weight, minlength=len(first))[:, None]
    mean = np.where(length > 1e-3 * scale, total / np.maximum(length, 1e-300), normals[first])
    return number, mean


def _split_hidden(group: Ints, mean: Floats, normals: Floats, flat: Floats) -> tuple[Ints, Floats]:
    """Corners that look away from their group's normal get a vertex of their own, normal to their face."""
    face_normal = np.repeat(flat, 3, axis=0)
    hidden = np.flatnonzero((mean[group] * face_normal).sum(axis=1) < FACING)
    if not len(hidden):
        return group, mean
    own = normals.reshape(-1, 3)[hidden]
    facing = (own * face_normal[hidden]).sum(axis=1) >= FACING
    group = group.copy()
    group[hidden] = len(mean) + np.arange(len(hidden))
    return group, np.concatenate([mean, np.where(facing[:, None], own, face_normal[hidden])])


def _split_mirrored(group: Ints, mean: Floats, hand: Ints) -> tuple[Ints, Floats]:
    """Corners that lie mirrored in the picture leave groups of others that do not."""
    leaving = np.flatnonzero(mirrored(group, hand))
    if not len(leaving):
        return group, mean
    left, number = np.unique(group[leaving], return_inverse=True)
    group = group.copy()
    group[leaving] = len(mean) + number.reshape(-1)
    return group, np.concatenate([mean, mean[left]])
