"""Seamless cloning: what is pasted keeps its own detail and takes over the level of its surroundings.

Pérez, Gangnet and Blake 2003, equation (10): inside the mask the made picture has the source's differences
between neighbours, on the mask's rim it is the target. Made − source is then harmonic inside (their section
2 calls it the membrane): only that smooth correction is solved for, by sine transform where the mask is a
rectangle, else by conjugate gradients. Float64 inside; no picture is ever rounded to bytes.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
_HELD, _FREE, _RING = "held at its ends", "free at its ends", "ring"
_RESIDUAL = 1e-9
_STEPS = 2000


def clone(
    target: npt.NDArray[Any], source: npt.NDArray[Any], mask: Mask, wrap: bool = False
) -> npt.NDArray[np.float32]:
    """(H, W, C) `target` with `source`'s detail where `mask` (H, W) is set, else `target` bit for bit.

    wrap: left and right edge are neighbours (an azimuth). Where the mask reaches an edge of the picture, it
    is free there. A mask that covers all of the picture has no rim: the source is taken as it is. Light may
    come out negative; `clone_light` never does. ValueError for sizes that differ.
    """
    return _cloned(target, source, mask, wrap, np.asarray, np.asarray)


def clone_light(
    target: npt.NDArray[Any],
    source: npt.NDArray[Any],
    mask: Mask,
    wrap: bool = False,
    floor: float = 1e-6,
) -> npt.NDArray[np.float32]:
    """As `clone`, in logarithms: ratios of light are kept, and the result is positive.

    floor: darker than this (in the pictures' unit) counts as this, on the mask's rim and in the source.
    """

    def logarithm(light: npt.NDArray[Any]) -> F64:
        return np.asarray(np.log(np.maximum(light, floor)), np.float64)

    return _cloned(target, source, mask, wrap, logarithm, np.exp)


def membrane(values: npt.NDArray[Any], mask: Mask, wrap: bool = False) -> F64:
    """(H, W, C) `values` outside of `mask`, and inside the harmonic surface that joins them: each pixel is
    the mean of its four neighbours (of those that there are, at an edge). 0 where the mask has no rim.
    """
    made = np.array(values, dtype=np.float64)
    height, width = mask.shape
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return made
    top, bottom = int(rows[0]), int(rows[-1]) + 1
    if wrap and 0 < len(columns) < width:  # begin and end with a column that the mask leaves out
        turn = int(np.flatnonzero(~mask.any(axis=0))[0])
        order = (np.arange(width + 1) + turn) % width
        made[:, order] = membrane(made[:, order], mask[:, order])
        return made
    left, right = int(columns[0]), int(columns[-1]) + 1
    ring = wrap and left == 0 and right == width
    around = (slice(max(top - 1, 0), bottom + 1), slice(max(left - 1, 0), right + 1))
    inside = mask[top:bottom, left:right]
    if inside.all():
        sides = (
            made[top - 1, left:right] if top > 0 else None,
            made[bottom, left:right] if bottom < height else None,
            made[top:bottom, left - 1] if left > 0 else None,
            made[top:bottom, right] if right < width else None,
        )
        size = (bottom - top, right - left, made.shape[2])
        made[top:bottom, left:right] = _rectangle(sides, size, ring)
    else:
        made[around] = _free_form(made[around], mask[around], ring)
    return made


def _cloned(
    target: npt.NDArray[Any],
    source: npt.NDArray[Any],
    mask: Mask,
    wrap: bool,
    encoded: Callable[[npt.NDArray[Any]], npt.NDArray[Any]],
    decoded: Callable[[npt.NDArray[Any]], npt.NDArray[Any]],
) -> npt.NDArray[np.float32]:
    made = np.array(target, dtype=np.float32)
    if made.ndim != 3 or made.shape != np.shape(source) or mask.shape != made.shape[:2]:
        raise ValueError("target, source and mask must have one size")
    if not mask.any():
        return made
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    part = (
        slice(max(rows[0] - 1, 0), rows[-1] + 2),
        slice(None) if wrap else slice(max(columns[0] - 1, 0), columns[-1] + 2),
    )
    inside = mask[part]
    pasted = encoded(np.asarray(source[part], np.float64))
    correction = membrane(encoded(np.asarray(target[part], np.float64)) - pasted, inside, wrap)
    made[part][inside] = decoded(pasted[inside] + correction[inside])
    return made


def _rectangle(sides: tuple[F64 | None, ...], shape: tuple[int, int, int], ring: bool) -> F64:
    """(m, n, C) harmonic between the lines above, below, before and after; None: free there.

    ring: n is one, with neither before nor after.
    """
    m, n, channels = shape
    above, below, before, after = sides
    made = np.zeros((channels, m, n))
    upright = _FREE if above is None and below is None else _HELD
    across = _RING if ring else _FREE if before is None and after is None else _HELD
    if above is not None or below is not None:
        made += _spread(above, below, m, before is None, after is None, across)
    if before is not None or after is not None:
        made += _spread(before, after, n, above is None, below is None, upright).transpose(0, 2, 1)
    return made.transpose(1, 2, 0)


def _spread(first: F64 | None, last: F64 | None, m: int, free_low: bool, free_high: bool, kind: str) -> F64:
    """(C, m, n): harmonic, with the lines `first` before and `last` after m lines, and 0 beside them.

    A line (n, C) that is None is a free end of the m. `kind`: how the n values of a line end. Where only
    one of its two ends is free, line and mirrored line are solved together, held at both ends.

    Along the line, sine (cosine, Fourier) terms decouple; across it, the term with the eigenvalue
    −4 sin² a of the second difference falls off as sinh, or as cosh towards a free end.
    """
    from scipy import fft

    forward, backward, sines = {
        _HELD: (partial(fft.dst, type=1), partial(fft.idst, type=1), _held_sines),
        _FREE: (partial(fft.dct, type=2), partial(fft.idct, type=2), _free_sines),
        _RING: (fft.rfft, fft.irfft, _ring_sines),
    }[kind]
    mirrored = kind == _HELD and free_low != free_high
    lines = []
    for values in (first, last):
        if values is not None and mirrored:
            values = np.concatenate([values[::-1], values] if free_low else [values, values[::-1]])
        lines.append(values)
    length = max(len(values) for values in lines if values is not None)
    fall = _fall(2 * np.arcsinh(sines(length)), m, first is None or last is None)
    total: npt.NDArray[Any] | float = 0.0
    for values, profile in ((lines[0], fall), (lines[1], fall[::-1])):
        if values is not None:
            total = total + profile * forward(values.T)[:, None]
    made = backward(total, n=length, overwrite_x=True)
    if mirrored:
        made = made[..., length // 2 :] if free_low else made[..., : length // 2]
    return np.asarray(made, np.float64)


def _held_sines(n: int) -> F64:
    return np.asarray(np.sin(np.pi * np.arange(1, n + 1) / (2 * (n + 1))), np.float64)


def _free_sines(n: int) -> F64:
    return np.asarray(np.sin(np.pi * np.arange(n) / (2 * n)), np.float64)


def _ring_sines(n: int) -> F64:
    return np.asarray(np.sin(np.pi * np.arange(n // 2 + 1) / n), np.float64)


def _fall(alpha: F64, m: int, free: bool) -> F64:
    """(m, terms) what is left of a line's term at 1 … m from it; it is 0 at m + 1, or m + ½ is a free end."""
    at = np.arange(1, m + 1, dtype=np.float64)[:, None]
    near = np.exp(-alpha * at)
    if free:  # cosh(α (m + ½ − y)) / cosh(α (m + ½))
        end = np.exp(-alpha * m)
        return np.asarray((near + near[::-1] * end) / (1 + end * np.exp(-alpha * (m + 1))), np.float64)
    end = np.exp(-alpha * (m + 1))
    with np.errstate(invalid="ignore"):  # sinh(α (m + 1 − y)) / sinh(α (m + 1))
        held = (near - near[::-1] * end) / (1 - end * end)
    return np.asarray(np.where(alpha > 0, held, 1 - at / (m + 1)), np.float64)


def _free_form(values: F64, mask: Mask, ring: bool) -> F64:
    """`values` with the masked ones harmonic, by conjugate gradients on them alone.

    Preconditioned by the sine transform of the whole rectangle, which solves all but what the mask's
    rim does. Places that no rim reaches stay 0.
    """
    from scipy import fft, ndimage

    height, width, channels = values.shape
    reached = mask & _reached(mask, ring, ndimage)
    made = np.where((mask & ~reached)[:, :, None], 0.0, values)
    mask = reached
    if not mask.any():
        return made
    edge = "wrap" if ring else "nearest"
    free = mask.astype(np.float64)[:, :, None]

    def neighbours(field: F64) -> F64:
        total = np.zeros_like(field)
        total[1:] += field[:-1]
        total[0] += field[0]
        total[:-1] += field[1:]
        total[-1] += field[-1]
        total[:, 1:] += field[:, :-1]
        total[:, :-1] += field[:, 1:]
        total[:, 0] += field[:, -1] if edge == "wrap" else field[:, 0]
        total[:, -1] += field[:, 0] if edge == "wrap" else field[:, -1]
        return total

    y = np.sin(np.pi * np.arange(1, height + 1) / (2 * (height + 1))) ** 2
    x = np.sin(np.pi * np.arange(1, width + 1) / (2 * (width + 1))) ** 2
    eigenvalues = 4 * (y[:, None] + x[None, :])[:, :, None]

    def preconditioned(field: F64) -> F64:
        terms = fft.dstn(field, type=1, axes=(0, 1)) / eigenvalues
        return np.asarray(fft.idstn(terms, type=1, axes=(0, 1)), np.float64) * free

    level = made[~mask].reshape(-1, channels).mean(axis=0)
    made[mask] = level
    residual = (neighbours(made) - 4 * made) * free
    size = np.sqrt((residual**2).sum(axis=(0, 1)))
    direction, before = np.zeros_like(made), np.ones(channels)
    for _ in range(_STEPS):
        if (np.sqrt((residual**2).sum(axis=(0, 1))) <= _RESIDUAL * size).all():
            break
        better = preconditioned(residual)
        now = (residual * better).sum(axis=(0, 1))
        direction = better + direction * np.divide(now, before, out=np.zeros(channels), where=before > 0)
        changed = (4 * direction - neighbours(direction)) * free
        power = (direction * changed).sum(axis=(0, 1))
        step = np.divide(now, power, out=np.zeros(channels), where=power > 0)
        made += step * direction
        residual -= step * changed
        before = now
    return made


def _reached(mask: Mask, ring: bool, ndimage: Any) -> Mask:
    """Those masked places that are joined to one outside of the mask."""
    if ring:  # laid out twice, so that parts are joined across the edge
        return _reached(np.concatenate([mask, mask, mask], axis=1), False, ndimage)[
            :, mask.shape[1] : 2 * mask.shape[1]
        ]
    parts, _ = ndimage.label(mask)
    beside = np.zeros_like(mask)
    beside[1:] |= ~mask[:-1]
    beside[:-1] |= ~mask[1:]
    beside[:, 1:] |= ~mask[:, :-1]
    beside[:, :-1] |= ~mask[:, 1:]
    return np.asarray(np.isin(parts, np.unique(parts[beside & mask])) & mask, bool)
