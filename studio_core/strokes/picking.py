"""Which light shows as a colour of the screen: exposure and view transform taken back."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from studio_core.kernels.tonemap import FROM_FILM, KINDS, TO_FILM, film, shown
from studio_core.params import Colour

F64 = npt.NDArray[np.float64]

BYTE = 1 / 255
FAITHFUL = 0.75 * BYTE
"""Light that shows as nearly as that gives the same byte, but for its rounding."""
BRIGHTEST = 1e6
_TO_FILM, _FROM_FILM = TO_FILM.astype(np.float64), FROM_FILM.astype(np.float64)


class Picked(NamedTuple):
    """Radiance (3,), and whether it is the light that was meant.

    It is not `exact` where a channel is as bright as the screen can be: brighter light looks the same, and
    this is the darkest that does; nor where a film shows no light so: this is then the nearest.
    """

    radiance: Colour
    exact: bool


def radiance_of_display(colour: npt.ArrayLike, exposure: float = 0.0, kind: str = "srgb") -> Picked:
    """The light that is shown as a colour (3,), 0 … 1 of the screen's range.

    `exposure` in EV and `kind` are as in `kernels.tonemap.tonemap`. ValueError for another `kind`.
    """
    if kind not in KINDS:
        raise ValueError(f"there is no view {kind!r}; known: {', '.join(KINDS)}")
    wanted = np.clip(np.asarray(colour, np.float64), 0, 1)
    linear = wanted if kind == "raw" else _uncurved(wanted)
    if kind == "filmic":
        linear = _before_film(linear)
    seen = np.asarray(shown(linear[None].astype(np.float32), 0.0, kind)[0], np.float64)
    exact = bool((wanted < 1).all() and (np.abs(seen - wanted) <= FAITHFUL).all())
    red, green, blue = (float(one) for one in linear * 2.0**-exposure)
    return Picked((red, green, blue), exact)


def _uncurved(x: F64) -> F64:
    """Display-linear values of sRGB ones (IEC 61966-2-1)."""
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def _before_film(wanted: F64) -> F64:
    """(3,) light ≥ 0 that the film's curve makes (3,) 0 … 1 of, or what is nearest to that.

    The curve y = (x² + a x − b) / (c x² + d x + e) between its matrices has one root x ≥ 0 for each y.
    """
    a, b, c, d, e = 0.0245786, 0.000090537, 0.983729, 0.4329510, 0.238081
    y = np.clip(np.linalg.solve(_FROM_FILM, wanted), 0, 1)
    square, linear, plain = 1 - c * y, a - d * y, -(b + e * y)
    x = (np.sqrt(linear**2 - 4 * square * plain) - linear) / (2 * square)
    light = np.asarray(np.linalg.solve(_TO_FILM, x), np.float64)
    if (light >= 0).all():
        return light
    from scipy.optimize import least_squares

    def left(tried: F64) -> Any:
        seen = film(tried[None].astype(np.float32))[0].astype(np.float64)
        beyond = ((wanted <= 0) & (seen < 0)) | ((wanted >= 1) & (seen > 1))  # the screen shows it so
        return np.where(beyond, 0, seen - wanted)

    start = np.clip(light, 1e-3, BRIGHTEST / 2)
    found = least_squares(left, start, bounds=(0, BRIGHTEST), diff_step=1e-3)
    return np.asarray(found.x, np.float64)


__all__ = ["Picked", "radiance_of_display"]
