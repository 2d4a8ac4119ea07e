"""Patterns in metres: how long one unit of a surface's texture coordinates is, and pictures laid by size.

On a face with corners P and coordinates (u, v), ∂P/∂u and ∂P/∂v say how many metres one unit is. A material
may lie on objects of different density; then one size is that of the middle (the median by area), and the
others have another.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np
import numpy.typing as npt

from studio_core.scene.geometry import Geometry, Texture
from studio_core.scene.nodes import MaterialId, MeshObject, Scene

F64 = npt.NDArray[np.float64]

MOST_FACES = 20_000
"""Of a slot: more are sampled evenly."""
_Where = tuple[tuple[Geometry, int, float], ...]
LEAST_AREA = 1e-12  # of a face in the picture, of the lengths of its sides there: less says nothing
EVEN = 1.05  # between the ends of a range that is one size


@dataclass(frozen=True)
class UnitLengths:
    """Metres of one unit of u and of v: the median by area, and the 5th and 95th percentile of each."""

    u: float
    v: float
    u_range: tuple[float, float]
    v_range: tuple[float, float]

    @property
    def even(self) -> bool:
        """Whether a pattern has one size on all of the surface."""
        return all(high <= EVEN * low for low, high in (self.u_range, self.v_range))


PLAIN = UnitLengths(1.0, 1.0, (1.0, 1.0), (1.0, 1.0))
"""Where no surface says otherwise: a unit is a metre."""


@dataclass
class PatternRuler:
    """Finds `UnitLengths` of materials, and keeps what it found while meshes and their sizes stay."""

    _known: WeakKeyDictionary[Geometry, dict[int, F64]] = field(default_factory=WeakKeyDictionary)
    _last: dict[MaterialId, tuple[_Where, UnitLengths | None]] = field(default_factory=dict)

    def lengths(self, scene: Scene, material: MaterialId) -> UnitLengths | None:
        """On everything that has this material; None where nothing with texture coordinates has it."""
        where = tuple(
            (node.geometry, slot, scene.world(node.id).scale)
            for node in scene.of(MeshObject)
            if material in node.materials and node.geometry.uvs is not None
            for slot, own in enumerate(node.materials)
            if own == material
        )
        known = self._last.get(material)
        if known is None or known[0] != where:
            known = self._last[material] = where, self._found(where)
        return known[1]

    def _found(self, where: _Where) -> UnitLengths | None:
        found = []
        for geometry, slot, scale in where:
            of_mesh = self._known.setdefault(geometry, {})
            if slot not in of_mesh:
                of_mesh[slot] = face_lengths(geometry, slot)
            found.append(of_mesh[slot] * (scale, scale, scale * scale))
        every = np.concatenate(found) if found else np.zeros((0, 3))
        if not len(every):
            return None
        u, v = (_quantiles(every[:, axis], every[:, 2]) for axis in (0, 1))
        return UnitLengths(u[1], v[1], (u[0], u[2]), (v[0], v[2]))


def face_lengths(geometry: Geometry, slot: int) -> F64:
    """(F, 3) metres of one u, of one v, and area that stands for it, of the faces of a slot.

    Faces without an extent in space or in the picture are left out; of many, a part stands for all.
    """
    if geometry.uvs is None or geometry.slots is None:
        return np.zeros((0, 3))
    own = np.flatnonzero(geometry.slots == slot)
    step = max(-(-len(own) // MOST_FACES), 1)
    corners = geometry.faces[own[::step]]
    place = geometry.positions[corners].astype(np.float64)
    uvs = geometry.uvs[corners].astype(np.float64)
    one, other = place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]
    (u1, v1), (u2, v2) = (uvs[:, 1] - uvs[:, 0]).T, (uvs[:, 2] - uvs[:, 0]).T
    in_map = u1 * v2 - u2 * v1
    area = np.linalg.norm(np.cross(one, other), axis=1) / 2
    told = np.abs(in_map) > LEAST_AREA * (np.hypot(u1, v1) * np.hypot(u2, v2) + 1e-300)
    told &= area > 0
    one, other, in_map = one[told], other[told], in_map[told, None]
    u1, u2, v1, v2 = (side[told, None] for side in (u1, u2, v1, v2))
    along_u = np.linalg.norm((one * v2 - other * v1) / in_map, axis=1)
    along_v = np.linalg.norm((other * u1 - one * u2) / in_map, axis=1)
    return np.stack([along_u, along_v, area[told] * step], axis=1)


def _quantiles(values: F64, weights: F64) -> tuple[float, float, float]:
    order = np.argsort(values)
    upto = np.cumsum(weights[order])
    at = np.searchsorted(upto, np.array([0.05, 0.5, 0.95]) * upto[-1])
    low, middle, high = values[order[np.minimum(at, len(order) - 1)]].tolist()
    return low, middle, high


def pattern_size(texture: Texture, lengths: UnitLengths) -> tuple[float, float]:
    """Width and height of one picture on the surface, metres; infinite where it never repeats."""
    a, b, _, c, d, _ = texture.affine
    laid = np.array([[a / lengths.u, b / lengths.v], [c / lengths.u, d / lengths.v]])
    if abs(a * d - b * c) < 1e-30:
        return math.inf, math.inf
    width, height = np.linalg.norm(np.linalg.inv(laid), axis=0).tolist()
    return width, height


def with_size(texture: Texture, lengths: UnitLengths, size: tuple[float, float]) -> Texture:
    """The picture `size` metres wide and high, turned and mirrored as before, at the same origin."""
    aspect = lengths.v / lengths.u
    signs = [math.copysign(1.0, scale) for scale in texture.scale]
    if texture.aspect < 0:
        signs[1] = -signs[1]
    scale = (signs[0] * lengths.u / size[0], signs[1] * lengths.u / size[1])
    return dataclasses.replace(texture, scale=scale, aspect=aspect)


def with_rotation(texture: Texture, lengths: UnitLengths, degrees: float) -> Texture:
    """The picture turned to another angle, as large as before."""
    width, height = pattern_size(texture, lengths)
    turned = dataclasses.replace(texture, rotation=degrees)
    if not (math.isfinite(width) and math.isfinite(height)):
        return turned
    return with_size(turned, lengths, (width, height))


__all__ = [
    "PLAIN",
    "PatternRuler",
    "UnitLengths",
    "face_lengths",
    "pattern_size",
    "with_rotation",
    "with_size",
]
