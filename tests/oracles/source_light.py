"""Light at vertices from a list of samples: one pair at a time, in float64, each with a shadow ray."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]


def arriving(samples: Any, column: int, variant: int, position: F64) -> tuple[F64, float, float]:
    """Unit direction to a sample, the share of its light that arrives face on, and how far it is."""
    place = samples.place[variant, column]
    if place[3] == 0:
        return place[:3], 1.0, math.inf
    way = place[:3] - position
    far = max(float(np.linalg.norm(way)), 1e-6)
    cosine = float(-(way / far) @ samples.lamp[column, :3])
    share = 1.0
    if samples.kind[column] == 3:
        share = max(cosine, 0.0)
    elif samples.kind[column] == 2:
        outer, inner = samples.lamp[column, 3:]
        if inner - outer < 1e-9:
            share = float(cosine >= outer)
        else:
            t = min(max((cosine - outer) / (inner - outer), 0.0), 1.0)
            share = t * t * (3 - 2 * t)
    return way / far, share / far**2, far


def cell(local: F64) -> int:
    """16 rings of equal angle, each in 64 parts of a turn."""
    ring = min(int(math.acos(min(max(local[2], 0.0), 1.0)) / (math.pi / 2) * 16), 15)
    turn = math.atan2(local[1], local[0]) / (2 * math.pi) % 1.0
    return ring * 64 + min(int(turn * 64), 63)


def light_at_vertices(
    samples: Any, light: F64, variant: Any, mesh: Any, seen: Any, rows: Any, functions: list[F64]
) -> tuple[F64, list[F64]]:
    """Irradiance (V, 3), and of each vertex its sums (K, 3).

    seen[v, c]: whether a shadow ray comes through; functions[r] (cells, K) of each material row; `variant`
    gives that of a vertex.
    """
    count = len(mesh.positions)
    irradiance = np.zeros((count, 3))
    made = []
    for v in range(count):
        position = mesh.positions[v].astype(np.float64) + mesh.origin
        n, t = mesh.normals[v].astype(np.float64), mesh.tangents[v].astype(np.float64)
        axes = np.stack([t[:3], t[3] * np.cross(n, t[:3]), n])
        own = functions[rows[v]]
        sums = np.zeros((own.shape[1], 3))
        for c in range(len(samples)):
            towards, share, _ = arriving(samples, c, variant(v), position)
            local = axes @ towards
            if not seen[v, c] or local[2] <= 0:
                continue
            came = light[variant(v), c].astype(np.float64) * share * local[2]
            irradiance[v] += came
            sums += own[cell(local)][:, None] * came
        made.append(sums)
    return irradiance, made
