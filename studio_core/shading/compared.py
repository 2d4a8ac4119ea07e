"""What is shown at some places beside what is true there, and the errors that follow."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import NodeId
from studio_core.shading.measured_error import Error, MeasuredError

RESAMPLINGS = 200


def compare(
    shown: npt.ArrayLike, true: npt.ArrayLike, seed: int = 0, again: npt.ArrayLike | None = None
) -> Error:
    """The error of (N, 3) radiance; its standard error by bootstrap over the places.

    All is relative to the mean of what is true. Where that is black and what is shown is not, it is relative
    to the mean of what is shown: at least 1, as if all of it were wrong. With `again`, `true` and it are two
    independent estimates of the truth whose noise does not count, but for the percentile.
    """
    a, b = np.asarray(shown, np.float64), np.asarray(true, np.float64)
    c = b if again is None else np.asarray(again, np.float64)
    truth = (b + c) / 2
    relative_to = truth if truth.any() else a
    if not relative_to.any():
        return Error(0.0, 0.0, len(b))
    squares, means = ((a - b) * (a - c)).mean(axis=1), relative_to.mean(axis=1)
    drawn = np.random.default_rng(seed).integers(0, len(b), (RESAMPLINGS, len(b)))
    redrawn = np.sqrt(np.maximum(squares[drawn].mean(axis=1), 0))
    redrawn /= np.maximum(means[drawn].mean(axis=1), 1e-30)
    worst = np.percentile(np.abs(a - truth).mean(axis=1), 99) / means.mean()
    found = float(np.sqrt(max(squares.mean(), 0)) / means.mean())
    return Error(found, float(redrawn.std()), len(b), float(worst))


@dataclass(frozen=True, eq=False)
class Compared:
    """Radiance (N, 3): as shown, and true; `again` is an independent second estimate of the truth."""

    shown: npt.NDArray[Any]
    true: npt.NDArray[Any]
    again: npt.NDArray[Any] | None = None

    def __add__(self, other: Compared) -> Compared:
        """At all places of both."""
        again = None
        if self.again is not None and other.again is not None:
            again = np.concatenate([self.again, other.again])
        shown, true = ((self.shown, other.shown), (self.true, other.true))
        return Compared(np.concatenate(shown), np.concatenate(true), again)

    def error(self) -> Error:
        """See `compare`."""
        return compare(self.shown, self.true, again=self.again)


@dataclass(frozen=True, eq=False)
class Looked:
    """Places of a picture and of its vertices; light by light at those of the picture, and that between
    surfaces alone.
    """

    picture: Compared
    vertices: Compared
    layers: Mapping[NodeId, Compared] = field(default_factory=dict)
    indirect: Compared | None = None

    def __add__(self, other: Looked) -> Looked:
        """All places of both, of the same picture."""
        indirect = None
        if self.indirect is not None and other.indirect is not None:
            indirect = self.indirect + other.indirect
        layers = {layer: one + other.layers[layer] for layer, one in self.layers.items()}
        return Looked(self.picture + other.picture, self.vertices + other.vertices, layers, indirect)

    def error(self) -> MeasuredError:
        """What these places tell."""
        layers = {layer: one.error() for layer, one in self.layers.items()}
        indirect = None if self.indirect is None else self.indirect.error()
        return MeasuredError(self.picture.error(), self.vertices.error(), layers, indirect)
