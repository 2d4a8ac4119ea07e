"""What a saved version holds, in a few words, for whoever has to choose between versions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from studio_core.arrays import frozen_map
from studio_core.project.faults import explained
from studio_core.project.records import Revision
from studio_core.project.rows import Rows
from studio_core.project.schema import reading
from studio_core.project.store import current, kinds, revision_of

STEPS = 4
"""How many of the latest steps are told."""


@dataclass(frozen=True)
class Outline:
    """A version: `nodes` counts by kind ("mesh", "camera", …), `steps` are the labels of what was done last,
    the latest first.
    """

    revision: Revision
    nodes: Mapping[str, int] = field(default_factory=frozen_map)
    materials: int = 0
    steps: tuple[str, ...] = ()

    @property
    def objects(self) -> int:
        """Meshes and rooms."""
        return self.nodes.get("mesh", 0) + self.nodes.get("room", 0)


def outline(path: Path, revision: int | None = None) -> Outline:
    """The newest version of a project, or one of its earlier ones, no mesh or picture read.

    ProjectError naming the file when it cannot be read.
    """
    path = path.resolve()
    with explained(path, "read"), current(path) as (source, _), reading(source) as (connection, _):
        rows = Rows(connection)
        chosen = revision_of(rows.revisions(), rows.head() if revision is None else revision)
        nodes, materials = rows.lists(chosen.scene)
        steps: tuple[str, ...] = ()
        if chosen.history is not None:
            history = rows.steps(chosen.history)
            done = history.steps[1 : history.position + 1]
            steps = tuple(step.label for step in reversed(done[-STEPS:]))
        return Outline(
            revision=chosen,
            nodes=kinds(rows, nodes, "the list of nodes", "type"),
            materials=len(rows.entries(materials, "the list of materials")),
            steps=steps,
        )


def revisions(path: Path) -> tuple[Revision, ...]:
    """Every save that a project still holds, the oldest first; ProjectError when it cannot be read."""
    path = path.resolve()
    with explained(path, "read"), current(path) as (source, _), reading(source) as (connection, _):
        return Rows(connection).revisions()
