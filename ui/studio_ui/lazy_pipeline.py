"""Pipelines as the window has them: provided by the composition root, made on the compute thread."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Protocol

from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Scene
from studio_core.shading.artifacts import MeasuredError
from studio_core.shading.frame import Frame, IndirectChoice
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Pipeline
from studio_core.strokes.solution import Lit


class Shading(Protocol):
    """What the composition root provides: pipelines and their parameters by backend.

    Both are called on the compute thread alone, since they import what is heavy.
    """

    def pipeline(self, backend: str) -> Pipeline:
        """Fresh stages that end in a Picture."""
        ...

    def params(self, backend: str, values: Mapping[str, Any]) -> Any:
        """The backend's parameters."""
        ...

    def indirect(self, choice: IndirectChoice) -> IndirectChoice | None:
        """The choice with its parameters instead of their values by name; None for an unknown method."""
        ...

    def measure(self, pipeline: Pipeline, frame: Frame, job: Job) -> MeasuredError | None:
        """How wrong the pipeline's last picture is."""
        ...

    def lit(self, pipeline: Pipeline, scene: Scene) -> Lit | None:
        """What solvers of strokes on `scene` need of it; None where it has nothing like that."""
        ...


class LazyPipeline:
    """A pipeline that is made when the compute thread first needs it."""

    def __init__(self, shading: Shading, backend: str) -> None:
        self._shading, self._backend = shading, backend
        self._made: Pipeline | None = None
        self._error: Exception | None = None

    @property
    def current(self) -> int:
        """Index of the stage that runs."""
        return self._made.current if self._made is not None else 0

    @property
    def rounds(self) -> int:
        """How often the frame at rest was refined."""
        return self._made.rounds if self._made is not None else 0

    def lit(self, scene: Scene) -> Lit | None:
        """See `Shading.lit`."""
        return None if self._made is None else self._shading.lit(self._made, scene)

    def dirties(self, changes: Changes, upto: int) -> bool:
        """Whether a stage at or before index `upto` would rerun."""
        return self._made.dirties(changes, upto) if self._made is not None else bool(changes)

    def mark(self, frame: Frame, changes: Changes) -> None:
        """Remember what changed; a pipeline that was not made yet starts with everything anyway."""
        if self._made is not None:
            self._made.mark(frame, changes)

    def update(self, frame: Frame, changes: Changes, job: Job) -> Any:
        """See `Pipeline.update`; raises again what making it raised."""
        if self._error is not None:
            raise self._error
        if self._made is None:
            try:
                self._made = self._shading.pipeline(self._backend)
            except Exception as error:
                self._error = error
                raise
        return self._made.update(self._ready(frame), changes, job)

    def complete(self, frame: Frame, job: Job) -> None:
        """See `Pipeline.complete`."""
        if self._made is not None:
            self._made.complete(self._ready(frame), job)

    def measure(self, frame: Frame, job: Job) -> MeasuredError | None:
        """The error of what was last made; see `Shading.measure`."""
        if self._made is None:
            return None
        return self._shading.measure(self._made, self._ready(frame), job)

    def _ready(self, frame: Frame) -> Frame:
        """With parameters instead of values by name."""
        params = self._shading.params(self._backend, frame.params)
        choice = None if frame.indirect is None else self._shading.indirect(frame.indirect)
        return dataclasses.replace(frame, params=params, indirect=choice)


__all__ = ["LazyPipeline", "Shading"]
