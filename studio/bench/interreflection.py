"""`lucarne bench interreflection`: light between surfaces, timed, and compared with paths and with Mitsuba 3.

Rows are named [paper/]CASE: `paper/` is the paper's method (`fields`), without it is `gather`. Cases are the
scenes of `studio.bench.interreflection_scenes`, and parts with modules of their own. What the metrics are
stands in benchmarks/README.md.
"""

from __future__ import annotations

import dataclasses
import importlib
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studio.bench import cuts_peers
from studio.bench.harness import Report, Timing
from studio.bench.interreflection_edits import EDITS
from studio.bench.interreflection_measure import Editor
from studio.bench.interreflection_poses import poses, slid
from studio.bench.interreflection_scenes import CASES, Setting, setting
from studio.bench.interreflection_truth import Light3, Places, Truth, TruthTracer
from studio.headless import Headless
from studio_core.contract import Services
from studio_core.errors import PluginError
from studio_core.kernels.visibility import lifted
from studio_core.scene.nodes import Scene
from studio_core.session import View
from studio_core.shading.artifacts import Casters, Surfaces
from studio_core.shading.cache import DiskCache
from studio_core.shading.offline import scene_view

F64 = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

BACKEND = "cuts"
METHODS = {"": "gather", "paper/": "fields"}
IN_PARTS = True
PARTS = (
    "studio.bench.interreflection_furnace",
    "studio.bench.interreflection_operator",
    "studio.bench.interreflection_sky",
    "studio.bench.interreflection_figures",
)
"""Modules with further cases: each has `run(report, program, setup)`."""
BOUNCES = 3
STILL = 4
"""Samples across and up a pixel of pictures at rest."""
MOST = 0.98
"""Share of the places that are left where the worst are left out."""


@dataclass(frozen=True)
class Setup:
    """How much is measured: places a pose, paths a place in each half of the truth, edits a kind.

    From the first `dragged` poses something is dragged by so many `steps`.

    `samples` and `converged` are Mitsuba's, a pixel, in pictures of `peer` pixels.
    """

    width: int = 960
    height: int = 540
    poses: int = 20
    places: int = 500
    paths: int = 4096
    edits: int = 9
    peer: tuple[int, int] = (480, 270)
    samples: tuple[int, ...] = (4, 16, 64)
    converged: int = 384
    dragged: int = 5
    steps: int = 3
    choices: dict[str, object] = field(default_factory=lambda: {"bounces": BOUNCES})
    cache: Path | None = None


QUICK = Setup(
    width=240,
    height=135,
    poses=2,
    places=120,
    paths=1024,
    edits=3,
    peer=(120, 68),
    samples=(4, 16),
    converged=32,
    dragged=1,
    steps=1,
)


def run(report: Report, program: Headless) -> None:
    """All cases of all methods that there are, and the parts."""
    setup = QUICK if report.quick else Setup()
    for prefix, method in METHODS.items():
        for name in CASES:
            case = f"{prefix}{name}"
            if report.wants(case):
                one = setting(name, program)
                if one is None:
                    report.notes.append(f"{case}: the shared test data is absent.")
                else:
                    measure(report, program, case, one, method, setup)
                report.keep()
    for part in PARTS:
        importlib.import_module(part).run(report, program, setup)
        report.keep()


def measure(
    report: Report, program: Headless, case: str, one: Setting, method: str, setup: Setup, peers: bool = True
) -> None:
    """All rows of one case; a note where the method is not there."""
    try:
        program.registry.get("indirect", method)
    except PluginError as error:
        report.notes.append(f"{case}: {error}")
        return
    with tempfile.TemporaryDirectory(prefix="lucarne-bench-") as folder:
        suite = Case(report, program, case, one, method, setup, Path(folder))
        suite.checked = peers and cuts_peers.installed()
        suite.first()
        suite.errors()
        suite.edits()
        if suite.checked:
            suite.peers()


class Case:
    """One scene by one method."""

    def __init__(
        self,
        report: Report,
        program: Headless,
        name: str,
        one: Setting,
        method: str,
        setup: Setup,
        folder: Path,
    ) -> None:
        self.report, self.program, self.name = report, program, name
        self.one, self.method, self.setup, self.folder = one, method, setup, folder
        self.backend = program.registry.get("backend", BACKEND)
        self.view = self.seen(one.scene, (setup.width, setup.height))
        self.eye = np.asarray(self.view.transform.translation, np.float64)
        self.details: dict[str, Any] = report.details.setdefault(name, {})
        self.checked = False

    def seen(self, scene: Scene, size: tuple[int, int]) -> View:
        """What the scene's camera sees, one sample a pixel as while something moves."""
        return dataclasses.replace(scene_view(scene, None, *size), antialias=1)

    def services(self, name: str) -> Services:
        """With a cache folder of their own, empty at first."""
        return dataclasses.replace(self.program.services, cache=DiskCache(self.folder / name, 8 << 30))

    def editor(self, name: str, refine: bool = False, view: View | None = None) -> Editor:
        """A fresh one; services of the same name share what is kept on disk."""
        values = {"vertices": self.one.budget, "refine": refine}
        return Editor(
            self.backend, self.services(name), self.method, view or self.view, values, self.setup.choices
        )

    def add(self, metric: str, value: float, unit: str, spread: float = 0.0) -> None:
        """A row of this case."""
        self.report.add(self.name, metric, value, unit, spread)

    def say(self, text: str) -> None:
        """Progress."""
        self.program.say(f"{time.strftime('%H:%M:%S')} {self.name}: {text}")

    def first(self) -> None:
        """From nothing to the first picture, in hand and at rest, kernels compiled; and bytes."""
        self.say("from nothing")
        warm = self.editor("warm")
        for moving in (True, False):
            warm.go(self.one.scene, moving)
        del warm
        fresh = self.editor("first")
        step, _ = fresh.go(self.one.scene, True)
        self.add("vertices", self.one.count(), "1")
        self.add("visible", len(fresh.seen()), "1")
        self.add("s_first", step.between, "s")
        self.add("bytes_moving", fresh.nbytes(), "B")
        step, _ = fresh.go(self.one.scene, False)
        self.add("s_first_rest", step.between, "s")
        self.add("bytes_rest", fresh.nbytes(), "B")
        again = self.editor("first")
        step, _ = again.go(self.one.scene, True)
        self.add("s_first_kept", step.between, "s")
        self.details["facts"] = dict(step.facts)

    def errors(self) -> None:
        """Poses one after another, each in hand and then at rest, against the truth of each."""
        editor = self.editor("shared")
        tracer = TruthTracer(
            self.program.services,
            self.setup.paths,
            BOUNCES,
            None if self.setup.cache is None else DiskCache(self.setup.cache),
        )
        found: dict[str, list[float]] = {}
        settled: list[float] = []
        covered: list[float] = []
        least = np.inf
        for number, scene in enumerate(poses(self.one, self.setup.poses)):
            self.say(f"pose {number}")
            editor.go(scene, True)
            places, share = self._places(scene, editor, number)
            covered.append(share)
            made = {"moving": editor.light(places)}
            step, _ = editor.go(scene, False)
            settled.append(step.between)
            made["rest"] = editor.light(places)
            truth = tracer(scene, self.eye, editor.pipeline, places)
            if number == 0 and self.checked:
                self._check(scene, editor, places, truth)
            compared = [(tier, light, truth, self._walls(editor, places)) for tier, light in made.items()]
            if number < self.setup.dragged:
                compared += self._dragged(scene, editor, tracer, number)
            for tier, light, true, walls in compared:
                least = min(least, float(light.irradiance.min()))
                for metric, value in errors_of(light, true, walls).items():
                    found.setdefault(f"{metric}_{tier}", []).append(value)
        for metric, values in found.items():
            self.add(metric, float(np.mean(values)), "1", float(np.std(values)))
            self.add(f"{metric}_worst", float(np.max(values)), "1")
        self.add("least_irradiance", least, "1")
        self.add("share_covered", float(np.mean(covered)), "1")
        self.add("s_rest", float(np.median(settled)), "s", float(np.std(settled)))
        self.details["errors"] = {metric: [round(v, 5) for v in values] for metric, values in found.items()}

    def _dragged(
        self, scene: Scene, editor: Editor, tracer: TruthTracer, number: int
    ) -> list[tuple[str, Light3, Truth, Bools]]:
        """From rest something is dragged in small steps, each in hand: light, truth, and where walls are."""
        made = []
        for step, moved in enumerate(slid(self.one, scene, self.setup.steps, number)):
            editor.go(moved, True)
            places, _ = self._places(moved, editor, 1000 * (number + 1) + step)
            truth = tracer(moved, self.eye, editor.pipeline, places)
            made.append(("dragged", editor.light(places), truth, self._walls(editor, places)))
        return made

    def _places(self, scene: Scene, editor: Editor, seed: int) -> tuple[Places, float]:
        """Places among what is seen on which nothing stands, and the share of it on which something does."""
        surfaces, seen = editor.pipeline.artifact(Surfaces), editor.seen()
        assert surfaces is not None
        rows = editor.free(seen)
        some = np.random.default_rng(seed).choice(rows, min(self.setup.places, len(rows)), False)
        return Places.of(scene, surfaces, np.sort(some), editor.services), 1 - len(rows) / len(seen)

    def _walls(self, editor: Editor, places: Places) -> Bools:
        """(N,) which places are on what is tinted."""
        surfaces = editor.pipeline.artifact(Surfaces)
        assert surfaces is not None
        tinted = np.array([name == self.one.tinted for name in surfaces.materials])
        return np.asarray(tinted[surfaces.mesh.material[places.rows]])

    def _check(self, scene: Scene, editor: Editor, places: Places, truth: Truth) -> None:
        """The truth itself against Mitsuba's paths, in one pose."""
        from studio.bench.interreflection_peers import disagreement

        surfaces, casters = editor.pipeline.artifact(Surfaces), editor.pipeline.artifact(Casters)
        assert surfaces is not None
        assert casters is not None
        mesh, rows, caster = surfaces.mesh, places.rows, casters.primary
        world = mesh.positions[rows] + mesh.origin
        starts = lifted(caster, world, mesh.geometric[rows], mesh.inset[rows]) + caster.centre
        off, noise = disagreement(
            scene, self.program, starts, mesh.normals[rows], truth, BOUNCES, self.setup.paths
        )
        self.add("truth_irradiance_rel_rmse_vs_mitsuba", off, "1", noise)

    def edits(self) -> None:
        """Small steps of every kind in hand, each after the scene at rest."""
        editor = self.editor("shared")
        for kind, steps in EDITS.items():
            self.say(f"edits: {kind}")
            first, *others = steps(self.one, self.setup.edits + 1)
            editor.go(self.one.scene, False)
            editor.go(first, True)
            taken = [editor.go(scene, True)[0] for scene in others]
            between = Timing.of(step.between for step in taken)
            whole = Timing.of(step.seconds for step in taken)
            self.add(f"ms_{kind}", 1000 * between.median, "ms", 1000 * between.spread)
            self.add(f"ms_{kind}_whole", 1000 * whole.median, "ms", 1000 * whole.spread)
            self.details[f"{kind}_stages_ms"] = {
                name: round(1000 * float(np.median([step.stages.get(name, 0.0) for step in taken])), 2)
                for name in taken[-1].stages
            }
            self.details[f"{kind}_counts"] = dict(taken[-1].counts)

    def peers(self) -> None:
        """Pictures: Mitsuba's seconds to the error of ours, over ours, after an edit and from nothing."""
        from studio.bench.interreflection_peers import path_peer, without_sky

        self.say("against Mitsuba")
        setup = self.setup
        view = self.seen(self.one.scene, setup.peer)
        editor = self.editor("peers", view=view)
        editor.go(without_sky(self.one.scene), False)
        scene = without_sky(EDITS["light"](self.one, 3)[0])
        step, picture = editor.go(scene, True)
        given = (scene, self.program, setup.peer, BOUNCES, setup.samples, setup.converged)
        peer = path_peer(*given, picture.distance)
        still = dataclasses.replace(view, antialias=STILL)
        rest, exact = self.editor("peers", refine=True, view=still).go(scene, False)
        for metric, one, made in (("", step, picture), ("_first", rest, exact)):
            error = peer.error(made.linear)
            self.add(f"peer{metric}_picture_rel_rmse", error, "1", peer.noise)
            self.add(f"peer{metric}_seconds", one.seconds, "s")
            self.add(f"peer{metric}_ratio", peer.ratio(error, one.seconds), "1", peer.law.misfit)
        self.details["peer"] = {"seconds": peer.seconds, "errors": peer.errors}


def errors_of(light: Light3, truth: Truth, walls: npt.NDArray[np.bool_]) -> dict[str, float]:
    """By metric without its tier; `rg_error…` only where there are walls."""
    made = {
        "indirect_rel_rmse": truth.error(light, "indirect"),
        "indirect_rel_rmse_diffuse": truth.error(light, "irradiance"),
        "indirect_rel_rmse_98": truth.error(light, "indirect", MOST),
        "picture_rel_rmse": truth.error(light, "all"),
        "direct_rel_rmse": truth.error(light, "direct"),
    }
    if walls.any():
        off = np.abs(red_to_green(light.all[walls]) / red_to_green(truth.mean("all")[walls]) - 1)
        one, two = (red_to_green(half.all[walls]) for half in (truth.first, truth.second))
        made["rg_error"] = float(np.percentile(off, 95))
        made["rg_error_max"] = float(off.max())
        made["rg_noise"] = float(np.percentile(np.abs(one / two - 1) / 2, 95))
    return made


def red_to_green(radiance: npt.ArrayLike) -> F64:
    """(N,) R/G of radiance (N, 3)."""
    values = np.maximum(np.asarray(radiance, np.float64), 1e-12)
    return np.asarray(values[:, 0] / values[:, 1])
