"""The whole fit of a BTF: a model for its average, then what every texel has of its own, as pictures pass by.

First pass: the average over all texels under every pair of directions, and a few hundred texels in full. The
average is one surface seen from many sides, so the model of photographs is fitted to it (`parametric`), and
the table of what it lacks. On the few texels bases are compared by lights and views that they have not seen.
Second pass: the chosen basis of all texels at once (`btf_solve`). A third one, over what was held back, tells
the error. Texels need no turning into a frame of theirs: BTFs are measured in the surface's.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from studio_core.errors import InputError
from studio_core.parallel import Workers
from studio_core.shading.job import Job
from studio_plugins.residual.bases import BASES, Basis
from studio_plugins.residual.btf import Block, Btf, Indices, unique_directions
from studio_plugins.residual.btf_solve import GrowingSolve
from studio_plugins.residual.errors import Errors
from studio_plugins.residual.frames import tangent_frames
from studio_plugins.residual.masks import HIGHLIGHT_ANGLE
from studio_plugins.residual.parametric import SHAPES, Parametric, best_parametric
from studio_plugins.residual.result import Candidate, ResidualFit, Settings
from studio_plugins.residual.samples import F32, F64, Flags, Lights, Samples
from studio_plugins.residual.shading import GRAZING, Shared, shade
from studio_plugins.residual.tables import fit_table

_PROBES, _PROBE_BYTES = 400, 100_000_000  # texels that are kept in full
_CLOSE = 0.06  # of ln error: as good
_FOLD = 4  # every fourth light, and every fourth view, in turn
_CLIPPED = 0.05  # share of clipped texels from which an average says nothing


@dataclass(frozen=True)
class BtfErrors:
    """On pictures held back: of the fit, and of its parametric model alone."""

    made: Errors
    alone: Errors
    pictures: int


def fit_btf(
    btf: Btf,
    settings: Settings | None = None,
    held: Flags | None = None,
    job: Job | None = None,
    *,
    size: int = 0,
    workers: Workers | None = None,
) -> tuple[ResidualFit, BtfErrors | None]:
    """Fit to all pictures but those `held` (m,), and its errors on these.

    `size`: texels of the longer side at most, 0 for all there are. The result's views are (0, 0, 1), its
    lights those of the pictures. InputError where there is nothing to fit.
    """
    settings, job = settings or Settings(), job or Job("fit a BTF")
    _check(settings)
    away = np.zeros(len(btf.lights), np.bool_) if held is None else np.asarray(held)
    seen = (btf.lights[:, 2] > GRAZING) & (btf.views[:, 2] > GRAZING)
    train, test = np.flatnonzero(seen & ~away), np.flatnonzero(seen & away)
    if len(train) < 12:
        raise InputError("the material cannot be fitted: hardly any light and view is above the sample")
    run = _Run(btf, size, job, total=2 * len(train) + len(test), workers=workers)
    survey = run.survey(train)
    average = survey.samples(btf.lights[train], btf.views[train])
    model = best_parametric(average, settings.models, use=average.usable)
    trial = _Trial(btf.lights[train], btf.views[train], survey, model)
    basis, with_table, tried = trial.chosen(settings)
    shared = trial.shared(with_table, np.ones(len(train), np.bool_))
    coefficients, rank = run.coefficients(train, shared, basis, settings)
    height, width = run.shape
    normals = np.zeros((height, width, 3), np.float32)
    normals[..., 2] = 1
    notes = [*btf.notes]
    if model.at_bound:
        notes.append("a shape of the reflectance model is at the end of its range")
    lights = unique_directions(btf.lights[seen])[0]
    made = ResidualFit(
        shared,
        basis,
        coefficients.reshape(height, width, basis.size, 3),
        rank.reshape(height, width),
        normals,
        normals,
        Lights.of(lights, btf.source),
        tried,
        tuple(notes),
    )
    return made, run.errors(test, made) if len(test) else None


def lights_held(btf: Btf, share: float, seed: int = 0) -> Flags:
    """(m,) all pictures of a random share of the lights. InputError where that can't be."""
    lights, which = unique_directions(btf.lights)
    if not 0 < share < 1 or len(lights) < 4:
        raise InputError(f"{share:g} of {len(lights)} lights cannot be held back")
    count = min(max(round(share * len(lights)), 1), len(lights) - 3)
    chosen = np.random.default_rng(seed).permutation(len(lights))[:count]
    return np.isin(which, chosen)


def _check(settings: Settings) -> None:
    for name in settings.models:
        if name not in SHAPES:
            raise InputError(f"there is no reflectance model {name!r}; known: {', '.join(SHAPES)}")
    if settings.basis and settings.basis not in BASES:
        raise InputError(f"there is no basis {settings.basis!r}; known: {', '.join(BASES)}")


@dataclass(frozen=True, eq=False)
class _Curves:
    """Of each picture (m): what the shared part says (m, 3), the model alone (m, 3), the basis' columns
    (m, k), and whether it is outside the highlight (m,)."""

    shared: F32
    alone: F32
    rows: F32
    outside: Flags

    @classmethod
    def of(cls, shared: Shared, basis: Basis, lights: F64, views: F64) -> _Curves:
        normals = np.zeros((len(lights), 3), np.float32)
        normals[:, 2] = 1
        made = shade(shared, normals, views.astype(np.float32), lights)
        rows = made.columns(basis.name, tangent_frames(normals))
        return cls(made.shared, made.alone, rows, made.half < np.cos(HIGHLIGHT_ANGLE))


@dataclass(frozen=True, eq=False)
class _Survey:
    """Averages (m, 3) and what share of texels they leave out (m,); some texels in full: values (m, t, 3) and
    whether they count (m, t)."""

    average: F64
    lost: F64
    values: F32
    usable: Flags

    def samples(self, lights: F64, views: F64) -> Samples:
        """The average as a surface whose texels are the views."""
        at_light, which_light = unique_directions(lights)
        at_view, which_view = unique_directions(views)
        shape = len(at_light), 1, len(at_view)
        values, usable = np.zeros((*shape, 3), np.float32), np.zeros(shape, np.bool_)
        values[which_light, 0, which_view] = self.average
        usable[which_light, 0, which_view] = self.lost < _CLIPPED
        towards = np.broadcast_to(at_view.astype(np.float32), (1, len(at_view), 3))
        normals = np.zeros_like(towards)
        normals[..., 2] = 1
        return Samples(values, usable, normals, towards, Lights.of(at_light))


class _Run:
    """The passes over a BTF's pictures."""

    def __init__(self, btf: Btf, size: int, job: Job, total: int, workers: Workers | None) -> None:
        self._btf, self._job, self._total, self._workers = btf, job, total, workers
        self._done = 0
        height, width = btf.size
        scale = min(size / max(height, width), 1.0) if size else 1.0
        self.shape = max(round(height * scale), 1), max(round(width * scale), 1)

    def survey(self, which: Indices) -> _Survey:
        texels = self.shape[0] * self.shape[1]
        count = min(_PROBES, texels, max(_PROBE_BYTES // (len(which) * 12), 50))
        probes = np.random.default_rng(texels).choice(texels, count, replace=False)
        average, lost = np.zeros((len(which), 3)), np.zeros(len(which))
        values = np.empty((len(which), count, 3), np.float32)
        usable = np.ones((len(which), count), np.bool_)
        first = 0
        for _, pictures, good in self._pictures(which):
            part = slice(first, first + len(pictures))
            first += len(pictures)
            values[part] = pictures[:, probes]
            if good is None:
                average[part] = pictures.mean(axis=1, dtype=np.float64)
                continue
            usable[part] = good[:, probes]
            kept = np.maximum(good.sum(axis=1), 1)
            average[part] = (pictures * good[..., None]).sum(axis=1, dtype=np.float64) / kept[:, None]
            lost[part] = 1 - good.mean(axis=1)
        return _Survey(average, lost, values, usable)

    def coefficients(
        self, which: Indices, shared: Shared, basis: Basis, settings: Settings
    ) -> tuple[F32, np.ndarray]:
        state = GrowingSolve(self.shape[0] * self.shape[1], basis.size, self._workers)
        curves = _Curves.of(shared, basis, self._btf.lights[which], self._btf.views[which])
        first = 0
        if basis.size:
            for _, pictures, good in self._pictures(which):
                part = slice(first, first + len(pictures))
                first += len(pictures)
                lacking = pictures - curves.shared[part, None]
                weights = None if good is None else good.astype(np.float32)
                state.add(curves.rows[part], lacking, weights)
        return state.solved(basis.stages, settings.solver.truncation)

    def errors(self, which: Indices, made: ResidualFit) -> BtfErrors:
        curves = _Curves.of(made.shared, made.basis, self._btf.lights[which], self._btf.views[which])
        own = made.coefficients.reshape(-1, made.basis.size, 3)
        flat = np.ascontiguousarray(np.moveaxis(own, 1, 0)).reshape(made.basis.size, -1)
        sums = np.zeros((2, 2, 2))  # fit or model, outside or within, difference or power
        first = 0
        for _, pictures, good in self._pictures(which):
            for k, picture in enumerate(pictures):
                i = first + k
                use = slice(None) if good is None else good[k]
                told = curves.shared[i] + (curves.rows[i] @ flat).reshape(-1, 3)
                region = 0 if curves.outside[i] else 1
                power = float((picture[use].astype(np.float64) ** 2).sum())
                for one, guess in enumerate((np.maximum(told, 0), curves.alone[i])):
                    off = float(((guess - picture)[use].astype(np.float64) ** 2).sum())
                    sums[one, region] += off, power
            first += len(pictures)
        made_errors, alone = (_errors(part) for part in sums)
        return BtfErrors(made_errors, alone, len(which))

    def _pictures(self, which: Indices) -> Iterator[tuple[Indices, F32, Flags | None]]:
        """Indices, values (b, t, 3) and whether they count (b, t; None: all) of every block."""
        for block in self._btf.blocks(which):
            self._job.checkpoint(self._done, self._total)
            self._done += len(block.indices)
            yield self._smaller(block)

    def _smaller(self, block: Block) -> tuple[Indices, F32, Flags | None]:
        values, clipped = block.values, block.clipped
        count = len(values)
        if self.shape != self._btf.size:
            import cv2

            def fewer(picture: F32) -> F32:
                return np.asarray(cv2.resize(picture, self.shape[::-1], interpolation=cv2.INTER_AREA))

            values = np.stack([fewer(one) for one in values])
            if clipped is not None:
                clipped = np.stack([fewer(one.astype(np.float32)) > 0 for one in clipped])
        good = None if clipped is None else ~clipped.reshape(count, -1)
        return block.indices, values.reshape(count, -1, 3), good


def _errors(sums: F64) -> Errors:
    (outside, within), both = sums, sums.sum(axis=0)
    whole, out, inside = (float(off / power) if power > 0 else 0.0 for off, power in (both, outside, within))
    return Errors(whole, out, inside)


class _Trial:
    """Bases compared on a few texels, by lights and views that were held back in turn."""

    def __init__(self, lights: F64, views: F64, survey: _Survey, model: Parametric) -> None:
        self._lights, self._views, self._survey, self._model = lights, views, survey, model
        self._folds = []
        for which in (unique_directions(lights)[1], unique_directions(views)[1]):
            order = np.random.default_rng(5).permutation(int(which.max()) + 1)
            if len(order) >= _FOLD:
                self._folds.append(np.isin(which, order[::_FOLD]))

    def shared(self, with_table: bool, train: Flags) -> Shared:
        """The model, and the table of what the average lacks under some of the pictures."""
        plain = Shared(self._model)
        if not with_table:
            return plain
        normals = np.zeros((len(train), 3), np.float32)
        normals[:, 2] = 1
        made = shade(plain, normals, self._views.astype(np.float32), self._lights)
        lacking = (self._survey.average - made.alone).astype(np.float32)
        weights = (train & (self._survey.lost < _CLIPPED)).astype(np.float32)
        return Shared(self._model, fit_table(made.half, made.cosine, lacking, weights))

    def chosen(self, settings: Settings) -> tuple[Basis, bool, tuple[Candidate, ...]]:
        """The basis with the fewest bytes among those that are best, and whether the table helps."""
        names: Sequence[str] = (settings.basis,) if settings.basis else settings.among
        if not self._folds:
            return BASES[names[-1]], False, ()
        first = [self._of(BASES[name], False, settings) for name in ("none", "albedo")]
        with_table = False
        tried = list(first)
        if settings.table:
            tabled = [self._of(BASES[name], True, settings) for name in ("none", "albedo")]
            with_table = min(map(_score, tabled)) < min(map(_score, first)) - _CLOSE
            tried += tabled
        known = {(one.basis, one.table) for one in tried}
        tried += [self._of(BASES[n], with_table, settings) for n in names if (n, with_table) not in known]
        allowed = {*names, *(["none"] if settings.cautious else [])}
        fair = [c for c in tried if c.basis in allowed]
        if settings.cautious:
            fair = [c for c in fair if c.nmse <= first[0].nmse * 1.0001] or fair
        least = min(map(_score, fair))
        best = min(
            (c for c in fair if _score(c) <= least + _CLOSE), key=lambda c: (c.bytes_per_texel, c.table)
        )
        return BASES[best.basis], best.table, tuple(tried)

    def _of(self, basis: Basis, with_table: bool, settings: Settings) -> Candidate:
        off, power = np.zeros(2), np.zeros(2)
        values, usable = self._survey.values, self._survey.usable
        for held in self._folds:
            curves = _Curves.of(self.shared(with_table, ~held), basis, self._lights, self._views)
            state = GrowingSolve(values.shape[1], basis.size)
            train = np.flatnonzero(~held)
            for first in range(0, len(train), 256):
                i = train[first : first + 256]
                state.add(curves.rows[i], values[i] - curves.shared[i, None], usable[i].astype(np.float32))
            own, _ = state.solved(basis.stages, settings.solver.truncation)
            made = curves.shared[held, None] + np.einsum("mk,tkc->mtc", curves.rows[held], own)
            squared = ((np.maximum(made, 0) - values[held]).astype(np.float64) ** 2).sum(axis=-1)
            seen = (values[held].astype(np.float64) ** 2).sum(axis=-1)
            for k, region in enumerate((usable[held], usable[held] & curves.outside[held, None])):
                off[k] += squared[region].sum()
                power[k] += seen[region].sum()
        whole, outside = (off / np.maximum(power, 1e-30)).tolist()
        return Candidate(basis.name, with_table, whole, outside, basis.bytes_per_texel)


def _score(one: Candidate) -> float:
    return float(np.log(one.nmse + 1e-7) + np.log(one.outside + 1e-7))
