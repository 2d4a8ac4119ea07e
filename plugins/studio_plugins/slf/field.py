"""The change that is wanted at any place, from what was decided for strokes or for elements (section 4.3).

The paper has R + ∫ s Δ / ∫ s, over everything: where one stroke alone reaches, its likeness s would cancel.
What nobody painted counts as well, with what is left of 1: R + Σ s Δ / max(Σ s, 1). So a change fades out
where it ends, and where several meet they are averaged.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.parallel import Workers
from studio_plugins.slf.similarity import Reach, likeness_of
from studio_plugins.slf.spots import Spots
from studio_plugins.slf.upsampling import Upsampling

F32 = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Decided:
    """One change for what is alike a stroke's marks: by parameter (1,) or (3,)."""

    marks: Spots
    reach: Reach
    changes: Mapping[str, npt.ArrayLike]


@dataclass(frozen=True, eq=False)
class Varied:
    """Changes by parameter (E, C) at elements, each times its weight (E,).

    With strokes, what lies between is times how alike it is the one that it is most alike.
    """

    elements: Spots
    changes: Mapping[str, F32]
    weight: F32
    strokes: Sequence[tuple[Spots, Reach]] = ()


Layer = Sequence[Decided]


@dataclass(frozen=True, eq=False)
class Field:
    """Changes that add up: those of layers, in each of which decisions meet, and those of elements."""

    layers: Sequence[Layer] = ()
    varied: Sequence[Varied] = ()

    @property
    def widths(self) -> dict[str, int]:
        """How many numbers each parameter that changes has."""
        changes = [one.changes for layer in self.layers for one in layer]
        made = {name: np.size(value) for each in changes for name, value in each.items()}
        return made | {name: part.shape[1] for one in self.varied for name, part in one.changes.items()}

    @property
    def by_look(self) -> bool:
        """Whether looks decide anything."""
        return bool(self.varied) or any(one.reach.alike for layer in self.layers for one in layer)

    @property
    def marks(self) -> tuple[Spots, ...]:
        """Where something is known of what is wanted."""
        of_elements = (marks for one in self.varied for marks, _ in one.strokes)
        return (*(one.marks for layer in self.layers for one in layer), *of_elements)

    def at(self, spots: Spots, workers: Workers | None = None) -> dict[str, F32]:
        """By parameter (P, C) at places."""
        made: dict[str, F32] = {}
        for layer in self.layers:
            sums: dict[str, F32] = {}
            total: dict[str, F32] = {}
            for one in layer:
                alike = likeness_of(spots, one.marks, one.reach, workers)
                for name, change in one.changes.items():
                    part = alike[:, None] * np.asarray(change, np.float32).reshape(1, -1)
                    sums[name] = sums[name] + part if name in sums else part
                    total[name] = total[name] + alike if name in total else alike
            for name, part in sums.items():
                most = np.maximum(total[name], 1).astype(np.float32)
                _add(made, name, part / most[:, None])
        for varied in self.varied:
            between = Upsampling.of(varied.elements, spots)
            near = [likeness_of(spots, marks, reach, workers) for marks, reach in varied.strokes]
            share = np.max(near, axis=0) if near else np.ones(len(spots), np.float32)
            for name, change in varied.changes.items():
                _add(made, name, share[:, None] * between(change, varied.weight))
        return made


def _add(made: dict[str, F32], name: str, part: F32) -> None:
    made[name] = made[name] + part if name in made else part


__all__ = ["Decided", "Field", "Layer", "Varied"]
