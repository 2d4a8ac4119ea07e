"""Diffuse light in an empty box-shaped room: exact form factors, bounced until nothing is left.

Every wall is a grid of square-ish patches. All patches see each other (a box is convex), so the only
approximation is that a patch's irradiance is that of its centre. Contour form of Lambert's formula as in
Cohen and Wallace, "Radiosity and Realistic Image Synthesis", 1993, section 4.2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .mesh import Array, Point


@dataclass(frozen=True)
class Wall:
    """One side of the box: its plane `axis` = `at`, the two axes it spans, and its grid of patches."""

    axis: int
    at: float
    inward: float
    spans: tuple[int, int]
    low: tuple[float, float]
    high: tuple[float, float]
    cells: tuple[int, int]

    @property
    def normal(self) -> Array:
        """Unit normal, into the room."""
        made = np.zeros(3)
        made[self.axis] = self.inward
        return made

    def centres(self) -> Array:
        """(cells, 2) patch centres on the wall, second axis fastest."""
        lines = [
            lo + (np.arange(n) + 0.5) / n * (hi - lo)
            for lo, hi, n in zip(self.low, self.high, self.cells, strict=True)
        ]
        return np.stack(np.meshgrid(*lines, indexing="ij"), -1).reshape(-1, 2)

    def points(self, flat: Array) -> Array:
        """(N, 3) of coordinates (N, 2) on the wall."""
        made = np.full((len(flat), 3), float(self.at))
        made[:, list(self.spans)] = flat
        return made

    def corners(self) -> Array:
        """(cells, 4, 3) corners of the patches, in order around."""
        half = [(hi - lo) / n / 2 for lo, hi, n in zip(self.low, self.high, self.cells, strict=True)]
        centres = self.centres()
        around = [(-1, -1), (1, -1), (1, 1), (-1, 1)]
        return np.stack([self.points(centres + np.array([u * half[0], v * half[1]])) for u, v in around], 1)

    def smooth(self, values: Array, flat: Array) -> Array:
        """Values of patches (cells, C) at coordinates (N, 2): cubic (Catmull–Rom) interpolation."""
        grid = values.reshape(*self.cells, -1)
        index, weight = [], []
        for k in range(2):
            t = (flat[:, k] - self.low[k]) / (self.high[k] - self.low[k]) * self.cells[k] - 0.5
            t = np.clip(t, -0.5, self.cells[k] - 0.5)
            base = np.floor(t).astype(np.int64)
            f = t - base
            index.append([np.clip(base + o, 0, self.cells[k] - 1) for o in (-1, 0, 1, 2)])
            weight.append(
                [
                    -0.5 * f + f**2 - 0.5 * f**3,
                    1 - 2.5 * f**2 + 1.5 * f**3,
                    0.5 * f + 2 * f**2 - 1.5 * f**3,
                    -0.5 * f**2 + 0.5 * f**3,
                ]
            )
        made = np.zeros((len(flat), grid.shape[-1]))
        for i, u in zip(index[0], weight[0], strict=True):
            for j, v in zip(index[1], weight[1], strict=True):
                made += grid[i, j] * (u * v)[:, None]
        return np.maximum(made, 0.0)


def walls(low: Point, high: Point, patch: float) -> list[Wall]:
    """The six sides of a box with patches of about `patch` metres: x low, x high, y low, … z high."""
    made = []
    for axis in range(3):
        spans = ((1, 2), (0, 2), (0, 1))[axis]
        lo, hi = tuple(low[k] for k in spans), tuple(high[k] for k in spans)
        cells = tuple(max(1, round((b - a) / patch)) for a, b in zip(lo, hi, strict=True))
        for at, inward in ((low[axis], 1.0), (high[axis], -1.0)):
            made.append(Wall(axis, at, inward, spans, lo, hi, cells))  # type: ignore[arg-type]
    return made


def form_factors(points: Array, normal: Array, corners: Array) -> Array:
    """(N, M) share of what points (N, 3) with one normal see that polygons (M, K, 3) fill, cosine-weighted.

    The polygons lie on or above the points' horizon.
    """
    total = np.zeros((len(points), len(corners)))
    rays = corners[None] - points[:, None, None]
    n = normal
    for k in range(corners.shape[1]):
        a, b = rays[:, :, k], rays[:, :, (k + 1) % corners.shape[1]]
        x = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
        y = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
        z = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
        sine = np.sqrt(x * x + y * y + z * z)
        cosine = a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]
        total += np.arctan2(sine, cosine) * (n[0] * x + n[1] * y + n[2] * z) / np.maximum(sine, 1e-12)
    return np.abs(total) / (2 * np.pi)


def bounced(sides: list[Wall], direct: list[Array], albedo: list[Array], bounces: int = 40) -> list[Array]:
    """Total irradiance (cells, 3) of every wall's patches from their direct irradiance and albedo."""
    sizes = [len(d) for d in direct]
    corners = np.concatenate([side.corners() for side in sides])
    factors = np.concatenate(
        [form_factors(side.points(side.centres()), side.normal, corners) for side in sides]
    )
    ends = np.cumsum(sizes)
    for start, end in zip(ends - sizes, ends, strict=True):
        factors[start:end, start:end] = 0.0  # a wall does not see itself
    factors /= factors.sum(axis=1, keepdims=True)
    first, reflects = np.concatenate(direct), np.concatenate(albedo)
    total = first
    for _ in range(bounces):
        total = first + factors @ (reflects * total)
    return np.split(total, ends[:-1])
