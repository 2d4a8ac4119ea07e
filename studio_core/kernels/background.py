"""The environment behind what is hit."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.camera import TOP, WHOLE
from studio_core.kernels.directions import arctangent

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]
I64 = npt.NDArray[np.int64]

BLOCK = 512  # rays whose place in the picture is found together, in vector code
_HALF, _TINY = np.float32(0.5), np.float32(1e-30)
_PI, _QUARTER_TURN = np.float32(np.pi), np.float32(np.pi / 2)
_INVERSE_TURN, _INVERSE_PI = np.float32(1 / (2 * np.pi)), np.float32(1 / np.pi)


@kernel
def angle(y: np.float32, x: np.float32) -> np.float32:
    """atan2(y, x) within 3e-7; 0 at the origin. Of minima and maxima: a loop of it becomes vector code."""
    across, up = abs(x), abs(y)
    made = arctangent(min(across, up) / max(max(across, up), _TINY))
    made = _QUARTER_TURN - made if up > across else made
    made = _PI - made if x < 0 else made
    return -made if y < 0 else made


@kernel
def background_hits(
    start: int,
    stop: int,
    pinhole: F64,
    samples: I64,
    face: I32,
    turn: F32,
    pixels: F32,
    gain: F32,
    out: F32,
) -> None:
    """Radiance out (stop − start, 3) of what hits start … stop−1 leave open; 0 where there is a face.

    samples (N,) names their samples of the picture; empty: hit i is sample i. turn (3, 3) is picture from
    camera, gain (3,) multiplies the equirectangular `pixels` (H, W, 3), which are read bilinearly, around in
    u, no further than the poles in v.
    """
    width, n = int(pinhole[0]), int(pinhole[1])
    high, wide = pixels.shape[0], pixels.shape[1]
    right, up = 2 * pinhole[2] / (width * n), 2 * pinhole[3] / (pinhole[WHOLE] * n)
    above = int(pinhole[TOP]) * n
    xx, xy, xz = turn[0]
    yx, yy, yz = turn[1]
    zx, zy, zz = turn[2]
    here = np.empty(BLOCK, np.int64)
    s, t = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    out[: stop - start] = 0
    hit = start
    pixel, inner = start // (n * n), start % (n * n)
    left, top = (pixel % width) * n, (pixel // width) * n  # of the pixel, in samples
    i, j = inner % n, inner // n
    while hit < stop:
        found = 0
        while hit < stop and found < BLOCK:
            if len(samples):
                pixel, inner = samples[hit] // (n * n), samples[hit] % (n * n)
                left, top = (pixel % width) * n, (pixel // width) * n
                i, j = inner % n, inner // n
            if face[hit] < 0:
                s[found] = (left + i + 0.5) * right - pinhole[2]
                t[found] = pinhole[3] - (above + top + j + 0.5) * up
                here[found] = hit - start
                found += 1
            hit += 1
            i += 1  # the next sample: counted on, since dividing takes as long as all the rest
            if i == n:
                i, j = 0, j + 1
                if j == n:
                    j, left = 0, left + n
                    if left == width * n:
                        left, top = 0, top + n
        for k in range(found):
            a, b = s[k], t[k]
            x, y, z = xx * a + xy * b - xz, yx * a + yy * b - yz, zx * a + zy * b - zz
            s[k] = (_HALF - angle(x, z) * _INVERSE_TURN) * np.float32(wide) - _HALF
            t[k] = angle(np.sqrt(x * x + z * z), y) * _INVERSE_PI * np.float32(high) - _HALF
        for k in range(found):
            s0, t0 = np.floor(s[k]), np.floor(t[k])
            fs, ft = s[k] - s0, t[k] - t0
            i0, j0 = int(s0), int(t0)
            i1, j1 = i0 + 1, min(max(j0 + 1, 0), high - 1)
            i0, i1 = i0 + wide if i0 < 0 else min(i0, wide - 1), i1 if i1 < wide else 0
            j0 = min(max(j0, 0), high - 1)
            for c in range(3):
                low = pixels[j0, i0, c] + fs * (pixels[j0, i1, c] - pixels[j0, i0, c])
                far = pixels[j1, i0, c] + fs * (pixels[j1, i1, c] - pixels[j1, i0, c])
                out[here[k], c] = gain[c] * (low + ft * (far - low))
