"""The best matte and shiny reflectance for samples, by the exact weighted error of the material's own model.

Of coefficients c the weighted squared error is cᵀAc − 2 c·b + yy, channel by channel, A and b sums over
samples of a level's terms: it costs the same whether a stroke has ten places or a thousand. Coefficients are
affine in the matte part, so its best value beside a given shine is a quotient, clipped to what leaves no more
light than arrives. The amount of shine and the level are searched: all amounts and levels of a grid at once,
then finer about the best. (The paper rescales an unconstrained minimum; its equations 5 and 6 are those of
the normal equations' residual, see `paper`.)
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_plugins.slf.samples import F64, Model, Reflectance, Samples

TINY = 1e-300
FLAT = 1e-9
"""Curvature relative to the largest level's, below which a matte part shows nothing and stays."""
AMOUNTS = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 31)])
ZOOMS, AROUND = 3, 31


@dataclass(frozen=True, eq=False)
class Grams:
    """Of M levels: aa (M, 3, T, T), ab (M, 3, T), and yy (3,), weighted with a sample's importance."""

    levels: F64
    aa: F64
    ab: F64
    yy: F64

    @classmethod
    def of(cls, samples: Samples, levels: F64, importance: F64, terms: F64 | None = None) -> Grams:
        """At real levels (M,), or of the terms (M, N, T, 3) there."""
        terms = (samples.at(levels) if terms is None else terms).transpose(0, 3, 1, 2)  # M, 3, N, T
        weighted = terms * importance.T[None, :, :, None]
        aa = weighted.swapaxes(2, 3) @ terms
        ab = np.matmul(samples.wanted.T[:, None], weighted)[:, :, 0]  # M, 3, T
        return cls(levels, aa, ab, (importance * samples.wanted**2).sum(axis=0))

    def some(self, which: npt.NDArray[np.generic]) -> Grams:
        """These levels."""
        return dataclasses.replace(self, levels=self.levels[which], aa=self.aa[which], ab=self.ab[which])


@dataclass(frozen=True, eq=False)
class Rungs:
    """Grams of all L levels, and across (L, 3, T, T) of each with the next, their transposes added.

    Terms between two levels are their mixture, so Grams there follow from these without any sample.
    """

    grams: Grams
    across: F64

    @classmethod
    def of(cls, samples: Samples, importance: F64) -> Rungs:
        """Of all samples."""
        levels, terms = samples.levels, samples.terms.shape[2]
        aa, across = np.zeros((2, levels, 3, terms, terms))
        ab = np.zeros((levels, 3, terms))
        add_rungs(np.ascontiguousarray(samples.terms), samples.wanted, importance, aa, across, ab)
        yy = (importance * samples.wanted**2).sum(axis=0)
        return cls(Grams(np.arange(float(levels)), aa, ab, yy), across)

    def at(self, levels: F64) -> Grams:
        """At real levels (M,)."""
        own = self.grams
        low = np.clip(np.floor(levels), 0, len(own.levels) - 1).astype(np.int64)
        high = np.minimum(low + 1, len(own.levels) - 1)
        share = np.clip(levels - low, 0, 1)[:, None, None]
        ab = (1 - share) * own.ab[low] + share * own.ab[high]
        share = share[..., None]
        aa = (1 - share) ** 2 * own.aa[low] + share**2 * own.aa[high]
        return Grams(levels, aa + share * (1 - share) * self.across[low], ab, own.yy)


@kernel
def add_rungs(terms: F64, wanted: F64, importance: F64, aa: F64, across: F64, ab: F64) -> None:
    """See `Rungs`: aa, across (L, 3, T, T) and ab (L, 3, T) += those of terms (L, N, T, 3)."""
    levels, count, width = terms.shape[0], terms.shape[1], terms.shape[2]
    for level in range(levels):
        following = min(level + 1, levels - 1)
        for n in range(count):
            for t in range(width):
                for c in range(3):
                    weighted = importance[n, c] * terms[level, n, t, c]
                    ab[level, c, t] += weighted * wanted[n, c]
                    for u in range(t + 1):
                        aa[level, c, t, u] += weighted * terms[level, n, u, c]
                    for u in range(width):
                        across[level, c, t, u] += weighted * terms[following, n, u, c]
        for c in range(3):
            for t in range(width):
                for u in range(t):
                    aa[level, c, u, t] = aa[level, c, t, u]
                for u in range(t + 1):
                    both = across[level, c, t, u] + across[level, c, u, t]
                    across[level, c, t, u], across[level, c, u, t] = both, both


@dataclass(frozen=True, eq=False)
class Found:
    """A reflectance and the weighted squared error that it leaves."""

    reflectance: Reflectance
    left: float


@dataclass(frozen=True, eq=False)
class Shines:
    """K shines (K, 3), amounts (K,) of a tint whose largest channel is 1, or the one that stays (no tint).

    room (K, 3) is the largest matte part beside each; coefficients (K, T, 3) are `plain` without any, and
    rise with it.
    """

    tint: F64 | None
    amounts: F64
    shine: F64
    room: F64
    plain: F64
    rise: F64

    @classmethod
    def start(cls, model: Model, now: Reflectance, tint: F64 | None) -> Shines:
        """With which a search begins: today's amount, and, where there is a tint, all of AMOUNTS."""
        own = now.specular.max()
        return cls.of(model, now, tint, np.unique(np.append([] if tint is None else AMOUNTS, own)))

    @classmethod
    def of(cls, model: Model, now: Reflectance, tint: F64 | None, amounts: F64) -> Shines:
        """Of amounts (K,)."""
        shine = now.specular[None] if tint is None else amounts[:, None] * tint
        room = model.room(shine)
        matte = np.concatenate([np.zeros_like(room), room])
        plain, full = np.split(model.coefficients(matte, np.concatenate([shine, shine])), 2)
        return cls(tint, amounts, shine, room, plain, (full - plain) / np.maximum(room, 1e-9)[:, None])

    def finer(self, model: Model, now: Reflectance, at: int) -> Shines:
        """More of them between the neighbours of one."""
        low, high = self.amounts[max(at - 1, 0)], self.amounts[min(at + 1, len(self.amounts) - 1)]
        amounts = np.append(np.linspace(low, high, AROUND), self.amounts[at])
        return Shines.of(model, now, self.tint, np.unique(amounts))


def best(grams: Grams, model: Model, now: Reflectance, diffuse: bool, shines: Shines) -> Found:
    """The best at one of the levels, searched from some shines on; the matte part stays unless `diffuse`."""
    level = at = 0
    for zoom in range(1 if shines.tint is None else ZOOMS):
        if zoom:
            near = np.arange(max(level - 1, 0), min(level + 2, len(grams.levels)))
            grams, shines = grams.some(near), shines.finer(model, now, at)
        errors, matte = errors_of(grams, now, diffuse, shines)
        level, at = divmod(int(np.argmin(errors)), len(shines.amounts))
    made = Reflectance(matte[level, at], shines.shine[at], float(grams.levels[level]))
    return Found(made, float(errors[level, at]))


def errors_of(grams: Grams, now: Reflectance, diffuse: bool, shines: Shines) -> tuple[F64, F64]:
    """(M, K) weighted squared errors at all levels for all shines, and the matte parts (M, K, 3)."""
    errors = np.full((len(grams.levels), len(shines.amounts)), grams.yy.sum())
    matte = np.empty((*errors.shape, 3))
    own = now.diffuse
    add_errors(grams.aa, grams.ab, shines.plain, shines.rise, shines.room, own, diffuse, errors, matte)
    return np.maximum(errors, 0), matte


@kernel
def add_errors(
    aa: F64,
    ab: F64,
    plain: F64,
    rise: F64,
    room: F64,
    own: F64,
    diffuse: bool,
    errors: F64,
    matte: F64,
) -> None:
    """errors (M, K) += cᵀAc − 2 c·b of c = plain + matte · rise (K, T, 3), matte (M, K, 3) being the best.

    Or own (3,) as far as there is room (K, 3), unless `diffuse` and where it shows nothing.
    """
    levels, shines, terms = len(aa), len(plain), plain.shape[1]
    curve, slope = np.empty((levels, shines, 3)), np.empty((levels, shines, 3))
    most = 0.0
    for m in range(levels):
        for k in range(shines):
            for c in range(3):
                bend, tilt, still, towards = 0.0, 0.0, 0.0, 0.0
                for t in range(terms):
                    risen, put = 0.0, 0.0
                    for u in range(terms):
                        risen += aa[m, c, t, u] * rise[k, u, c]
                        put += aa[m, c, t, u] * plain[k, u, c]
                    bend += rise[k, t, c] * risen
                    tilt += rise[k, t, c] * (ab[m, c, t] - put)
                    still += plain[k, t, c] * put
                    towards += plain[k, t, c] * ab[m, c, t]
                curve[m, k, c], slope[m, k, c] = bend, tilt
                errors[m, k] += still - 2 * towards
                most = max(most, bend)
    least = FLAT * max(most, TINY)
    for m in range(levels):
        for k in range(shines):
            for c in range(3):
                made = own[c]
                if diffuse and curve[m, k, c] > least:
                    made = slope[m, k, c] / curve[m, k, c]
                made = min(max(made, 0.0), room[k, c])
                matte[m, k, c] = made
                errors[m, k] += made * (made * curve[m, k, c] - 2 * slope[m, k, c])
