"""Path tracing: where rays go, what they meet, and what lamps and the environment send along them.

Light is stopped by what is opaque. The inside of closed parts is black.
"""

from __future__ import annotations

import numpy as np

from studio_core.jit import call_address, kernel
from studio_core.kernels.directions import leaf_of
from studio_core.kernels.packets import (
    DIRECTION,
    GEOMETRY,
    INSTANCE,
    MASK,
    NO_HIT,
    OPAQUE,
    ORIGIN,
    PRIMITIVE,
    TFAR,
    U,
    V,
    clear_hits,
    new_packet,
)
from studio_core.kernels.path_state import (
    AREA,
    ENDED,
    I64,
    Lights,
    Mesh,
    Paths,
    Tracer,
    area_weight,
    scrambled,
)

NO_BACK = np.uint32(0xFFFFFFFF)
LEAST_SHARE = 1e-4
"""Of a corner: points nearer to an edge of their face could lie outside of the mesh by rounding."""


@kernel
def follow_paths(
    start: int,
    stop: int,
    active: I64,
    escapes: bool,
    last: bool,
    tracer: Tracer,
    mesh: Mesh,
    lights: Lights,
    paths: Paths,
) -> None:
    """Leads paths active[start:stop] to the surface that their ray meets first, or ends them.

    Rays that leave the scene bring the environment's light, and those that pass area lamps theirs, where
    `escapes` says that they may count: weighted with the density of choosing the same direction as a light's
    (Veach & Guibas 1995, balance heuristic). With `last` nothing but that is wanted of them.
    """
    packet, valid = new_packet()
    words = packet.view(np.uint32)
    words[MASK, :] = OPAQUE
    for first in range(start, stop, 8):
        count = min(8, stop - first)
        clear_hits(packet)
        for lane in range(8):
            valid[lane] = -1 if lane < count else 0
            if lane >= count:
                continue
            n = active[first + lane]
            for axis in range(3):
                packet[ORIGIN + axis, lane] = paths.origin[n, axis]
                packet[DIRECTION + axis, lane] = paths.direction[n, axis]
            packet[TFAR, lane] = np.inf
        shortly = last and lights.areas == 0  # whether something is met says all
        if shortly:
            call_address(tracer.occluded8, valid, tracer.scene, packet, 0)
        else:
            call_address(tracer.intersect8, valid, tracer.scene, packet, 0)
        for lane in range(count):
            n = active[first + lane]
            paths.material[n] = ENDED
            missed = packet[TFAR, lane] >= 0 if shortly else words[GEOMETRY, lane] == NO_HIT
            dx, dy, dz = paths.direction[n, 0], paths.direction[n, 1], paths.direction[n, 2]
            if escapes and lights.areas > 0:
                _pass_lamps(n, np.inf if missed else np.float64(packet[TFAR, lane]), lights, paths)
            if missed:
                if escapes and lights.k > 0:
                    leaf = leaf_of(dx, dy, dz, lights.k)
                    own = paths.density[n]
                    share = own / max(own + lights.chance[leaf], np.float32(1e-30))
                    for c in range(3):
                        paths.radiance[n, c] += paths.throughput[n, c] * lights.radiance[leaf, c] * share
                continue
            if last:
                continue
            item = np.int64(words[INSTANCE, lane])
            slot = tracer.face_start[item, np.int64(words[GEOMETRY, lane])] + np.int64(words[PRIMITIVE, lane])
            f = mesh.face_offsets[item] + np.int64(tracer.face_ids[slot])
            i, j, k = np.int64(mesh.faces[f, 0]), np.int64(mesh.faces[f, 1]), np.int64(mesh.faces[f, 2])
            ax, ay, az = (
                np.float64(mesh.positions[i, 0]),
                np.float64(mesh.positions[i, 1]),
                np.float64(mesh.positions[i, 2]),
            )
            bx, by, bz = mesh.positions[j, 0] - ax, mesh.positions[j, 1] - ay, mesh.positions[j, 2] - az
            cx, cy, cz = mesh.positions[k, 0] - ax, mesh.positions[k, 1] - ay, mesh.positions[k, 2] - az
            gx, gy, gz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
            length = np.sqrt(gx * gx + gy * gy + gz * gz)
            facing = gx * dx + gy * dy + gz * dz
            if not length > 0.0 or facing == 0.0:
                continue
            scale = 1.0 / length
            if facing > 0.0:
                if mesh.back_faces[f, 0] == NO_BACK:
                    continue
                i, j, k = (
                    np.int64(mesh.back_faces[f, 0]),
                    np.int64(mesh.back_faces[f, 1]),
                    np.int64(mesh.back_faces[f, 2]),
                )
                scale = -scale
            w1 = max(np.float64(packet[U, lane]), LEAST_SHARE)
            w2 = max(np.float64(packet[V, lane]), LEAST_SHARE)
            w0 = max(1.0 - w1 - w2, LEAST_SHARE)
            whole = 1.0 / (w0 + w1 + w2)
            w0, w1, w2 = w0 * whole, w1 * whole, w2 * whole
            geometric = gx * scale, gy * scale, gz * scale
            edges = (
                ax + w1 * bx + w2 * cx,
                ay + w1 * by + w2 * cy,
                az + w1 * bz + w2 * cz,
            )
            nx = w0 * mesh.normals[i, 0] + w1 * mesh.normals[j, 0] + w2 * mesh.normals[k, 0]
            ny = w0 * mesh.normals[i, 1] + w1 * mesh.normals[j, 1] + w2 * mesh.normals[k, 1]
            nz = w0 * mesh.normals[i, 2] + w1 * mesh.normals[j, 2] + w2 * mesh.normals[k, 2]
            length = np.sqrt(nx * nx + ny * ny + nz * nz)
            if length > 1e-6:
                nx, ny, nz = nx / length, ny / length, nz / length
            else:
                nx, ny, nz = geometric
            tx = w0 * mesh.tangents[i, 0] + w1 * mesh.tangents[j, 0] + w2 * mesh.tangents[k, 0]
            ty = w0 * mesh.tangents[i, 1] + w1 * mesh.tangents[j, 1] + w2 * mesh.tangents[k, 1]
            tz = w0 * mesh.tangents[i, 2] + w1 * mesh.tangents[j, 2] + w2 * mesh.tangents[k, 2]
            along = tx * nx + ty * ny + tz * nz
            tx, ty, tz = tx - along * nx, ty - along * ny, tz - along * nz
            length = np.sqrt(tx * tx + ty * ty + tz * tz)
            if not length > 1e-6:  # tangents that cancel: any will do (Duff et al. 2017)
                sign = 1.0 if nz >= 0 else -1.0
                a = -1.0 / (sign + nz)
                tx, ty, tz = 1.0 + sign * nx * nx * a, sign * nx * ny * a, -sign * nx
                length = np.sqrt(tx * tx + ty * ty + tz * tz)
            for axis in range(3):
                place = edges[axis] + mesh.shift[axis] + tracer.epsilon * geometric[axis]
                paths.origin[n, axis] = place
                paths.geometric[n, axis] = geometric[axis]
            paths.normal[n, 0], paths.normal[n, 1], paths.normal[n, 2] = nx, ny, nz
            paths.tangent[n, 0], paths.tangent[n, 1] = tx / length, ty / length
            paths.tangent[n, 2], paths.tangent[n, 3] = tz / length, mesh.tangents[i, 3]
            for c in range(2):
                paths.uv[n, c] = w0 * mesh.uvs[i, c] + w1 * mesh.uvs[j, c] + w2 * mesh.uvs[k, c]
            paths.material[n] = paths.row[n] = mesh.material[i]
            chance = np.float64(scrambled(paths.random[n]) >> np.uint64(11)) * 2.0**-53
            paths.vertex[n] = i if chance < w0 else (j if chance < w0 + w1 else k)


@kernel
def _pass_lamps(n: int, far: float, lights: Lights, paths: Paths) -> None:
    """Adds the light of area lamps that ray n passes before `far`."""
    for i in range(len(lights.kind)):
        if lights.kind[i] != AREA:
            continue
        ahead, back, square, cosine, facing = 0.0, 0.0, 0.0, 0.0, 0.0
        for axis in range(3):
            gap = lights.position[i, axis] - paths.origin[n, axis]
            ahead += gap * lights.axis[i, axis]
            back -= paths.direction[n, axis] * lights.axis[i, axis]
            square += gap * gap
            cosine += gap * paths.normal[n, axis]
        if not (back > 1e-9 and ahead < 0.0):
            continue
        away = -ahead / back
        if away > far:
            continue
        a, b, wide, tall = 0.0, 0.0, 0.0, 0.0
        for axis in range(3):
            place = paths.origin[n, axis] + away * paths.direction[n, axis] - lights.position[i, axis]
            a += place * lights.across[i, axis]
            b += place * lights.up[i, axis]
            wide += lights.across[i, axis] * lights.across[i, axis]
            tall += lights.up[i, axis] * lights.up[i, axis]
        if 2.0 * abs(a) > wide or 2.0 * abs(b) > tall:
            continue
        square = max(square, 1e-12)
        middle = np.sqrt(square)
        facing = -ahead / middle
        weight = area_weight(lights.power[i], lights.spread[i], cosine / middle, facing, square)
        chance = weight / max(paths.lamps[n], 1e-300) * away * away / (back * lights.area[i])
        share = paths.density[n] / max(paths.density[n] + chance, 1e-30)
        for c in range(3):
            paths.radiance[n, c] += paths.throughput[n, c] * lights.gain[i, c] / lights.area[i] * share


__all__ = ["LEAST_SHARE", "follow_paths"]
