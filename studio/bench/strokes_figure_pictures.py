"""Figures of strokes as they stand in the documents: an act a row, from what was shown over what was painted
to what came of it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio.bench.strokes_figures import Played, Session
from studio_core.kernels.tonemap import tonemap

U8 = npt.NDArray[np.uint8]
F32 = npt.NDArray[np.float32]
GAP = 6
STRIPES = 10
"""Pixels from one stripe of what is held to the next."""
STAYS = np.array([0.3, 0.65, 1.0], np.float32)


def sheet(session: Session, played: Played) -> U8:
    """(H, W, 3) of a session that was played."""
    rows = []
    for act, (before, after) in enumerate(played.pictures):
        shown = [before.linear, after.linear]
        if session.acts[act].strokes:
            shown.insert(1, painted(before.linear, played.wanted[act], played.masks[act]))
        rows.append(beside([tonemap(light, 0.0, "srgb") for light in shown]))
    return beside(rows, axis=0)


def painted(shown: F32, wanted: F32, mask: F32) -> F32:
    """(H, W, 3) what is wanted over what is shown, with an outline; what shall stay has stripes."""
    stays = (mask > 0) & (wanted == shown).all(axis=2)
    across = np.indices(mask.shape).sum(axis=0) % STRIPES < STRIPES // 3
    share = mask[..., None]
    made = shown * (1 - share) + np.where(np.isfinite(wanted), wanted, shown) * share
    made[stays & across] = made[stays & across] / 2 + STAYS / 2
    made[_outline(mask > 0.5)] = 1.0
    return np.asarray(made, np.float32)


def beside(parts: list[U8], axis: int = 1) -> U8:
    """Parts one after the other with white between."""
    gap = list(parts[0].shape)
    gap[axis] = GAP
    made = [parts[0]]
    for part in parts[1:]:
        made += [np.full(gap, 255, np.uint8), part]
    return np.concatenate(made, axis=axis)


def _outline(inside: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    from scipy.ndimage import binary_dilation

    return np.asarray(binary_dilation(inside) & ~inside)


__all__ = ["beside", "painted", "sheet"]
