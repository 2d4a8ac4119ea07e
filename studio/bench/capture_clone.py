"""Seamless cloning against a sparse direct solve of the same equations, and its seconds a megapixel."""

from __future__ import annotations

from functools import partial

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report, timed

F32 = npt.NDArray[np.float32]
CHECKED = (240, 320)


def measure(report: Report, size: tuple[int, int]) -> None:
    """Rows `clone`: `rel_error` over a picture with two thousandths to a thousand times the mean light,
    `s_per_mpx` of a rectangle as large as `size` and of a smaller free form, three channels."""
    from studio_core.imaging.poisson import clone

    target, source = picture(*CHECKED, 1), picture(*CHECKED, 2)
    worst = 0.0
    for mask in (rectangle(*CHECKED), blob(*CHECKED)):
        made, exact = clone(target, source, mask), solved(target, source, mask)
        worst = max(worst, float(np.abs(made - exact).max() / np.abs(exact).max()))
    report.add("clone", "rel_error", worst, "1")
    repeats = 3 if report.quick else 7
    for metric, shape, form in (("s_per_mpx", size, rectangle), ("free_form_s_per_mpx", CHECKED, blob)):
        target, source, mask = picture(*shape, 3), picture(*shape, 4), form(*shape)
        taken = timed(partial(clone, target, source, mask), repeats)
        megapixels = mask.sum() / 1e6
        report.add("clone", metric, taken.median / megapixels, "s", taken.spread / megapixels)


def picture(height: int, width: int, seed: int) -> F32:
    """Light (H, W, 3) with fine texture, steps and a few lamps."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width] / max(height, width)
    made = 0.5 + 0.3 * np.sin(9 * x + 4 * y + seed)[:, :, None] + 0.1 * rng.random((height, width, 3))
    made += (x > 0.4)[:, :, None] * 0.7
    for _ in range(5):
        cy, cx = rng.integers(0, height), rng.integers(0, width)
        made[max(cy - 2, 0) : cy + 2, max(cx - 2, 0) : cx + 2] += rng.uniform(10, 1000)
    return np.asarray(made, np.float32)


def rectangle(height: int, width: int) -> npt.NDArray[np.bool_]:
    """All but the rim."""
    mask = np.zeros((height, width), bool)
    mask[1:-1, 1:-1] = True
    return mask


def blob(height: int, width: int) -> npt.NDArray[np.bool_]:
    """A disc with a hole."""
    y, x = (np.mgrid[0:height, 0:width].T / [height, width] - 0.5).T
    reach = np.hypot(x, y)
    return np.asarray((reach < 0.4) & (reach > 0.08), bool)


def solved(target: F32, source: F32, mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64]:
    """Pérez, Gangnet and Blake 2003, equation 7, as sparse equations in float64, solved directly."""
    from scipy import sparse
    from scipy.sparse.linalg import splu

    number = np.full(mask.shape, -1)
    number[mask] = np.arange(mask.sum())
    rows, columns = np.nonzero(mask)
    count = len(rows)
    made = target.astype(np.float64)
    right = np.zeros((count, target.shape[2]))
    wide = source.astype(np.float64)
    entries = [(np.arange(count), np.arange(count), np.full(count, 4.0))]
    for dy, dx in ((0, 1), (1, 0), (0, -1), (-1, 0)):
        near = number[rows + dy, columns + dx]
        right += wide[rows, columns] - wide[rows + dy, columns + dx]
        rim = near < 0
        right[rim] += made[rows[rim] + dy, columns[rim] + dx]
        inner = np.flatnonzero(~rim)
        entries.append((inner, near[inner], np.full(len(inner), -1.0)))
    i, j, values = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    matrix = sparse.csc_matrix((values, (i, j)), shape=(count, count))
    made[rows, columns] = splu(matrix).solve(right)
    return made
