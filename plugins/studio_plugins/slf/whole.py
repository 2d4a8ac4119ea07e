"""All elements of a scene at once: what arrives at them, n bounces, and the paper's solve (listing 1).

T¹ is one bounce, K G l_e (the paper's T^i is off by one as printed): `bounced` sends on what a field sends,
the environment's and the lamps' light. A solve over n bounces takes the light of the reflectances that it
found last, so that light between surfaces that a change brings is not brought twice (figure 15).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.nodes import Light, NodeId
from studio_core.shading.artifacts import Casters, Lighting, Surfaces
from studio_core.transport.cells import CELLS, PARTS, RINGS
from studio_core.transport.operator import Counts, Transport
from studio_plugins.slf.elements import COUNT, Elements
from studio_plugins.slf.ladder import LEVELS
from studio_plugins.slf.links import cell_pattern, frames_of, links
from studio_plugins.slf.lumitexels import LightField
from studio_plugins.slf.mixed import choose_all
from studio_plugins.slf.moments import moments
from studio_plugins.slf.paper import Solver
from studio_plugins.slf.series import (
    WIDTH,
    half_level,
    light_of,
    matte_of,
    sent_of,
    series_of,
)
from studio_plugins.slf.skylight import averages
from studio_plugins.slf.straight import StraightLight

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
U32 = npt.NDArray[np.uint32]
Bools = npt.NDArray[np.bool_]

CHUNK = 32
LIMIT = 128 << 20
BURIED = 0.5  # share of rays that meet the inside of something closed

Wanted = Callable[[slice, F32], F32]
"""Of some elements, on any thread: of the series (N, 3, RINGS, WIDTH) of what they send, what is wanted."""


@dataclass(frozen=True, eq=False)
class Reflectances:
    """Of E elements: matte and shiny albedo (E, 3), gloss level (E,), any real number of the ladder's."""

    diffuse: F64
    specular: F64
    level: F64


@dataclass(frozen=True, eq=False)
class Answer:
    """What a solve found; kind (E,) as in `paper`, flagged (E,) elements that stay as they are."""

    reflectances: Reflectances
    kind: npt.NDArray[np.int64]
    residual: F64
    flagged: Bools

    @property
    def counts(self) -> dict[str, int]:
        """How many elements were solved and how many skipped."""
        skipped = int(self.flagged.sum())
        return {"solved": len(self.flagged) - skipped, "skipped": skipped}


class Whole:
    """A scene's elements and what reaches them, over many edits. Owned by the compute thread."""

    def __init__(self, workers: Workers, count: int = COUNT) -> None:
        self._workers, self._count = workers, count
        self._transport = Transport(workers, cell_pattern(), LIMIT)
        self._straight = StraightLight(workers)
        self._known: tuple[object, ...] = ()
        self._wanted: Bools = np.zeros(0, np.bool_)
        self._lit: tuple[object, ...] = ()
        self._sky: F32 | None = None
        self._gain = np.zeros(3, np.float32)
        self.elements = Elements(np.zeros(0, np.int64), np.zeros(0, np.int32), np.zeros(0))
        self.frames: F32 = np.zeros((0, 3, 3), np.float32)
        self.links: U32 = np.zeros((0, CELLS), np.uint32)
        self.buried: Bools = np.zeros(0, np.bool_)

    @property
    def nbytes(self) -> int:
        """Memory of what is kept, without light fields."""
        sky = 0 if self._sky is None else self._sky.nbytes
        own = self._transport.nbytes + self.links.nbytes + self.frames.nbytes + self.elements.owner.nbytes
        return own + self._straight.nbytes + sky

    @property
    def state(self) -> tuple[object, ...]:
        """Other objects than before where the environment brings other light, lamps and suns apart."""
        return self.links, self._sky, self._gain

    def update(
        self,
        surfaces: Surfaces,
        casters: Casters,
        lighting: Lighting,
        lights: Mapping[NodeId, Light],
        wanted: Bools,
        job: Checkpoints | None = None,
    ) -> Counts:
        """Follows meshes, moves and lights; only those of `lights`, with their gains, are on.

        Elements stand for the vertices `wanted` (V,) of the unrefined meshes.
        """
        mesh = surfaces.unrefined.mesh
        if casters.meshes != self._known or not np.array_equal(wanted, self._wanted):
            self.elements = Elements.of(mesh, wanted, self._count)
            self._known, self._wanted = casters.meshes, wanted.copy()
            self.links = np.zeros((0, CELLS), np.uint32)
        some = np.zeros(len(mesh), np.bool_)
        some[self.elements.vertex] = True
        counts = self._transport.update(surfaces, casters, some, job)
        if counts.rays or counts.tested or len(self.links) != len(self.elements):
            self.frames = frames_of(mesh, self.elements.vertex)
            self._transport.keep_only(some)
            black = LightField.rows_of(len(self.elements)) - 1
            self.links = links(mesh, self.elements, self._transport, self.frames, black, self._workers, job)
            self.buried = (self._transport.share_back > BURIED)[self._transport.row_of[self.elements.vertex]]
        self._straight.update(surfaces, casters, lighting, lights, self.elements, job)
        self._look_up(lighting, lights, job)
        return counts

    def _look_up(self, lighting: Lighting, lights: Mapping[NodeId, Light], job: Checkpoints | None) -> None:
        environment = lighting.environment
        shown = None if environment is None else lights.get(environment.id)
        if shown is None or lighting.tree is None:
            self._sky, self._lit = None, ()
            return
        if lighting.integrated != self._lit:
            self._sky, self._lit = averages(lighting.tree, self._workers, job), lighting.integrated
        gain = np.asarray(shown.gain(), np.float32)
        self._gain = self._gain if np.array_equal(gain, self._gain) else gain

    def dark(self) -> LightField:
        """What is sent before any light was reflected: the environment alone."""
        made = LightField(len(self.elements))
        if self._sky is not None:
            made.keep_sky(self._sky * self._gain)
        return made

    def incident(self, field: LightField, start: int, stop: int) -> F32:
        """(N, 3, RINGS, WIDTH) the series of what arrives at elements start … stop − 1."""
        light = np.empty((stop - start, 3, RINGS, PARTS), np.float32)
        field.read(self.links[start:stop], light)
        series = series_of(light)
        self._straight.add_to(series, start, self.frames[start:stop])
        return series

    def matte(self, field: LightField, start: int, stop: int) -> F64:
        """(N, 3) what elements start … stop − 1 send where they are white and matte, without the series."""
        light = np.empty((stop - start, 3, RINGS, PARTS), np.float32)
        field.read(self.links[start:stop], light)
        means = np.zeros((*light.shape[:-1], 2), np.float32)  # no wave but the one that is even
        means[..., 0] = light.sum(axis=-1)
        self._straight.add_to(means, start, self.frames[start:stop])
        return matte_of(means)

    def sent(self, series: F32, of: Reflectances, start: int) -> F32:
        """The series of what elements from `start` on send of the incident light's."""
        own = slice(start, start + len(series))
        return sent_of(series, of.diffuse[own], of.specular[own], half_level(of.level[own]))

    def bounced(self, of: Reflectances, field: LightField, job: Checkpoints | None = None) -> LightField:
        """What all send of what `field` sends: one bounce more."""
        made = LightField(field.elements)
        made.copy_sky(field)

        def body(start: int, stop: int) -> None:
            if of.specular[start:stop].any():
                made.keep(start, light_of(self.sent(self.incident(field, start, stop), of, start)))
            else:
                even = self.matte(field, start, stop) * of.diffuse[start:stop]
                made.keep_even(start, np.maximum(even, 0).astype(np.float32))

        self._workers.run(len(self.elements), CHUNK, body, job)
        return made

    def after(self, bounces: int, of: Reflectances, job: Checkpoints | None = None) -> LightField:
        """T^n: the field after so many bounces, one at least."""
        field = self.dark()
        for _ in range(max(bounces, 1)):
            field = self.bounced(of, field, job)
        return field

    def solve(
        self,
        wanted: Wanted,
        now: Reflectances,
        field: LightField,
        solver: Solver = "mixed",
        job: Checkpoints | None = None,
    ) -> Answer:
        """Reflectances of all elements that send what is wanted of what `field` sends to them.

        `dark()` as the field is the paper's one bounce.
        """
        count = len(self.elements)
        level = np.clip(np.rint(now.level), 0, LEVELS - 1).astype(np.int64)
        both = np.stack([now.diffuse, now.specular], axis=2)
        made, gloss = both.copy(), level.copy()
        kind, residual, flagged = np.zeros(count, np.int64), np.zeros(count), np.ones(count, np.bool_)

        def body(start: int, stop: int) -> None:
            own = slice(start, stop)
            series = self.incident(field, start, stop)
            target = wanted(own, self.sent(series, now, start))
            series[self.buried[own]] = 0
            found = choose_all(moments(series, target, both[own], level[own]), solver)
            made[own], gloss[own] = found.reflectance.reshape(-1, 3, 2), found.level
            kind[own], residual[own], flagged[own] = found.kind, found.residual, found.flagged

        self._workers.run(count, CHUNK, body, job)
        made[flagged] = both[flagged]
        real = np.where(flagged | (gloss == level), now.level, gloss)
        return Answer(Reflectances(made[..., 0], made[..., 1], real), kind, residual, flagged)

    def settled(
        self,
        wanted: Wanted,
        now: Reflectances,
        bounces: int,
        solver: Solver = "mixed",
        job: Checkpoints | None = None,
    ) -> list[Answer]:
        """Listing 1: solved again under the light of what was found, as often as light is to bounce."""
        field, made = self.dark(), list[Answer]()
        for _ in range(max(bounces, 1)):
            made.append(self.solve(wanted, now, field, solver, job))
            field = self.bounced(made[-1].reflectances, field, job)
        return made


__all__ = ["WIDTH", "Answer", "Reflectances", "Wanted", "Whole"]
