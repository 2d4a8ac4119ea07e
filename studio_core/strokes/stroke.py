"""The stroke as a node: its tool, its marks, and what the designer decided about it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from studio_core.params import param
from studio_core.scene.geometry import Table
from studio_core.scene.nodes import Node, NodeId
from studio_core.strokes.marks import Marks

REPLACE, BRIGHTEN, DARKEN, BLUR = "replace", "brighten", "darken", "blur"
SHARPEN, CLONE, SMEAR, FIXATE = "sharpen", "clone", "smear", "fixate"
TOOLS = (REPLACE, BRIGHTEN, DARKEN, BLUR, SHARPEN, CLONE, SMEAR, FIXATE)
AUTOMATIC, COLOUR, SHINE, GLOSS = "automatic", "colour", "shine", "gloss"
MEANINGS = (
    AUTOMATIC, COLOUR, SHINE, GLOSS, "colour and shine", "colour and gloss", "shine and gloss", "everything",
)  # fmt: skip
"""What of a material a stroke may change, in the designer's words."""


@dataclass(frozen=True, kw_only=True)
class Stroke(Node):
    """Light that is wanted at places of `objects`; `hidden` strokes count for nothing.

    Each is solved on what those before have made, or, `together` with the one before it, as one with that.
    `flat` tells that one colour was painted over everything: then its mean is meant, not its shape. `near`,
    `facing` and `alike` are σ_s, σ_n and σ_r of section 4.3's s(x, y): how the change spreads to similar
    surface. `through` is the object that somebody chose to change for a stroke in indirect mode ("": any),
    and its slot (-1: any). `reached` are other objects on which it changes something, as last found.
    """

    tool: str = param(REPLACE, "Tool", choices=TOOLS)
    indirect: bool = param(
        False, "Change what is reflected", "The surface stays as it is; what lights it or shows in it changes"
    )
    weight: float = param(1.0, "Weight", "How much it counts beside other strokes", low=0.0, high=100.0)
    meaning: str = param(AUTOMATIC, "Means", "What of the material it changes", choices=MEANINGS)
    flat: bool = False
    together: bool = param(False, "Together", "Explained together with the stroke before it")
    near: float = param(0.0, "Nearness", "How much only near places change alike", low=0.0, high=100.0)
    facing: float = param(0.0, "Direction", "How much only surfaces that face alike do", low=0.0, high=100.0)
    alike: float = param(0.0, "Likeness", "How much only surfaces that look alike do", low=0.0, high=100.0)
    objects: tuple[NodeId, ...] = ()
    table: Table | None = None
    through: NodeId = ""
    through_slot: int = -1
    reached: tuple[NodeId, ...] = ()

    def __post_init__(self) -> None:
        marks = self.marks
        if marks is not None and int(marks.object.max()) >= len(self.objects):
            raise ValueError("a mark names an object that the stroke does not have")

    @cached_property
    def marks(self) -> Marks | None:
        """What it says; None of one that holds nothing."""
        return None if self.table is None else Marks.of_table(self.table)


__all__ = [
    "AUTOMATIC", "BLUR", "BRIGHTEN", "CLONE", "COLOUR", "DARKEN", "FIXATE", "GLOSS", "MEANINGS", "REPLACE",
    "SHARPEN", "SHINE", "SMEAR", "TOOLS", "Stroke",
]  # fmt: skip
