"""What is to be shaded: an immutable request."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from studio_core.scene.nodes import Scene
from studio_core.session import ALL, DIRECT, View


@dataclass(frozen=True)
class IndirectChoice:
    """A method of the registry's kind `indirect`, and its parameters."""

    method: str
    params: Any


@dataclass(frozen=True)
class Frame:
    """Scene, view and the backend's parameters; `revision` grows with every request.

    `indirect` says how light goes on between surfaces; None: not at all. `light`, one of `session.LIGHTS`, is
    looked at. While `moving`, somebody drags or looks around: soon is better than exact, and a frame at
    rest, with changes of at least VIEW, follows.
    """

    scene: Scene
    view: View
    params: Any
    revision: int = 0
    moving: bool = False
    indirect: IndirectChoice | None = None
    light: str = ALL

    @property
    def bounced(self) -> IndirectChoice | None:
        """How light between surfaces is computed for what is looked at; None where none of it is."""
        return None if self.light == DIRECT else self.indirect
