"""`lucarne bench cuts`: edits in the sample room, timed and compared with brute force and with Mitsuba 3.

Rows are named [paper/][sun/]CASE: `paper/` is the paper's own path, `sun/` the room with a sun in its
picture; without, daylight through windows. What the metrics are stands in benchmarks/README.md.
"""

from __future__ import annotations

import dataclasses
import tempfile
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from studio.bench import cuts_growth, cuts_keeping, cuts_paper, cuts_peers, cuts_settled
from studio.bench.cuts_cases import CASES, Case, State
from studio.bench.cuts_measure import Editor, Errors, Measured, Shaded, Truth, fitting, measured
from studio.bench.cuts_scenes import ENVIRONMENTS, NATIVE, Rooms, prefix_of
from studio.bench.harness import Report
from studio.headless import Headless
from studio.samples import sample
from studio_core.contract import Services, ShadingBackend
from studio_core.params import param_infos
from studio_core.scene.nodes import Scene
from studio_core.shading.cache import DiskCache
from studio_core.shading.offline import backend_params, scene_view

BACKEND = "cuts"
METHODS = {"": "exact", "paper/": "svc-vcf"}
IN_PARTS = True  # --only and --growth
FULL = "full"
PEER_ERRORS = (0.05, 0.02, 0.01)


@dataclass(frozen=True)
class Setup:
    """How much is measured. `samples` and `converged` are Mitsuba's, a pixel; `growth` has steps or none."""

    width: int = 960
    height: int = 540
    vertices: int = 30_000
    directions: int = 1 << 15
    edits: int = 20
    checks: int = 2
    peer_edits: int = 6
    peer_exact: int = 3
    samples: tuple[int, ...] = (4, 16, 64)
    converged: int = 384
    settles: int = 1
    opens: int = 2
    paper: cuts_paper.Sizes = dataclasses.field(default_factory=cuts_paper.Sizes)
    growth: cuts_growth.Steps | None = dataclasses.field(default_factory=cuts_growth.Steps)


QUICK = Setup(
    width=240,
    height=135,
    vertices=3000,
    directions=1 << 11,
    edits=3,
    checks=1,
    peer_edits=2,
    peer_exact=2,
    samples=(4, 16),
    converged=64,
    settles=1,
    opens=1,
    paper=cuts_paper.Sizes(receivers=500, samples=20, points=100, shells=(8, 16)),
    growth=None,
)


def run(report: Report, program: Headless) -> None:
    """The whole suite on the sample room."""
    from studio_core.project.store import load

    setup = QUICK if report.quick else Setup()
    if report.growth != FULL:
        few = cuts_growth.QUICK if report.growth == "quick" else None
        setup = dataclasses.replace(setup, growth=few)
    measure(report, program, load(sample()).scene, setup)


def measure(report: Report, program: Headless, base: Scene, setup: Setup, backend: str | None = None) -> None:
    """The whole suite on another scene; see `studio.bench.cuts_cases` for the names that it needs."""
    with tempfile.TemporaryDirectory(prefix="lucarne-bench-") as name:
        suite = Suite(report, program, base, setup, Path(name), backend or BACKEND)
        suite.run()


class Suite:
    """One run: what all its parts share."""

    def __init__(
        self, report: Report, program: Headless, base: Scene, setup: Setup, folder: Path, backend: str
    ) -> None:
        self.report, self.program, self.setup, self.folder = report, program, setup, folder
        self.backend: ShadingBackend = program.registry.get("backend", backend)
        self.services = self.services_in("shared")
        self.view = dataclasses.replace(scene_view(base, None, setup.width, setup.height), antialias=1)
        self.rooms = Rooms(base)
        values = {"directions": str(setup.directions), "vertices": setup.vertices, "quarters": False}
        reference = program.registry.get("backend", "reference")
        self.truth = Truth(reference, program.services, values)
        self.finer = Truth(reference, program.services, {**values, "quarters": True})
        self._peers: dict[tuple[str, str], cuts_peers.Peer] = {}
        self._settled: dict[tuple[str, str, str, bool], Editor] = {}
        self._traced: set[str] = set()
        self.known = param_infos(self.backend.Params)
        self.methods = {p: m for p, m in METHODS.items() if not p or "method" in self.known}

    def run(self) -> None:
        """All parts."""
        self._notes()
        still = [case for case in CASES if not case.name.startswith("move")]
        moves = [case for case in CASES if case.name.startswith("move") and self._can(case)]
        for cases in (still, moves):  # the truth traces again whenever something stands elsewhere
            for prefix, method in self.methods.items():
                editor = Editor(self.backend, self.services)
                for environment in ENVIRONMENTS:
                    if prefix and environment != ENVIRONMENTS[0] and cases is moves:
                        continue  # minutes that tell nothing new of the paper's path
                    for case in cases:
                        name = f"{prefix}{prefix_of(environment)}{case.name}"
                        self.part(name, partial(self._case, name, editor, case, environment, method, cases))
        for environment in ENVIRONMENTS:
            name = f"{prefix_of(environment)}all-directions"
            self.part(name, partial(self._equal_directions, name, environment))
        self._against_peers()
        for environment in ENVIRONMENTS:
            for settled in cuts_keeping.SETTLES:
                name = f"{prefix_of(environment)}{settled}"
                self.part(name, partial(cuts_keeping.settle, self, environment, settled))
        for prefix, method in self.methods.items():
            self.part(f"{prefix}precompute", partial(cuts_keeping.opening, self, prefix, method))
        if "paper/" in self.methods:
            self.part("paper/table", partial(cuts_paper.tables, self, self.setup.paper))
        if self.setup.growth is not None:
            cuts_growth.run(self, self.setup.growth)

    def part(self, name: str, work: Callable[[], object], kind: str = "") -> None:
        """Measure a part if it was asked for by its name; its seconds are told, what was found is kept."""
        if not self.report.wants(name):
            return
        started = time.perf_counter()
        work()
        seconds = time.perf_counter() - started
        self.detail(name, **{f"seconds{kind.replace(' ', '_')}": round(seconds, 1)})
        self.say(f"{name}{kind}: {seconds:.1f} s")
        self.report.keep()

    # --- what the parts need --------------------------------------------------------------------------

    def services_in(self, name: str) -> Services:
        """Services with a cache folder of their own."""
        cache = DiskCache(self.folder / name, 8 << 30)
        return dataclasses.replace(self.program.services, cache=cache)

    def uncached(self) -> Services:
        """Services that keep nothing on disk."""
        return dataclasses.replace(self.program.services, cache=None)

    def params(self, **values: object) -> Any:
        """Of the backend: as finely as the setup says, unrefined; what it does not know is left out."""
        wanted = {
            "directions": str(self.setup.directions),
            "vertices": self.setup.vertices,
            "refine": False,
            **values,
        }
        return backend_params(self.backend, fitting(self.backend, wanted))

    def settled_editor(self, environment: str, case: Case, refined: bool) -> Editor:
        """For edits with refined meshes or without; cases share one while only materials differ."""
        alone = "" if case.name.startswith("brdf") else case.name
        key = (environment, case.materials, alone)
        if self._settled and next(iter(self._settled))[:3] != key:
            self._settled = {}
        if (*key, refined) not in self._settled:
            self._settled[*key, refined] = Editor(self.backend, self.services)
        return self._settled[*key, refined]

    def base(self, environment: str, materials: str) -> State:
        """The room as every path begins and ends."""
        return State(self.rooms(environment, materials), self.view)

    def peer(self, environment: str, materials: str) -> cuts_peers.Peer | None:
        """Mitsuba on a native room; None on another one, and where it is not installed."""
        if not cuts_peers.installed() or materials not in NATIVE.values():
            return None
        key = (environment, materials)
        if key not in self._peers:
            self.say(f"Mitsuba: {environment}, {materials}")
            setup = self.setup
            state = self.base(environment, materials)
            made = cuts_peers.peer(state, self.program, setup.samples, setup.converged)
            name = f"{prefix_of(environment)}mitsuba-{materials.removeprefix('native-')}"
            for error in PEER_ERRORS if made.law.exponent < 0 else ():
                self.report.add(name, f"seconds_to_{error:g}", made.law.where(error), "s")
            self.report.add(name, "error_exponent", made.law.exponent, "1", made.law.misfit)
            self.report.add(name, "converged_noise", made.noise, "1")
            self.detail(name, samples=setup.samples, seconds=made.seconds, errors=made.errors)
            self._peers[key] = made
        return self._peers[key]

    def say(self, text: str) -> None:
        """On stderr, unless the command is to be quiet."""
        if not self.program.quiet:
            self.program.say(text)

    def detail(self, name: str, **values: object) -> None:
        """Beside the rows, in the JSON."""
        self.report.details.setdefault(name, {}).update(values)

    # --- parts ----------------------------------------------------------------------------------------

    def _notes(self) -> None:
        if not cuts_peers.installed():
            self.report.notes.append("Mitsuba 3 is not installed: rows against it are left out.")
        missing = [name for name in ("method", "refine", "everywhere") if name not in self.known]
        if missing:
            self.report.notes.append(
                f"{self.backend.id} has no {', '.join(missing)}: these rows are left out."
            )

    def _can(self, case: Case) -> bool:
        return "everywhere" in self.known or not case.everywhere

    def _asked_for(self, case: Case) -> bool:
        names = (f"{p}{prefix_of(e)}{case.name}" for p in self.methods for e in ENVIRONMENTS)
        return any(self.report.wants(name) for name in names)

    def _path(self, case: Case, environment: str, materials: str) -> list[State]:
        return case.path(self.base(environment, materials), self.setup.edits + 1, materials)

    def _trace_all(self, cases: Iterable[Case]) -> None:
        """The truth of every state to be looked at, in the order that moves things least; once."""
        cases = [case for case in cases if case.name not in self._traced and self._asked_for(case)]
        self._traced |= {case.name for case in cases}
        wanted: dict[int, list[tuple[State, bool]]] = {}
        for environment in ENVIRONMENTS:
            for case in sorted(cases, key=lambda case: not case.everywhere):
                path = self._path(case, environment, case.materials)
                for place in looked(len(path), self.setup.checks):
                    wanted.setdefault(place, []).append((path[place], case.everywhere))
        for place, states in wanted.items():
            self.say(f"reference of edit {place}: {len(states)} states")
            for state, everywhere in states:
                self.truth(state, everywhere)

    def _equal_directions(self, name: str, environment: str) -> None:
        """What is left to be wrong in a sum over all S directions, against the brightest in four parts."""
        state = self.base(environment, "diffuse")
        self.errors(name, [(self.truth(state), self.finer(state))], False)

    def _case(
        self, name: str, editor: Editor, case: Case, environment: str, method: str, cases: Iterable[Case]
    ) -> None:
        self._trace_all(cases)
        params = self.params(method=method, everywhere=case.everywhere)
        path = self._path(case, environment, case.materials)
        places = looked(len(path), self.setup.checks)
        found = measured(editor, path, case.moving, params, self.program.registry, places)
        pairs = [(made, self.truth(state, case.everywhere)) for state, made in found.on_the_way]
        self.rows(name, found)
        self.errors(name, pairs, case.everywhere)

    def _against_peers(self) -> None:
        """Material by material: what a picture has settled to serves all its cases."""
        cases = sorted(
            (case for case in CASES if not case.everywhere), key=lambda case: (case.materials, case.name)
        )
        for environment in ENVIRONMENTS:
            for case in cases:
                name = f"{prefix_of(environment)}{case.name}"
                work = partial(cuts_settled.against_peer, self, name, case, environment)
                self.part(name, work, " against Mitsuba")
        self._settled = {}

    def rows(self, name: str, found: Measured) -> None:
        """Times, counts and threads of a case."""
        for metric, part in (
            ("ms", "own"),
            ("primary_ms", "primary"),
            ("compose_ms", "compose"),
            ("picture_ms", "seconds"),
            ("first_picture_ms", "first"),
        ):
            timing = found.timing(part)
            self.report.add(name, metric, 1000 * timing.median, "ms", 1000 * timing.spread)
        counts = found.counts()
        for count, value in counts.items():
            if count.startswith("skipped"):
                self.report.add(name, count, value, "1")
        self.report.add(name, "threads", self.program.services.workers.threads, "1")
        own = [round(1000 * step.own, 3) for step in found.steps]
        self.detail(name, stages_ms=found.stages(), counts=counts, ms=own)

    def errors(self, name: str, pairs: list[tuple[Shaded, Shaded]], everywhere: bool) -> None:
        """Errors of a case against the reference."""
        errors = Errors.of(pairs, everywhere)
        for metric, value in (
            ("vertex_rel_rmse", errors.vertex),
            ("vertex_p99", errors.vertex_p99),
            ("irradiance_rel_rmse", errors.irradiance),
            ("picture_rel_rmse", errors.picture),
        ):
            self.report.add(name, metric, value, "1")


def looked(length: int, checks: int) -> set[int]:
    """Which states of a path are compared: the last but one (the end is the start), and some before."""
    last = length - 2
    return {max(1, round(last - step * last / max(2, checks))) for step in range(checks)}
