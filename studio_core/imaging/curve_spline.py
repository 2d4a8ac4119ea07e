"""Response curves as splines over the numbers, and the shapes that most of them are close to."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
KNOTS = 48
_TOE, _SHOULDER = 0.01, 1.05
_CONTRAST = 0.88  # of exposure to number: cameras show a little more of it than sRGB's curve


def place(number: npt.ArrayLike) -> F64:
    """Where numbers 0 … 1 lie along the spline, 0 … KNOTS − 3: closer knots near both ends."""
    x = np.clip(np.asarray(number, np.float64), 0.0, 1.0)
    ends = _coordinate(np.array([0.0, 1.0]))
    return np.asarray((_coordinate(x) - ends[0]) / (ends[1] - ends[0]) * (KNOTS - 3), np.float64)


def _coordinate(x: F64) -> F64:
    return np.asarray(np.log2(x + _TOE) - 0.5 * np.log2(_SHOULDER - x), np.float64)


def basis(number: npt.ArrayLike) -> F64:
    """(..., KNOTS) uniform cubic B-splines at numbers 0 … 1."""
    at = place(number)
    first = np.minimum(at.astype(np.int64), KNOTS - 4)
    t = at - first
    parts = np.stack([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3], axis=-1)
    made = np.zeros((*at.shape, KNOTS))
    np.put_along_axis(made, first[..., None] + np.arange(4), parts / 6, axis=-1)
    return made


def knot_logs() -> F64:
    """log2 number that belongs to each coefficient (at the peak of its spline)."""
    dense = np.linspace(0, 1, 20001)
    number = np.interp(np.arange(KNOTS) - 1.0, place(dense), dense)
    logs = np.log2(number + 0.004)
    logs[0], logs[-1] = 2 * logs[1] - logs[2], 2 * logs[-2] - logs[-3]  # beyond the ends
    return np.asarray(logs, np.float64)


def ordinary_shapes() -> F64:
    """(M, KNOTS): powers, sRGB, toes and shoulders, whose sums most responses are close to."""
    x = np.linspace(0, 1, 1001)[1:]
    usual = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)
    shapes = [np.ones_like(x), np.log2(x + 0.002), np.log2(usual), x, x**2, np.log2(_SHOULDER - x)]
    splines = basis(x)
    smooth = 1e-3 * np.diff(np.eye(KNOTS), 2, axis=0)
    matrix = np.concatenate([splines, smooth])
    right = np.concatenate([np.array(shapes).T, np.zeros((len(smooth), len(shapes)))])
    return np.asarray(np.linalg.lstsq(matrix, right, rcond=None)[0].T, np.float64)


def usual_scale(curve: F64) -> float:
    """The factor that makes curves (3, KNOTS) most like an ordinary camera's; > 0."""
    number = np.linspace(0.1, 0.9, 81)
    own = (basis(number) @ curve.T).mean(axis=1)
    light = np.log2(((number + 0.055) / 1.055) ** 2.4)
    return max(_CONTRAST * float(np.polyfit(own, light, 1)[0]), 0.05)
