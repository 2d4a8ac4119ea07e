"""What interpolation misses, face by face and edge by edge, by loops."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def size(colour: Array) -> float:
    return float(np.sqrt(np.mean(np.square(colour))))


def far_corner_miss(a: Array, b: Array, c: Array, values: Array, out: Array, there: Array) -> float:
    """How far `there` is from what triangle a, b, c with values (3, 3) continues to, at the foot of `out`."""
    plane = np.stack([b - a, c - a], axis=1)
    u, v = np.linalg.lstsq(plane, out - a, rcond=None)[0]
    weights = np.clip([1 - u - v, u, v], -4, 4)
    return size(weights @ values - there)


def edge_squares(
    positions: Array,
    corners: list[tuple[int, int, int]],
    samples: list[int],
    radiance: Array,
    parents: list[tuple[int, int]],
) -> dict[tuple[int, int], float]:
    """Summed squared error by edge; `corners` are the seen faces, each with so many samples."""
    faces: dict[tuple[int, int], list[int]] = {}
    for number, face in enumerate(corners):
        for k in range(3):
            i, j = face[k], face[(k + 1) % 3]
            faces.setdefault((min(i, j), max(i, j)), []).append(number)
    missed: dict[tuple[int, int], float] = {}
    for edge, both in faces.items():
        if len(both) != 2:
            continue
        for here, there in (both, both[::-1]):
            a, b, c = (positions[v] for v in corners[here])
            far = next(v for v in corners[there] if v not in edge)
            miss = far_corner_miss(a, b, c, radiance[list(corners[here])], positions[far], radiance[far])
            missed[edge] = max(miss, missed.get(edge, 0.0))
    worst = []
    for face in corners:
        around = [tuple(sorted((face[k], face[(k + 1) % 3]))) for k in range(3)]
        known = [missed[e] for e in around if e in missed]  # type: ignore[index]
        worst.append(max(known) if known else np.inf)
    made = {}
    for (i, j), both in faces.items():
        gap = size(radiance[i] - radiance[j])
        jump = max(worst[number] for number in both)
        bend = min(jump, gap) / gap if gap > 0 else 0.0
        expected = min(gap / 2, jump * (1 / 6 + bend / 3)) if gap > 0 else 0.0
        for new, old in ((i, j), (j, i)):
            p, q = parents[new]
            if p != q and old in (p, q):
                expected = min(expected, size(radiance[new] - (radiance[p] + radiance[q]) / 2))
        made[i, j] = 8 / 45 * sum(samples[number] for number in both) * expected**2
    return made
