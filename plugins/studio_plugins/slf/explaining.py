"""One decision about a slot of an object: what its strokes say together, and what may be changed."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.scene.nodes import Material, MeshObject, NodeId, Scene
from studio_core.strokes.marks import Marks
from studio_core.strokes.paintable import paintable
from studio_core.strokes.stroke import AUTOMATIC, FIXATE, Stroke
from studio_plugins.slf.dressed import Dressed
from studio_plugins.slf.grams import Grams, Shines, best
from studio_plugins.slf.joint import NOISE, SINGLE, Change, Explanation, Verdict, decide
from studio_plugins.slf.places import Places
from studio_plugins.slf.regions import Region
from studio_plugins.slf.samples import F64, Reflectance, Samples

WORDS: Mapping[Change, str] = {
    Change.NONE: "",
    Change.DIFFUSE: "colour",
    Change.SPECULAR: "shine",
    Change.GLOSS: "gloss",
    Change.DIFFUSE | Change.SPECULAR: "colour and shine",
    Change.DIFFUSE | Change.GLOSS: "colour and gloss",
    Change.SPECULAR | Change.GLOSS: "shine and gloss",
    Change.DIFFUSE | Change.SPECULAR | Change.GLOSS: "everything",
}
MEANT = {word: change for change, word in WORDS.items()}
STRANGE = 0.15
"""Relative error of a place's light as it is, from which on it says little of how it would change."""
NOISE_OF_ONE_LIGHT = 0.05
"""As `joint.NOISE`, of one flat colour."""
ENOUGH = 2 / 3
"""What explains so much of a flat colour may be it, without another tint of the shine. On a blue sofa, orange
is its colour with 72 %; a yellow glint on tiles is 60 % their colour, 91 % their shine."""
NEAR, STEPS = 1.5, 12
"""Levels around that of a gloss, among which one flat colour alone may choose; steps to each side."""


@dataclass(frozen=True, eq=False)
class Step:
    """One decision: what was found, and what each explanation adds to the material's parameters."""

    strokes: tuple[Stroke, ...]
    verdict: Verdict
    now: Reflectance
    gloss: float | None
    places: int


@dataclass(eq=False)
class Painting:
    """A region on the way: its material as it can be painted, and what was decided so far."""

    dressed: Dressed
    was: Material
    steps: list[Step]
    changes: dict[str, F64]
    offsets: dict[NodeId, list[tuple[npt.NDArray[np.int64], F64]]]
    rays: int = 0

    @staticmethod
    def begin(material: Material, services: Services) -> Painting | None:
        """Of a bare material; None where nothing of it can be painted."""
        dressed = Dressed.of(paintable(material, services.registry), services.registry)
        return None if dressed is None else Painting(dressed, material, [], {}, {})

    def take(self, step: Step) -> None:
        """Goes on from its best explanation."""
        self.steps.append(step)
        best = step.verdict.best
        for name, change in self.dressed.changes(step.now, step.gloss, best.reflectance, best.change).items():
            self.changes[name] = self.changes.get(name, np.zeros_like(change)) + change


def on_region(stroke: Stroke, places: Places, region: Region) -> npt.NDArray[np.bool_]:
    """(N,) which of a stroke's places lie on a region."""
    assert stroke.marks is not None
    return _marks_on(stroke, stroke.marks, region)[places.mark]


def _marks_on(stroke: Stroke, marks: Marks, region: Region) -> npt.NDArray[np.bool_]:
    node = np.array([name == region.node for name in stroke.objects], np.bool_)
    made: npt.NDArray[np.bool_] = node[marks.object] & (marks.slot == region.slot)
    return made


def paint_under(scene: Scene, stroke: Stroke, region: Region) -> dict[str, F64]:
    """By parameter (1,) or (3,), what paint changes of a region, in the mean over a stroke's marks on it."""
    node, marks = scene[region.node], stroke.marks
    paint = node.paint if isinstance(node, MeshObject) else None
    if paint is None or marks is None:
        return {}
    there = marks.some(_marks_on(stroke, marks, region) & marks.painted & (marks.weight > 0))
    if not len(there):
        return {}
    between = paint.weights(there.place, there.normal, there.slot)
    every = {name: between(paint.change(name)) for name in paint.changes}
    return {name: np.average(one, axis=0, weights=there.weight) for name, one in every.items()}


def samples_of(
    stroke: Stroke, places: Places, sums: F64, dressed: Dressed, now: Reflectance
) -> tuple[Samples, F64]:
    """What a stroke says, its targets as the model would make them; and the offsets (N, 3)."""
    assert stroke.marks is not None
    marks = stroke.marks.some(places.mark)
    shown, wanted = marks.shown.astype(np.float64), marks.wanted.astype(np.float64)
    if stroke.tool == FIXATE:
        wanted = shown
    coefficients = dressed.coefficients(now.diffuse, now.specular)
    before = np.einsum("ntc,tc->nc", sums[-1], coefficients)
    known = np.isfinite(marks.offset).all(axis=1, keepdims=True)
    offset = np.where(known, marks.offset, shown - before)
    weight = marks.weight.astype(np.float64) * stroke.weight
    one_light = stroke.flat & marks.painted  # as wanted in the mean over all of them, known well or not
    weight = weight * np.where(one_light, 1, _trust(offset, shown, before))
    return Samples(wanted - offset, before, sums[:-1], sums[-1], weight), offset


def as_curved(samples: Samples, own: F64, dressed: Dressed, now: Reflectance) -> Samples:
    """With other columns (N, T, 3) of the gloss that there is; what was painted is as far from that light."""
    curved = dataclasses.replace(samples, own=own)
    before = curved.made(dressed, now, own=True)
    return dataclasses.replace(curved, before=before, wanted=samples.wanted + before - samples.before)


def _trust(offset: F64, shown: F64, before: F64) -> F64:
    """(N,) how well the model knows the light of a place: 1 / (1 + (its relative error / STRANGE)²)²."""
    error = np.abs(offset).mean(axis=1)
    light = np.maximum(np.abs(shown), np.abs(before)).mean(axis=1)
    relative = error / np.maximum(light, 1e-30)
    return np.asarray(1 / (1 + (relative / STRANGE) ** 2) ** 2)


def pooled_of(parts: Sequence[tuple[Stroke, Samples, Places]], beside: bool = True) -> Samples:
    """All samples; of a stroke in one flat colour its mean, and what lies beside it as it is, or without."""
    made: Samples | None = None
    for stroke, samples, places in parts:
        one = samples
        if stroke.flat and stroke.tool != FIXATE and stroke.marks is not None:
            marks = stroke.marks.some(places.mark)
            painted = marks.painted
            one = samples.some(np.flatnonzero(painted)).mean()
            if beside:
                one = one + samples.some(np.flatnonzero(~painted))
        made = one if made is None else made + one
    assert made is not None
    return made


def one_light(strokes: Sequence[Stroke]) -> bool:
    """Whether all of them are of one flat colour each."""
    painted = [stroke for stroke in strokes if stroke.tool != FIXATE]
    return bool(painted) and all(stroke.flat for stroke in painted)


def allowed_of(dressed: Dressed, strokes: Sequence[Stroke]) -> tuple[Change, ...]:
    """What may change: single changes for flat strokes and what somebody chose, else all that there is."""
    if one_light(strokes):
        chosen = (stroke.meaning for stroke in strokes if stroke.tool != FIXATE)
        some = (*SINGLE, *(MEANT[meaning] for meaning in chosen if meaning != AUTOMATIC))
        return tuple(change for change in dict.fromkeys(some) if change & dressed.can == change)
    return dressed.allowed


def exactness_of(strokes: Sequence[Stroke]) -> float:
    """The relative error with which light is meant."""
    return NOISE_OF_ONE_LIGHT if one_light(strokes) else NOISE


def meant_first(verdict: Verdict, dressed: Dressed, strokes: Sequence[Stroke]) -> Verdict:
    """With what somebody chose as the first explanation."""
    for stroke in strokes:
        if stroke.meaning == AUTOMATIC:
            continue
        chosen = [one for one in verdict.explanations if one.change == MEANT[stroke.meaning] & dressed.can]
        others = [one for one in verdict.explanations if one not in chosen]
        return dataclasses.replace(verdict, explanations=(*chosen, *others))
    return verdict


def explained(
    samples: Samples, dressed: Dressed, now: Reflectance, strokes: Sequence[Stroke], coloured: bool
) -> Verdict:
    """How strokes are explained; with `coloured` the shine may take the colour that was painted.

    One flat colour could be that of the matte part as well: there the shine keeps its own, unless so much is
    left over that neither can be it.
    """
    allowed, exactness = allowed_of(dressed, strokes), exactness_of(strokes)
    plain = one_light(strokes) and Change.DIFFUSE in dressed.can
    if plain or not coloured:
        verdict = decide(samples, dressed, now, allowed, (), exactness)
        if not coloured or verdict.best.explained > ENOUGH:
            return verdict
    return decide(samples, dressed, now, allowed, tints_of(samples, dressed, now), exactness)


def as_painted(
    verdict: Verdict, painted: Samples, curved: Samples, dressed: Dressed, now: Reflectance
) -> Verdict:
    """With as much of the one number or colour that changes as makes what was `painted`, without its beside.

    What lies beside one flat colour tells which parameter it is; that it stays is not meant as exactly, and
    no part of what is said to be explained. A picture at rest has highlights as surfaces are `curved`, once
    there are any.
    """
    painted, curved = painted.that_count(), curved.that_count()
    if not len(painted) or not len(curved):
        return verdict
    here = Grams.of(curved, np.array([now.level]), curved.importance, curved.own[None])
    staying = Shines.start(dressed, now, None)

    def sized(one: Explanation) -> Explanation:
        found, told = one.reflectance, curved
        if one.change is Change.DIFFUSE:
            made = best(here, dressed, now, True, staying)
        elif one.change is Change.SPECULAR:
            tint = found.tint if found.specular.max() > 0 else now.tint
            made = best(here, dressed, now, False, Shines.start(dressed, now, tint))
        elif one.change is Change.GLOSS:
            levels = found.level + np.linspace(-NEAR, NEAR, 2 * STEPS + 1)
            levels = levels[(levels >= 0) & (levels <= painted.levels - 1)]
            levels = levels[np.sign(levels - now.level) == np.sign(found.level - now.level)]
            told = painted
            grams = Grams.of(painted, levels, painted.importance)
            made = best(grams, dressed, now, False, staying)
        else:
            return one
        asked = float((told.importance * (told.wanted - told.before) ** 2).sum())
        explained = 1 - made.left / asked if asked > 0 else one.explained
        return dataclasses.replace(one, reflectance=made.reflectance, explained=explained)

    return dataclasses.replace(verdict, explanations=tuple(map(sized, verdict.explanations)))


def tints_of(samples: Samples, dressed: Dressed, now: Reflectance) -> tuple[F64, ...]:
    """White, and the colour in which the shine would have what was painted."""
    if dressed.white:
        return ()
    more = samples.wanted - samples.before
    full = Reflectance(now.diffuse, np.ones(3), now.level)
    none = Reflectance(now.diffuse, np.zeros(3), now.level)
    shine = samples.made(dressed, full, own=True) - samples.made(dressed, none, own=True)
    weight = samples.weight[:, None]
    colour = (weight * shine * more).sum(axis=0) / np.maximum((weight * shine**2).sum(axis=0), 1e-30)
    colour = np.clip(colour + now.specular, 0, None)
    return (np.ones(3), colour) if colour.max() > 0 else (np.ones(3),)


__all__ = [
    "MEANT",
    "WORDS",
    "Painting",
    "Step",
    "as_curved",
    "as_painted",
    "explained",
    "meant_first",
    "on_region",
    "one_light",
    "paint_under",
    "pooled_of",
    "samples_of",
]
