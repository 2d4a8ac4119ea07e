"""Lobes over an element's cells against whole convolution, and beside it the paper's box-filtered MIP.

`lobe/LEVEL`: the operator (`slf.lobes`); `mip/LEVEL`: the mirrored light on 32 × 32 cells of equal solid
angle, averaged over boxes as large as the lobe, between two levels (section 6.2). `operator_error` is the RMS
difference over directions, over the mean; `albedo` the most that a lobe sends back of light from anywhere.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report
from studio_core.kernels.directions import direction_set
from studio_core.transport.cells import CELLS, PARTS, RINGS, cell_directions, cells_of
from studio_plugins.slf.lobes import albedos, cell_weights, exponents, lobe, spectra

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

LOOKED_AT = 12  # cells
FINE = (4, 8, 12)  # directions along a side of a cell, by sharpness
GRID = 11  # 2^11 directions of the sphere are 32 × 32 of a hemisphere


def run(report: Report) -> None:
    """All levels that are wanted."""
    rng = np.random.default_rng(3)
    light = 0.2 + rng.uniform(0, 1, (RINGS, PARTS)) ** 8
    light[4:7, 10:18] += 12  # a window
    cells = rng.choice(CELLS, LOOKED_AT, replace=False)
    for level, exponent in enumerate(exponents().tolist()):
        names = f"lobe/{level}", f"mip/{level}"
        if not any(report.wants(name) for name in names):
            continue
        fine = FINE[0] if level < 14 else FINE[1] if level < 18 else FINE[2]
        true = convolved(exponent, light, cells, fine)
        for name, made in zip(names, (operated(level, light), boxed(exponent, light)), strict=True):
            if report.wants(name):
                off = math.sqrt(((made[cells] - true) ** 2).mean()) / true.mean()
                report.add(name, "operator_error", off, "1")
        if report.wants(names[0]):
            report.add(names[0], "albedo", float(albedos(spectra())[level].max()), "1")


def operated(level: int, light: F64) -> F64:
    """(CELLS,) by the operator of a level."""
    series = np.fft.rfft(light, axis=1) * cell_weights()[:, None]
    sent = np.einsum("mij,jm->im", spectra()[level], series)
    return np.asarray(np.fft.irfft(sent, PARTS, axis=1).ravel())


def boxed(exponent: float, light: F64) -> F64:
    """(CELLS,) by boxes about the mirror direction."""
    upper = direction_set(GRID).directions[: 1 << (GRID - 1)][:, [2, 0, 1]]
    held = np.empty(len(upper), np.uint16)
    cells_of(np.ascontiguousarray(upper), held)
    finest = light.ravel()[held]
    mirrored = cell_directions() * np.array([-1, -1, 1], np.float32)
    leaf = direction_set(GRID).leaf_of(mirrored[:, [1, 2, 0]])
    wide = math.log(len(upper) / (exponent + 1), 4)  # 2π / (n + 1) over a cell
    low = int(np.clip(math.floor(wide), 0, 5))
    share = float(np.clip(wide - low, 0, 1))

    def at(size: int) -> F64:
        size = min(size, 5)
        return np.asarray(finest.reshape(-1, 4**size).mean(axis=1)[leaf >> (2 * size)])

    return (1 - share) * at(low) + share * at(low + 1)


def convolved(exponent: float, light: F64, cells: I64, fine: int) -> F64:
    """(N,) mean light towards cells (N,), from many directions of every cell, extrapolated (Richardson)."""
    coarse, finer = (_summed(exponent, light, cells, count) for count in (fine // 2, fine))
    return (4 * finer - coarse) / 3


def _summed(exponent: float, light: F64, cells: I64, fine: int) -> F64:
    wi, share = _directions(np.arange(CELLS), fine)
    weights = (share * (np.repeat(cell_weights(), PARTS) * light.ravel())[:, None]).ravel()
    wo, looks = _directions(cells, fine)
    made = np.zeros(len(cells))
    for cell in range(len(cells)):
        for direction, look in zip(wo[cell], looks[cell], strict=True):
            made[cell] += look * (lobe(exponent, wi.reshape(-1, 3), direction) @ weights)
    return made


def _directions(cells: I64, fine: int) -> tuple[F64, F64]:
    at = (np.arange(fine) + 0.5) / fine
    theta = (cells[:, None, None] // PARTS + at[:, None]) * (math.pi / 2 / RINGS)
    phi = (cells[:, None, None] % PARTS + at) * (2 * math.pi / PARTS)
    theta, phi = (one.reshape(len(cells), -1) for one in np.broadcast_arrays(theta, phi))
    share = np.sin(theta) * np.cos(theta)
    made = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    return made, share / share.sum(axis=1, keepdims=True)
