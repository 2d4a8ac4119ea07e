"""Numbers as colours: a scale from dark to bright that the eye reads evenly, also without seeing hues."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.imaging.transfer import srgb_to_linear

_ANCHORS = np.array(
    [[0, 0, 4], [51, 10, 95], [120, 28, 109], [187, 55, 84], [237, 105, 37], [252, 180, 26], [252, 255, 164]],
    np.float64,
)  # matplotlib's inferno (CC0, van der Walt and Smith 2015) at seven even places


def false_colours(values: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.uint8]:
    """(…, 3) sRGB bytes of numbers (…), 0 dark … 1 bright; what lies outside has the end's colour."""
    place = np.clip(np.nan_to_num(np.asarray(values, np.float64)), 0, 1) * (len(_ANCHORS) - 1)
    low = np.minimum(place.astype(np.intp), len(_ANCHORS) - 2)
    share = (place - low)[..., None]
    mixed = _ANCHORS[low] * (1 - share) + _ANCHORS[low + 1] * share
    return np.asarray(np.rint(mixed), np.uint8)


def linear_colours(values: npt.NDArray[np.floating[Any]]) -> npt.NDArray[np.float32]:
    """The same as scene-linear light, which a colour-true display at exposure 0 shows with these bytes."""
    return srgb_to_linear(false_colours(values))


__all__ = ["false_colours", "linear_colours"]
