"""The colours of bare metals: reflectance head-on, linear Rec.709.

From measured refractive indices n + ik: R = ((n − 1)² + k²) / ((n + 1)² + k²) at every 10 nm from 380 to
730 nm, seen under daylight D65 by the CIE 1931 observer (the analytic fit of Wyman, Sloan & Shirley 2013),
so that a perfect mirror is 1, 1, 1; gold's red lies outside Rec.709 (1.035) and is cut to 1. Indices are as
tabulated by refractiveindex.info (CC0).
"""

from __future__ import annotations

from dataclasses import dataclass

from studio_core.params import Colour

_NOBLE = "Johnson & Christy 1972, Phys. Rev. B 6, 4370"
_TRANSITION = "Johnson & Christy 1974, Phys. Rev. B 9, 5056"
_ALLOYS = "Querry 1985, CRDC-CR-85034"


@dataclass(frozen=True)
class Metal:
    """`colour` is F0, as metals have it as their colour; `source` measured its refractive index."""

    name: str
    colour: Colour
    source: str


METALS = (
    Metal("Gold", (1.0, 0.730, 0.364), _NOBLE),
    Metal("Silver", (0.989, 0.984, 0.978), _NOBLE),
    Metal("Copper", (0.929, 0.624, 0.522), _NOBLE),
    Metal("Brass (70 % copper)", (0.908, 0.779, 0.424), _ALLOYS),
    Metal("Red brass (90 % copper)", (0.960, 0.714, 0.464), _ALLOYS),
    Metal("Aluminium", (0.906, 0.916, 0.923), "McPeak et al. 2015, ACS Photonics 2, 326"),
    Metal("Stainless steel", (0.604, 0.587, 0.568), "Karlsson & Ribbing 1982, J. Appl. Phys. 53, 6340"),
    Metal("Chrome", (0.550, 0.556, 0.554), _TRANSITION),
    Metal("Nickel", (0.696, 0.641, 0.563), _TRANSITION),
    Metal("Titanium", (0.618, 0.580, 0.542), _TRANSITION),
    Metal("Iron", (0.529, 0.513, 0.494), _TRANSITION),
)

__all__ = ["METALS", "Metal"]
