"""The paper's figures 14–22 as sessions: strokes as a file has them, painted act by act.

Cases `figure-N`: what a session's claims are stands in its `limits`, by metric; `holds` is 1 where all do.
`docs/pictures/make.py figures` draws them.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report
from studio.headless import Headless
from studio_core.scene.nodes import MeshObject, Scene
from studio_core.shading.artifacts import Picture
from studio_core.shading.frame import IndirectChoice
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, indirect_choice
from studio_core.strokes.files import strokes_from_json
from studio_core.strokes.planned import Look, PaintedStroke
from studio_core.strokes.session import KIND, Easel, paint_and_solve
from studio_core.strokes.solution import Finding
from studio_core.strokes.tools import Seen, wanted

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

SIZE, QUICK_SIZE = (400, 300), (320, 240)
QUALITY: Mapping[str, object] = {"vertices": 20_000, "pixel_lamps": True}
QUICK_QUALITY: Mapping[str, object] = {**QUALITY, "vertices": 1000, "directions": "2048", "refine": False}
QUICK_TOLERANCE, TOLERANCE = 6.0, 3.0
SOLVER, BACKEND = "joint", "cuts"


@dataclass(frozen=True)
class Act:
    """Strokes that are painted together, or a stylisation of the whole scene by an amount; on what the act
    before has left, or `afresh` on the bare scene.
    """

    strokes: Sequence[Mapping[str, Any]] = ()
    rounds: int = 1
    stylise: float = 0.0
    afresh: bool = False


@dataclass(frozen=True)
class Session:
    """What one figure shows. `limits`: between which numbers each metric of `judge` lies, if it does."""

    title: str
    scene: Callable[[], Scene]
    acts: tuple[Act, ...]
    judge: Callable[[Played], dict[str, float]]
    limits: Mapping[str, tuple[float, float]]
    bounces: int = 0


@dataclass(frozen=True, eq=False)
class Played:
    """A session that was played: of each act the scene and picture before and after, the light that was
    wanted (H, W, 3), where it was painted (H, W), and what was found.
    """

    scenes: tuple[tuple[Scene, Scene], ...]
    pictures: tuple[tuple[Picture, Picture], ...]
    wanted: tuple[F32, ...]
    masks: tuple[F32, ...]
    findings: tuple[tuple[Finding, ...], ...]

    def before(self, act: int) -> F64:
        """(3,) mean light before an act, where that painted something else than what was there."""
        return self._mean(act, self.pictures[act][0].linear)

    def after(self, act: int) -> F64:
        """(3,) the same after it."""
        return self._mean(act, self.pictures[act][1].linear)

    def wish(self, act: int) -> F64:
        """(3,) the same of what was wanted."""
        return self._mean(act, self.wanted[act])

    def off(self, act: int) -> float:
        """How far the mean light after an act is from what was wanted, of that."""
        return float(np.linalg.norm(self.after(act) - self.wish(act)) / np.linalg.norm(self.wish(act)))

    def followed(self, act: int) -> float:
        """How much of the change of mean light that was wanted has come; 1 is all of it."""
        wish, made = self.wish(act) - self.before(act), self.after(act) - self.before(act)
        return float(made @ wish / (wish @ wish))

    def fixed(self, act: int) -> float:
        """How much the light has changed where an act painted that it shall stay, of that."""
        before, after = (one.linear for one in self.pictures[act])
        still = (self.masks[act] > 0) & (self.wanted[act] == before).all(axis=2)
        return float(np.abs(after - before)[still].mean() / before[still].mean())

    def bare(self, node: str) -> float:
        """1 where an object has no paint in the end."""
        thing = self.scenes[-1][1][node]
        assert isinstance(thing, MeshObject)
        return float(thing.paint is None)

    def painted(self) -> float:
        """The share of all objects that have paint in the end."""
        return float(np.mean([thing.paint is not None for thing in self.scenes[-1][1].of(MeshObject)]))

    def named(self, act: int, node: str, meaning: str) -> float:
        """1 where an act's first finding is of that object and that meaning."""
        found = self.findings[act]
        return float(bool(found) and (found[0].node, found[0].reasons[0].meaning) == (node, meaning))

    def value(self, act: int, name: str) -> F64:
        """Numbers of a parameter as an act's first reason has it."""
        return np.atleast_1d(np.asarray(self.findings[act][0].reasons[0].values[name], np.float64))

    def _mean(self, act: int, light: F32) -> F64:
        mask = self.masks[act] * (self.wanted[act] != self.pictures[act][0].linear).any(axis=2)
        return np.asarray(np.einsum("hw,hwc->c", mask, light.astype(np.float64)) / mask.sum())


def play(
    session: Session,
    program: Headless,
    quick: bool = False,
    size: tuple[int, int] = SIZE,
) -> Played:
    """From the bare scene through all acts, by the doors that everybody has."""
    size, quality = (QUICK_SIZE, QUICK_QUALITY) if quick else (size, QUALITY)
    backend = program.registry.get("backend", BACKEND)
    choice: IndirectChoice | None = None
    if session.bounces:
        how = {"bounces": session.bounces, "tolerance": QUICK_TOLERANCE if quick else TOLERANCE}
        choice = indirect_choice(program.registry, "gather", how)
    easel = Easel(backend, backend_params(backend, quality), program.services, choice)
    bare, job = session.scene(), Job("Figure")
    view = Look(width=size[0], height=size[1]).view(bare)
    start = (bare, easel.picture(bare, view, job))
    acts: list[tuple[Any, ...]] = []
    at = start
    for act in session.acts:
        if act.afresh and at is not start:
            at = (bare, easel.picture(bare, view, job))
        wish, mask = _painted(act, at[1], size)
        made, found = _explained(act, at[0], size, easel, program)
        then = (made, easel.picture(made, view, job))
        acts.append(((at[0], made), (at[1], then[1]), wish, mask, found))
        at = then
    return Played(*zip(*acts, strict=True))


def run(report: Report, program: Headless) -> None:
    """All figures that are wanted."""
    from studio.bench.strokes_figure_sessions import FIGURES

    for number, session in FIGURES.items():
        case = f"figure-{number}"
        if report.wants(case):
            metrics = session.judge(play(session, program, report.quick))
            for metric, value in metrics.items():
                report.add(case, metric, value, "1")
            report.add(case, "holds", float(not broken(session, metrics)), "1")
            report.keep()


def broken(session: Session, metrics: Mapping[str, float]) -> dict[str, float]:
    """Metrics that are not within a session's limits."""
    return {
        name: metrics[name]
        for name, (low, high) in session.limits.items()
        if not low <= metrics[name] <= high
    }


def _planned(act: Act, size: tuple[int, int]) -> Any:
    return strokes_from_json(json.dumps({"size": list(size), "strokes": list(act.strokes)}))


def _painted(act: Act, shown: Picture, size: tuple[int, int]) -> tuple[F32, F32]:
    """What an act wants of a picture, and where it was painted: what the window's film shows."""
    wish, mask = shown.linear.copy(), np.zeros(shown.linear.shape[:2], np.float32)
    seen = Seen.of(shown)
    for one in _planned(act, size) if act.strokes else ():
        assert isinstance(one, PaintedStroke)
        own = one.gesture.mask(seen)
        light = wanted(one.tool, seen, one.gesture, one.settings, own)
        wish = np.where(own[..., None] > 0, light, wish)
        mask = np.maximum(mask, own)
    return wish, mask


def _explained(
    act: Act, scene: Scene, size: tuple[int, int], easel: Easel, program: Headless
) -> tuple[Scene, tuple[Finding, ...]]:
    solver = program.registry.get(KIND, SOLVER)
    if act.stylise:
        run_ = solver.open(program.services)
        edit = run_.stylise(scene, act.stylise, easel.lit(), Job("Figure")).edit
        return edit(scene), ()
    made = paint_and_solve(
        scene, _planned(act, size), solver, solver.Params(), easel, program.services, rounds=act.rounds
    )
    return made.scene, made.findings


__all__ = ["Act", "Played", "Session", "broken", "play", "run"]
