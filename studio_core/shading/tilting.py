"""Light sums at leaning normals, by brute force: the same points, with the same light let through, turned."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from studio_core.kernels.tilted import FIELDS, LEANS, lean_weights, leaning_frame
from studio_core.scene.tangents import perpendicular
from studio_core.shading.artifacts import ChosenPoints, LayerRadiance, ShadingPoints, Shapes

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]


def turned_points(points: ShadingPoints, normals: F32) -> ChosenPoints:
    """The points with shading normals (P, 3) of their own, unit and in the points' frames; else unchanged."""
    up, along = points.normals.astype(np.float64), points.tangents[:, :3].astype(np.float64)
    across = np.cross(up, along) * points.tangents[:, 3:]
    x, y, z = normals.astype(np.float64).T[:, :, None]
    made = x * along + y * across + z * up
    made /= np.maximum(np.linalg.norm(made, axis=1, keepdims=True), 1e-30)
    tangents = np.concatenate([perpendicular(along, made), points.tangents[:, 3:]], axis=1)
    return ChosenPoints(
        points.origin,
        points.positions,
        made.astype(np.float32),
        tangents.astype(np.float32),
        points.geometric,
        points.inset,
        points.material,
    )


@dataclasses.dataclass(frozen=True)
class Facing:
    """Points that look another way, and where their light sums go: terms (V, T, 3), irradiance (V, 3)."""

    mesh: ShadingPoints
    terms: F32
    irradiance: F32
    leaning: npt.NDArray[np.bool_] | None = None

    def some(self, block: I64) -> I64 | slice:
        """Which points of a block it is for."""
        return slice(None) if self.leaning is None else np.flatnonzero(self.leaning[block])


def facings(mesh: ShadingPoints, shapes: Shapes, layer: LayerRadiance) -> list[Facing]:
    """The points themselves, for `layer`, then those of materials with normal maps, leaning each way."""
    made = [Facing(mesh, layer.terms, layer.irradiance)]
    if shapes.tilt is None or layer.tilts is None:
        return made
    slope = np.append(shapes.tilt, np.float32(0))[shapes.rows(mesh)]
    frame = np.empty((3, 3))
    for number in range(LEANS):
        normals = np.zeros((len(slope), 3), np.float32)
        for steep in np.unique(slope).tolist():
            leaning_frame(number, steep, frame)
            normals[slope == steep] = frame[2]
        sums = np.zeros_like(layer.terms), np.zeros_like(layer.irradiance)
        made.append(Facing(turned_points(mesh, normals), *sums, slope > 0))
    return made


def gather_tilts(shapes: Shapes, mesh: ShadingPoints, found: list[Facing], tilts: F32) -> None:
    """tilts (V, FIELDS, T, 3) from the light sums of all `facings`."""
    slope = np.append(shapes.tilt if shapes.tilt is not None else 0, np.float32(0))[shapes.rows(mesh)]
    for steep in np.unique(slope[slope > 0]).tolist():
        own = np.flatnonzero(slope == steep)
        total = np.zeros((len(own), FIELDS, *tilts.shape[2:]))
        for number, facing in _numbered(found):
            field, weight, bend = lean_weights(number, steep)
            sums = facing.terms[own].astype(np.float64)
            total[:, field] += weight * sums
            total[:, 2] += bend * sums
        tilts[own] = total


def _numbered(found: list[Facing]) -> Iterator[tuple[int, Facing]]:
    """The leaning ones by number, and the upright one as number LEANS."""
    yield from enumerate(found[1:])
    yield LEANS, found[0]


__all__ = ["Facing", "facings", "gather_tilts", "turned_points"]
