"""The kind `fitter` of the registry: a request becomes a material of the scene that can be asked how good it
is, lamp by lamp.

Lamps are held back from a first fit, which is then asked about them; their own places and brightness are
refined by it, as those of all others were, never the reverse. The material itself is made of all lamps,
unless the request says otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from studio_core.errors import InputError
from studio_core.fitting import NONE, Figures, FitRequest, LampError, Quality
from studio_core.scene.nodes import Material
from studio_core.shading.job import Job
from studio_core.shading.job_parts import JobPart
from studio_plugins.residual.fit import fit, relit
from studio_plugins.residual.masks import lit, outside_highlight
from studio_plugins.residual.material import SHOWN, SceneMaterial, scene_material
from studio_plugins.residual.reading import read_samples
from studio_plugins.residual.result import ResidualFit, Settings
from studio_plugins.residual.samples import F32, Flags, Lights, Samples
from studio_plugins.residual.splits import SPLITS

_MODELS = {
    "lambert": "matte",
    "rough-lambert": "matte, rough or smooth",
    "rough-blinn": "matte with a highlight (Blinn–Phong)",
    "rough-ggx": "matte with a highlight (GGX)",
    "rough-two-blinn": "matte with two highlights (Blinn–Phong)",
    "rough-two-ggx": "matte with two highlights (GGX)",
}
_BASES = {
    "none": "nothing",
    "albedo": "its colour",
    "albedo-gloss": "its colour and its shine",
    "half": "how it differs along the half vector",
    "albedo-half": "its colour, and how it differs along the half vector",
    "albedo-light": "its colour, and how it is tilted to the light",
}
"""In words, for reports."""
_LIVE = 128  # texels a side that are relit while a hand drags the lamp
_READ, _FITTED, _MEASURED = 0.15, 0.7, 0.75  # of the whole work


@dataclass(frozen=True)
class ResidualFitter:
    """Spheres and flat samples, by a model that all spots share and what each has of its own."""

    label: str = "Ball or flat sample under known lamps"
    settings: Settings = Settings(among=SHOWN)

    def fit(self, request: FitRequest, job: Job) -> FittedPhotographs:
        """Read, fit, measure. InputError in one sentence; Cancelled at the next step."""
        if request.held not in (*SPLITS, NONE):
            known = ", ".join((*SPLITS, NONE))
            raise InputError(f"there is no way {request.held!r} of holding lamps back; known: {known}")
        samples, found, notes = read_samples(request, JobPart(job, 0.0, _READ, "Reading photographs"))
        held = _held(request.held, samples.lights)
        fitting = JobPart(job, _READ, _FITTED, "Fitting")
        fitting.at(0.0)
        measured = fit(samples.some(~held), self.settings, fitting)
        test = _as_measured(measured, samples, held, bool(self.settings.refine))
        asked = _asked(measured, test, JobPart(job, _FITTED, _MEASURED, "Asking about every lamp"))
        if held.any():
            asking = JobPart(job, _MEASURED, _MEASURED, "Asking about lamps as told")
            found["unseen_as_told"] = asdict(_quality(_asked(measured, samples.some(held), asking)))
        made = measured
        if request.whole and held.any():
            shared = measured.shared.parametric.model
            settings = replace(self.settings, models=(shared,), basis=measured.basis.name)
            again = JobPart(job, _MEASURED, 1.0, "Fitting to all lamps")
            again.at(0.0)
            made = fit(samples, settings, again)
        scene = scene_material(made, request.folder.name or "Captured")
        notes = (*notes, *made.notes, *scene.notes)
        return FittedPhotographs(scene, made, measured, test, held, asked, found, notes)


def _held(name: str, lights: Lights) -> Flags:
    if name == NONE:
        return np.zeros(len(lights), np.bool_)
    held = SPLITS[name](lights)
    if not held.any() or held.all():
        raise InputError(
            f"these {len(lights)} lamps cannot be parted so that some are held back: hold none back,"
            " or others"
        )
    return held


def _as_measured(made: ResidualFit, samples: Samples, held: Flags, refine: bool) -> Samples:
    """All lamps as the fit knows them: its own refined by it, those held back by the finished material.

    Where it left its own as told, these stay as told, too.
    """
    towards, strengths = samples.lights.directions.copy(), samples.lights.strengths.copy()
    known = made.lights
    moved = not np.array_equal(towards[~held], known.directions)
    towards[~held], strengths[~held] = known.directions, known.strengths
    if held.any() and refine and moved:
        other = relit(made, samples.some(held)).lights
        towards[held], strengths[held] = other.directions, other.strengths
    return samples.lit_by(replace(samples.lights, directions=towards, strengths=strengths))


@dataclass(frozen=True)
class _Sums:
    """Of squares over what counts under one lamp, in all and outside of highlights: measured, differences of
    the fit, and of the model alone.
    """

    power: float
    power_outside: float
    off: float
    off_outside: float
    off_alone: float


def _asked(made: ResidualFit, samples: Samples, job: Job) -> tuple[_Sums, ...]:
    """What the fit says of every lamp, against what was measured."""
    use = samples.usable & lit(samples)
    outside = use & outside_highlight(samples)
    sums = []
    for i, seen in enumerate(samples.values):
        job.checkpoint(i, len(samples.values))
        one = samples.lights.some([i])
        off, alone = made.predict(one)[0] - seen, made.alone(one)[0] - seen
        pairs = (seen, use[i]), (seen, outside[i]), (off, use[i]), (off, outside[i]), (alone, use[i])
        sums.append(_Sums(*(_squared(values, where) for values, where in pairs)))
    return tuple(sums)


def _squared(values: F32, where: Flags) -> float:
    return float((values[where].astype(np.float64) ** 2).sum())


def _quality(sums: Sequence[_Sums]) -> Quality:
    power = max(sum(s.power for s in sums), 1e-30)
    outside = max(sum(s.power_outside for s in sums), 1e-30)
    return Quality(
        sum(s.off for s in sums) / power,
        sum(s.off_outside for s in sums) / outside,
        sum(s.off_alone for s in sums) / power,
    )


class FittedPhotographs:
    """See `studio_core.fitting.Fitted`. `samples` are as the measured fit knows their lamps."""

    def __init__(
        self,
        scene: SceneMaterial,
        made: ResidualFit,
        measured: ResidualFit,
        samples: Samples,
        held: Flags,
        asked: Sequence[_Sums],
        found: dict[str, object],
        notes: Sequence[str],
    ) -> None:
        self.notes = tuple(_sentence(note) for note in notes)
        self._scene, self._made, self._measured = scene, made, measured
        self._samples, self._held, self._found = samples, held, found
        self._use: Flags = samples.usable & lit(samples)
        self._small = _smaller(made)
        self.lamps = tuple(
            LampError(name, azimuth, height, bool(back), each.whole, each.outside, each.alone)
            for name, (azimuth, height), back, each in zip(
                samples.lights.names,
                samples.lights.angles().tolist(),
                held,
                [_quality([one]) for one in asked],
                strict=True,
            )
        )
        parts = [[s for s, back in zip(asked, held, strict=True) if back == which] for which in (True, False)]
        unseen = _quality(parts[0]) if parts[0] else None
        self.figures = _figures(scene.material, made, unseen, _quality(parts[1]))

    @property
    def material(self) -> Material:
        """Ready for a scene."""
        return self._scene.material

    @property
    def about(self) -> str:
        """A description for the library."""
        wide = self._scene.width
        pattern = f" The pattern is as wide as {wide:.2f} radii of the ball." if wide else ""
        return f"Captured under {len(self._made.lights)} lamps; basis {self._made.basis.name}.{pattern}"

    @property
    def tags(self) -> tuple[str, ...]:
        """Words that the library finds it by."""
        return ("captured",)

    @property
    def report(self) -> dict[str, Any]:
        """All of it, for JSON."""
        of = self.figures
        return {
            **self._found,
            "fit": self._made.report(),
            "measured_fit": self._measured.report() if self._measured is not self._made else None,
            "scene": {"off": self._scene.off, "width": self._scene.width},
            "unseen": None if of.unseen is None else asdict(of.unseen),
            "seen": asdict(of.seen),
            "bytes_in_all": of.bytes_in_all,
            "lamps": [asdict(lamp) for lamp in self.lamps],
            "notes": list(self.notes),
        }

    def photograph(self, lamp: int) -> F32:
        """What was measured under a lamp."""
        return np.asarray(self._samples.values[lamp])

    def trusted(self, lamp: int) -> Flags:
        """What counts of it."""
        return np.asarray(self._use[lamp])

    def reconstruction(self, lamp: int) -> F32:
        """What the measured fit says of the same lamp."""
        return np.asarray(self._measured.predict(self._samples.lights.some([lamp]))[0])

    def relit(self, azimuth: float, height: float) -> F32:
        """Under a lamp of one's own, by the material's fit."""
        return np.asarray(self._small.predict(Lights.at([azimuth], [height]))[0])


def _figures(material: Material, made: ResidualFit, unseen: Quality | None, seen: Quality) -> Figures:
    ranks, shared = made.rank[made.rank > 0], made.shared
    images = {id(one.image): one.image for one in material.textures.values()}
    kept = sum(int(image.pixels.nbytes) for image in images.values())
    height, width = made.normals.shape[:2]
    return Figures(
        unseen=unseen,
        seen=seen,
        model=_MODELS.get(shared.parametric.model, shared.parametric.model)
        + (", and a table of what all spots lack" if shared.table is not None else ""),
        basis=_BASES.get(made.basis.name, made.basis.name),
        columns=made.basis.size,
        rank=int(np.median(ranks)) if ranks.size else 0,
        bytes_per_texel=made.bytes_per_texel,
        bytes_in_all=kept + sum(table.nbytes for table in material.tables.values()),
        texels=(width, height),
    )


def _smaller(made: ResidualFit) -> ResidualFit:
    """Every so many texels of it."""
    step = -(-max(made.normals.shape[:2]) // _LIVE)
    if step == 1:
        return made
    some = (slice(step // 2, None, step), slice(step // 2, None, step))
    return replace(
        made,
        coefficients=np.ascontiguousarray(made.coefficients[some]),
        rank=made.rank[some],
        normals=np.ascontiguousarray(made.normals[some]),
        views=np.ascontiguousarray(made.views[some]),
    )


def _sentence(text: str) -> str:
    whole = text[:1].upper() + text[1:]
    return whole if whole.endswith((".", "!", "?")) else f"{whole}."


FITTER = ResidualFitter()

__all__ = ["FITTER", "FittedPhotographs", "ResidualFitter"]
