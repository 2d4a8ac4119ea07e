"""A fitted material: the shared model, each texel's residual, and what light they say comes back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_plugins.residual.bases import BASES, Basis
from studio_plugins.residual.frames import tangent_frames
from studio_plugins.residual.masks import Masks
from studio_plugins.residual.samples import F32, Lights
from studio_plugins.residual.shading import Shade, Shared, shade
from studio_plugins.residual.solve import Solver


@dataclass(frozen=True)
class Settings:
    """How to fit.

    models: of which the first is taken that no later one betters (`parametric.SHAPES`); basis: of
    `bases.BASES`, or "" to choose `among` some by held-out error; table: may be used where it helps there;
    refine: rounds of light refinement; cautious: never worse than the model alone on lights held back in
    turn.
    """

    models: tuple[str, ...] = (
        "lambert",
        "rough-lambert",
        "rough-blinn",
        "rough-ggx",
        "rough-two-blinn",
        "rough-two-ggx",
    )
    basis: str = ""
    among: tuple[str, ...] = tuple(BASES)
    table: bool = True
    refine: int = 3
    masks: Masks = Masks()
    solver: Solver = Solver()
    cautious: bool = True


@dataclass(frozen=True)
class Candidate:
    """A basis that was tried: nMSE on lights held back in turn, in all and outside the highlight."""

    basis: str
    table: bool
    nmse: float
    outside: float
    bytes_per_texel: int


@dataclass(frozen=True, eq=False)
class ResidualFit:
    """f_r and δ* of every texel. `coefficients` (h, w, k, 3) in the texels' frames; `rank` (h, w) of their
    designs; `lights`: those it was fitted to, as refined; `tried`: bases by held-out error; `notes`:
    sentences.
    """

    shared: Shared
    basis: Basis
    coefficients: F32
    rank: npt.NDArray[np.uint8]
    normals: F32
    views: F32
    lights: Lights
    tried: tuple[Candidate, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def bytes_per_texel(self) -> int:
        """Of the residual, as half floats."""
        return self.basis.bytes_per_texel

    @cached_property
    def frames(self) -> F32:
        """(h, w, 3, 3) tangent frames of the texels."""
        return tangent_frames(self.normals)

    def predict(self, lights: Lights) -> F32:
        """(n, h, w, 3) light that comes back, as under strength 1; ≥ 0."""

        def whole(now: Shade) -> F32:
            if not self.basis.size:
                return now.shared
            columns = now.columns(self.basis.name, self.frames)
            added = np.einsum("hwk,hwkc->hwc", columns, self.coefficients)
            return np.asarray(now.shared + added, np.float32)

        return self._each(lights, whole)

    def alone(self, lights: Lights) -> F32:
        """(n, h, w, 3) of the parametric model alone."""
        return self._each(lights, lambda now: now.alone)

    def _each(self, lights: Lights, value: Callable[[Shade], F32]) -> F32:
        made = np.empty((len(lights), *self.normals.shape), np.float32)
        for i, towards in enumerate(lights.directions):
            now = shade(self.shared, self.normals, self.views, towards)
            made[i] = np.maximum(value(now), 0) * (now.cosine > 0)[..., None]
        return made

    def report(self) -> dict[str, Any]:
        """Numbers for JSON."""
        p = self.shared.parametric
        ranks = np.bincount(self.rank.ravel(), minlength=self.basis.size + 1)
        return {
            "model": p.model,
            "shapes": list(p.shapes),
            "colours": p.colours.tolist(),
            "shape_at_bound": p.at_bound,
            "parametric_training_nmse": p.nmse,
            "table": self.shared.table is not None,
            "basis": self.basis.name,
            "bytes_per_texel": self.bytes_per_texel,
            "rank": {str(r): int(count) for r, count in enumerate(ranks)},
            "tried": [vars(one) for one in self.tried],
            "lights": [
                {"name": name, "direction": list(d), "strength": list(s)}
                for name, d, s in zip(
                    self.lights.names,
                    self.lights.directions.tolist(),
                    self.lights.strengths.tolist(),
                    strict=True,
                )
            ],
            "light_source": self.lights.source,
            "notes": list(self.notes),
        }
