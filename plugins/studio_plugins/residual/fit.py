"""The whole fit in order: model, lights, model again, table, basis, coefficients."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np

from studio_core.colour import LUMINANCE
from studio_core.errors import InputError
from studio_core.shading.job import Job
from studio_plugins.residual.bases import BASES, Basis
from studio_plugins.residual.frames import tangent_frames
from studio_plugins.residual.masks import lit, outside_highlight, sample_weights
from studio_plugins.residual.parametric import SHAPES, Parametric, best_parametric
from studio_plugins.residual.refine import refined
from studio_plugins.residual.result import Candidate, ResidualFit, Settings
from studio_plugins.residual.samples import F32, Flags, Samples
from studio_plugins.residual.shading import Shade, Shared, shade
from studio_plugins.residual.solve import Solver, solve
from studio_plugins.residual.splits import folds
from studio_plugins.residual.tables import Table, fit_table

_TRIED = 900  # texels on which bases are compared
_CLOSE = 0.06  # of ln error: as good
_CHUNK = 16384  # texels at a time


def fit(samples: Samples, settings: Settings | None = None, job: Job | None = None) -> ResidualFit:
    """Fit a material to all given lights. InputError where there is nothing to fit."""
    settings, job = settings or Settings(), job or Job("fit a material")
    for name in settings.models:
        if name not in SHAPES:
            raise InputError(f"there is no reflectance model {name!r}; known: {', '.join(SHAPES)}")
    if settings.basis and settings.basis not in BASES:
        raise InputError(f"there is no basis {settings.basis!r}; known: {', '.join(BASES)}")
    use = _trusted(samples, settings)
    if np.count_nonzero(use) < 100:
        raise InputError(
            "the material cannot be fitted: hardly anything is lit and not clipped in the pictures"
        )
    searched = len(settings.models)
    total = searched + 2 + (settings.refine + settings.refine - 1 + searched if settings.refine else 0)
    done = itertools.count(1)

    def step() -> None:
        job.checkpoint(next(done), total)

    model = first = best_parametric(samples, settings.models, use=use, step=step)
    lights, as_told, trusted = samples.lights, samples, use
    for turn in range(settings.refine):
        mended = None
        if settings.table:
            some = _Texels.of(samples, _spread(samples, use), settings)
            mended = some.table(model, np.ones(len(samples.lights), np.bool_))
        shared = Shared(model, mended)
        samples = samples.lit_by(refined(samples, shared, _albedo(samples, shared, settings), use))
        use = _trusted(samples, settings)
        step()
        models = settings.models if turn == settings.refine - 1 else (model.model,)
        model = best_parametric(samples, models, use=use, step=step)
    texels = _Texels.of(samples, _spread(samples, use), settings)
    shared, basis, tried = _chosen(texels, model, settings)
    refused = False
    if settings.refine and settings.cautious and tried:
        plain = _Texels.of(as_told, _spread(as_told, trusted), settings)
        other = _chosen(plain, first, settings)
        if _least(other[2]) < _least(tried):
            samples, model, texels, refused = as_told, first, plain, True
            shared, basis, tried = other
    if settings.table and shared.table is not None:
        shared = Shared(model, texels.table(model, np.ones(len(samples.lights), np.bool_)))
    step()
    coefficients, rank = _coefficients(samples, shared, basis, settings)
    step()
    return ResidualFit(
        shared,
        basis,
        coefficients,
        rank,
        samples.normals,
        samples.views,
        samples.lights,
        tried,
        _notes(model, lights.directions, samples, rank, basis, refused),
    )


def relit(fitted: ResidualFit, samples: Samples) -> Samples:
    """Samples of lights that were held back, with these refined by the finished material (not the
    reverse).
    """
    extra = np.zeros((*samples.size, 3), np.float32)
    use = samples.usable & lit(samples)
    if fitted.basis.name.startswith("albedo"):
        extra = fitted.coefficients[:, :, 0]
    return samples.lit_by(refined(samples, fitted.shared, extra, use))


def _trusted(samples: Samples, settings: Settings) -> Flags:
    use = lit(samples) if settings.masks.shadow else np.ones(samples.usable.shape, np.bool_)
    return use & samples.usable if settings.masks.clipped else use


def _notes(
    model: Parametric, told: object, samples: Samples, rank: object, basis: Basis, refused: bool
) -> tuple[str, ...]:
    made = []
    if refused:
        made.append(
            "light directions stay as told: refined ones predict lights that were held back no better"
        )
    if model.at_bound:
        made.append("a shape of the reflectance model is at the end of its range")
    off = np.degrees(np.arccos(np.clip((np.asarray(told) * samples.lights.directions).sum(axis=1), -1, 1)))
    if off.max() > 0.05:
        made.append(
            f"light directions were refined by {off.mean():.2f}° on average, {off.max():.2f}° at most"
        )
    if basis.size and np.median(np.asarray(rank)[np.asarray(rank) > 0]) < basis.size:
        made.append(
            "the lights tell less than the basis has columns: what they do not tell is left at nothing"
        )
    return tuple(made)


def _spread(samples: Samples, use: Flags) -> np.ndarray:
    """Indices of texels that are spread over all that are seen under several lights."""
    seen = np.flatnonzero(use.sum(axis=0).ravel() >= min(4, len(use)))
    if len(seen) <= _TRIED:
        return seen
    return np.random.default_rng(len(seen)).choice(seen, _TRIED, replace=False)


@dataclass(frozen=True, eq=False)
class _Texels:
    """Some texels in a row, under all lights: values (n, t, 3), normals, views, frames, and settings."""

    samples: Samples
    frames: F32
    settings: Settings

    @classmethod
    def of(cls, samples: Samples, which: np.ndarray, settings: Settings) -> _Texels:
        n = len(samples.lights)
        row = Samples(
            samples.values.reshape(n, -1, 3)[:, which][:, None],
            samples.usable.reshape(n, -1)[:, which][:, None],
            samples.normals.reshape(-1, 3)[which][None],
            samples.views.reshape(-1, 3)[which][None],
            samples.lights,
            samples.noise,
        )
        return cls(row, tangent_frames(row.normals), settings)

    def shades(self, shared: Shared) -> list[Shade]:
        return [
            shade(shared, self.samples.normals, self.samples.views, d) for d in self.samples.lights.directions
        ]

    def table(self, model: Parametric, train: Flags) -> Table:
        """What these texels lack in common under some of the lights, each texel's own albedo divided out."""
        chosen = np.flatnonzero(train)
        shades = [s for s, used in zip(self.shades(Shared(model)), train, strict=True) if used]
        values, usable = self.samples.values[chosen], self.samples.usable[chosen]
        masks = replace(self.settings.masks, highlight=False)
        weights = sample_weights(values, usable, shades, masks)
        gloss = np.stack([s.shine for s in shades])[..., None] * _direction(model)
        alone = np.stack([s.alone for s in shades])
        half, cosine = np.stack([s.half for s in shades]), np.stack([s.cosine for s in shades])
        table = None
        for _ in range(2):
            own = self._albedos(Shared(model, table), train)
            lacking = np.asarray((values - gloss) / np.maximum(own, 0.1) - (alone - gloss), np.float32)
            weight = weights * (np.minimum(own, 4) ** 2).mean(axis=-1)
            table = fit_table(
                half.ravel(), cosine.ravel(), lacking.reshape(-1, 3), weight.ravel().astype(np.float32)
            )
        assert table is not None
        return table

    def _albedos(self, shared: Shared, train: Flags) -> F32:
        """(1, t, 3) each texel's albedo, over the shared one."""
        _, coefficients, _ = self.solved(shared, BASES["albedo"], train)
        base = np.maximum(
            shared.parametric.colours[0], 1e-4 * max(float(shared.parametric.colours[0].max()), 1e-9)
        )
        return np.asarray(1 + coefficients[None, :, 0] / base, np.float32)

    def solved(self, shared: Shared, basis: Basis, train: Flags) -> tuple[F32, F32, np.ndarray]:
        """What the basis adds under every light (n, 1, t, 3) when it was fitted under some; coefficients;
        rank.
        """
        shades = self.shades(shared)
        lacking = self.samples.values - np.stack([s.shared for s in shades])
        masks = self.settings.masks
        if basis.name == "albedo-gloss":
            masks = replace(masks, highlight=False)
        weights = (
            sample_weights(self.samples.values, self.samples.usable, shades, masks) * train[:, None, None]
        )
        design = np.stack([s.columns(basis.name, self.frames) for s in shades])[:, 0].swapaxes(0, 1)
        wanted, weight = lacking[:, 0].swapaxes(0, 1), weights[:, 0].T
        solver = self._solver()
        found, ranks = [], np.zeros(design.shape[0], np.uint8)
        first = 0
        for size in basis.stages:
            part = design[:, :, first : first + size]
            one = solve(np.ascontiguousarray(part), wanted, weight, solver)
            wanted = wanted - part @ one.coefficients
            found.append(one.coefficients)
            ranks = ranks + one.rank
            first += size
        coefficients = np.concatenate(found, axis=1)
        added = (design @ coefficients).swapaxes(0, 1)[:, None]
        return added, coefficients, ranks

    def told(self, basis: Basis, model: Parametric) -> bool:
        """Whether the lights tell all columns apart, so that the basis may be trusted elsewhere.

        H's own columns may always be used: what is not told of them is left at nothing.
        """
        if basis.name in ("none", "half", "albedo-gloss", "albedo-half", "albedo-light"):
            return True
        shades = self.shades(Shared(model))
        some = np.stack([s.columns(basis.name, self.frames) for s in shades])[:, 0, :50].swapaxes(0, 1)
        values = np.linalg.svd(some, compute_uv=False)
        return bool(
            np.median(values[:, -1] / np.maximum(values[:, 0], 1e-12)) > self.settings.solver.truncation
        )

    def _solver(self) -> Solver:
        return replace(self.settings.solver, floor=max(self.settings.solver.floor, self.samples.noise))


def _albedo(samples: Samples, shared: Shared, settings: Settings) -> F32:
    """(h, w, 3) what each texel's albedo has more than the shared one."""
    plain = replace(settings, solver=replace(settings.solver, shrink=False))
    return _coefficients(samples, shared, BASES["albedo"], plain)[0][:, :, 0]


def _coefficients(
    samples: Samples, shared: Shared, basis: Basis, settings: Settings
) -> tuple[F32, np.ndarray]:
    """(h, w, k, 3) of all texels, and the ranks of their designs (h, w)."""
    height, width = samples.size
    made = np.zeros((height * width, basis.size, 3), np.float32)
    rank = np.zeros(height * width, np.uint8)
    if basis.size:
        every = np.ones(len(samples.lights), np.bool_)
        for first in range(0, height * width, _CHUNK):
            which = np.arange(first, min(first + _CHUNK, height * width))
            _, made[which], rank[which] = _Texels.of(samples, which, settings).solved(shared, basis, every)
    return made.reshape(height, width, basis.size, 3), rank.reshape(height, width)


def _chosen(
    texels: _Texels, model: Parametric, settings: Settings
) -> tuple[Shared, Basis, tuple[Candidate, ...]]:
    """The shared part and the basis with the fewest bytes among those that are best on lights held back.

    Whether the table helps is asked first, under the smallest bases.
    """
    lights = texels.samples.lights
    every = np.ones(len(lights), np.bool_)
    parts = folds(lights, 2)
    wanted = [BASES[name] for name in ((settings.basis,) if settings.basis else settings.among)]
    if not parts or (len(wanted) == 1 and not settings.table and not settings.cautious):
        return Shared(model), wanted[-1], ()
    trial = _Trial(texels, model, parts)
    small = [BASES[name] for name in ("none", "albedo")]
    tried = [trial.of(basis, False) for basis in small]
    with_table = False
    if settings.table:
        tabled = [trial.of(basis, True) for basis in small]
        with_table = min(map(_score, tabled)) < min(map(_score, tried)) - _CLOSE
        tried += tabled
    known = {(one.basis, one.table) for one in tried}
    for basis in wanted:
        if (basis.name, with_table) not in known and texels.told(basis, model):
            tried.append(trial.of(basis, with_table))
    plain = tried[0]
    allowed = {basis.name for basis in wanted} | ({"none"} if settings.cautious else set())
    fair = [
        c for c in tried if c.basis in allowed and (not settings.cautious or c.nmse <= plain.nmse * 1.0001)
    ]
    fair = fair or [c for c in tried if c.basis in allowed] or [plain]
    least = min(map(_score, fair))
    best = min((c for c in fair if _score(c) <= least + _CLOSE), key=lambda c: (c.bytes_per_texel, c.table))
    table = texels.table(model, every) if best.table else None
    return Shared(model, table), BASES[best.basis], tuple(tried)


def _direction(model: Parametric) -> F32:
    """(3,) the highlight's colour, of luminance 1."""
    colour = model.colours[model.matte_terms :].sum(axis=0)
    luminance = float(colour @ np.array(LUMINANCE))
    return np.asarray(colour / luminance if luminance > 0 else np.ones(3), np.float32)


def _least(tried: tuple[Candidate, ...]) -> float:
    return min(map(_score, tried))


def _score(one: Candidate) -> float:
    """Of error in all and outside the highlight alike, for both have their own scale."""
    return float(np.log(one.nmse + 1e-7) + np.log(one.outside + 1e-7))


class _Trial:
    """Bases compared on lights that they have not seen."""

    def __init__(self, texels: _Texels, model: Parametric, parts: list[Flags]) -> None:
        self.texels, self.model, self.parts = texels, model, parts
        use = texels.samples.usable & lit(texels.samples)
        self.regions = use, use & outside_highlight(texels.samples)
        self._shared: dict[tuple[int, bool], Shared] = {}

    def of(self, basis: Basis, with_table: bool) -> Candidate:
        """A basis' errors, summed over all parts held back."""
        values = self.texels.samples.values
        off, power = np.zeros(2), np.zeros(2)
        for part, held in enumerate(self.parts):
            key = part, with_table
            if key not in self._shared:
                table = self.texels.table(self.model, ~held) if with_table else None
                self._shared[key] = Shared(self.model, table)
            shared = self._shared[key]
            made = np.stack([s.shared for s in self.texels.shades(shared)])[held]
            if basis.size:
                made = made + self.texels.solved(shared, basis, ~held)[0][held]
            squared = (np.maximum(made, 0) - values[held]).astype(np.float64) ** 2
            for k, region in enumerate(self.regions):
                off[k] += squared[region[held]].sum()
                power[k] += (values[held][region[held]].astype(np.float64) ** 2).sum()
        whole, outside = (off / np.maximum(power, 1e-30)).tolist()
        return Candidate(basis.name, with_table, whole, outside, basis.bytes_per_texel)
