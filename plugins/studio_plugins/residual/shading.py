"""What the shared part of a fit says of texels under one light, and the columns of a basis there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from studio_core.colour import LUMINANCE
from studio_plugins.residual.bases import columns
from studio_plugins.residual.frames import to_tangent
from studio_plugins.residual.parametric import Parametric, half_vector
from studio_plugins.residual.samples import F32, F64
from studio_plugins.residual.tables import Table

_LUMINANCE = np.array(LUMINANCE, np.float32)
GRAZING = 0.05
"""n·l under which the terminator begins."""


@dataclass(frozen=True, eq=False)
class Shared:
    """The model that all texels share, and the table that mends it, if any."""

    parametric: Parametric
    table: Table | None = None


@dataclass(frozen=True, eq=False)
class Shade:
    """Texels under one light of strength 1. `alone` (..., 3): the parametric model's radiance; `shared`:
    with the table; `matte`: luminance of all but the highlight, of the albedo's; `gloss`: luminance of
    the highlight, of its own albedo's scale; `shine`: luminance of the highlight itself; `cosine` n·l;
    `half` n·h; `light`, `middle`: directions to light and half vector.
    """

    alone: F32
    shared: F32
    matte: F32
    gloss: F32
    shine: F32
    cosine: F32
    half: F32
    light: F32
    middle: F32

    def columns(self, basis: str, frames: F32) -> F32:
        """(..., k) of a basis in the texels' frames (..., 3, 3)."""
        light, half = to_tangent(self.light, frames), to_tangent(self.middle, frames)
        fade = faded(self.cosine)
        return columns(basis, light, half, self.matte * (fade > 0), self.gloss * (fade > 0), fade)


def faded(cosine: F32) -> F32:
    """1, and on to 0 at the terminator: for light that comes back not in proportion to the cosine."""
    return np.asarray(np.clip(cosine / np.float32(GRAZING), 0, 1), np.float32)


def shade(shared: Shared, normals: F32, views: F32, towards: F64) -> Shade:
    """Under a light of strength 1 from a direction (3,)."""
    light = np.broadcast_to(towards.astype(np.float32), normals.shape)
    middle = half_vector(views, towards)
    cosine = (normals * light).sum(axis=-1)
    half = (normals * middle).sum(axis=-1)
    matte, glossy = shared.parametric.parts(normals, views, towards)
    alone = matte + glossy
    whole, rest = alone, matte
    if shared.table is not None:
        more = shared.table.at(half, cosine) * faded(cosine)[..., None]
        whole, rest = alone + more, np.maximum(matte + more, 0)
    albedo = max(float(shared.parametric.colours[0] @ _LUMINANCE), 1e-6)
    shine = max(
        float(shared.parametric.colours[shared.parametric.matte_terms :].sum(axis=0) @ _LUMINANCE), 1e-6
    )
    seen = glossy @ _LUMINANCE
    return Shade(
        alone=alone,
        shared=whole,
        matte=rest @ _LUMINANCE / np.float32(albedo),
        gloss=seen / np.float32(shine),
        shine=seen,
        cosine=cosine,
        half=half,
        light=light,
        middle=middle,
    )
