"""The start page's new room: a room, daylight through its window, and a view of it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from studio_core.edits import Add
from studio_core.scene.nodes import Environment, Light, new_id
from studio_core.scene.transform import looking
from studio_core.shading.job import Job
from studio_ui.context import Context

_EYE, _MIDDLE = (2.6, 4.6, 8.0), (0.0, 1.2, 0.0)  # metres: over the front wall, a little from the right
OUTSIDE = "Terrace"
"""The sample whose sky is seen through the windows."""


class FirstRoom:
    """`add_room` adds a room that is open towards the viewer, `frame_all` looks at all of it."""

    def __init__(
        self,
        context: Context,
        add_room: Callable[[], object],
        frame_all: Callable[[], object],
        samples: Mapping[str, Path],
    ) -> None:
        self._context, self._add, self._frame = context, add_room, frame_all
        self._sky = samples.get(OUTSIDE)

    def begin(self) -> None:
        """Add the room at once, the light when it has been read; each is a step that can be undone."""
        view = self._context.session.view
        focus = float(np.linalg.norm(np.subtract(_EYE, _MIDDLE)))
        self._context.session.look(dataclasses.replace(view, transform=looking(_EYE, _MIDDLE), focus=focus))
        self._add()
        self._context.session.select([])
        self._frame()
        path = self._sky
        if path is None:
            return

        def read(job: Job) -> Environment | None:
            from studio_core.project.store import load

            return next(load(path).scene.of(Environment), None)

        def done(found: Environment | None) -> None:
            if found is None or any(True for _ in self._context.document.scene.of(Light)):
                return
            sky = dataclasses.replace(found, id=new_id("environment"), parent=None)
            self._context.editing.apply(Add((sky,), label="Daylight"))

        self._context.tasks.run("Reading daylight", read, done)
