"""Light as a list of samples: places on lamps, directions towards suns and the environment.

A vertex looks at every *column* of the list once, in one of P variants of it. Columns are strata: what the
variants of a column stand for together is a part of a lamp, of a sun, or of the sky. So one vertex sees
little of a lamp, but the vertices that rays from elsewhere meet have all of its variants among them.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.kernels.suns import Sun
from studio_core.scene.nodes import Light, NodeId
from studio_core.shading.artifacts import Lamp
from studio_core.shading.lamps import lamp_targets

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

DISTANT, POINT, SPOT, AREA = range(4)
_KINDS = {"directional": DISTANT, "point": POINT, "spot": SPOT, "area": AREA}
VARIANTS = 16


@dataclass(frozen=True)
class SampleCounts:
    """How often a vertex looks at each area lamp or sun, and at the environment; in how many variants."""

    lamp: int = 4
    environment: int = 64
    variants: int = VARIANTS


@dataclass(frozen=True, eq=False)
class LightSamples:
    """Samples of one light, or of several: P rows, variants for each zone of the scene, of C columns.

    place (P, C, 4): (x, y, z, 1) in the world, (x, y, z, 0) a unit direction towards the light. kind (C,) and
    lamp (C, 5), its axis and the cosines of cone and full cone, say how its light falls off. light (P, C, 3)
    is what the light of `owner[c]` gives at unit gain to a surface that faces it: at 1 m, of lamps. Equal
    `keys`, one for each group of columns (and how many there are), mean equal places.
    """

    place: F64
    kind: npt.NDArray[np.int8]
    lamp: F64
    light: F32
    owner: tuple[NodeId, ...]
    keys: tuple[tuple[Hashable, int], ...]

    def __len__(self) -> int:
        return len(self.kind)

    @property
    def rows(self) -> int:
        """P."""
        return len(self.place)

    def relative(self, origin: F64) -> F64:
        """`place` relative to a mesh's origin (3,)."""
        place = self.place.copy()
        place[..., :3] -= place[..., 3:] * origin
        return place

    def coloured(self, lights: Mapping[NodeId, Light]) -> F32:
        """(P, C, 3): the light with the gains of `lights`; lights that are not among them are off."""
        gains = {node: np.asarray(lights[node].gain(), np.float32) for node in set(self.owner) & set(lights)}
        off = np.zeros(3, np.float32)
        gain = np.array([gains.get(node, off) for node in self.owner], np.float32).reshape(-1, 3)
        return np.asarray(self.light * gain, np.float32)


def joined(parts: Sequence[LightSamples], rows: int) -> LightSamples:
    """Several lights' samples in one list, all of so many rows."""
    if len(parts) == 1:
        return parts[0]
    if not parts:
        none = np.zeros((rows, 0, 4))
        return LightSamples(
            none,
            np.zeros(0, np.int8),
            np.zeros((0, 5)),
            np.zeros((rows, 0, 3), np.float32),
            (),
            (),
        )
    return LightSamples(
        np.concatenate([part.place for part in parts], axis=1),
        np.concatenate([part.kind for part in parts]),
        np.concatenate([part.lamp for part in parts]),
        np.concatenate([part.light for part in parts], axis=1),
        tuple(node for part in parts for node in part.owner),
        tuple(key for part in parts for key in part.keys),
    )


def distant(directions: F64, light: npt.NDArray[np.floating], owner: NodeId, key: Hashable) -> LightSamples:
    """Directions (P, C, 3) of one light that give `light` (P, C, 3) each."""
    variants, count = directions.shape[:2]
    return LightSamples(
        np.concatenate([directions, np.zeros((variants, count, 1))], axis=2),
        np.full(count, DISTANT, np.int8),
        np.zeros((count, 5)),
        np.asarray(light, np.float32),
        (owner,) * count,
        ((key, count),),
    )


def shuffles(columns: int, variants: int, seed: int) -> I64:
    """(P, C): which of P places within a column each variant takes; every column in an order of its own."""
    ranks = np.random.default_rng(seed).random((variants, columns)).argsort(axis=0)
    return np.asarray(ranks, np.int64)


def lamp_samples(lamp: Lamp, samples: int, variants: int, zones: int) -> LightSamples:
    """A lamp, the same for all zones; one that has no extent has one column, whatever is asked for.

    With one variant these are the samples of `lamp_targets`.
    """
    rows = zones * variants
    targets = lamp_targets(lamp, samples * variants)
    if len(targets) == 1:
        columns, places = 1, np.repeat(targets[None], variants, axis=0)
    else:
        columns = len(targets) // variants
        chosen = np.arange(columns) * variants + shuffles(columns, variants, 7)
        places = targets[chosen]
    share = 1.0 / columns
    if lamp.kind == "area":
        share *= float(np.linalg.norm(np.cross(lamp.across, lamp.up)))
    vectors = np.concatenate([lamp.position, lamp.axis, lamp.across, lamp.up])
    numbers = (*vectors.tolist(), lamp.cos_cone, lamp.cos_inner, lamp.angle)
    return LightSamples(
        np.tile(places, (zones, 1, 1)),
        np.full(columns, _KINDS[lamp.kind], np.int8),
        np.tile([*lamp.axis, lamp.cos_cone, lamp.cos_inner], (columns, 1)),
        np.full((rows, columns, 3), share, np.float32),
        (lamp.node,) * columns,
        (((lamp.kind, *numbers, variants), columns),),
    )


def sun_samples(
    sun: Sun, samples: int, variants: int, zones: int, owner: NodeId, key: Hashable
) -> LightSamples:
    """The compact sources of an environment, each in about `samples` columns, the strong ones in more.

    A column stands for neighbouring samples of the sun; variants take one of them each, by its power, with
    the power of all.
    """
    directions, light = [], []
    power = sun.irradiance.astype(np.float64).sum(axis=1)
    wanted = samples * (len(sun.parts) - 1) / max(len(power), 1)
    for first, last in zip(sun.parts[:-1], sun.parts[1:], strict=True):
        columns = int(np.clip(round((last - first) * wanted), 1, last - first))
        upto = np.concatenate([[0.0], np.cumsum(power[first:last])])
        place = (shuffles(columns, variants, int(first)) + 0.5) / variants + np.arange(columns)
        chosen = np.searchsorted(upto, place * (upto[-1] / columns), side="right") - 1
        at = first + np.clip(chosen, 0, last - first - 1)
        directions.append(sun.directions[at])
        light.append(sun.irradiance[at] * (upto[-1] / columns / power[at])[..., None])
    tiles = (zones, 1, 1)
    return distant(
        np.tile(np.concatenate(directions, axis=1), tiles),
        np.tile(np.concatenate(light, axis=1), tiles),
        owner,
        key,
    )
