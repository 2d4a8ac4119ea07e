"""The residual fit the slow, obvious way: one texel at a time, in float64."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def radiance(
    model: str, shapes: list[float], n: npt.ArrayLike, v: npt.ArrayLike, light: npt.ArrayLike
) -> list[float]:
    """Terms of the models at one point; see `studio_plugins.residual.parametric`."""
    n, v, to = (np.asarray(x, np.float64) for x in (n, v, light))
    nl, nv = max(float(n @ to), 0.0), float(n @ v)
    made = [nl]
    if model.startswith("rough-"):
        i, o = np.arccos(nl), np.arccos(nv)
        flat_l, flat_v = to - (n @ to) * n, v - nv * n
        lengths = np.linalg.norm(flat_l) * np.linalg.norm(flat_v)
        turn = float(flat_l @ flat_v) / lengths if lengths > 0 else 0.0
        made.append(nl * max(turn, 0.0) * np.sin(max(i, o)) * np.tan(min(i, o)))
        model = model.removeprefix("rough-")
    h = (to + v) / np.linalg.norm(to + v)
    nh = float(n @ h)
    for s in shapes:
        if nl <= 0:
            made.append(0.0)
        elif model == "paper":
            made.append(max(nh, 0.0) ** s)
        elif model == "phong":
            mirrored = 2 * float(n @ to) * n - to
            made.append(max(float(mirrored @ v), 0.0) ** s * (s + 2) / 2 * nl)
        elif model.endswith("blinn"):
            peak = (s + 2) * (s + 4) / (8 * np.pi * (2 ** (-s / 2) + s))
            made.append(np.pi * peak * max(nh, 0.0) ** s * nl)
        else:
            a = s * s
            d = a / (np.pi * (nh**2 * (a - 1) + 1) ** 2)
            shadows = 2 * nl * nv / (nl * np.sqrt(a + (1 - a) * nv**2) + nv * np.sqrt(a + (1 - a) * nl**2))
            made.append(np.pi * d * shadows / (4 * nl * nv) * nl)
    return made


def least_squares(
    a: npt.ArrayLike, b: npt.ArrayLike, weights: npt.ArrayLike, truncation: float
) -> npt.NDArray[np.float64]:
    """Weighted minimum-norm least squares of one texel (n, k), (n, c) with singular values cut off."""
    root = np.sqrt(np.asarray(weights, np.float64))[:, None]
    return np.linalg.pinv(np.asarray(a, np.float64) * root, rcond=truncation) @ (
        np.asarray(b, np.float64) * root
    )


def left_out(a: npt.ArrayLike, b: npt.ArrayLike, truncation: float) -> npt.NDArray[np.float64]:
    """(n, c) what the other rows say of each row."""
    a, b = np.asarray(a, np.float64), np.asarray(b, np.float64)
    made = []
    for i in range(len(a)):
        others = np.arange(len(a)) != i
        made.append(a[i] @ least_squares(a[others], b[others], np.ones(others.sum()), truncation))
    return np.stack(made)
