"""Light where no lens looked: that of the surroundings, getting smoother with distance.

Known light is averaged down a pyramid (by solid angle) and comes up again where nothing is known (Gortler
et al. 1996, "pull-push"), in logarithms: what is not seen is likely a wall like those next to it, not half a
lamp. It is a guess, and marked as one.
"""

from __future__ import annotations

import numpy as np

from studio_core.capturing.artifacts import F32, Mask
from studio_core.imaging.resample import known_means, resize_area
from studio_core.imaging.sphere import even_rows, with_border

_FINEST = 1024


def fill(light: F32, unseen: Mask) -> None:
    """Put light into the `unseen` (H, 2H) pixels of `light` (H, 2H, 3); where nothing at all is seen, 0."""
    if not unseen.any():
        return
    if unseen.all():
        light[...] = 0
        return
    import cv2

    height, width = unseen.shape
    rows = min(height, _FINEST // 2)
    known, share = known_means(light, ~unseen, rows, 2 * rows)
    grey = known.mean(axis=2)[share > 0]
    floor = 1e-4 * float(grey.mean()) + 1e-12
    values = _pull_push(np.log(known + floor).astype(np.float32), share[..., None])
    guess = even_rows(np.exp(values) - np.float32(floor), 2 * np.pi / rows)
    np.maximum(guess, 0, out=guess)
    if rows != height:
        wide = cv2.resize(with_border(guess, 1), None, fx=height / rows, fy=height / rows)
        border = (wide.shape[0] - height) // 2
        guess = np.asarray(wide[border : border + height, border : border + width], np.float32)
    light[unseen] = guess[unseen]


def _pull_push(values: F32, share: F32) -> F32:
    """Values (h, 2h, 3) everywhere, from where `share` (h, 2h, 1) is above 0."""
    rows = values.shape[0]
    if rows <= 2:
        total = max(float(share.sum()), 1e-9)
        mean = ((values * share).sum(axis=(0, 1)) / total).astype(np.float32)
        return np.asarray(share * values + (1 - share) * mean, np.float32)
    half = (rows + 1) // 2
    ring = np.sin(np.pi * (np.arange(rows) + 0.5) / rows).astype(np.float32)[:, None, None]
    weight = share * ring
    whole = resize_area(np.broadcast_to(ring, share.shape), half, 2 * half)
    down = resize_area(weight, half, 2 * half)
    mean = resize_area(values * weight, half, 2 * half) / np.maximum(down, 1e-9)
    coarse = _pull_push(mean, np.minimum(down / whole * 2, 1).astype(np.float32))
    return np.asarray(share * values + (1 - share) * _twice(coarse, rows), np.float32)


def _twice(coarse: F32, rows: int) -> F32:
    """Linear between the places of `coarse`, around the sphere, with `rows` rows."""
    import cv2

    factor = rows / coarse.shape[0]
    wide = with_border(coarse, 2)
    y = ((np.arange(rows) + 0.5) / factor + 1.5).astype(np.float32)
    x = ((np.arange(2 * rows) + 0.5) / factor + 1.5).astype(np.float32)
    at_x, at_y = np.meshgrid(x, y)
    return np.asarray(cv2.remap(wide, at_x, at_y, cv2.INTER_LINEAR), np.float32)
