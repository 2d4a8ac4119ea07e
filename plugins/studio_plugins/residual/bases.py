"""Bases of δ*: what a texel's light may add to the model that all texels share.

A basis has columns, made of directions in the texel's own frame (tangent, binormal, normal), of the
shared model's matte curve, and of its highlight. Columns are solved in stages: what is certain first
(albedo), then the rest of the rest, so that lights that say little about a direction cannot trade one for
the other.

==============  =====================================================================  =======
basis           columns                                                                stages
==============  =====================================================================  =======
none            –                                                                      –
half            H: the paper's s · H (equation 5)                                      3
constant-half   1, H                                                                   4
ptm             l_u², l_v², l_u l_v, l_u, l_v, 1 (Malzbender et al. 2001)              6
harmonics       spherical harmonics of L up to degree 2                                9
albedo          matte curve: the texel's own albedo                                    1
albedo-gloss    matte curve, highlight: its own albedo and shine                       2
albedo-half     matte curve; H                                                         1, 3
albedo-light    matte curve; L: bumps, which tilt the normal                           1, 3
==============  =====================================================================  =======
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from studio_plugins.residual.samples import F32


@dataclass(frozen=True)
class Basis:
    """Its name and how many columns each stage has."""

    name: str
    stages: tuple[int, ...]

    @property
    def size(self) -> int:
        """Columns in all."""
        return sum(self.stages)

    @property
    def bytes_per_texel(self) -> int:
        """As half floats, three colours."""
        return self.size * 3 * 2


BASES = {
    basis.name: basis
    for basis in (
        Basis("none", ()),
        Basis("albedo", (1,)),
        Basis("albedo-gloss", (2,)),
        Basis("half", (3,)),
        Basis("constant-half", (4,)),
        Basis("albedo-half", (1, 3)),
        Basis("albedo-light", (1, 3)),
        Basis("ptm", (6,)),
        Basis("harmonics", (9,)),
    )
}
"""All bases, smallest first."""


def columns(name: str, light: F32, half: F32, matte: F32, gloss: F32, fade: F32) -> F32:
    """(..., k) of directions in the texel's frame (..., 3), the matte curve and the highlight (...).

    What depends on directions alone is light without a cosine, times `fade` (...).
    """
    one = np.ones_like(matte)
    x, y, z = np.moveaxis(light, -1, 0)
    own = {"albedo": [matte], "albedo-gloss": [matte, gloss]}
    own |= {basis: [matte] for basis in ("albedo-half", "albedo-light")}
    towards = {
        "half": list(np.moveaxis(half, -1, 0)),
        "constant-half": [one, *np.moveaxis(half, -1, 0)],
        "albedo-half": list(np.moveaxis(half, -1, 0)),
        "albedo-light": [x, y, z],
        "ptm": [x * x, y * y, x * y, x, y, one],
        "harmonics": [one, x, y, z, x * y, y * z, z * x, x * x - y * y, 1.5 * z * z - 0.5],
    }
    parts = [*own.get(name, []), *(part * fade for part in towards.get(name, []))]
    return np.stack(parts, axis=-1).astype(np.float32) if parts else np.zeros((*matte.shape, 0), np.float32)
