"""Visibility, light and nodes of the cuts, leaf by leaf in float64: plain loops and sums."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from oracles import radiance as truth

F64 = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Interval = tuple[int, int]


def leaves_of(words: npt.NDArray[np.uint64]) -> Bools:
    """(…, S) bits of words (…, S / 64): bit i of word w is leaf 64·w + i."""
    made = [[bool(int(word) >> bit & 1) for word in row for bit in range(64)] for row in np.atleast_2d(words)]
    return np.array(made, np.bool_).reshape(*words.shape[:-1], -1)


def unpacked(words: npt.NDArray[np.uint64]) -> Bools:
    """The same for many words, by NumPy."""
    little = np.ascontiguousarray(words).astype("<u8").view(np.uint8)
    return np.unpackbits(little, axis=-1, bitorder="little").astype(np.bool_)


def words_of(leaves: Bools) -> npt.NDArray[np.uint64]:
    """Words of (S,) bits."""
    values = []
    for first in range(0, len(leaves), 64):
        values.append(sum(1 << bit for bit in range(64) if leaves[first + bit]))
    return np.array(values, np.uint64)


def runs(leaves: Sequence[bool] | Bools) -> list[Interval]:
    """First and last of every run of set leaves."""
    found: list[Interval] = []
    for leaf, there in enumerate(leaves):
        if not there:
            continue
        if found and found[-1][1] == leaf - 1:
            found[-1] = found[-1][0], leaf
        else:
            found.append((leaf, leaf))
    return found


def segments(record: Iterable[Any]) -> dict[int, list[Interval]]:
    """What a record says of every slot."""
    numbers = [int(number) for number in record]
    found: dict[int, list[Interval]] = {}
    at = 0
    while at < len(numbers):
        slot, count = numbers[at], numbers[at + 1]
        assert slot not in found
        pairs = numbers[at + 2 : at + 2 + 2 * count]
        found[slot] = list(zip(pairs[::2], pairs[1::2], strict=True))
        at += 2 + 2 * count
    assert at == len(numbers)
    return found


def record(known: dict[int, list[Interval]]) -> list[int]:
    """The numbers of a record."""
    made: list[int] = []
    for slot, pairs in known.items():
        made += [slot, len(pairs), *(leaf for pair in pairs for leaf in pair)]
    return made


def seen(record: Iterable[Any], size: int, skip: Iterable[int] = ()) -> Bools:
    """(size,) leaves that nobody blocks, but for the slots to skip."""
    free = np.ones(size, np.bool_)
    for slot, pairs in segments(record).items():
        if slot not in skip:
            for first, last in pairs:
                free[first : last + 1] = False
    return free


def irradiance(visible: Bools, normal: npt.ArrayLike, radiance: npt.ArrayLike, directions: Any) -> F64:
    """(3,) Σ L (n·ω) Δω over visible leaves."""
    n, light = np.asarray(normal, np.float64), np.asarray(radiance, np.float64)
    total = np.zeros(3)
    for leaf in np.flatnonzero(visible):
        total += light[leaf] * float(directions.directions[leaf].astype(np.float64) @ n)
    return np.asarray(np.maximum(total * directions.solid_angle, 0.0))


def node(visible: Bools, normal: npt.ArrayLike, radiance: npt.ArrayLike, directions: Any, cell: int) -> Any:
    """Direction (3,), irradiance (3,), luminance and spread of the visible light below a node of the tree."""
    size = len(visible)
    level = cell.bit_length() - 1
    width = size >> level
    first = cell * width - size
    mask = np.zeros(size, np.bool_)
    mask[first : first + width] = visible[first : first + width]
    light = np.asarray(radiance, np.float64)[mask] * directions.solid_angle
    towards = directions.directions[mask].astype(np.float64)
    luminance = light @ np.array([0.2126, 0.7152, 0.0722])
    power, moment = luminance.sum(), luminance @ towards
    length = float(np.linalg.norm(moment))
    arrives = light.T @ towards @ np.asarray(normal, np.float64)
    spread = 1 - length / power if power > 0 else 0.0
    return (moment / length if length > 0 else moment), arrives, power, spread


def chosen(
    visible: Bools, normal: npt.ArrayLike, radiance: npt.ArrayLike, directions: Any, allowed: float
) -> list[int]:
    """Top-down, from left to right: nodes whose irradiance times spread is at most what is allowed."""
    made: list[int] = []
    waiting = [1]
    while waiting:
        cell = waiting.pop()
        _, arrives, power, spread = node(visible, normal, radiance, directions, cell)
        arriving = float(arrives @ np.array([0.2126, 0.7152, 0.0722]))
        if power <= 0 or arriving <= 0:
            continue
        if arriving * spread > allowed and cell < len(visible):
            waiting += [2 * cell + 1, 2 * cell]
        else:
            made.append(cell)
    return made


def brdf_sum(brdf: Any, shape: Any, wo: F64, nodes: F64) -> F64:
    """(K, 3) Σ E_n b_k(ω_n, ω_o) over nodes (N, 6) of direction in the shading frame and irradiance."""
    total = np.zeros((brdf.terms, 3))
    for row in nodes:
        total += truth.evaluate(brdf, shape, wo, row[:3])[:, None] * row[3:]
    return total


def ways_to_a_box(point: F64, half: F64, count: int, rng: np.random.Generator) -> F64:
    """Unit directions from a point to so many places in a box about the origin, its corners among them."""
    places = rng.uniform(-1, 1, (count, 3)) * half
    places[:8] = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    ways = places - point
    return np.asarray(ways / np.linalg.norm(ways, axis=1, keepdims=True))


def out_of_date(then: Sequence[Any], now: Sequence[Any], receiver: int, occluder: int) -> bool:
    """Whether what one object's vertices knew of another has to be traced again; transforms, or None."""
    a, b = then[receiver], then[occluder]
    c, d = now[receiver], now[occluder]
    if a is None or b is None:
        return True
    turned = any(not np.allclose(x.rotation, y.rotation) for x, y in ((a, c), (b, d)))
    if receiver == occluder:
        return turned
    sized = a.scale != c.scale or b.scale != d.scale
    way_then = np.subtract(b.translation, a.translation)
    way_now = np.subtract(d.translation, c.translation)
    return turned or sized or not np.allclose(way_then, way_now, atol=1e-9)


def meets_sphere(position: F64, targets: F64, centre: F64, radius: float) -> bool:
    """Whether a way from a position to one of the targets (Q, 4) of lamps meets a sphere."""
    for target in targets:
        way = target[:3] - position if target[3] else target[:3]
        along = float((centre - position) @ way) / float(way @ way)
        along = min(max(along, 0.0), 1.0) if target[3] else max(along, 0.0)
        if np.linalg.norm(position + along * way - centre) <= radius:
            return True
    return False


def filled(
    between: npt.NDArray[np.int64],
    material: npt.NDArray[np.int32],
    summed: Bools,
    wanted: Bools,
    settled: Bools,
    terms: npt.NDArray[np.float32],
    irradiance: npt.NDArray[np.float32],
    usual: float,
) -> tuple[F64, F64]:
    """Terms (V, T, 3) and irradiance (V, 3) of refined vertices, asked for one after the other."""
    common = {}
    for kind in set(material.tolist()):
        own = summed & (material == kind)
        light = irradiance[own].sum(axis=0, dtype=np.float64)
        sums = terms[own].sum(axis=0, dtype=np.float64)
        common[kind] = np.divide(sums, light, out=np.zeros(sums.shape), where=light > 0)

    def of(i: int) -> tuple[F64, F64]:
        if summed[i]:
            return terms[i].astype(np.float64), irradiance[i].astype(np.float64)
        (t1, e1), (t2, e2) = of(between[i, 0]), of(between[i, 1])
        if not (settled[i] and wanted[i]):
            return (t1 + t2) / 2, (e1 + e2) / 2
        own = irradiance[i].astype(np.float64)
        light = e1 + e2 + usual * own
        sums = own * (t1 + t2 + usual * own * common[material[i]])
        return np.divide(sums, light, out=np.zeros(sums.shape), where=light > 0), own

    made = [of(i) if wanted[i] else (terms[i], irradiance[i]) for i in range(len(terms))]
    return np.array([one[0] for one in made]), np.array([one[1] for one in made])
