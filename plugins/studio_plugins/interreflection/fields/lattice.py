"""Where an object's fields are sampled: concentric spheres about it, or layers along both sides of a plate.

Spheres (section 4.2, after Zhou et al. 2005): radii grow by equal factors from `NEAREST` to `FARTHEST` times
the radius of the object's bounding sphere; on each, places form a square of `cells` × `cells` that is folded
to an octahedron, whose nodes lie on the edges too, so that no interpolation leaves the square (20² places
are as many as the paper's kind of 6 · 8²). Places inside the object see nothing; they take what the next
sphere outward has in the same direction (`fill_blind`).

A plate is what is at most `FLAT` as thick as it is wide: floor, wall, rug. A sphere about it would have few
places near it. Layers lie above and below (only above, where all of it faces one way) at heights
that grow by equal factors, each a grid over the plate and a margin around it.

Nearer than the first sphere or layer the first is taken, in the same direction or at the same foot. Beyond
the last, light arrives as at the outermost place in the same direction from the centre, less by the square
of the distances. What is interpolated is radiance times 1 + d²/R² (d from the centre, R the radius): far
away this is constant, near the object the radiance itself is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.scene.shading_mesh import ShadingMesh

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

NEAREST, FARTHEST = 0.25, 8.0
"""Radii of the first and last sphere, in radii of the object."""
LOWEST, HIGHEST = 0.02, 2.5
"""Heights of the first and last layer over a plate, in halves of its length."""
FLAT = 0.1
MARGIN = 1.2
"""How far layers reach, in halves of the plate's sides."""
NEIGHBOURS = 8


@dataclass(frozen=True, eq=False)
class Lattice:
    """Places about an object in its own frame.

    axes (3, 3): rows are the axes of the lattice's frame about `centre` (3,); a plate's third is its normal.
    numbers: 1 for a plate, nodes of the first and second side, layers of one side, a plate's sides. lengths:
    R, first and last radius or height, a plate's half sides (with margin) and half thickness.
    """

    centre: F64
    axes: F64
    numbers: I64
    lengths: F64

    @property
    def flat(self) -> bool:
        """Whether it is a plate's."""
        return bool(self.numbers[0])

    @property
    def radius(self) -> float:
        """R."""
        return float(self.lengths[0])

    @property
    def layer_size(self) -> int:
        """Places of one sphere or layer."""
        return int(self.numbers[1] * self.numbers[2])

    @property
    def sides(self) -> int:
        """2 where layers lie on both sides."""
        return int(self.numbers[4])

    def __len__(self) -> int:
        return self.layer_size * int(self.numbers[3]) * self.sides

    def places(self) -> F64:
        """(P, 3) in the lattice's frame: by side (upper first), layer, second number, first number."""
        _, across, along, layers, sides = self.numbers.tolist()
        _, first, last, *_ = self.lengths.tolist()
        steps = first * (last / first) ** (np.arange(layers) / max(layers - 1, 1))
        s = np.linspace(-1.0, 1.0, across)
        t = np.linspace(-1.0, 1.0, along)
        b, a = np.meshgrid(t, s, indexing="ij")
        if not self.flat:
            return np.concatenate([radius * _unfolded(a.ravel(), b.ravel()) for radius in steps])
        flat = np.stack([a.ravel() * self.lengths[3], b.ravel() * self.lengths[4]], axis=1)
        upper = steps + self.lengths[5]
        heights = np.concatenate([upper, -upper][:sides])
        return np.concatenate([np.column_stack([flat, np.full(len(flat), height)]) for height in heights])

    def points(self) -> F64:
        """(P, 3) in the object's frame."""
        return self.centre + self.places() @ self.axes

    def grown(self) -> F64:
        """(P,) 1 + d²/R² of each place: what fields are multiplied with to be kept."""
        return np.asarray(1 + (self.places() ** 2).sum(axis=1) / self.radius**2)


def lattice_of(mesh: ShadingMesh, shells: int, cells: int, some: I64 | None = None) -> Lattice:
    """For an object, or `some` of its vertices: `shells` spheres of `cells`² places, or a plate's layers."""
    own = slice(None) if some is None else some
    points = mesh.positions[own].astype(np.float64)
    weight = mesh.area[own].astype(np.float64) + 1e-30
    middle = np.average(points, axis=0, weights=weight)
    spread = ((points - middle) * weight[:, None]).T @ (points - middle)
    axes = np.linalg.eigh(spread / weight.sum())[1].T[::-1].copy()  # longest first
    axes[2] = np.cross(axes[0], axes[1])
    facing = mesh.normals[own] @ axes[2]
    one_way = bool((facing > 0.5).all() or (facing < -0.5).all())
    if one_way and facing[0] < 0:
        axes[1:] *= -1
    along = (points - middle) @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    half = np.maximum((high - low) / 2, 0.0)
    if half[2] <= FLAT * half[1] and half[1] > 0:
        centre = middle + ((low + high) / 2) @ axes
        size = float(half[0])
        ratio = float(np.clip(half[0] / half[1], 1.0, 4.0))
        across = max(round(cells * math.sqrt(ratio)), 2)
        other = max(round(cells * cells / across), 2)
        layers = shells if one_way else max(shells // 2, 2)
        numbers = np.array([1, across, other, layers, 1 if one_way else 2], np.int64)
        lengths = np.array([size, LOWEST * size, HIGHEST * size, *(MARGIN * half[:2]), half[2]])
        return Lattice(centre, axes, numbers, lengths)
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    radius = max(float(np.linalg.norm(points - centre, axis=1).max()), 1e-9)
    numbers = np.array([0, cells, cells, shells, 1], np.int64)
    lengths = np.array([radius, NEAREST * radius, FARTHEST * radius, 0.0, 0.0, 0.0])
    return Lattice(centre, np.eye(3), numbers, lengths)


def fill_blind(lattice: Lattice, blind: npt.NDArray[np.bool_], values: F32) -> None:
    """Gives places that see nothing (P,) what the next one outward has; values (J, P, …), not yet grown."""
    size, layers = lattice.layer_size, int(lattice.numbers[3])
    for side in range(lattice.sides):
        for layer in range(layers - 2, -1, -1):
            start = (side * layers + layer) * size
            lost = start + np.flatnonzero(blind[start : start + size])
            values[:, lost] = values[:, lost + size]


def _unfolded(s: F64, t: F64) -> F64:
    """(N, 3) unit directions of places in the square, −1 … 1."""
    z = 1 - np.abs(s) - np.abs(t)
    x = np.where(z < 0, (1 - np.abs(t)) * np.where(s < 0, -1.0, 1.0), s)
    y = np.where(z < 0, (1 - np.abs(s)) * np.where(t < 0, -1.0, 1.0), t)
    made = np.stack([x, y, z], axis=1)
    return np.asarray(made / np.linalg.norm(made, axis=1, keepdims=True))


@kernel
def neighbours(x: float, y: float, z: float, numbers: I64, lengths: F64, index: I64, weight: F64) -> None:
    """Fills index and weight (8,): light at a point of the lattice's frame is Σ weight · grown field."""
    across, along, layers = numbers[1], numbers[2], numbers[3]
    size = lengths[0]
    first, last = lengths[1], lengths[2]
    scale, start = 1.0, 0
    if numbers[0] == 1:
        thick = lengths[5]
        out = max(max(abs(x) / lengths[3], abs(y) / lengths[4]), abs(z) / (last + thick))
        if out > 1.0:
            scale = 1.0 / (out * out)
            x, y, z = x / out, y / out, z / out
        if z < 0.0:
            if numbers[4] == 2:
                start = layers * along * across
            elif z < -first - thick:
                scale = 0.0  # behind what faces one way
        far = min(max(abs(z) - thick, first), last)
        s, t = x / lengths[3], y / lengths[4]
        distance2 = x * x + y * y + (far + thick) * (far + thick)
    else:
        far = math.sqrt(x * x + y * y + z * z)
        if far > last:
            scale = (last / far) * (last / far)
        total = abs(x) + abs(y) + abs(z)
        if total > 0.0:
            s, t = x / total, y / total
            if z < 0.0:
                s, t = (
                    (1.0 - abs(t)) * (-1.0 if s < 0.0 else 1.0),
                    (1.0 - abs(s)) * (-1.0 if t < 0.0 else 1.0),
                )
        else:
            s, t = 0.0, 0.0
        far = min(max(far, first), last)
        distance2 = far * far
    scale /= 1.0 + distance2 / (size * size)
    up = math.log(far / first) / math.log(last / first) * (layers - 1)
    a = min(max((s + 1.0) * 0.5 * (across - 1), 0.0), across - 1.0)
    b = min(max((t + 1.0) * 0.5 * (along - 1), 0.0), along - 1.0)
    layer, column, row = min(int(up), layers - 2), min(int(a), across - 2), min(int(b), along - 2)
    f, g, h = up - layer, a - column, b - row
    for corner in range(NEIGHBOURS):
        c, r, k = corner & 1, (corner >> 1) & 1, corner >> 2
        index[corner] = start + ((layer + k) * along + row + r) * across + column + c
        share = (g if c else 1.0 - g) * (h if r else 1.0 - h) * (f if k else 1.0 - f)
        weight[corner] = share * scale


__all__ = ["NEIGHBOURS", "Lattice", "fill_blind", "lattice_of", "neighbours"]
