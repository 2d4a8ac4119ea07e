"""Indirect light the plain way: every path on its own, directions all alike, every light looked at."""

from __future__ import annotations

import numpy as np

from studio_core.brdfs.calls import evaluate
from studio_core.kernels.directions import direction_set
from studio_core.kernels.packets import OPAQUE
from studio_core.scene.shading_mesh import NO_BACK
from studio_core.shading.lamps import lamp_light, lamp_targets
from studio_core.shading.materials import coefficients, resolve


class PathOracle:
    """Of untextured materials, over the artifacts of a pipeline; `lamp_samples` places of lamps are seen."""

    def __init__(self, scene, surfaces, casters, lighting, gains, registry, workers, lamp_samples=1):
        self.mesh, self.caster, self.lighting, self.gains = surfaces.mesh, casters.primary, lighting, gains
        self.workers, self.lamp_samples = workers, lamp_samples
        self.looks = []
        for name in surfaces.materials:
            found = resolve(scene.material(name), registry)
            shape = np.atleast_1d(np.asarray(found.brdf.shape(found.typical()), np.float32))
            self.looks.append((found.brdf, shape, coefficients(found).astype(np.float64)))

    def irradiance(self, position, normal, geometric, inset, bounces, paths, rng):
        """(paths, 3) estimates of one point's irradiance by way of up to `bounces` surfaces."""
        origin = np.tile(position + self.caster.epsilon * geometric + inset, (paths, 1))
        direction, factor = self._even(np.tile(normal, (paths, 1)), rng)
        keep = (direction @ geometric > 0) & (factor > 0)
        factor = np.where(keep, factor * 2 * np.pi, 0)[:, None] * np.ones(3)
        made = np.zeros((paths, 3))
        for _ in range(bounces):
            where, normals, flat, material, towards, alive = self._meet(origin, direction)
            factor[~alive] = 0
            rows = np.flatnonzero(factor.any(axis=1))
            onward, cosine = self._even(normals, rng)
            start = where + self.caster.epsilon * flat
            sent, factor_next = self._surfaces(
                rows, start, normals, flat, material, towards, onward, cosine, rng
            )
            made += factor * sent
            factor = factor * factor_next
            origin, direction = start, onward
        return made

    def _even(self, normals, rng):
        """Directions of the hemisphere, all alike, and their cosines."""
        d = rng.normal(size=normals.shape)
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        cosine = (d * normals).sum(axis=1)
        return np.where(cosine[:, None] < 0, -d, d), np.abs(cosine)

    def _meet(self, origin, direction):
        hits = self.caster.closest(origin, direction, 0.0, np.inf, self.workers, mask=OPAQUE)
        hit = hits.object >= 0
        face = self.mesh.face_offsets[hits.object] + hits.face
        corners, back = self.mesh.faces[face], self.mesh.back_faces[face]
        behind = hit & ~hits.front
        black = behind & (back[:, 0] == NO_BACK)
        corners = np.where((behind & ~black)[:, None], back, corners)
        weights = np.stack([1 - hits.u - hits.v, hits.u, hits.v], axis=1).astype(np.float64)
        where = np.einsum("nk,nkc->nc", weights, self.mesh.positions[corners].astype(np.float64))
        normals = np.einsum("nk,nkc->nc", weights, self.mesh.normals[corners].astype(np.float64))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        flat = np.where(hits.front[:, None], hits.normal, -hits.normal).astype(np.float64)
        return (
            where + self.mesh.origin,
            normals,
            flat,
            self.mesh.material[corners[:, 0]],
            -direction,
            hit & ~black,
        )

    def _surfaces(self, rows, start, normals, flat, material, towards, onward, cosine, rng):
        """Radiance sent by surfaces `rows`, and what their next ray counts; (paths, 3) both."""
        sent, factor = np.zeros_like(start), np.zeros_like(start)
        ways, light = [onward], [np.zeros_like(start)]
        for lamp in self.lighting.lamps:
            targets = lamp_targets(lamp, self.lamp_samples)
            aims, weight = lamp_light(lamp, targets, start)
            for q, target in enumerate(targets):
                free = self._free(start, aims[:, q], target)
                ways.append(aims[:, q])
                light.append((weight[:, q] * free)[:, None] * self.gains[lamp.node])
        tree = self.lighting.tree
        if tree is not None:
            aim, _ = self._even(normals, rng)
            leaf = direction_set(tree.k).leaf_of(aim.astype(np.float32))
            free = ~self.caster.occluded(start, aim, np.inf, self.workers)
            sky = tree.radiance[leaf] * self.gains[self.lighting.environment.id]
            ways.append(aim)
            light.append(sky * (2 * np.pi * free)[:, None])
        for n in rows:
            frame = _frame(normals[n])
            brdf, shape, colour = self.looks[material[n]]
            world = np.array([way[n] for way in ways])
            wi = world @ frame.T
            wo = frame @ towards[n]
            if wo[2] < 1e-3:
                wo[2] = 1e-3
                wo /= np.linalg.norm(wo)
            values = evaluate(brdf, shape, wo, wi).astype(np.float64) @ colour
            values *= (np.maximum(wi[:, 2], 0) * (world @ flat[n] > 0))[:, None]
            factor[n] = values[0] * 2 * np.pi
            sent[n] = sum(value * given[n] for value, given in zip(values[1:], light[1:], strict=True))
        return sent, factor

    def _free(self, start, aims, target):
        far = np.full(len(start), np.inf)
        if target[3]:
            far = np.maximum(np.linalg.norm(target[:3] - start, axis=1) - 4 * self.caster.epsilon, 0)
        return ~self.caster.occluded(start, aims, far, self.workers)


def _frame(normal):
    """Rows t, b, n; for models without a grain."""
    other = np.array([1.0, 0, 0]) if abs(normal[0]) < 0.9 else np.array([0, 1.0, 0])
    t = np.cross(other, normal)
    t /= np.linalg.norm(t)
    return np.stack([t, np.cross(normal, t), normal])
