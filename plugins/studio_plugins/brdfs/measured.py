"""Measured reflectance: a table over half and difference angles, as the MERL database's.

f_r = tint · s · table(θ_h, θ_d, φ_d), trilinear between the middles of the table's cells
(`studio_core.brdfs.half_difference`; Rusinkiewicz 1998, Matusik et al. 2003); s = min(s(ω_i), s(ω_o)).
Where a measurement returns more light than arrives, as real ones do near grazing, s(ω) = 1 / albedo(ω),
elsewhere 1: the albedo stays at most 1, f_r is reciprocal, pairs of sound directions keep what was measured.
Terms: b0, b1, b2 = red, green and blue of the table; c0 = (tint red, 0, 0), …

==============  ========  =====  ============================================================
parameter       range     unit   meaning
==============  ========  =====  ============================================================
tint            0…1       –      what the measured colours are multiplied with, linear Rec.709
keep_energy     yes/no    –      scale directions that return more light than arrives
==============  ========  =====  ============================================================

The table is the material's `measurement`. Without any material the stand-in is a matte grey of 50 %.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.calls import evaluate as call
from studio_core.contract import Brdf
from studio_core.errors import InputError
from studio_core.jit import batch_function, kernel
from studio_core.kernels.background import angle
from studio_core.kernels.brdf import (
    DENSITY_SIGNATURE,
    HALF,
    LEAST_HEIGHT,
    ONE,
    SAMPLE_SIGNATURE,
    SIGNATURE,
    TWO,
    ZERO,
    carray,
)
from studio_core.kernels.half_angles import EDGES, cumulative, drawn_height, height_density
from studio_core.kernels.sampling import around_normal, cosine_density, cosine_direction, reflected
from studio_core.kernels.tables import REFERENCE, reference, referred
from studio_core.params import Colour, Value, param
from studio_core.scene.geometry import Table
from studio_plugins.brdfs.functions import Functions

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

SLOT = "measurement"
CURVE = 64
"""Directions of the scale s, even in θ."""
_MARGIN = 0.999
_MOST_KEPT = 64
_TO_HALF = np.float32(np.sqrt(2 / np.pi))
_TO_DIFFERENCE = np.float32(2 / np.pi)
_TO_AZIMUTH = np.float32(1 / np.pi)
_PI = np.float32(np.pi)
_UPRIGHT = np.float32(1e-12)
_TO_CURVE = np.float32((CURVE - 1) * 2 / np.pi)


@dataclass(frozen=True)
class Params:
    """Parameters of `Measured`."""

    tint: Colour = param((1.0, 1.0, 1.0), "Tint", "Multiplies the measured colours", low=0.0, high=1.0)
    keep_energy: bool = param(
        True, "Keep energy", "Scale directions in which the measurement returns more light than arrives"
    )


@kernel
def _scale(shape: Any, flat: np.float32, up: np.float32) -> np.float32:
    """s of a direction by its sine and cosine."""
    at = _TO_CURVE * angle(flat, max(up, ZERO))
    first = min(int(at), CURVE - 2)
    part = at - np.float32(first)
    made: np.float32 = shape[REFERENCE + first] * (ONE - part) + shape[REFERENCE + first + 1] * part
    return made


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """See `studio_core.contract.Brdf`. shape: reference of the table, s at CURVE directions, half angles."""
    s = carray(shape, REFERENCE + CURVE)
    table = referred(s)
    half, difference, azimuth = int(s[4]), int(s[5]), int(s[6])
    o = carray(wo, 3)
    ox, oy, oz = o[0], o[1], o[2]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    terms = carray(out, 3 * count)
    red, green, blue = terms[:count], terms[count : 2 * count], terms[2 * count :]
    # Vector code: cells of θ_h, θ_d and φ_d, counted from the first's middle, wait where results will be.
    to_half, to_difference = _TO_HALF * np.float32(half), _TO_DIFFERENCE * np.float32(difference)
    to_azimuth, most_a, most_b = (
        _TO_AZIMUTH * np.float32(azimuth),
        np.float32(half - 1),
        np.float32(difference - 1),
    )
    for k in range(count):
        hx, hy, hz = x[k] + ox, y[k] + oy, z[k] + oz
        ex, ey, ez = x[k] - ox, y[k] - oy, z[k] - oz
        flat = hx * hx + hy * hy
        length = np.sqrt(flat + hz * hz)
        upright = flat < _UPRIGHT
        turn = angle(ey if upright else hx * ey - hy * ex, ex if upright else -ez * length)
        turn = turn + _PI if turn < ZERO else turn
        a = to_half * np.sqrt(angle(np.sqrt(flat), max(hz, ZERO))) - HALF
        b = to_difference * angle(np.sqrt(ex * ex + ey * ey + ez * ez), length) - HALF
        red[k] = min(max(a, ZERO), most_a)
        green[k] = min(max(b, ZERO), most_b)
        blue[k] = max(to_azimuth * turn - HALF, -HALF)
    for k in range(count):
        a, b, c = red[k], green[k], blue[k]
        if not (oz > ZERO and z[k] > ZERO):
            red[k] = green[k] = blue[k] = ZERO
            continue
        i, j, low = int(a), int(b), int(c + ONE) - 1
        u, v, w = a - np.float32(i), b - np.float32(j), c - np.float32(low)
        low = low + azimuth if low < 0 else (low - azimuth if low >= azimuth else low)
        high = low + 1 if low + 1 < azimuth else 0
        below, next_row = j * azimuth, azimuth * difference if i + 1 < half else 0
        beside = azimuth if j + 1 < difference else 0
        first = i * difference * azimuth + below
        red[k], green[k], blue[k] = ZERO, ZERO, ZERO
        for corner in range(4):
            row = first + (next_row if corner & 2 else 0) + (beside if corner & 1 else 0)
            weight = (u if corner & 2 else ONE - u) * (v if corner & 1 else ONE - v)
            left, right = weight * (ONE - w), weight * w
            p, q = 3 * (row + low), 3 * (row + high)
            red[k] += left * table[p] + right * table[q]
            green[k] += left * table[p + 1] + right * table[q + 1]
            blue[k] += left * table[p + 2] + right * table[q + 2]
    least = ONE
    for k in range(CURVE):
        least = min(least, s[REFERENCE + k])
    if least == ONE:
        return  # no direction returns too much
    seen = _scale(s, np.sqrt(ox * ox + oy * oy), oz)
    for k in range(count):
        scale = min(seen, _scale(s, np.sqrt(x[k] * x[k] + y[k] * y[k]), z[k]))
        red[k] *= scale
        green[k] *= scale
        blue[k] *= scale


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """By the cosine and by half angles, half each; see `studio_core.contract.SampledBrdf`."""
    angles = carray(shape, REFERENCE + CURVE + EDGES)[REFERENCE + CURVE :]
    o = carray(wo, 3)
    ox, oy, oz = o[0], o[1], o[2]
    numbers = carray(u, 2 * count)
    u0, u1 = numbers[:count], numbers[count:]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    for k in range(count):
        if u0[k] < HALF:
            a, b, c = cosine_direction(TWO * u0[k], u1[k])
        else:
            hx, hy, hz = around_normal(drawn_height(angles, TWO * u0[k] - ONE), u1[k])
            facing = ox * hx + oy * hy + oz * hz > ZERO
            a, b, c = reflected(ox, oy, oz, hx, hy, hz)
            c = c if facing else -ONE
        x[k], y[k], z[k] = a, b, (c if oz > ZERO else -ONE)


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """cos θ / 2π + D(h) / (8 ω_o·h), the same for every term; see `studio_core.contract.SampledBrdf`."""
    angles = carray(shape, REFERENCE + CURVE + EDGES)[REFERENCE + CURVE :]
    o = carray(wo, 3)
    ox, oy, oz = o[0], o[1], o[2]
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    terms = carray(out, 3 * count)
    for k in range(count):
        lit = ONE if (oz > ZERO and z[k] > ZERO) else ZERO
        hx, hy, hz = x[k] + ox, y[k] + oy, max(z[k] + oz, LEAST_HEIGHT)
        flat = np.sqrt(hx * hx + hy * hy)
        lobe = height_density(angles, flat, hz) / (TWO * np.sqrt(flat * flat + hz * hz))
        both = lit * HALF * (cosine_density(z[k]) + lobe)
        terms[k] = terms[count + k] = terms[2 * count + k] = both


class Measured(Functions):
    """See the module; satisfies `studio_core.contract.TabulatedBrdf`."""

    id = "measured"
    label = "Measured"
    Params = Params
    functions = evaluate, sample, density
    terms = 3
    textures: tuple[str, ...] = ("tint",)
    tables: tuple[str, ...] = (SLOT,)

    def __init__(self) -> None:
        self._plain = Table(np.full((2, 2, 2, 3), 0.5 / np.pi, np.float32), "grey")
        self._albedos: dict[str, F64] = {}
        self._angles: dict[str, F32] = {}

    def shape(self, values: Mapping[str, Value]) -> F32:
        """(145,) of the stand-in."""
        return self.shape_of(values, {SLOT: self._plain})

    def shape_of(self, values: Mapping[str, Value], tables: Mapping[str, Table]) -> F32:
        """(145,): reference of the table, s at CURVE directions, how half angles are drawn."""
        table = tables[SLOT]
        if table.values.shape[3] != 3 or (table.key not in self._angles and table.values.min() < 0):
            raise InputError("its measurement is no table of reflectances in red, green and blue")
        curve = np.ones(CURVE)
        if values["keep_energy"]:
            most = self.albedo(table).max(axis=1)
            curve = np.where(most > _MARGIN, _MARGIN / np.maximum(most, _MARGIN), 1.0)
        return np.concatenate([reference(table), curve.astype(np.float32), self._half_angles(table)])

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> F32:
        """(..., 3, 3): the tint on the diagonal."""
        tint: F32 = np.clip(np.asarray(values["tint"], np.float32), 0, 1)
        return tint[..., None, :] * np.eye(3, dtype=np.float32)

    def _half_angles(self, table: Table) -> F32:
        """(EDGES,) how often half vectors are drawn, by the table's mean over difference angles."""
        if table.key not in self._angles:
            while len(self._angles) >= _MOST_KEPT:
                self._angles.pop(next(iter(self._angles)))
            difference = (np.arange(table.values.shape[1]) + 0.5) / table.values.shape[1]
            weight = np.sin(np.pi * difference)  # sin 2θ_d: grazing ones lie close together
            self._angles[table.key] = cumulative(table.values.sum(axis=(2, 3), dtype=np.float64) @ weight)
        return self._angles[table.key]

    def albedo(self, table: Table) -> F64:
        """(CURVE, 3) share of light that comes back, at directions even in θ from above to grazing.

        Over half vectors, dω_i = 4 (ω_o·h) dω_h (Walter et al. 2007, eq. 14), one row of quadrature a cell.
        """
        if table.key not in self._albedos:
            while len(self._albedos) >= _MOST_KEPT:
                self._albedos.pop(next(iter(self._albedos)))
            self._albedos[table.key] = self._measured_albedo(table)
        return self._albedos[table.key]

    def _measured_albedo(self, table: Table) -> F64:
        shape = np.concatenate([reference(table), np.ones(CURVE + EDGES, np.float32)])
        rows, turns = 2 * max(table.values.shape[0], 45), 48
        edge = np.linspace(0, 1, rows + 1)
        theta = np.pi / 2 * (edge[1:] / 2 + edge[:-1] / 2) ** 2
        weight = np.cos(np.pi / 2 * edge[:-1] ** 2) - np.cos(np.pi / 2 * edge[1:] ** 2)
        phi = 2 * np.pi * (np.arange(turns) + 0.5) / turns
        flat = np.sin(theta)[:, None]
        h = np.stack(
            np.broadcast_arrays(flat * np.cos(phi), flat * np.sin(phi), np.cos(theta)[:, None]), -1
        ).reshape(-1, 3)
        share = np.repeat(weight, turns) * 2 * np.pi / turns
        made = np.zeros((CURVE, 3))
        for k in range(CURVE):
            up = max(np.cos(np.pi / 2 * k / (CURVE - 1)), 1e-4)
            wo = np.array([np.sqrt(1 - up * up), 0.0, up])
            cosine = h @ wo
            wi = 2 * cosine[:, None] * h - wo
            used = (cosine > 0) & (wi[:, 2] > 0)
            measure = (4 * cosine * share * wi[:, 2])[used]
            made[k] = measure @ call(cast(Brdf, self), shape, wo, wi[used]).astype(np.float64)
        return made


MODEL = Measured()
