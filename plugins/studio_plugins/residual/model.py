"""`captured`: a fitted material as a reflectance model of the scene, its residual in the same light sum.

What a `ResidualFit` says of a texel under a light of irradiance π is radiance; over π times the cosine it is
a reflectance, f_r = Σ c_k b_k (decision 4), so every backend lights it as any other material:

====  ==============================================================  ===========================
term  b_k                                                             c_k
====  ==============================================================  ===========================
b0    (1 + ρ max(0, cos Δφ) sin α tan β + fade · table / n·l) / π     albedo of the texel
b1    the shared highlight: Blinn–Phong, Phong or GGX, up to two      its shine
      lobes, without Fresnel
b2–4  fade · (H_x, H_y, H_z) / (π n·l), or L instead of H             s(P), of any sign
====  ==============================================================  ===========================

with fade = min(n·l / 0.05, 1). The residual is light that comes back, not in proportion to a cosine; it
fades over the last three degrees before the terminator, where no sample was fitted. So Σ_k L_k V̄_k b_{2–4}
n·l Δω is E_H, by which ∫ L V δ* dω = s(P) · E_H: visibility V̄ without a cosine, made in the loop that sums
b0.

The residual is neither reciprocal nor bound to return less than arrives; pixels are cut off at nothing once
all light is summed, not lamp by lamp. Without it, f_r is both.

===========  ========  =====  ==================================================================
parameter    range     unit   meaning
===========  ========  =====  ==================================================================
albedo       0…1       –      colour of the matte part, times its map; linear Rec.709
shine        0…1       –      colour of the highlight, times its map
character    0…2       –      how much is shown of what a spot has of its own: 1 as photographed
direction    −180…180  °      of bumps and weave within the pictures: 0 as photographed
===========  ========  =====  ==================================================================

What was fitted lies in the material's table `capture` (`Capture`), the maps are its textures: `albedo`,
`shine`, and `residual_x`, `_y`, `_z`, linear. Without a table it is matte.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.jit import batch_function, kernel
from studio_core.kernels.brdf import (
    DENSITY_SIGNATURE,
    HALF,
    INV_PI,
    LEAST_HEIGHT,
    ONE,
    SAMPLE_SIGNATURE,
    SIGNATURE,
    TWO,
    ZERO,
    arc_cosine,
    carray,
    ggx_distribution,
    power_of_complement,
)
from studio_core.kernels.lobes import (
    draw_cosine,
    draw_half_power,
    draw_mirror_power,
    draw_visible,
    weigh_cosine,
    weigh_half_power,
    weigh_mirror_power,
    weigh_visible,
)
from studio_core.kernels.sampling import TURN, around_normal
from studio_core.params import Colour, Value, param
from studio_core.scene.geometry import Table
from studio_plugins.residual.shading import GRAZING
from studio_plugins.residual.tables import NODES, WIDEST

F32 = npt.NDArray[np.float32]

SLOT = "capture"
RESIDUAL = ("residual_x", "residual_y", "residual_z")
NO_LOBE, BLINN, PHONG, GGX = 0, 1, 2, 3
HALF_VECTOR, LIGHT = 0, 1
FADE = np.float32(GRAZING)
"""Cosine under which what is not proportional to it fades."""
_HEAD = 10
_SIZE = _HEAD + NODES[0] * NODES[1]
_SHAPE = _SIZE + 2
_TERMS = np.array([1, 2, 5])
_LEAST_NV = np.float32(1e-4)
_NARROW = np.float32(1 / WIDEST)
_LAST_X, _LAST_Y = np.float32(NODES[0] - 2), np.float32(NODES[1] - 2)


@dataclass(frozen=True, eq=False)
class Capture:
    """What all texels share. `terms`: 1 matte, 2 with a highlight, 5 with a residual along `columns`; `rough`
    is ρ; `lobe` with two `shapes` (exponents or α) and their weights; `nodes` (14, 10) of the table's
    luminance over the albedo's, or None.
    """

    terms: int
    rough: float = 0.0
    lobe: int = NO_LOBE
    shapes: tuple[float, float] = (1.0, 1.0)
    weights: tuple[float, float] = (0.0, 0.0)
    columns: int = HALF_VECTOR
    nodes: F32 | None = None

    def table(self, name: str = "") -> Table:
        """As the material keeps it: (1, 1, 1, 150)."""
        made = np.zeros(_SIZE, np.float32)
        head = (self.terms, self.rough, self.lobe, *self.shapes, *self.weights, self.columns)
        made[: len(head)] = head
        if self.nodes is not None:
            made[8], made[_HEAD:] = 1, self.nodes.reshape(-1)
        return Table(made.reshape(1, 1, 1, -1), name)


def _checked(table: Table) -> F32:
    """(150,) of a table; InputError where it is no capture."""
    if table.values.shape != (1, 1, 1, _SIZE):
        raise InputError("its capture is of another kind")
    made = table.values.reshape(-1)
    terms, rough, lobe, a, b, wa, wb, columns, has = made[:9].tolist()
    sharp = all(1e-4 <= s <= (1.0 if lobe == GGX else 1e5) for s in (a, b))
    if (
        terms not in _TERMS
        or lobe not in (NO_LOBE, BLINN, PHONG, GGX)
        or columns not in (HALF_VECTOR, LIGHT)
        or has not in (0, 1)
        or not sharp
        or min(rough, wa, wb) < 0
        or np.abs(made).max() > 1e6
    ):
        raise InputError("its capture does not fit the model")
    return made


@dataclass(frozen=True)
class Params:
    """Parameters of `Captured`."""

    albedo: Colour = param(
        (0.5, 0.5, 0.5), "Colour", "Of the matte part; the captured picture is multiplied with it",
        low=0.0, high=1.0,
    )  # fmt: skip
    shine: Colour = param(
        (0.0, 0.0, 0.0), "Highlight colour", "The captured shine is multiplied with it", low=0.0, high=1.0
    )
    character: float = param(
        1.0, "Character", "How much of each spot's own weave, bumps and crevices is shown; 1 as photographed",
        low=0.0, high=2.0,
    )  # fmt: skip
    direction: float = param(
        0.0, "Light turned", "How light on bumps is turned against the pictures; 0 as photographed", unit="°",
        low=-180.0, high=180.0,
    )  # fmt: skip


@kernel
def _table(s: Any, cosine_half: np.float32, cosine_light: np.float32) -> np.float32:
    """The table's tents at cos θ_h and n·l."""
    theta = arc_cosine(min(max(cosine_half, ZERO), ONE)) * _NARROW
    x = min(np.sqrt(theta), ONE) * np.float32(NODES[0] - 1)
    y = min(max(cosine_light, ZERO), ONE) * np.float32(NODES[1] - 1)
    i, j = np.int32(min(x, _LAST_X)), np.int32(min(y, _LAST_Y))
    u, v = x - np.float32(i), y - np.float32(j)
    at = _HEAD + i * np.int32(NODES[1]) + j
    low = s[at] + v * (s[at + 1] - s[at])
    high = s[at + NODES[1]] + v * (s[at + NODES[1] + 1] - s[at + NODES[1]])
    made: np.float32 = low + u * (high - low)
    return made


@batch_function(SIGNATURE)
def evaluate(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """The kernels of the module; see `studio_core.contract.Brdf`. shape: the capture, cos and sin of the
    pattern's direction.
    """
    s = carray(shape, _SHAPE)
    terms, rough, kind, along = int(s[0]), s[1], int(s[2]), int(s[7])
    tabled, cosine, sine = s[8] > ZERO, s[_SIZE], s[_SIZE + 1]
    o = carray(wo, 3)
    ox, oy, oz = o[0], o[1], o[2]
    seen = ONE if oz > ZERO else ZERO
    nv = min(max(oz, _LEAST_NV), ONE)
    directions = carray(wi, 3 * count)
    x, y, z = directions[:count], directions[count : 2 * count], directions[2 * count :]
    made = carray(out, terms * count)
    b0 = made[:count]
    for k in range(count):
        lit = seen if z[k] > ZERO else ZERO
        back = max(x[k] * ox + y[k] * oy, ZERO) / max(max(z[k], nv), _LEAST_NV)
        b0[k] = lit * INV_PI * (ONE + rough * back)
    if tabled:
        for k in range(count):
            hx, hy, hz = x[k] + ox, y[k] + oy, max(z[k] + oz, LEAST_HEIGHT)
            upright = hz / np.sqrt(hx * hx + hy * hy + hz * hz)
            more = _table(s, upright, z[k]) / max(z[k], FADE)
            b0[k] = max(b0[k] + INV_PI * more, ZERO) if b0[k] > ZERO else ZERO
    if terms == 1:
        return
    b1 = made[count : 2 * count]
    for k in range(count):
        b1[k] = ZERO
    for number in range(2):
        n, weight = s[3 + number], s[5 + number]
        if kind == NO_LOBE or weight <= ZERO:
            continue
        if kind == GGX:
            a2 = n * n
            out_root = np.sqrt(oz * oz * (ONE - a2) + a2)
            for k in range(count):
                down = max(z[k], ZERO)
                lit = seen if z[k] > ZERO else ZERO
                hx, hy, hz = x[k] + ox, y[k] + oy, max(down + max(oz, ZERO), LEAST_HEIGHT)
                both = down * out_root + oz * np.sqrt(down * down * (ONE - a2) + a2)
                lobe = ggx_distribution(hx, hy, hz, n) * HALF / max(both, np.float32(1e-12))
                b1[k] += lit * weight * lobe
        elif kind == BLINN:
            peak = (
                weight * (n + TWO) * (n + np.float32(4)) / (np.float32(8 * np.pi) * (TWO ** (-HALF * n) + n))
            )
            for k in range(count):
                lit = seen if z[k] > ZERO else ZERO
                hx, hy, hz = x[k] + ox, y[k] + oy, max(z[k] + oz, LEAST_HEIGHT)
                flat, height = hx * hx + hy * hy, hz * hz
                whole = flat + height
                b1[k] += lit * peak * power_of_complement(flat / whole, height / whole, HALF * n)
        else:
            peak = weight * (n + TWO) * HALF * INV_PI
            for k in range(count):
                lit = seen if z[k] > ZERO else ZERO
                dx, dy, dz = x[k] + ox, y[k] + oy, z[k] - oz
                t = HALF * (dx * dx + dy * dy + dz * dz)
                b1[k] += lit * peak * power_of_complement(t, ONE - t, n)
    if terms == 2:
        return
    b2, b3, b4 = made[2 * count : 3 * count], made[3 * count : 4 * count], made[4 * count :]
    share = ZERO if along == LIGHT else ONE
    for k in range(count):
        hx, hy, hz = x[k] + share * ox, y[k] + share * oy, max(z[k] + share * oz, LEAST_HEIGHT)
        lit = seen if z[k] > ZERO else ZERO
        scale = lit * INV_PI / (max(z[k], FADE) * np.sqrt(hx * hx + hy * hy + hz * hz))
        b2[k] = scale * (cosine * hx + sine * hy)
        b3[k] = scale * (cosine * hy - sine * hx)
        b4[k] = scale * hz


@batch_function(SAMPLE_SIGNATURE)
def sample(shape: Any, wo: Any, term: int, count: int, u: Any, wi: Any) -> None:
    """By the cosine, by the lobes' shares, and evenly for the residual; see `SampledBrdf`."""
    s = carray(shape, _SHAPE)
    o, numbers, directions = carray(wo, 3), carray(u, 2 * count), carray(wi, 3 * count)
    if term == 0 or (term == 1 and s[2] == ZERO):
        draw_cosine(o, numbers, directions)
        return
    if term > 1:
        for k in range(count):
            x, y, z = around_normal(ONE - numbers[k], numbers[count + k])
            directions[k], directions[count + k] = x, y
            directions[2 * count + k] = z if o[2] > ZERO else -ONE
        return
    first = s[5] / max(s[5] + s[6], np.float32(1e-30))
    own, pair = np.empty(3, np.float32), np.empty(2, np.float32)
    for k in range(count):
        chosen = numbers[k] < first
        n = s[3] if chosen else s[4]
        low, width = (ZERO, first) if chosen else (first, ONE - first)
        pair[0] = min((numbers[k] - low) / max(width, np.float32(1e-30)), np.float32(1 - 2**-24))
        pair[1] = numbers[count + k]
        if int(s[2]) == GGX:
            draw_visible(o, n, n, pair, own)
        elif int(s[2]) == BLINN:
            draw_half_power(o, n + ONE, pair, own)
        else:
            draw_mirror_power(o, n, pair, own)
        directions[k], directions[count + k], directions[2 * count + k] = own[0], own[1], own[2]


@batch_function(DENSITY_SIGNATURE)
def density(shape: Any, wo: Any, count: int, wi: Any, out: Any) -> None:
    """Of `sample`; see `studio_core.contract.SampledBrdf`."""
    s = carray(shape, _SHAPE)
    terms = int(s[0])
    o, directions, made = carray(wo, 3), carray(wi, 3 * count), carray(out, terms * count)
    weigh_cosine(o, directions, made[:count])
    if terms == 1:
        return
    row = made[count : 2 * count]
    if s[2] == ZERO:
        weigh_cosine(o, directions, row)
    else:
        other = np.empty(count, np.float32)
        first = s[5] / max(s[5] + s[6], np.float32(1e-30))
        for number in range(2):
            n, d = s[3 + number], row if number == 0 else other
            if int(s[2]) == GGX:
                weigh_visible(o, n, directions, d)
            elif int(s[2]) == BLINN:
                weigh_half_power(o, n + ONE, directions, d)
            else:
                weigh_mirror_power(o, n, directions, d)
        for k in range(count):
            row[k] = first * row[k] + (ONE - first) * other[k]
    for term in range(2, terms):
        for k in range(count):
            lit = o[2] > ZERO and directions[2 * count + k] > ZERO
            made[term * count + k] = ONE / TURN if lit else ZERO


class Captured:
    """See the module; satisfies `studio_core.contract.TabulatedBrdf` and `SampledBrdf`."""

    id = "captured"
    label = "Captured"
    Params = Params
    terms = 2
    textures: tuple[str, ...] = ("albedo", "shine", *RESIDUAL)
    tables: tuple[str, ...] = (SLOT,)
    turning = "direction"

    def __init__(self) -> None:
        self._plain = Capture(2).table("matte")

    @property
    def address(self) -> int:
        """Of `evaluate`."""
        return evaluate.address

    @property
    def sampler(self) -> int:
        """Of `sample`."""
        return sample.address

    @property
    def density(self) -> int:
        """Of `density`."""
        return density.address

    def terms_of(self, tables: Mapping[str, Table]) -> int:
        """As many as the capture needs."""
        return int(_checked(tables[SLOT])[0])

    def shape(self, values: Mapping[str, Value]) -> F32:
        """(152,) of the matte stand-in."""
        return self.shape_of(values, {SLOT: self._plain})

    def shape_of(self, values: Mapping[str, Value], tables: Mapping[str, Table]) -> F32:
        """(152,): the capture, and the pattern's direction."""
        turn = np.radians(float(values["direction"]))  # type: ignore[arg-type]
        return np.append(_checked(tables[SLOT]), np.array([np.cos(turn), np.sin(turn)], np.float32))

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> F32:
        """(..., 2, 3): albedo and shine, divided by their sum where that exceeds 1; (..., 5, 3) with maps of
        the residual.
        """
        albedo = np.maximum(np.asarray(values["albedo"], np.float32), 0)
        shine = np.maximum(np.asarray(values["shine"], np.float32), 0)
        excess = np.maximum(albedo + shine, np.float32(1))
        parts = [albedo / excess, shine / excess]
        if any(name in values for name in RESIDUAL):
            character = np.asarray(values["character"], np.float32)[..., None]
            none = np.zeros(3, np.float32)
            parts += [character * np.asarray(values.get(name, none), np.float32) for name in RESIDUAL]
        return np.stack(np.broadcast_arrays(*parts), axis=-2)


MODEL = Captured()
