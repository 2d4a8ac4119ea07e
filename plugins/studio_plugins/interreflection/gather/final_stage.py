"""The last stage: what receivers get of all that is sent."""

from __future__ import annotations

import functools

import numpy as np
import numpy.typing as npt

from studio_core.contract import Services
from studio_core.scene.diff import Aspect
from studio_core.shading.artifacts import (
    Casters,
    Indirect,
    LayerRadiance,
    Lighting,
    Receivers,
    Shapes,
    Surfaces,
)
from studio_core.shading.brute_force import blank_layer
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.kept import Kept
from studio_core.shading.path_world import PathWorlds
from studio_core.shading.pipeline import Inputs
from studio_core.shading.tilting import Facing, facings, gather_tilts
from studio_core.transport.operator import Transport
from studio_core.transport.rows import Rows
from studio_core.transport.separable import Separated
from studio_plugins.interreflection.gather.carrying import Carry, Layer, Setting
from studio_plugins.interreflection.gather.collecting import NO_RAYS, Collector, Rays, Sending
from studio_plugins.interreflection.gather.detail import noise_of, shared_noise
from studio_plugins.interreflection.gather.following import Follower
from studio_plugins.interreflection.gather.lobe_rays import Drawn, LobeRays
from studio_plugins.interreflection.gather.near import followed, near_rays, trusted
from studio_plugins.interreflection.gather.skylight import looking_out
from studio_plugins.interreflection.gather.smooth import Neighbours, Spacing, smoothed
from studio_plugins.interreflection.gather.stages import FINAL_SEED, Meetings, Sent, Tables, method_params
from studio_plugins.interreflection.gather.tiers import Chosen

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


class FinalStage:
    """What receivers get of all that is sent."""

    needs: tuple[type, ...] = (
        Surfaces,
        Casters,
        Shapes,
        Lighting,
        Receivers,
        Chosen,
        Separated,
        Meetings,
        Sent,
    )
    gives = Indirect
    dirtied_by = Aspect.VIEW

    def __init__(self, services: Services, neighbours: Neighbours) -> None:
        self._workers = services.workers
        self._tables = Tables(services, FINAL_SEED)
        self._lobes = LobeRays(services)
        self._worlds = PathWorlds(services.registry)
        self._neighbours = neighbours
        self._carry = Carry()
        self._spacing: Kept[Spacing] = Kept()
        self._meetings: Meetings | None = None

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Indirect:
        """The layer at the receivers."""
        surfaces, shapes, receivers = inputs[Surfaces], inputs[Shapes], inputs[Receivers]
        mesh, sent, tier = surfaces.mesh, inputs[Sent], inputs[Chosen].tier
        wanted, casters = receivers.seen, inputs[Casters]
        rays_of_each = tier.rays_for(int(np.count_nonzero(wanted)))
        met = self._tables(rays_of_each, surfaces, casters, wanted, self._meetings, job)
        traced = 0 if met is self._meetings else met.rays
        self._meetings = met
        lobes = self._lobes.update(frame.scene, surfaces, casters, shapes, receivers, tier.lobes, job)
        eye = (receivers.eye - mesh.origin).astype(np.float32)
        flat, cosine_rays = inputs[Separated].matte, sum(rays_of_each)
        collector = Collector(mesh, shapes, flat, eye, lobes, cosine_rays, self._workers, job)
        spacing = self._spacing(lambda: Spacing.of(met.tables[0], self._workers, job), met)
        neighbours = self._neighbours(mesh)
        sending = Sending.of(sent.sources.light, sent.surface)
        vertices, layer = np.flatnonzero(wanted), blank_layer(mesh, shapes)
        ways, every = facings(mesh, shapes, layer), (*map(_of_pattern, met.tables), *_of_lobes(lobes))
        hand = not inputs[Chosen].level and not tier.last
        setting = Setting(frame.scene, mesh, shapes, wanted, method_params(frame))
        counted = tuple(rays.vertex.shape[1] for rays in every)
        heard = self._carry.hears(setting, counted, frame.moving) if hand else ()
        for way in ways:
            needed = _needed(vertices, way)
            for number, rays in enumerate(every):
                hear = heard[number] if heard and way is ways[0] else None
                before = way.irradiance.copy()
                collector.add(rays, sending, needed, way, way.terms, way.irradiance, hear)
                if number == len(met.tables) - 1:
                    parts = (before, way.irradiance - before)
            mask = np.zeros(len(wanted), np.bool_)
            mask[needed] = True
            share = functools.partial(
                smoothed, receivers=met.tables[0], wanted=mask, spacing=spacing, mesh=mesh,
                neighbours=neighbours, rays=cosine_rays, workers=self._workers, job=job,
            )  # fmt: skip
            if len(met.tables) > 1:
                noise = noise_of(*parts, (cosine_rays - rays_of_each[-1], rays_of_each[-1]))
                made = shared_noise(way.irradiance, noise, mask, neighbours, share, self._workers, job)
            else:
                made = share(way.irradiance)
            way.irradiance[:] = made
        near = 0
        if tier.paths:
            near = self._look_closer(frame, inputs, every, collector, ways, vertices, job)
        layers = [Layer(way.irradiance, way.terms) for way in ways]
        if heard:
            self._carry.first(setting, layers, heard, frame.moving)
        elif not hand:
            self._carry.finer(setting, layers, inputs[Chosen].level, tier.last)
        for way in ways:
            collector.add_flat(_needed(vertices, way), way.terms, way.irradiance)
        if layer.tilts is not None:
            gather_tilts(shapes, mesh, ways, layer.tilts)
        counts = {
            "rays_of_receivers": traced,
            "rays_of_lobes": lobes.rays,
            "rays_followed": near,
            "receivers": len(vertices),
        }
        return self._told(inputs, layer, wanted, counts, cosine_rays)

    def _look_closer(
        self,
        frame: Frame,
        inputs: Inputs,
        every: tuple[Rays, ...],
        collector: Collector,
        ways: list[Facing],
        vertices: I64,
        job: Job,
    ) -> int:
        """Adds what `near` tells, but to flat terms; how many paths it took."""
        surfaces, sent, separated = inputs[Surfaces], inputs[Sent], inputs[Separated]
        mesh = surfaces.mesh
        world = self._worlds(frame.scene, surfaces, inputs[Casters], inputs[Lighting])
        tables = []
        for rays in every:
            which = rays.row_of[vertices].astype(np.int64)
            tables.append(
                (rays, *near_rays(rays, which[which >= 0], mesh.area, collector.row, separated.error))
            )
        world = looking_out(world, sent.worth)
        follow = Follower(mesh, world, sent.sources, sent.surface, self._workers, job)
        deltas, paths = followed(tables, inputs[Chosen].tier.paths, follow)
        found = list(zip(every, deltas, strict=True))
        trust = trusted(found, self._neighbours(mesh))
        for way in ways:
            needed = _needed(vertices, way)
            terms, irradiance = np.zeros_like(way.terms), np.zeros_like(way.irradiance)
            for rays, near in found:
                own = rays._replace(vertex=near.numbered(rays))
                collector.add(own, Sending.along_rays(near.change), needed, way, terms, irradiance)
            way.terms[:] += trust[:, None, None] * terms
            way.irradiance[:] = np.maximum(way.irradiance + trust[:, None] * irradiance, 0)
        return paths

    def _told(
        self, inputs: Inputs, layer: LayerRadiance, wanted: Bools, counts: dict[str, int], rays: int
    ) -> Indirect:
        inner, sent, tier = inputs[Meetings], inputs[Sent], inputs[Chosen].tier
        counts = {
            "rays_between_vertices": inner.rays if Meetings in inputs.rebuilt else 0,
            "rays_to_lights": sent.rays if Sent in inputs.rebuilt else 0,
            **counts,
        }
        held = (
            sum(table.nbytes for table in inner.tables)
            + self._tables.nbytes
            + self._lobes.nbytes
            + self._carry.nbytes
        )
        separated = inputs[Separated]
        facts = {
            "rays": float(rays),
            "lobe_rays": float(tier.lobes),
            "inner_rays": float(sum(tier.inner)),
            "functions": float(separated.count.max(initial=0)),
            "lobe_error": float(separated.error.max(initial=0)),
            "rounds": float(sent.sources.steps),
            "bytes": float(held + sent.nbytes + separated.nbytes + self._neighbours.nbytes),
        }
        return Indirect(inputs[Surfaces], layer, wanted, tier.last, counts, facts, sent.exchange)


def _needed(vertices: I64, way: Facing) -> I64:
    return vertices if way.leaning is None else vertices[way.leaning[vertices]]


def _of_pattern(table: Transport) -> Rays:
    return _rays(table, table.pattern.directions, NO_RAYS)


def _of_lobes(lobes: Drawn) -> tuple[Rays, ...]:
    return () if lobes.transport is None else (_rays(lobes.transport, NO_RAYS, lobes.directions),)


def _rays(table: Rows, pattern: F32, world: F32) -> Rays:
    hits = table.table
    met = (hits.vertex, hits.cell, hits.distance)
    return Rays(table.rows, table.row_of, table.variant, *met, pattern, world)
