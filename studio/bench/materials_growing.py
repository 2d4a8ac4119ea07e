"""How well small samples grow: `python -m studio.bench.materials_growing [SIDE]` prints a row each.

Steps across seams over the sample's own steps at the texels on both sides, with and without mixing; how far
mean and spread are from the sample's; the highest correlation with itself farther than FAR texels away, and
the sample's own; seconds of processor time.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

from studio.bench.pattern_samples import SAMPLES, weave
from studio_core.imaging.synthesis import fitting_size, grow, principal

FAR = 64.0
CASES: Mapping[str, Callable[[], npt.NDArray[np.float32]]] = {
    **SAMPLES,
    "weave 12.7": lambda: weave(256, 12.7),
}


def measure(sample: npt.NDArray[np.float32], side: int, seed: int = 0) -> dict[str, float]:
    """Figures of one sample, grown to about `side` texels."""
    start = time.process_time()
    size = fitting_size(sample, (side, side))
    made = grow(sample, size, seed=seed)
    grown = np.asarray(made.of(sample), np.float32)
    return {
        "height": size[0],
        "width": size[1],
        "steps": made.seam_ratio(sample),
        "steps_unmixed": made.seam_ratio(sample, 0),
        "mean_error": float(np.abs(grown.mean(axis=(0, 1)) / sample.mean(axis=(0, 1)) - 1).max()),
        "spread": float(grown.std() / sample.std()),
        "comes_back": correlation(grown, FAR, torus=True),
        "comes_back_in_sample": correlation(sample, FAR, torus=False),
        "s": time.process_time() - start,
    }


def correlation(picture: npt.NDArray[np.float32], far: float, *, torus: bool) -> float:
    """The highest with itself, shifted by more than `far` texels; at least a quarter has to overlap."""
    signal = principal(picture)
    shape = signal.shape[:2] if torus else tuple(2 * side for side in signal.shape[:2])
    heard = np.fft.irfft2((np.abs(np.fft.rfft2(signal.transpose(2, 0, 1), shape)) ** 2).sum(axis=0), shape)
    there = np.fft.irfft2(np.abs(np.fft.rfft2(np.ones(signal.shape[:2]), shape)) ** 2, shape)
    heard = np.where(there > 0.25 * there.max(), heard / np.maximum(there, 1), 0)
    away = [np.minimum(np.arange(n), n - np.arange(n)) for n in shape]
    return float(heard[np.hypot(away[0][:, None], away[1]) > far].max() / heard[0, 0])


if __name__ == "__main__":
    for name, sample in CASES.items():
        figures = measure(sample(), int(sys.argv[1]) if len(sys.argv) > 1 else 1024)
        print(name, " ".join(f"{key} {value:.4g}" for key, value in figures.items()), flush=True)
