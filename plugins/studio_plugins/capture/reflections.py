"""Finding reflections of the lens' black frame (cuts.txt, IV, left that to the user).

Light that the frame throws back brightens the picture near the circle's edge. What lies there is seen by the
other lens too, further inside: where one lens is brighter than the other at its own frame, and no shift of
near things explains it, a rectangle is proposed.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import F32, Registration, View
from studio_core.capturing.settings import BACK, FRONT, Patch, ReflectionSettings
from studio_core.shading.job import Job
from studio_plugins.capture.compare import STEP, Comparison, compare
from studio_plugins.capture.ring import runs

_SURE, _PART = 0.38, 0.2  # stops: that a reflection has somewhere, and everywhere
_ALONG = 8.0  # degrees of azimuth that a reflection fills at least, but for a fifth of them
_STEEP = 0.25  # stops: so much more than a column has itself is not its own
_GAP = 6.0  # degrees: a lamp or an edge in a reflection does not part it
_NARROWEST = 6.0  # degrees
_WHOLE = 0.92  # of the turn: a frame that throws light back everywhere cannot be told from a scale
_MARGIN = 2.0  # degrees that a rectangle reaches further, all round
_GONE = 0.1  # of the largest excess: there a reflection ends towards the axis
_UNSEEN = 3.0  # degrees more where it has not ended as far as the other lens sees


def find_reflections(
    front: View, back: View | None, registration: Registration | None, settings: ReflectionSettings, job: Job
) -> tuple[Patch, ...]:
    """Rectangles for either lens, brightest first.

    Views hold light as photographed, falloff not undone (`registration` tells it). Nothing is found without
    a second lens and a registration to trust, or where both see less than a degree in common.
    """
    if back is None or registration is None or not registration.trusted or not settings.automatic:
        return ()
    views = {FRONT: front, BACK: back}
    found: list[Patch] = []
    for side, other in ((FRONT, BACK), (BACK, FRONT)):
        comparison = compare(views[side], views[other], registration, side, job)
        if comparison is not None:
            found += patches_of(comparison, side, math.degrees(views[side].lens.half), settings.sensitivity)
    return tuple(sorted(found, key=lambda patch: -patch.excess))


def patches_of(comparison: Comparison, side: str, edge: float, sensitivity: float = 1.0) -> list[Patch]:
    """Rectangles of one side. `edge`: degrees from the axis to the frame."""
    level = _opened(comparison.score)
    some = np.maximum(level, _opened(comparison.likely))
    found: list[Patch] = []
    bright = some > _PART / sensitivity
    if bright.mean() > _WHOLE:  # this is a scale that is wrong
        return found
    for start, length in runs(~bright):
        if length * STEP <= _GAP:
            bright[(start + np.arange(length)) % len(bright)] = True
    for start, length in runs(bright):
        columns = (start + np.arange(length)) % len(level)
        if length * STEP >= _NARROWEST and level[columns].max() > _SURE / sensitivity:
            inner, excess = _depth(comparison, columns, edge)
            width = min(length * STEP + 2 * _MARGIN, 360.0)
            azimuth = (start * STEP - _MARGIN) % 360
            found.append(Patch(side, azimuth, width, inner, edge, found=True, excess=excess))
    return found


def _opened(score: F32) -> F32:
    """What nearly all of `_ALONG` degrees have, around each column; a narrow brightness is no reflection."""
    from scipy import ndimage

    along = round(_ALONG / STEP)
    least = ndimage.percentile_filter(score, 20, size=along, mode="wrap")
    return np.asarray(
        np.minimum(ndimage.maximum_filter1d(least, along, mode="wrap"), score + 0.25), np.float32
    )


def _depth(comparison: Comparison, columns: npt.NDArray[np.intp], edge: float) -> tuple[float, float]:
    """Degrees from the axis to where the excess has gone, and its median in stops over what is brightest."""
    excess = np.where(comparison.known[:, columns], comparison.excess[:, columns], np.nan)
    seen = np.isfinite(excess).mean(axis=1) > 0.5
    rows = np.flatnonzero(seen)
    if not len(rows):
        return edge - 5.0, 0.0
    profile = np.array([np.nanmedian(excess[row]) for row in rows])
    peak = int(profile.argmax())
    gone = np.flatnonzero(profile[: peak + 1] < _GONE * profile[peak])
    theta = np.degrees(comparison.ring.theta[rows])
    inner = theta[gone[-1]] if len(gone) else theta[0] - _UNSEEN
    core = excess[rows][profile > 0.5 * profile[peak]]
    return float(inner - _MARGIN), float(np.nanmedian(core))
