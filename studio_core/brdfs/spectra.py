"""Reflectance by wavelength as linear Rec.709 colour.

CIE 1931 2° observer by the multi-lobe fit of Wyman, Sloan & Shirley ("Simple Analytic Approximations to the
CIE XYZ Color Matching Functions", JCGT 2(2), 2013), at every 5 nm from 380 to 780 nm. The sample is seen
under D65 (CIE 15, at every 10 nm) or equal energy E; its colours are adapted to D65 by Bradford's transform
(Lam 1985), so that a perfect white is (1, 1, 1) under either.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]

ILLUMINANTS = ("D65", "E")
WAVELENGTHS = np.arange(380.0, 781.0, 5.0)
_D65 = np.array(
    [
        *(49.9755, 54.6482, 82.7549, 91.486, 93.4318, 86.6823, 104.865, 117.008, 117.812, 114.861),
        *(115.923, 108.811, 109.354, 107.802, 104.79, 107.689, 104.405, 104.046, 100.0, 96.3342),
        *(95.788, 88.6856, 90.0062, 89.5991, 87.6987, 83.2886, 83.6992, 80.0268, 80.2146, 82.2778),
        *(78.2842, 69.7213, 71.6091, 74.349, 61.604, 69.8856, 75.087, 63.5927, 46.4182, 66.8054, 63.3828),
    ]
)
_LOBES = (  # height, centre in nm, slopes below and above it
    ((0.362, 442.0, 0.0624, 0.0374), (1.056, 599.8, 0.0264, 0.0323), (-0.065, 501.1, 0.0490, 0.0382)),
    ((0.821, 568.8, 0.0213, 0.0247), (0.286, 530.9, 0.0613, 0.0322)),
    ((1.217, 437.0, 0.0845, 0.0278), (0.681, 459.0, 0.0385, 0.0725)),
)
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
_TO_REC709 = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)


def observer(wavelengths: npt.ArrayLike) -> F64:
    """(..., 3) x̄, ȳ, z̄ at wavelengths in nm."""
    nm = np.asarray(wavelengths, np.float64)
    made = np.zeros((*nm.shape, 3))
    for k, lobes in enumerate(_LOBES):
        for height, centre, below, above in lobes:
            t = (nm - centre) * np.where(nm < centre, below, above)
            made[..., k] += height * np.exp(-0.5 * t * t)
    return made


def illuminant(name: str) -> F64:
    """Power at WAVELENGTHS; ValueError for a name that is not among ILLUMINANTS."""
    if name not in ILLUMINANTS:
        raise ValueError(f"there is no illuminant {name!r}; known: {', '.join(ILLUMINANTS)}")
    if name == "E":
        return np.full(len(WAVELENGTHS), 100.0)
    return np.asarray(np.interp(WAVELENGTHS, np.arange(380.0, 781.0, 10.0), _D65))


def rec709_weights(wavelengths: npt.ArrayLike, light: str = "D65") -> F64:
    """(W, 3): reflectances at ascending wavelengths (W,) times this are linear Rec.709.

    Between wavelengths reflectance is linear, beyond the first and the last constant.
    """
    nm = np.asarray(wavelengths, np.float64)
    if nm.ndim != 1 or not len(nm) or (np.diff(nm) <= 0).any():
        raise ValueError("wavelengths must ascend")
    basis: Any = np.stack([np.interp(WAVELENGTHS, nm, row) for row in np.eye(len(nm))])
    power = illuminant(light)[:, None] * observer(WAVELENGTHS)
    xyz = basis @ (power / power[:, 1].sum())
    return np.asarray(xyz @ (_TO_REC709 @ _adaptation(power.sum(axis=0))).T)


def from_xyz(values: F64, light: str = "D65") -> F64:
    """(..., 3) linear Rec.709 of XYZ in which a perfect white has Y = 1, under an illuminant."""
    white = (illuminant(light)[:, None] * observer(WAVELENGTHS)).sum(axis=0)
    return np.asarray(values @ (_TO_REC709 @ _adaptation(white)).T)


def _adaptation(white: F64) -> F64:
    """(3, 3) from XYZ under a light of that white to XYZ under Rec.709's own."""
    own = np.linalg.inv(_TO_REC709) @ np.ones(3)
    ratio = (_BRADFORD @ own) / (_BRADFORD @ (white / white[1]))
    return np.asarray(np.linalg.inv(_BRADFORD) @ np.diag(ratio) @ _BRADFORD)
