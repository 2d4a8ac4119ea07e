"""Reflectance that was measured at pairs of directions, and how far a model is from it."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.albedo import flat_coefficients
from studio_core.brdfs.half_difference import from_angles, to_angles
from studio_core.contract import Brdf
from studio_core.kernels.pairs import evaluate_pairs
from studio_core.params import Value
from studio_core.scene.geometry import Table

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

LOWEST = 0.02
"""Cosine of the flattest directions that count: below, measurements say little and weigh nothing."""
VIEW_EDGES = (0, 15, 30, 45, 60, 75, 90)
HALF_EDGES = (0, 1, 5, 15, 45, 90)


@dataclass(frozen=True)
class Samples:
    """Values (N, 3) of f_r in 1/sr, linear Rec.709, at unit pairs wi and wo (N, 3) above the surface.

    `weight` (N,) says how much each counts, 1 in the mean.
    """

    wi: F32
    wo: F32
    values: F64
    weight: F64

    def __len__(self) -> int:
        return len(self.wi)

    def some(self, most: int) -> Samples:
        """At most so many of them, evenly spread."""
        if len(self) <= most:
            return self
        rows = np.linspace(0, len(self) - 1, most).astype(np.int64)
        return Samples(self.wi[rows], self.wo[rows], self.values[rows], self.weight[rows])

    @property
    def cosine(self) -> F64:
        """(N, 1) of ω_i."""
        return self.wi[:, 2:].astype(np.float64)


def of_table(table: Table, differences: int = 12, azimuths: int = 9) -> Samples:
    """The middles of cells of a half-difference table: every θ_h, some θ_d and φ_d, no interpolation.

    Which θ_d and φ_d are taken changes from one θ_h to the next, so that all parts of the table count. Over
    difference angles samples weigh what the pairs of directions do, sin θ_d cos θ_d; over θ_h all cells weigh
    the same, for a sharp highlight has hardly any directions and is all that one sees.
    """
    h, d, p = table.values.shape[:3]
    row = np.arange(h)[:, None, None]
    steps = (d / min(differences, d), p / min(azimuths, p))
    column = np.arange(min(differences, d))[None, :, None]
    depth = np.arange(min(azimuths, p))[None, None, :]
    golden = 0.6180339887498949
    j = ((column + (row * golden) % 1) * steps[0]).astype(np.int64)
    k = ((depth + ((row + 7 * column) * golden) % 1) * steps[1]).astype(np.int64)
    i, j, k = (
        np.broadcast_to(a, np.broadcast_shapes(row.shape, j.shape, k.shape)).ravel() for a in (row, j, k)
    )
    wi, wo = from_angles(np.pi / 2 * ((i + 0.5) / h) ** 2, np.pi / 2 * (j + 0.5) / d, np.pi * (k + 0.5) / p)
    above = (wi[:, 2] > LOWEST) & (wo[:, 2] > LOWEST)
    weight = np.sin(np.pi * (j[above] + 0.5) / d)  # 2 sin θ_d cos θ_d
    return Samples(
        wi[above].astype(np.float32),
        wo[above].astype(np.float32),
        table.values[i, j, k][above].astype(np.float64),
        weight / weight.mean(),
    )


def predicted(brdf: Brdf, values: Mapping[str, Value], samples: Samples) -> F64:
    """(N, 3) of f_r by a model without textures."""
    shape = np.atleast_1d(np.asarray(brdf.shape(values), np.float32))
    terms = evaluate_pairs(brdf, shape, samples.wo, samples.wi)
    return np.asarray(terms.astype(np.float64) @ flat_coefficients(brdf, values))


def compressed(values: F64, cosine: F64) -> F64:
    """ln(1 + cos θ_i f_r): equal differences are about equally visible (Löw et al. 2012, section 5)."""
    made: F64 = np.log1p(np.maximum(values, 0) * cosine)
    return made


@dataclass(frozen=True)
class Difference:
    """Model against measurement.

    `metric` is the root mean square of the difference of ln(1 + cos θ_i f_r), over samples and channels;
    `rmse` is √(Σ (cos θ_i Δf)² / Σ (cos θ_i f)²); `bias` is Σ cos θ_i Δf / Σ cos θ_i f; all with the samples'
    weights. `count` samples.
    """

    metric: float
    rmse: float
    bias: float
    count: int


def difference(found: F64, samples: Samples, rows: npt.NDArray[np.bool_] | None = None) -> Difference:
    """How far f_r `found` (N, 3) is from the samples, or from those of some rows (N,)."""
    rows = np.ones(len(samples), np.bool_) if rows is None else rows
    if not rows.any():
        return Difference(0.0, 0.0, 0.0, 0)
    cosine, truth, made = samples.cosine[rows], samples.values[rows], found[rows]
    weight = samples.weight[rows][:, None]
    off, size = cosine * (made - truth), cosine * truth
    bent = compressed(made, cosine) - compressed(truth, cosine)
    square, total = float((weight * size * size).sum()), float((weight * np.abs(size)).sum())
    return Difference(
        float(np.sqrt((weight * bent * bent).sum() / (3 * weight.sum()))),
        float(np.sqrt((weight * off * off).sum() / square)) if square > 0 else float(np.abs(off).max() > 0),
        float((weight * off).sum() / total) if total > 0 else 0.0,
        int(rows.sum()),
    )


def by_angle(found: F64, samples: Samples) -> tuple[dict[str, Difference], dict[str, Difference]]:
    """Differences by the angle that is seen from, and by that of the half vector, in degrees."""
    view = np.degrees(np.arccos(np.clip(samples.wo[:, 2], 0, 1)))
    half = np.degrees(to_angles(samples.wi.astype(np.float64), samples.wo.astype(np.float64))[0])
    made = []
    for angle, edges in ((view, VIEW_EDGES), (half, HALF_EDGES)):
        bins = itertools.pairwise(edges)
        parts = {f"{a}–{b}": difference(found, samples, (angle >= a) & (angle < b)) for a, b in bins}
        made.append({name: part for name, part in parts.items() if part.count})
    return made[0], made[1]
