"""What kernels of path tracing hand to each other: states of paths, and the world that they go through.

Places are relative to the middle of the ray caster (float32 keeps them exact there), directions are world.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]
U32 = npt.NDArray[np.uint32]
U64 = npt.NDArray[np.uint64]
Bools = npt.NDArray[np.bool_]

ENDED = -1
POINT, SPOT, AREA, DIRECTIONAL, SUNS = 0, 1, 2, 3, 4
"""Kinds of lamps; the suns of an environment are one together."""


class Paths(NamedTuple):
    """N paths at their newest ray or surface.

    origin, direction (N, 3) of the ray; throughput (N, 3); radiance (N, 3) found so far; density (N,) per
    steradian with which the ray was drawn; random (N,) states; lamps (N,): the sum of what lamps would give
    where the ray starts, by which one was chosen. Where the ray meets a surface: normal, geometric (N, 3),
    tangent (N, 4), uv (N, 2), material and row (N,) of its BRDF; a path with the material `ENDED` is over.
    vertex (N,) is a corner of the face, chosen as often as its barycentric weight says.
    """

    origin: F32
    direction: F32
    throughput: F32
    radiance: F32
    density: F32
    random: U64
    lamps: F64
    normal: F32
    geometric: F32
    tangent: F32
    uv: F32
    material: I32
    row: I32
    vertex: I32

    @classmethod
    def of(cls, count: int) -> Paths:
        """Empty ones."""
        return cls(
            origin=np.zeros((count, 3), np.float32),
            direction=np.zeros((count, 3), np.float32),
            throughput=np.zeros((count, 3), np.float32),
            radiance=np.zeros((count, 3), np.float32),
            density=np.zeros(count, np.float32),
            random=np.zeros(count, np.uint64),
            lamps=np.zeros(count),
            normal=np.zeros((count, 3), np.float32),
            geometric=np.zeros((count, 3), np.float32),
            tangent=np.zeros((count, 4), np.float32),
            uv=np.zeros((count, 2), np.float32),
            material=np.full(count, ENDED, np.int32),
            row=np.zeros(count, np.int32),
            vertex=np.zeros(count, np.int32),
        )


class Tracer(NamedTuple):
    """What rays are traced with: see `raycast.CasterHandles`."""

    occluded8: int
    intersect8: int
    scene: int
    epsilon: float
    face_start: I64
    face_ids: I32


class Mesh(NamedTuple):
    """A `WorldMesh` as paths see it; positions + shift (3,) are relative to the ray caster's middle."""

    shift: F64
    positions: F32
    normals: F32
    tangents: F32
    uvs: F32
    material: I32
    faces: U32
    back_faces: U32
    face_offsets: I64


class Looks(NamedTuple):
    """Coefficients of M materials, see `shading.coefficients`; first (M,), size (M, 2): finest level.

    painted (V, T·3), or empty: what strokes add at vertices.
    """

    kind: I64
    plain: F32
    slope: F32
    texels: F32
    tables: F32
    first: I64
    size: I64
    uv_map: F32
    painted: F32


class Models(NamedTuple):
    """Reflectance of M materials: addresses of kernels (0: there is none) and their number of terms.

    albedo (M, BINS, T): how much of the light each term returns, about, by the cosine of the view; matte
    (M, T): terms that are the same for all directions.
    """

    address: I64
    sampler: I64
    density: I64
    terms: I64
    albedo: F32
    matte: Bools


class Lights(NamedTuple):
    """L lamps with their gains, suns, and the environment's leaves.

    kind (L,); position, axis, across, up (L, 3); cones (L, 2): cosines of cone and inner cone; spread (L,):
    tangent of half a sun's angle, or a twelfth of the squared sides of an area lamp; gain (L, 3), of area
    lamps times their area (L,); power (L,) by which lamps are chosen. Suns: towards (Q, 3), sun (Q, 3)
    irradiance; sun_upto (Q,) running sum of their choice. Leaves of 2^k directions: radiance (S, 3), chance
    (S,) per steradian with which they are chosen, upto (S,) its running sum; k = 0: none. `areas` counts area
    lamps.
    """

    kind: I64
    position: F64
    axis: F64
    across: F64
    up: F64
    cones: F64
    spread: F64
    gain: F64
    area: F64
    power: F64
    towards: F32
    sun: F32
    sun_upto: F64
    k: int
    radiance: F32
    chance: F32
    upto: F64
    areas: int


SOME = 0.1
"""Cosine added for lamps whose middle may be under the horizon, or turned away, while a part is not."""
_STEP = np.uint64(0x9E3779B97F4A7C15)
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_A, _B, _C, _D = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(40)
_UNIT = np.float32(2.0**-24)


@kernel
def area_weight(power: float, spread: float, cosine: float, back: float, square: float) -> float:
    """What an area lamp counts when one is chosen, by cosines at the surface and at the lamp's middle."""
    if not back > 0.0:
        return 0.0
    return power * (max(cosine, 0.0) + SOME) * (back + SOME) / (square + spread)


@kernel
def scrambled(state: np.uint64) -> np.uint64:
    """The next number of SplitMix64 (Steele, Lea & Flood 2014); the state grows by one step each time."""
    z = state + _STEP
    z = (z ^ (z >> _A)) * _FIRST
    z = (z ^ (z >> _B)) * _SECOND
    return z ^ (z >> _C)


@kernel
def next_random(random: U64, n: int) -> np.float32:
    """A number in [0, 1) of path n."""
    made = scrambled(random[n])
    random[n] += _STEP
    return np.float32(made >> _D) * _UNIT


@kernel
def seeded(seed: int, number: int, part: int) -> np.uint64:
    """A state of its own for each three numbers."""
    first = scrambled(np.uint64(seed))
    second = scrambled(first ^ np.uint64(number))
    return scrambled(second ^ np.uint64(part))
