"""The environment behind what is hit, far away or projected on the ground.

On the ground a ray meets a disc under the place where the picture was taken, or beyond it a dome on the same
disc; what the picture shows there is what was seen from that place (as Unreal's HDRI backdrop and three.js'
grounded skybox do). An eye that is not inside the dome sees it far away.
"""

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
DOME = 14
"""Numbers of a dome: the eye less the place of the picture (3), height, radius, world from camera (9)."""
FAR_AWAY = np.zeros(0)
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
def reach_of_dome(
    ex: float, ey: float, ez: float, height: float, radius: float, dx: float, dy: float, dz: float
) -> float:
    """How far along d (in lengths of d) the dome lies, seen from e, which is relative to the picture's place.

    inf where e is not inside: under the ground, or outside the dome.
    """
    over = ey + height
    across = ex * ex + ez * ez
    if over <= 0.0 or across + over * over >= radius * radius:
        return np.inf
    if dy < 0.0:
        reach = -over / dy
        gx, gz = ex + reach * dx, ez + reach * dz
        if gx * gx + gz * gz <= radius * radius:
            return reach
    a = dx * dx + dy * dy + dz * dz
    b = ex * dx + over * dy + ez * dz
    c = across + over * over - radius * radius
    made: float = (-b + np.sqrt(max(b * b - a * c, 0.0))) / a
    return made


@kernel
def _look_up(
    count: int, x: F32, y: F32, z: F32, turn: F32, pixels: F32, gain: F32, here: I64, out: F32
) -> None:
    """out[here[k]] of the first `count` directions (x, y, z), which `turn` leads into the picture's frame."""
    high, wide = pixels.shape[0], pixels.shape[1]
    xx, xy, xz = turn[0]
    yx, yy, yz = turn[1]
    zx, zy, zz = turn[2]
    for k in range(count):
        a, b, c = x[k], y[k], z[k]
        px, py, pz = xx * a + xy * b + xz * c, yx * a + yy * b + yz * c, zx * a + zy * b + zz * c
        x[k] = (_HALF - angle(px, pz) * _INVERSE_TURN) * np.float32(wide) - _HALF
        y[k] = angle(np.sqrt(px * px + pz * pz), py) * _INVERSE_PI * np.float32(high) - _HALF
    for k in range(count):
        s0, t0 = np.floor(x[k]), np.floor(y[k])
        fs, ft = x[k] - s0, y[k] - t0
        i0, j0 = int(s0), int(t0)
        i1, j1 = i0 + 1, min(max(j0 + 1, 0), high - 1)
        i0, i1 = i0 + wide if i0 < 0 else min(i0, wide - 1), i1 if i1 < wide else 0
        j0 = min(max(j0, 0), high - 1)
        for c in range(3):
            low = pixels[j0, i0, c] + fs * (pixels[j0, i1, c] - pixels[j0, i0, c])
            far = pixels[j1, i0, c] + fs * (pixels[j1, i1, c] - pixels[j1, i0, c])
            out[here[k], c] = gain[c] * (low + ft * (far - low))


@kernel
def _on_dome(count: int, x: F32, y: F32, z: F32, dome: F64) -> None:
    """Camera rays become directions from the picture's place to where they meet the dome, world."""
    ex, ey, ez, height, radius = dome[0], dome[1], dome[2], dome[3], dome[4]
    for k in range(count):
        a, b, c = np.float64(x[k]), np.float64(y[k]), np.float64(z[k])
        dx = dome[5] * a + dome[6] * b + dome[7] * c
        dy = dome[8] * a + dome[9] * b + dome[10] * c
        dz = dome[11] * a + dome[12] * b + dome[13] * c
        reach = reach_of_dome(ex, ey, ez, height, radius, dx, dy, dz)
        if reach < np.inf:
            dx, dy, dz = ex + reach * dx, ey + reach * dy, ez + reach * dz
        x[k], y[k], z[k] = dx, dy, dz


@kernel
def background_hits(
    start: int,
    stop: int,
    pinhole: F64,
    samples: I64,
    face: I32,
    turn: F32,
    dome: F64,
    pixels: F32,
    gain: F32,
    out: F32,
) -> None:
    """Radiance out (stop − start, 3) of what hits start … stop−1 leave open; 0 where there is a face.

    samples (N,) names their samples of the picture; empty: hit i is sample i. gain (3,) multiplies the
    equirectangular `pixels` (H, W, 3), which are read bilinearly, around in u, no further than the poles in
    v. turn (3, 3) is picture from camera, or with a `dome` (DOME,) picture from world.
    """
    width, n = int(pinhole[0]), int(pinhole[1])
    right, up = 2 * pinhole[2] / (width * n), 2 * pinhole[3] / (pinhole[WHOLE] * n)
    above = int(pinhole[TOP]) * n
    here = np.empty(BLOCK, np.int64)
    x, y, z = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
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
                x[found] = (left + i + 0.5) * right - pinhole[2]
                y[found] = pinhole[3] - (above + top + j + 0.5) * up
                z[found] = -1
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
        if len(dome):
            _on_dome(found, x, y, z, dome)
        _look_up(found, x, y, z, turn, pixels, gain, here, out)


@kernel
def backdrop_at(
    start: int,
    stop: int,
    pinhole: F64,
    samples: I64,
    distance: F32,
    turn: F32,
    dome: F64,
    pixels: F32,
    gain: F32,
    out: F32,
) -> None:
    """The same, out (N, 3), behind surfaces that samples start … stop−1 of `samples` (N,) meet.

    With a dome it is what was seen in the direction of the point that is met, `distance` (N,) metres away.
    """
    width, n = int(pinhole[0]), int(pinhole[1])
    right, up = 2 * pinhole[2] / (width * n), 2 * pinhole[3] / (pinhole[WHOLE] * n)
    above = int(pinhole[TOP]) * n
    here = np.empty(BLOCK, np.int64)
    x, y, z = np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32), np.empty(BLOCK, np.float32)
    while start < stop:
        found = min(stop - start, BLOCK)
        for k in range(found):
            pixel, inner = samples[start + k] // (n * n), samples[start + k] % (n * n)
            a = ((pixel % width) * n + inner % n + 0.5) * right - pinhole[2]
            b = pinhole[3] - (above + (pixel // width) * n + inner // n + 0.5) * up
            c = -1.0
            if len(dome):
                reach = distance[start + k] / np.sqrt(a * a + b * b + 1.0)
                dx = dome[5] * a + dome[6] * b + dome[7] * c
                dy = dome[8] * a + dome[9] * b + dome[10] * c
                dz = dome[11] * a + dome[12] * b + dome[13] * c
                a, b, c = dome[0] + reach * dx, dome[1] + reach * dy, dome[2] + reach * dz
            x[k], y[k], z[k] = a, b, c
            here[k] = start + k
        _look_up(found, x, y, z, turn, pixels, gain, here, out)
        start += found
