"""Timing edits as the window makes them, and how true what they give is.

An `Editor` holds one pipeline and goes from state to state by the difference of scenes, as
`studio_ui.feed` does; a `Truth` shades states by brute force over the same directions and vertices.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from studio.bench.cuts_cases import State
from studio.bench.harness import Timing, relative_p99, relative_rmse
from studio_core.contract import Registry, Services, ShadingBackend
from studio_core.errors import Cancelled, LucarneError
from studio_core.params import param_infos
from studio_core.raster import PictureStage
from studio_core.scene.diff import Aspect, Changes, diff, view_changed
from studio_core.scene.nodes import Light, Scene
from studio_core.shading.artifacts import Hits, Picture
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.primary import visible_vertices
from studio_core.shading.vertex_radiance import vertex_radiance

F32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Step:
    """One edit: seconds until its first picture and its last, and by stage."""

    seconds: float
    first: float
    primary: float
    compose: float
    stages: Mapping[str, float]
    counts: Mapping[str, int]

    @property
    def own(self) -> float:
        """All stages until Radiance, without primary rays."""
        return sum(self.stages.values()) - self.primary - self.compose


class Editor:
    """One backend, one pipeline; every `go` is a frame of the window."""

    def __init__(self, backend: ShadingBackend, services: Services) -> None:
        self.backend = backend
        self.pipeline = Pipeline([*backend.stages(services), PictureStage(services)])
        self.frame: Frame | None = None
        self.shown: list[tuple[float, F32]] = []

    def go(self, state: State, params: Any, moving: bool, listening: bool = True) -> tuple[Step, Picture]:
        """Shade `state` after whatever came before; `listening` shows what is published meanwhile.

        `shown` then holds the pictures of this frame, each with its seconds.
        """
        shown: list[tuple[float, F32]] = []
        seen = (lambda made: shown.append((time.perf_counter(), made.linear))) if listening else None
        job = Job("bench", on_publish=seen)
        started = time.perf_counter()
        frame, changes = self._next(state, params, moving)
        picture: Picture = self.pipeline.update(frame, changes, job)
        ended = time.perf_counter()
        shown = [*shown, (ended, picture.linear)]
        self.shown = [(at - started, linear) for at, linear in shown]
        stages: dict[str, float] = {}
        for run in self.pipeline.report:  # a stage may run in several rounds
            stages[run.name] = stages.get(run.name, 0.0) + run.seconds
        gives = {type(stage).__name__: stage.gives for stage in self.pipeline.stages}
        primary = sum(taken for name, taken in stages.items() if gives.get(name) is Hits)
        compose = sum(taken for name, taken in stages.items() if gives.get(name) is Picture)
        counts = dict(picture.radiance.counts)
        return Step(ended - started, self.shown[0][0], primary, compose, stages, counts), picture

    def first_exact(self, state: State, params: Any) -> tuple[float, Picture]:
        """Seconds at rest until the first exact picture, and that; what would refine it is cancelled."""
        found: list[tuple[float, Picture]] = []

        def look(picture: Picture) -> None:
            if picture.radiance.final and not found:
                found.append((time.perf_counter(), picture))
                job.cancel()

        job = Job("bench", on_publish=look)
        started = time.perf_counter()
        frame, changes = self._next(state, params, moving=False)
        with contextlib.suppress(Cancelled):
            look(self.pipeline.update(frame, changes, job))
        ended, picture = found[0]
        return ended - started, picture

    def _next(self, state: State, params: Any, moving: bool) -> tuple[Frame, Changes]:
        """The frame of a state after the last, and what differs; it counts from now on."""
        before = self.frame
        revision = 1 if before is None else before.revision + 1
        self.frame = Frame(state.scene, state.view, params, revision, moving)
        return self.frame, Changes() if before is None else changed(before, self.frame)


def changed(before: Frame, after: Frame) -> Changes:
    """What a window would say differs between two frames."""
    changes = diff(before.scene, after.scene)
    if before.view != after.view or (before.moving and not after.moving):
        changes |= view_changed()
    if before.params != after.params:
        changes |= view_changed(Aspect.QUALITY)
    return changes


def fitting(backend: ShadingBackend, wanted: Mapping[str, object]) -> dict[str, object]:
    """Those of `wanted` that the backend knows."""
    known = param_infos(backend.Params)
    return {name: value for name, value in wanted.items() if name in known}


@dataclass(frozen=True)
class Shaded:
    """Values of one state: radiance and irradiance (V, 3), which vertices have them and which are seen,
    and the pixels (N, 3) that show an object.
    """

    radiance: F32
    irradiance: F32
    valid: npt.NDArray[np.bool_]
    seen: npt.NDArray[np.bool_]
    pixels: F32

    @classmethod
    def of(cls, scene: Scene, picture: Picture, registry: Registry) -> Shaded:
        """Copies: a pipeline may write over its own."""
        lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
        made = picture.radiance
        values = vertex_radiance(scene, made, registry)
        seen = made.valid if made.hits is None else visible_vertices(made.surfaces, made.hits)
        pixels = picture.linear[picture.coverage > 0]
        return cls(values, made.irradiance(lights), made.valid.copy(), seen.copy(), pixels)


class Truth:
    """Brute force over as many directions, by states: what was traced is kept while nothing moves."""

    def __init__(
        self, backend: ShadingBackend, services: Services, values: Mapping[str, object], keep: int = 64
    ) -> None:
        self._editor = Editor(backend, services)
        self._values = dict(values)
        self._registry = services.registry
        self._keep = keep
        self._known: list[tuple[State, bool, Shaded]] = []

    def __call__(self, state: State, everywhere: bool = False) -> Shaded:
        """The state's values; an `everywhere` answer also serves where less is asked for."""
        for known, wide, shaded in self._known:
            if known == state and (wide or not everywhere):
                return shaded
        wanted = {**self._values, "everywhere": everywhere}
        params = backend_params(self._editor.backend, fitting(self._editor.backend, wanted))
        _, picture = self._editor.go(state, params, moving=True, listening=False)
        made = Shaded.of(state.scene, picture, self._registry)
        self._known = [*self._known[-self._keep :], (state, everywhere, made)]
        return made


@dataclass(frozen=True)
class Errors:
    """Of one or more states together; relative to the mean of the truth."""

    vertex: float
    vertex_p99: float
    irradiance: float
    picture: float

    @classmethod
    def of(cls, pairs: Sequence[tuple[Shaded, Shaded]], everywhere: bool = False) -> Errors:
        """(made, truth) of each state, over the vertices that are seen, or over all that the truth has.

        A vertex that was left out counts as what it then holds, mostly black.
        """
        columns: list[list[tuple[F32, F32]]] = [[], [], []]
        for made, truth in pairs:
            if len(made.valid) != len(truth.valid):
                raise LucarneError(
                    f"{len(made.valid)} shading vertices cannot be compared with {len(truth.valid)}"
                )
            rows = truth.valid if everywhere else truth.seen & truth.valid
            columns[0].append((made.radiance[rows], truth.radiance[rows]))
            columns[1].append((made.irradiance[rows], truth.irradiance[rows]))
            columns[2].append((made.pixels, truth.pixels))
        radiance, irradiance, linear = (
            tuple(np.concatenate(side) for side in zip(*column, strict=True)) for column in columns
        )
        return cls(
            relative_rmse(*radiance),
            relative_p99(*radiance),
            relative_rmse(*irradiance),
            relative_rmse(*linear),
        )


@dataclass
class Measured:
    """What a case gave: steps after the warm-up, the values of some states on the way, the last picture."""

    steps: list[Step] = field(default_factory=list)
    last: F32 | None = None
    on_the_way: list[tuple[State, Shaded]] = field(default_factory=list)

    def timing(self, name: str) -> Timing:
        """Of `own`, `seconds`, `first`, `primary` or `compose`."""
        return Timing.of(getattr(step, name) for step in self.steps)

    def stages(self) -> dict[str, float]:
        """Median milliseconds by stage."""
        names = dict.fromkeys(name for step in self.steps for name in step.stages)
        return {
            name: 1000 * float(np.median([step.stages.get(name, 0.0) for step in self.steps]))
            for name in names
        }

    def counts(self) -> dict[str, float]:
        """Median of what the backend counted, by name."""
        made = [step.counts for step in self.steps]
        names = dict.fromkeys(name for counts in made for name in counts)
        return {name: float(np.median([counts.get(name, 0) for counts in made])) for name in names}


def measured(
    editor: Editor,
    path: Sequence[State],
    moving: bool,
    params: Any,
    registry: Registry,
    looked: Container[int],
) -> Measured:
    """Go a path that ends where it begins: its end at rest first, one edit to warm up, the others timed.

    The values of the states `looked` at are kept; that takes no measured time.
    """
    editor.go(path[-1], params, moving=False)
    found = Measured()
    for index, state in enumerate(path):
        step, picture = editor.go(state, params, moving)
        if index > 0:
            found.steps.append(step)
        if index in looked:
            found.on_the_way.append((state, Shaded.of(state.scene, picture, registry)))
        found.last = picture.linear
    return found


def kept_bytes(artifact: object, owners: tuple[str, ...], seen: set[int]) -> int:
    """Bytes of all arrays that an artifact holds, each once, through objects of modules named so.

    `seen` holds what was counted before, and grows.
    """
    owners = (*owners, type(artifact).__module__)
    total = 0
    waiting = [artifact]
    while waiting:
        value = waiting.pop()
        if id(value) in seen:
            continue
        seen.add(id(value))
        if isinstance(value, np.ndarray):
            base = value
            while isinstance(base.base, np.ndarray):
                base = base.base
            if base is value or id(base) not in seen:
                seen.add(id(base))
                total += base.nbytes
        elif isinstance(value, dict):
            waiting.extend(value.values())
        elif isinstance(value, list | tuple | set | frozenset):
            waiting.extend(value)
        elif type(value).__module__.startswith(owners):
            waiting.extend(getattr(value, "__dict__", {}).values())
            slots = getattr(type(value), "__slots__", ())
            waiting.extend(getattr(value, name) for name in slots if hasattr(value, name))
    return total
