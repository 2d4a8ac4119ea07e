"""What pixels are made of: hits, what is seen through them, and the finer hits of pixels with edges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.kernels.compose import average
from studio_core.parallel import Workers
from studio_core.shading.artifacts import EdgeHits, Hits, Surfaces
from studio_core.shading.job import Job

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]

PIXELS = 1 << 12  # a chunk
EVERY = np.zeros(0, np.int64)
NO_COLOUR = np.zeros((0, 3), np.float32)
_FULLY = np.zeros(0, np.float32)


@dataclass(frozen=True, eq=False)
class Layer:
    """Hits, which samples of the part they are (empty: all), and how much each counts (empty: fully).

    `caught` are those of them on surfaces that catch shadows.
    """

    hits: Hits
    samples: I64
    weight: F32
    caught: I64

    @property
    def caught_samples(self) -> I64:
        """Which samples of the part these are."""
        return self.samples[self.caught] if len(self.samples) else self.caught

    @property
    def caught_weight(self) -> F32:
        """How much each of these counts."""
        return self.weight[self.caught] if len(self.weight) else np.ones(len(self.caught), np.float32)


@dataclass(frozen=True, eq=False)
class Part:
    """Pixels of a picture (empty: all) and the layers of hits that they are made of."""

    pixels: I64
    layers: tuple[Layer, ...]

    def of_picture(self, own: I64) -> I64:
        """Which samples of the picture (in which all pixels have as many) some of this part are."""
        if not len(self.pixels):
            return own
        hits = self.layers[0].hits
        return EdgeHits(self.pixels, hits).of_picture(own if len(own) else np.arange(len(hits.face)))


def parts_of(hits: Hits, surfaces: Surfaces) -> tuple[Part, ...]:
    """All pixels, then those whose hits stand in the place of theirs."""
    every = Part(EVERY, _layers(hits, surfaces))
    if hits.edges is None or not len(hits.edges.pixels):
        return (every,)
    return (every, Part(hits.edges.pixels, _layers(hits.edges.hits, surfaces)))


def _layers(hits: Hits, surfaces: Surfaces) -> tuple[Layer, ...]:
    """The hits and what is seen through them, each with what the surfaces before it let through."""
    made: list[Layer] = []
    _add_layers(hits, EVERY, _FULLY, surfaces, made)
    return tuple(made)


def _add_layers(hits: Hits, samples: I64, arrives: F32, surfaces: Surfaces, made: list[Layer]) -> None:
    """Not inside the other: a function that knows itself keeps all it knows until cycles are looked for."""
    weight = arrives.copy()
    if hits.behind and not len(weight):
        weight = np.ones(len(hits.face), np.float32)
    made.append(Layer(hits, samples, weight, caught_hits(hits, surfaces)))
    for index, rest in hits.behind:
        alpha = surfaces.opacity[surfaces.mesh.face_material[hits.face[index]]]
        passed = weight[index] * (1 - alpha)
        weight[index] *= alpha
        _add_layers(rest, samples[index] if len(samples) else index, passed, surfaces, made)


def caught_hits(hits: Hits, surfaces: Surfaces) -> I64:
    """Which hits meet what catches shadows."""
    if not surfaces.catches.any():
        return EVERY
    met = np.flatnonzero(hits.face >= 0)
    return np.asarray(met[surfaces.catches[surfaces.mesh.face_material[hits.face[met]]]])


def averaged(
    layer: Layer,
    look: Callable[[int, int, F32], None],
    background: F32,
    workers: Workers,
    job: Job | None,
) -> F32:
    """(P, 3) pixels whose samples start … stop−1 `look` writes; background (P, 3), or nothing, is added."""
    count = layer.hits.samples**2
    out = np.empty((len(layer.hits.face) // count, 3), np.float32)

    def fill(start: int, stop: int) -> None:
        if count == 1 and not len(layer.weight) and not len(background):
            look(start, stop, out[start:stop])
            return
        first, last = start * count, stop * count
        values = np.empty((last - first, 3), np.float32)
        look(first, last, values)
        average(count, values, layer.weight[first:last], background[start:stop], out[start:stop])

    workers.run(len(out), PIXELS, fill, job)
    return out
