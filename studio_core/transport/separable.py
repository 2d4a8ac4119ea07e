"""Reflectance as a sum of products of a function of light's direction and one of the view's.

b(ω_i, ω_o) ≈ Σ_k h_k(ω_i) g_k(ω_o) over cells of directions (`cells`): what a glossy surface sends on is then
known from a few sums over the light that reaches it, whoever looks (Iwasaki et al., eq. 2 and 3). How many
products a shape needs is found from a tolerance. A lobe that is too sharp for as many as there may be becomes
a wider one of the same energy; see `factors`.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from studio_core.shading.artifacts import Shapes
from studio_core.shading.job import Job
from studio_core.transport.cell_means import Kernel, Traits, cell_means, ring_means, ring_measures, traits
from studio_core.transport.cells import CELLS, cell_projected_angles
from studio_core.transport.factors import Directed, Spectrum, Turning

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

SPILL = 0.03
"""Share of one direction's light that clamping at 0 may add; on average it adds a third of it."""
LEAST_SOFTNESS, MOST_SOFTNESS, HALVINGS = 0.4, 8.0, 5
KEPT = 64 << 20
"""Bytes of functions of shapes that are not in use any more."""
TIERS = 3
"""Tolerances whose last result is at hand."""
STEPS = 16
"""Most different shapes of one material; those of a picture that has more are taken together."""

_Key: TypeAlias = tuple[int, int, bytes]


@dataclass(frozen=True, eq=False)
class Separated:
    """Products of the rows (R) of some `Shapes`, T terms wide.

    matte (R, T): value of a term that is constant; such a term has no functions. Row r has count[r] functions
    in all; function k belongs to term[first[r] + k], and at cell c it is incoming[base[r] + c · count[r] + k]
    for light, without a cosine, and outgoing[…] for the view. The sum of a term's products, clamped at 0
    unless `signed` (R, T), is the term. Rows of equal shape share functions. error (R,) is the relative
    error √(∫∫ (made − b)² cos cos) / √(∫∫ b² cos cos) of its worst term; one that reflects little counts for
    the root of its share.
    """

    matte: F32
    signed: npt.NDArray[np.bool_]
    count: I64
    base: I64
    term: I32
    first: I64
    incoming: F32
    outgoing: F32
    error: F32

    @property
    def nbytes(self) -> int:
        """Of all arrays."""
        small = (self.matte, self.signed, self.count, self.base, self.term, self.first, self.error)
        return sum(a.nbytes for a in (self.incoming, self.outgoing, *small))

    def functions(self, row: int) -> tuple[F32, F32, I32]:
        """incoming, outgoing (CELLS, K) and term (K,) of one row."""
        count, base, first = int(self.count[row]), int(self.base[row]), int(self.first[row])
        own = slice(base, base + CELLS * count)
        shape = (CELLS, count)
        term = self.term[first : first + count]
        return self.incoming[own].reshape(shape), self.outgoing[own].reshape(shape), term


@dataclass(frozen=True, eq=False)
class _Products:
    """Of one shape: matte and signed (T,), incoming and outgoing (CELLS, K), term (K,)."""

    matte: F32
    signed: npt.NDArray[np.bool_]
    incoming: F32
    outgoing: F32
    term: I32
    error: float

    @property
    def nbytes(self) -> int:
        return self.incoming.nbytes + self.outgoing.nbytes


class Separator:
    """Makes `Separated`; shapes that were met before cost nothing."""

    def __init__(self) -> None:
        self._known: OrderedDict[tuple[_Key, object], _Products] = OrderedDict()
        self._last: dict[object, tuple[tuple[_Key, ...], Separated]] = {}
        self.made = 0

    def __call__(
        self, shapes: Shapes, tolerance: float = 0.15, most: int = 36, job: Job | None = None
    ) -> Separated:
        """So many products that the error is at most `tolerance`, but at most `most` a row.

        The same object where nothing changed since one was last asked for with this tolerance. `made` counts
        shapes that had to be taken apart; a cancelled `job` keeps those that were.
        """
        return self._all(shapes, (float(tolerance), int(most)), job)

    def fixed(self, shapes: Shapes, count: int) -> Separated:
        """`count` products a row: the plain truncated singular value decomposition, which rings."""
        return self._all(shapes, int(count))

    def _all(self, shapes: Shapes, how: tuple[float, int] | int, job: Job | None = None) -> Separated:
        keys = tuple(_keys(shapes))
        last = self._last.pop(how, None)
        if last is not None and last[0] == keys:
            self._last[how] = last
            return last[1]
        found: dict[_Key, _Products] = {}
        different = list(dict.fromkeys(keys))
        for number, key in enumerate(different):
            if job is not None:
                job.checkpoint(number, len(different))
            products = self._known.pop((key, how), None)
            if products is None:
                products = _products(key, how)
                self.made += 1
            self._known[(key, how)] = found[key] = products
        self._forget(len(found))
        made = _laid_out(keys, found, shapes.width)
        while len(self._last) >= TIERS:
            self._last.pop(next(iter(self._last)))
        self._last[how] = keys, made
        return made

    def _forget(self, used: int) -> None:
        """Drops what was not used for longest."""
        total = sum(one.nbytes for one in self._known.values())
        while total > KEPT and len(self._known) > used:
            total -= self._known.popitem(last=False)[1].nbytes


def _keys(shapes: Shapes) -> list[_Key]:
    """What each row's kernel is, with at most STEPS different ones a material."""
    ends = np.append(shapes.offset, len(shapes.data) - 1)[1:]
    keys = [
        (int(address), int(terms), shapes.data[start:end].tobytes())
        for address, terms, start, end in zip(shapes.address, shapes.terms, shapes.offset, ends, strict=True)
    ]
    if shapes.owner is None:
        return keys
    for owner in np.unique(shapes.owner):
        rows = np.flatnonzero(shapes.owner == owner)[1:]  # the first is that of its mean
        if len(rows) > STEPS:
            places = (np.arange(STEPS) + 0.5) * (len(rows) / STEPS)  # rows come in the order of their values
            nearest = (np.arange(len(rows)) * STEPS) // len(rows)
            for row, near in zip(rows.tolist(), nearest.tolist(), strict=True):
                keys[row] = keys[int(rows[int(places[near])])]
    return keys


def _products(key: _Key, how: tuple[float, int] | int) -> _Products:
    kernel = Kernel(key[0], key[1], np.frombuffer(key[2], np.float32))
    found = traits(kernel)
    own = np.flatnonzero(np.isnan(found.matte)).tolist()
    matte = np.nan_to_num(found.matte).astype(np.float32)
    spectra, weights = _spectra(kernel, found, own, how)
    if isinstance(how, tuple):
        chosen, error = _chosen(spectra, weights, *how)
    else:
        chosen, error = _plain(spectra, weights, how)
    incoming, outgoing, term = [np.zeros((CELLS, 0))], [np.zeros((CELLS, 0))], [np.zeros(0, np.int32)]
    for t, spectrum, values in zip(own, spectra, chosen, strict=True):
        light, view = spectrum.products(values)
        incoming.append(light)
        outgoing.append(view)
        term.append(np.full(light.shape[1], t, np.int32))
    most = how if isinstance(how, int) else sum(one.shape[1] for one in incoming)
    flat = [np.concatenate(parts, axis=1)[:, :most].astype(np.float32) for parts in (incoming, outgoing)]
    return _Products(matte, found.signed, flat[0], flat[1], np.concatenate(term)[:most], error)


def _spectra(
    kernel: Kernel, found: Traits, own: Sequence[int], how: tuple[float, int] | int
) -> tuple[list[Spectrum], F64]:
    """Of the terms that are not constant, and how each counts: by its mean reflectance, the most of all 1."""
    spectra: list[Spectrum] = []
    weights = []
    energy = isinstance(how, tuple)
    most = how[1] if isinstance(how, tuple) else how
    rings, cells = ring_measures(), cell_projected_angles()
    some = cells[found.alike.images[0]] * len(found.alike.images)
    turning, directed = [t for t in own if found.turns[t]], [t for t in own if not found.turns[t]]
    even = bool(found.even[turning].all())
    rounds = dict(zip(turning, ring_means(kernel, turning, even), strict=True)) if turning else {}
    others = dict(zip(directed, cell_means(kernel, directed, found.alike), strict=True)) if directed else {}
    for t in own:
        how_so = bool(found.reciprocal[t]), bool(found.signed[t])
        if t in rounds:
            spectra.append(Turning(rounds[t], *how_so, energy))
            weights.append(float(rings @ np.abs(rounds[t]).mean(axis=2) @ rings) / math.pi)
        else:
            spectra.append(Directed(others[t], found.alike, *how_so, most, energy))
            weights.append(float(some @ np.abs(others[t]) @ cells) / math.pi)
    limited = np.minimum(weights, 1.0)
    return spectra, limited / max(limited.max(initial=0.0), 1e-300)


def _chosen(
    spectra: Sequence[Spectrum], weights: F64, tolerance: float, most: int
) -> tuple[list[F64], float]:
    """Values (N,) of each spectrum, softened, 0 where left out; and the error that remains."""
    if not spectra:
        return [], 0.0
    scale = [math.sqrt(w) / max(s.norm, 1e-300) for w, s in zip(weights.tolist(), spectra, strict=True)]
    worth = np.concatenate([s.values * by for s, by in zip(spectra, scale, strict=True)])
    copies = np.concatenate([s.copies for s in spectra])
    which = np.repeat(np.arange(len(spectra)), [len(s.values) for s in spectra])
    order = np.argsort(-worth, kind="stable")
    order = order[worth[order] > 1e-7]
    used = np.cumsum(copies[order]) + sum(s.base for s in spectra)
    last = int(np.searchsorted(used, most, side="right"))
    left = np.zeros(len(order) + 1)
    for number in range(len(spectra)):
        own = (copies * worth**2 * (which == number))[order]
        left[:-1] = np.maximum(left[:-1], np.cumsum(own[::-1])[::-1])
    low = min(int(np.searchsorted(-left, -(tolerance**2))), last)  # no fewer can do
    high, found = last + 1, None
    number = low
    while low < high and low <= last:
        tau = float(worth[order[number]]) if number < len(order) else 0.0
        kept = np.zeros(len(worth), bool)
        kept[order[:number]] = True
        values, error = _softened(spectra, weights, scale, kept, tau)
        if error <= tolerance or found is None or found[1] > tolerance:
            found = values, error
        if error <= tolerance:
            high = number
        else:
            low = number + 1
        number = min(low + max(low // 4, 1), last) if high > last else (low + high) // 2
    assert found is not None
    return found


def _soft(spectrum: Spectrum, own: npt.NDArray[np.bool_], tau: float) -> tuple[F64, float]:
    """The values that are kept with as hard an end as what clamping adds allows, and their error."""
    ratio = np.where(own, np.minimum(tau / np.maximum(spectrum.values, 1e-300), 1.0), 1.0)
    kept = np.where(own, spectrum.values, 0.0)
    error, spill = spectrum.measure(kept)
    if spill <= SPILL or tau <= 0:
        return kept, error
    values, low, high = kept, LEAST_SOFTNESS, MOST_SOFTNESS
    for _ in range(HALVINGS):
        softness = math.sqrt(low * high)
        tried = kept * (1 - ratio**softness)
        off, spill = spectrum.measure(tried)
        if spill <= SPILL:
            values, error, low = tried, off, softness
        else:
            high = softness
    if values is kept:
        values = kept * (1 - ratio**LEAST_SOFTNESS)
        error, _ = spectrum.measure(values)
    return values, error


def _softened(
    spectra: Sequence[Spectrum], weights: F64, scale: Sequence[float], kept: npt.NDArray[np.bool_], tau: float
) -> tuple[list[F64], float]:
    """As hard an end of each spectrum as what clamping adds allows."""
    made, start, total = [], 0, 0.0
    for weight, spectrum, by in zip(weights.tolist(), spectra, scale, strict=True):
        own = kept[start : start + len(spectrum.values)]
        start += len(own)
        values, off = _soft(spectrum, own, tau / by)
        made.append(values)
        total = max(total, weight * off**2)
    return made, math.sqrt(total)


def _plain(spectra: Sequence[Spectrum], weights: F64, count: int) -> tuple[list[F64], float]:
    """The `count` largest values, and what the others leave."""
    if not spectra:
        return [], 0.0
    scale = [math.sqrt(w) / max(s.norm, 1e-300) for w, s in zip(weights.tolist(), spectra, strict=True)]
    worth = np.concatenate([s.values * by for s, by in zip(spectra, scale, strict=True)])
    copies = np.concatenate([s.copies for s in spectra])
    order = np.argsort(-worth, kind="stable")
    before = np.cumsum(copies[order]) - copies[order]
    kept = np.zeros(len(worth), bool)
    kept[order[before < count]] = True
    within = np.minimum(np.maximum(count - before, 0), copies[order])
    of = np.zeros(len(worth))
    of[order] = within * worth[order] ** 2
    made, start, error = [], 0, 0.0
    for weight, spectrum in zip(weights.tolist(), spectra, strict=True):
        own = slice(start, start + len(spectrum.values))
        start = own.stop
        made.append(np.where(kept[own], spectrum.values, 0.0))
        error = max(error, weight - float(of[own].sum()))
    return made, math.sqrt(error)


def _laid_out(keys: Sequence[_Key], found: dict[_Key, _Products], width: int) -> Separated:
    base, first, length, number = {}, {}, 0, 0
    for key, one in found.items():
        base[key], first[key] = length, number
        length += one.incoming.size
        number += len(one.term)
    rows = [found[key] for key in keys]
    matte, signed = np.zeros((len(rows), width), np.float32), np.zeros((len(rows), width), bool)
    for row, one in enumerate(rows):
        matte[row, : len(one.matte)], signed[row, : len(one.signed)] = one.matte, one.signed
    nothing = np.zeros(0, np.float32)
    return Separated(
        matte,
        signed,
        np.array([len(one.term) for one in rows], np.int64),
        np.array([base[key] for key in keys], np.int64),
        np.concatenate([np.zeros(0, np.int32), *(one.term for one in found.values())]),
        np.array([first[key] for key in keys], np.int64),
        np.concatenate([nothing, *(one.incoming.ravel() for one in found.values())]),
        np.concatenate([nothing, *(one.outgoing.ravel() for one in found.values())]),
        np.array([one.error for one in rows], np.float32),
    )


def fixed(shapes: Shapes, count: int) -> Separated:
    """`Separator.fixed` without a memory."""
    return Separator().fixed(shapes, count)


__all__ = ["SPILL", "Separated", "Separator", "fixed"]
