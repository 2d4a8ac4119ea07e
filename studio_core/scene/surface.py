"""A source mesh made fit to be shaded: welded, oriented, without degenerate faces, doubles, T-junctions."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.scene.geometry import Geometry
from studio_core.scene.topology import (
    Bools,
    Edges,
    Floats,
    Ints,
    components,
    edges,
    forward,
    partners,
    t_junctions,
    tolerance,
    weld,
)

FLAT = 4.0  # faces lower, and T-junctions nearer, than this many welding tolerances
REPAIR_ROUNDS = 4
CAVITY_WORK = 10_000_000  # parts times faces
NO_VOLUME = 1e-4  # |volume| / area^1.5 of a closed part that is a folded sheet (sphere: 0.094)


@dataclass(frozen=True, eq=False)
class Surface:
    """Welded faces with what their corners carry, seen from the front and from behind.

    points (W, 3) own frame; faces (F, 3) into points, counter-clockwise from the front; source (F,) index
    into the geometry's faces. Corner arrays (F, 3, …) `normals` (zeros where the file has none) and `uvs`,
    with `slots` (F,), are the front's; `back_*` are what is seen from behind (a double of opposite winding
    in the file has a material of its own), their normals pointing to the back. partner (3F,) the half-edge
    across each half-edge or -1. two_sided (F,) whether the face can be seen from behind.
    """

    points: Floats
    faces: Ints
    source: Ints
    normals: Floats
    uvs: Floats
    slots: Ints
    back_normals: Floats
    back_uvs: Floats
    back_slots: Ints
    partner: Ints
    two_sided: Bools
    near: float

    def pick(self, keep: npt.NDArray[np.bool_] | Ints) -> Surface:
        """The chosen faces; partners are left unknown."""
        per_face = ("faces", "source", "normals", "uvs", "slots", "back_normals", "back_uvs", "back_slots")
        chosen = {name: getattr(self, name)[keep] for name in (*per_face, "two_sided")}
        return dataclasses.replace(self, partner=np.full(3 * len(chosen["faces"]), -1, np.int64), **chosen)

    def flip(self, turned: Bools) -> Surface:
        """Winding and sides exchanged where `turned`."""

        def corners(array: npt.NDArray[Any], other: npt.NDArray[Any]) -> npt.NDArray[Any]:
            made = array.copy()
            made[turned] = other[turned][:, [0, 2, 1]]
            return made

        return dataclasses.replace(
            self,
            faces=corners(self.faces, self.faces),
            normals=corners(self.normals, self.back_normals),
            back_normals=corners(self.back_normals, self.normals),
            uvs=corners(self.uvs, self.back_uvs),
            back_uvs=corners(self.back_uvs, self.uvs),
            slots=np.where(turned, self.back_slots, self.slots),
            back_slots=np.where(turned, self.slots, self.back_slots),
        )

    def doubled(self) -> Floats:
        """(F, 3) normal of each face times twice its area."""
        a, b, c = (self.points[self.faces[:, k]] for k in range(3))
        return np.asarray(np.cross(b - a, c - a), np.float64)


def surface(geometry: Geometry) -> Surface:
    """The repaired surface of a mesh; the geometry stays as it is.

    Vertices within the tolerance are welded, degenerate faces and exact doubles dropped, border edges split
    at T-junctions. Each part whose winding can be made consistent is: closed ones outwards, others the way
    most of their area is wound. A face is one-sided only where its part is closed and was not inside-out in
    the file (an inside-out box may well be a room), unless it is the wall of a cavity in another closed part.
    """
    near = tolerance(geometry.positions[np.unique(geometry.faces)])
    points, index = weld(geometry.positions, near)
    corner = geometry.faces.astype(np.int64)
    shape = corner.shape
    normals = np.zeros((*shape, 3)) if geometry.normals is None else geometry.normals.astype(float)[corner]
    uvs = np.zeros((*shape, 2)) if geometry.uvs is None else geometry.uvs.astype(np.float64)[corner]
    slots = geometry.slots.astype(np.int64) if geometry.slots is not None else np.zeros(len(corner), np.int64)
    made = Surface(
        points=points,
        faces=index[corner],
        source=np.arange(len(corner)),
        normals=normals,
        uvs=uvs,
        slots=slots,
        back_normals=-normals,
        back_uvs=uvs,
        back_slots=slots,
        partner=np.full(3 * len(corner), -1, np.int64),
        two_sided=np.ones(len(corner), bool),
        near=near,
    )
    for _ in range(REPAIR_ROUNDS):
        made = _solid_faces(made)
        around = edges(made.faces)
        found = t_junctions(made.points, made.faces, around, FLAT * near)
        if not len(found[0]):
            break
        made = _split_borders(made, around, *found)
    return _oriented(_without_doubles(_solid_faces(made)))


def _solid_faces(made: Surface) -> Surface:
    """Without faces that name a point twice or are flatter than the tolerance."""
    f = made.faces
    sides = made.points[np.roll(f, -1, axis=1)] - made.points[f]
    longest = np.sqrt((sides * sides).sum(axis=2).max(axis=1, initial=0.0))
    height = np.linalg.norm(made.doubled(), axis=1) / np.maximum(longest, 1e-300)
    distinct = (f[:, 0] != f[:, 1]) & (f[:, 1] != f[:, 2]) & (f[:, 2] != f[:, 0])
    keep = distinct & (height > FLAT * made.near)
    return made if keep.all() else made.pick(keep)


def _split_borders(made: Surface, around: Edges, edge: Ints, point: Ints, where: Floats) -> Surface:
    """Every border edge split at the points found on it; the insertion nearest the middle goes first."""
    half = around.order[around.start[edge]]
    where = np.where(forward(made.faces)[half], where, 1 - where)
    face, side = np.divmod(half, 3)
    while len(face):
        order = np.lexsort((point, np.abs(where - 0.5), face))
        first = np.zeros(len(face), bool)
        first[order] = np.concatenate([[True], face[order][1:] != face[order][:-1]])
        cut, cut_side, cut_point, cut_where = face[first], side[first], point[first], where[first]
        count = len(made.faces)
        parent = np.concatenate([np.arange(count), cut])
        wide = made.pick(parent)
        rows = np.arange(len(cut))
        near_half, far_half = cut, count + rows  # corners (0, m, 2) and (m, 1, 2), edge 0 → 1 being cut
        one = (cut_side + 1) % 3
        for array, old in _corner_arrays(wide, made):
            middle = _between(old[cut, cut_side], old[cut, one], cut_where)
            array[near_half, one] = middle
            array[far_half, cut_side] = middle
        wide.faces[near_half, one] = cut_point
        wide.faces[far_half, cut_side] = cut_point
        made = wide
        cut_of = np.full(count, -1)
        cut_of[cut] = rows
        row = cut_of[face[~first]]
        face, side, point, where = face[~first], side[~first], point[~first], where[~first]
        turn = (side - cut_side[row]) % 3
        share = cut_where[row]
        beyond = (turn == 1) | ((turn == 0) & (where > share))
        stretched = np.where(where < share, where / share, (where - share) / (1 - share))
        where = np.where(turn == 0, stretched, where)
        face = np.where(beyond, count + row, face)
    return made


def _corner_arrays(new: Surface, old: Surface) -> list[tuple[Floats, Floats]]:
    names = ("normals", "uvs", "back_normals", "back_uvs")
    return [(getattr(new, name), getattr(old, name)) for name in names]


def _between(a: Floats, b: Floats, share: Floats) -> Floats:
    """The value at `share` of the way from a to b."""
    return np.asarray(a + share[:, None] * (b - a))


def _without_doubles(made: Surface) -> Surface:
    """One face where several join the same points; one of opposite winding becomes the other's back.

    Doubles of opposite winding that both belong to closed parts are contacts of two solids and stay.
    """
    f = made.faces
    if not len(f):
        return made
    first = f.argmin(axis=1)
    rolled = np.take_along_axis(f, (first[:, None] + np.arange(3)) % 3, axis=1)
    key = np.unique(np.sort(f, axis=1), axis=0, return_inverse=True)[1].reshape(-1)
    turned = rolled[:, 1] > rolled[:, 2]
    once = np.sort(np.unique(2 * key + turned, return_index=True)[1])
    made, key = made.pick(once), key[once]
    paired = np.flatnonzero(np.bincount(key)[key] == 2)
    if not len(paired):
        return made
    both = paired[np.argsort(key[paired], kind="stable")].reshape(-1, 2)
    solid = _solid(made)
    both = both[~solid[both].all(axis=1)]
    # The face of a closed part stays in front, otherwise the one that comes first in the file.
    front = np.where(solid[both[:, 1]], both[:, 1], both[:, 0])
    back = both.sum(axis=1) - front
    match = (made.faces[front][:, :, None] == made.faces[back][:, None, :]).argmax(axis=2)
    for name in ("normals", "uvs"):
        array = getattr(made, f"back_{name}").copy()
        array[front] = np.take_along_axis(getattr(made, name)[back], match[:, :, None], axis=1)
        made = dataclasses.replace(made, **{f"back_{name}": array})
    slots = made.back_slots.copy()
    slots[front] = made.slots[back]
    keep = np.ones(len(made.faces), bool)
    keep[back] = False
    return dataclasses.replace(made, back_slots=slots).pick(keep)


def _solid(made: Surface) -> Bools:
    """(F,) whether a face's part is closed, consistently wound and holds volume, outwards."""
    part, across = _parts(made)
    whole = _closed(made, part, across)
    return np.asarray(whole & (_volume(made, part) > NO_VOLUME), bool)


def _parts(made: Surface) -> tuple[Ints, Ints]:
    """The part of each face, joined across paired edges, and the partners."""
    across = partners(made.points, made.faces, edges(made.faces))
    here = np.flatnonzero(across > np.arange(len(across)))
    return components(len(made.faces), here // 3, across[here] // 3), across


def _closed(made: Surface, part: Ints, across: Ints) -> Bools:
    """(F,) whether every edge of the face's part has a partner that runs the other way."""
    ahead = forward(made.faces)
    open_edge = (across < 0) | (ahead == ahead[across])
    wrong = np.bincount(np.repeat(part, 3), open_edge, minlength=len(part))
    return np.asarray(wrong[part] == 0, bool)


def _volume(made: Surface, part: Ints) -> Floats:
    """(F,) signed volume of each face's part over area^1.5, about the part's own mean."""
    doubled = made.doubled()
    count = len(part)
    centre = made.points[made.faces].mean(axis=1)
    number = np.maximum(np.bincount(part, minlength=count), 1)
    mean = np.stack([np.bincount(part, centre[:, k], minlength=count) / number for k in range(3)], axis=1)
    volume = np.bincount(part, ((centre - mean[part]) * doubled).sum(axis=1) / 6, minlength=count)
    area = np.bincount(part, np.linalg.norm(doubled, axis=1) / 2, minlength=count)
    return np.asarray((volume / np.maximum(area**1.5, 1e-300))[part])


def _oriented(made: Surface) -> Surface:
    """Winding made consistent in each part where that is possible, closed parts outwards; sides decided."""
    count = len(made.faces)
    if not count:
        return made
    part, across = _parts(made)
    here = np.flatnonzero(across > np.arange(len(across)))
    ahead = forward(made.faces)
    against = ahead[here] == ahead[across[here]]
    turned = np.zeros(count, bool)
    if against.any():
        # Two nodes a face, one for each winding: parts whose two copies stay apart can be oriented.
        a, b = here // 3, across[here] // 3
        low = components(
            2 * count,
            np.concatenate([a, a + count]),
            np.concatenate([b + count * against, b + count * ~against]),
        )
        twisted = low[:count] == low[count:]
        other = (low[:count] > low[count:]) & ~twisted
        area = np.linalg.norm(made.doubled(), axis=1)
        balance = np.bincount(part, np.where(other, -area, area), minlength=count)
        turned = np.where(twisted, False, other ^ (balance[part] < 0))
        made = made.flip(turned)
    closed = _closed(made, part, across) if not turned.any() else _closed(made, *_parts(made))
    volume = _volume(made, part)
    inside_out = closed & (volume < -NO_VOLUME)
    hollow = _cavities(made, part, inside_out, closed & (volume > NO_VOLUME))
    made = made.flip(inside_out & ~hollow)
    two_sided = ~closed | ((volume < NO_VOLUME) & ~hollow)  # other inside-out parts included
    across = partners(made.points, made.faces, edges(made.faces))
    return dataclasses.replace(made, partner=across, two_sided=two_sided)


def _cavities(made: Surface, part: Ints, inside_out: Bools, solid: Bools) -> Bools:
    """(F,) whether a face's inside-out part is the wall of a cavity: a solid part goes all round it.

    Not looked for where that would take long, as among thousands of leaves.
    """
    found = np.zeros(len(part), bool)
    hollow = np.unique(part[inside_out])
    if not len(hollow) or not solid.any() or len(hollow) * int(solid.sum()) > CAVITY_WORK:
        return found
    order = np.argsort(part, kind="stable")
    numbers, first = np.unique(part[order], return_index=True)
    corners = made.points[made.faces[order]]
    low = np.minimum.reduceat(corners.min(axis=1), first)
    high = np.maximum.reduceat(corners.max(axis=1), first)
    rows = np.split(order, first[1:])
    solid_part = solid[order[first]]
    for k in np.flatnonzero(np.isin(numbers, hollow)):
        round_it = solid_part & (low < low[k]).all(axis=1) & (high[k] < high).all(axis=1)
        point = made.points[made.faces[rows[k][0], 0]]
        if any(_turns(made, rows[other], point) > 0.5 for other in np.flatnonzero(round_it)):
            found[rows[k]] = True
    return found


def _turns(made: Surface, row: Ints, point: Floats) -> float:
    """How often some faces go round a point (van Oosterom 1983)."""
    a, b, c = (made.points[made.faces[row, k]] - point for k in range(3))
    far, wide, high = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    triple = (a * np.cross(b, c)).sum(axis=1)
    below = far * wide * high + (a * b).sum(axis=1) * high
    below += (b * c).sum(axis=1) * far + (c * a).sum(axis=1) * wide
    return float(2 * np.arctan2(triple, below).sum() / (4 * np.pi))
