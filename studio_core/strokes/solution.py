"""What a solver answers: the edit, and why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from studio_core.edits import Edit
from studio_core.scene.nodes import NodeId
from studio_core.shading.artifacts import Casters, Hits, Indirect, Lighting, Shapes, Surfaces


@dataclass(frozen=True)
class Reason:
    """One way to explain strokes on one material of an object.

    meaning is one of `stroke.MEANINGS` ("" changes nothing); explained is 1 − what is left over what was
    wanted to change, both relative and squared; score tells reasons apart, lower is better. `values` are the
    material's parameters then, in the middle of the stroke, by name. `edit` makes the scene that way instead,
    and remembers so.
    """

    meaning: str
    explained: float
    score: float
    values: Mapping[str, float | tuple[float, float, float]]
    edit: Edit


@dataclass(frozen=True)
class Finding:
    """What was found for one object's slot: reasons, best first; the first is in the solution's edit.

    `close` are how many others are nearly as good; `silent` are meanings of which these strokes cannot tell
    anything from where they were painted. Of findings that are `rivals` one alone holds: the first of them is
    in the solution's edit.
    """

    node: NodeId
    slot: int
    strokes: tuple[NodeId, ...]
    reasons: tuple[Reason, ...]
    close: int = 0
    silent: tuple[str, ...] = ()
    rivals: bool = False


@dataclass(frozen=True)
class Solution:
    """The edit that explains strokes, the findings, and in sentences what could not be done.

    counts: places and elements that were solved or skipped, rays, systems.
    """

    edit: Edit
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Lit:
    """What of a pipeline solvers need: who is where, what stops light, which light there is.

    All are those of the newest frame and belong to the compute thread. `indirect` is None where light does
    not go on between surfaces in the picture that was painted on.
    """

    surfaces: Surfaces
    casters: Casters
    shapes: Shapes
    lighting: Lighting
    hits: Hits | None
    indirect: Indirect | None


__all__ = ["Finding", "Lit", "Reason", "Solution"]
