"""How wrong a picture was found to be."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field

from studio_core.scene.nodes import NodeId

SURE, NEGLIGIBLE, ENOUGH = 0.15, 0.002, 2048
"""An error is sure when its uncertainty is that share of it, or that little, or by so many places."""


@dataclass(frozen=True)
class Error:
    """sqrt(mean((shown − true)²)) / mean(true), its standard error, and how many places were looked at.

    p99: the 99th percentile of |shown − true| / mean(true), each a mean over the colours.
    """

    relative_rmse: float
    uncertainty: float
    places: int
    p99: float = 0.0

    @property
    def sure(self) -> bool:
        """Whether more places would tell little more."""
        close = max(SURE * self.relative_rmse, NEGLIGIBLE)
        return self.uncertainty <= close or self.places >= ENOUGH

    def __str__(self) -> str:
        return f"{100 * self.relative_rmse:.1f} ± {100 * self.uncertainty:.1f} %"


@dataclass(frozen=True)
class MeasuredError:
    """Errors of a picture and of its vertices, in all and by light layer; of light between surfaces alone."""

    picture: Error
    vertices: Error
    layers: Mapping[NodeId, Error] = field(default_factory=dict)
    indirect: Error | None = None

    @property
    def sure(self) -> bool:
        """Whether that of the picture is."""
        return self.picture.sure

    def as_dict(self) -> dict[str, object]:
        """For --json."""
        return dataclasses.asdict(self)


__all__ = ["Error", "MeasuredError"]
