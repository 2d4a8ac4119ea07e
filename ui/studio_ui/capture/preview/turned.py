"""An equirectangular picture as it looks when it is turned: while a hand turns it, on the screen alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.imaging.latlong import direction_to_uv, equirect_direction


def turned(
    pixels: npt.NDArray[Any], rotation: npt.NDArray[np.float64], u: npt.NDArray[Any], v: npt.NDArray[Any]
) -> npt.NDArray[Any]:
    """Pixels (h, w, C) seen at u (w,) and v (h,) after all directions were turned by `rotation`.

    Nearest pixels, for the screen.
    """
    towards = equirect_direction(u[None, :], v[:, None]) @ rotation  # transposed: where it was before
    from_u, from_v = direction_to_uv(towards)
    height, width = pixels.shape[:2]
    columns = (from_u * width).astype(np.intp) % width
    rows = np.minimum((from_v * height).astype(np.intp), height - 1)
    return pixels[rows, columns]
