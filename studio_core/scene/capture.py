"""A capture in the scene: the photographs of a room, what was decided about them, and whose light it is.

It is a node so that it is saved, undone and copied like everything else; nothing is lit or drawn by it. The
picture that it became is its environment's.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from studio_core.capturing.settings import CaptureSettings
from studio_core.imaging.photograph import ShotFacts
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Node, NodeId


@dataclass(frozen=True)
class KeptPhotograph:
    """A photograph of a capture.

    `digest`: of the whole file as it was read; `path`: where it was, "" when it is not told. `data`: the
    file's bytes without position, owner and preview, (1, N, 1) uint8, where the project keeps them.
    """

    digest: str
    facts: ShotFacts
    size: tuple[int, int]
    thumbnail: Image
    path: str = ""
    data: Image | None = None


@dataclass(frozen=True, kw_only=True)
class Capture(Node):
    """`cube`: the six faces below each other (6 n, n, 3) in `studio_core.imaging.cubemap`'s order."""

    photographs: tuple[KeptPhotograph, ...] = ()
    settings: CaptureSettings = field(default_factory=CaptureSettings)
    environment: NodeId | None = None
    cube: Image | None = None
    report: str = ""
