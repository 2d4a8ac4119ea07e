"""Lamps of the scene as samples of directions and irradiance, at white unit gain."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from studio_core.scene.nodes import AreaLamp, DirectionalLamp, Environment, Light, PointLamp, Scene, SpotLamp
from studio_core.scene.transform import rotation_matrix
from studio_core.shading.artifacts import Lamp

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]


def shown_environment(scene: Scene) -> Environment | None:
    """The environment that lights the scene and is seen behind it: the first that is not hidden."""
    return next((node for node in scene.of(Environment) if scene.shown(node.id)), None)


def lamps(scene: Scene) -> tuple[Lamp, ...]:
    """Every shown lamp of the scene in the world."""
    found = []
    for node in scene.of(Light):
        kind = _KINDS.get(type(node))
        if kind is None or not scene.shown(node.id):
            continue
        world = scene.world(node.id)
        right, up, back = rotation_matrix(world.rotation).T
        cos_cone = cos_inner = -1.0
        angle = 0.0
        if isinstance(node, SpotLamp):
            cos_cone = math.cos(math.radians(node.cone))
            cos_inner = math.cos(math.radians(min(node.inner, node.cone)))
        elif isinstance(node, DirectionalLamp):
            angle = math.radians(node.angle)
        elif isinstance(node, AreaLamp):
            right, up = right * node.width * world.scale, up * node.height * world.scale
        place = np.array(world.translation)
        found.append(Lamp(node.id, kind, place, -back, right, up, cos_cone, cos_inner, angle))
    return tuple(found)


_KINDS = {PointLamp: "point", SpotLamp: "spot", DirectionalLamp: "directional", AreaLamp: "area"}


def spot_falloff(cosine: F64, cos_inner: float, cos_cone: float) -> F64:
    """1 inside the full cone, 0 outside the cone, smoothstep of the cosine between."""
    if cos_inner - cos_cone < 1e-9:
        return (cosine >= cos_cone).astype(np.float64)
    t = np.clip((cosine - cos_cone) / (cos_inner - cos_cone), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def lamp_targets(lamp: Lamp, samples: int) -> F64:
    """(Q, 4) where shadow rays go in the world: (x, y, z, 1) on the lamp, (x, y, z, 0) towards a sun.

    Point and spot lamps need one; rectangles and discs take `samples` of a Fibonacci lattice.
    """
    if lamp.kind == "directional":
        discs = _disc(1 if lamp.angle <= 0 else samples)
        tangent, bitangent = disc_axes(lamp.axis)
        spread = math.tan(lamp.angle / 2)
        aim = -lamp.axis + spread * (discs[:, :1] * tangent + discs[:, 1:] * bitangent)
        aim /= np.linalg.norm(aim, axis=1, keepdims=True)
        return np.column_stack([aim, np.zeros(len(aim))])
    places = lamp.position[None]
    if lamp.kind == "area":
        grid = _lattice(samples) - 0.5
        places = lamp.position + grid[:, :1] * lamp.across + grid[:, 1:] * lamp.up
    return np.column_stack([places, np.ones(len(places))])


def lamp_light(lamp: Lamp, targets: F64, positions: F64) -> tuple[F32, F32]:
    """Unit directions (P, Q, 3) from world positions (P, 3) to the targets, and irradiance (P, Q).

    The irradiance is what each target gives to a surface that faces it, at unit gain.
    """
    count, samples = len(positions), len(targets)
    if lamp.kind == "directional":
        parallel = np.broadcast_to(targets[:, :3].astype(np.float32), (count, samples, 3))
        return np.ascontiguousarray(parallel), np.full((count, samples), 1 / samples, np.float32)
    towards = targets[:, :3] - positions[:, None]
    distance = np.maximum(np.linalg.norm(towards, axis=2), 1e-6)
    directions = towards / distance[..., None]
    weight = 1 / distance**2
    if lamp.kind == "area":
        area = float(np.linalg.norm(np.cross(lamp.across, lamp.up)))
        weight *= area / samples * np.maximum(-directions @ lamp.axis, 0.0)
    elif lamp.kind == "spot":
        weight *= spot_falloff(-directions @ lamp.axis, lamp.cos_inner, lamp.cos_cone)
    return directions.astype(np.float32), weight.astype(np.float32)


def _lattice(count: int) -> F64:
    i = np.arange(count) + 0.5
    return np.stack([i / count, (i * 0.6180339887498949) % 1.0], axis=1)


def _disc(count: int) -> F64:
    if count == 1:
        return np.zeros((1, 2))
    lattice = _lattice(count)
    radius, turn = np.sqrt(lattice[:, 0]), 2 * np.pi * lattice[:, 1]
    return np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)


def disc_axes(axis: F64) -> tuple[F64, F64]:
    """Two unit vectors across the disc of a sun that shines along `axis`."""
    axis = -axis
    other = np.array([0.0, 1.0, 0.0]) if abs(axis[1]) < 0.9 else np.array([1.0, 0.0, 0.0])
    tangent = np.cross(other, axis)
    tangent /= np.linalg.norm(tangent)
    return tangent, np.cross(axis, tangent)
