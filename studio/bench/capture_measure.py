"""How far a capture is from the room that was photographed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio.bench.harness import relative_rmse
from studio.bench.phone import Truth
from studio.bench.phone_optics import look_up
from studio.bench.phone_response import Curve
from studio_core.capturing.artifacts import CaptureState, Response
from studio_core.capturing.settings import BACK, SIDES
from studio_core.capturing.standing import HALF_TURN
from studio_core.colour import LUMINANCE as WEIGHTS
from studio_core.imaging.latlong import pixel_directions, pixel_solid_angles
from studio_core.imaging.projection import project

F32 = npt.NDArray[np.float32]
LUMINANCE = np.array(WEIGHTS)
F64 = npt.NDArray[np.float64]
SEAM = 8.0
"""Degrees from where both lenses see the same, on either side, that `pixel_log2_median` leaves out."""
NORMALS = np.array(
    [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if x or y or z], float
)
NORMALS /= np.linalg.norm(NORMALS, axis=1, keepdims=True)


def irradiance(light: F32, normals: F64) -> F64:
    """(N, 3) of an equirectangular picture, for surfaces that face `normals` (N, 3)."""
    height, width = light.shape[:2]
    directions = pixel_directions(height, width).reshape(-1, 3)
    weighted = light.reshape(-1, 3) * np.repeat(pixel_solid_angles(height, width), width)[:, None]
    made = [np.maximum(directions @ normal, 0) @ weighted for normal in normals]
    return np.array(made, np.float64)


def best_scale(made: F64, truth: F64) -> float:
    """The factor on `made` with the least squared difference to `truth`."""
    return float((made * truth).sum() / max((made * made).sum(), 1e-300))


def irradiance_error(made: F32, truth: F32, finished_from_room: F64) -> float:
    """`irradiance_rel_rmse`: in the 26 directions to a cube's faces, edges and corners, all channels.

    After the best single scale; `finished_from_room` (3, 3) turns the room into the finished picture's frame.
    """
    a = irradiance(made, NORMALS @ finished_from_room.T)
    b = irradiance(truth, NORMALS)
    return relative_rmse(a * best_scale(a, b), b)


@dataclass(frozen=True)
class PixelError:
    """Median and 95th percentile of |log2| outside the seam; share of the sphere that was compared.

    `arcs`: mean of log2 where an arc brightens a lens that looks there (less than 90° off its axis).
    """

    median: float
    p95: float
    share: float
    arcs: float = 0.0


def pixel_error(
    state: CaptureState, truth_light: F32, truth: Truth, finished_from_room: F64, resolution: int = 512
) -> PixelError:
    """`pixel_log2_median`: luminance of places of equal area, where an exposure resolved them.

    After the scale that makes the median difference 0. Both pictures are compared at `resolution` columns, so
    that detail finer than the lens' pixels does not count.
    """
    assert state.captured is not None
    resolution = min(resolution, truth_light.shape[1])
    height, width = resolution // 2, resolution
    room = pixel_directions(height, width).reshape(-1, 3)
    exact = _calmed(truth_light, resolution).reshape(-1, 3)
    turned = room @ finished_from_room.T
    made = look_up(_calmed(state.captured.environment.pixels, resolution), turned)
    lost = state.captured.unresolved > 0
    for mask in (state.stitched.clipped, state.stitched.unseen) if state.stitched is not None else ():
        lost = lost | mask
    spoilt = look_up(np.repeat(lost[:, :, None], 3, 2).astype(np.float32), turned)[:, 0] > 0.01
    from_axis = np.degrees(np.arccos(np.clip(-(room @ truth.room_from_front)[:, 2], -1, 1)))
    fine = ~spoilt & (np.abs(from_axis - 90) > SEAM)
    weights = np.repeat(pixel_solid_angles(height, width), width)
    ratio = np.log2((_luminance(made) + 1e-12) / (_luminance(exact) + 1e-12))
    order = np.argsort(ratio[fine])
    middle = _quantile(ratio[fine][order], weights[fine][order], 0.5)
    off = np.abs(ratio[fine] - middle)
    order = np.argsort(off)
    median, p95 = (_quantile(off[order], weights[fine][order], q) for q in (0.5, 0.95))
    under = ~spoilt & under_arcs(room, truth)
    arcs = float(np.average(ratio[under] - middle, weights=weights[under])) if under.any() else 0.0
    return PixelError(median, p95, float(weights[fine].sum() / weights.sum()), arcs)


def under_arcs(room: F64, truth: Truth) -> npt.NDArray[np.bool_]:
    """Of directions of the room (N, 3): where the lens in front of which they lie has over 0.3 stops more."""
    made = np.zeros(len(room), bool)
    for side in SIDES:
        lens_way = room @ truth.room_from_front
        if side == BACK:
            lens_way = lens_way @ truth.rotation
        one = truth.side(side)
        points, seen = project(truth.phone.lens, one.circle, lens_way)
        height, width = one.stops.shape
        x, y = (np.clip(points[:, k].astype(int), 0, n - 1) for k, n in ((0, width), (1, height)))
        made |= seen & (lens_way[:, 2] < 0) & (one.stops[y, x] > 0.3)
    return made


def _calmed(light: F32, resolution: int) -> F32:
    """The picture in about the resolution at which it is compared."""
    import cv2

    if light.shape[1] <= resolution:
        return light
    made = cv2.resize(light, (resolution, resolution // 2), interpolation=cv2.INTER_AREA)
    return np.asarray(made, np.float32)


def _quantile(values: F64, weights: F64, q: float) -> float:
    """Of sorted values."""
    if not len(values):
        return float("nan")
    total = np.cumsum(weights)
    return float(values[np.searchsorted(total, q * total[-1])])


def _luminance(colour: npt.NDArray[np.floating]) -> F64:
    return np.asarray(colour @ LUMINANCE, np.float64)


def left_in_lenses(state: CaptureState, truth: Truth) -> float | None:
    """`lens_arcs_log2`: mean log2 of what arcs leave in the lenses' own light, against the same ring beside.

    What the seam takes from the other lens anyway is counted too. None without arcs or for other sizes.
    """
    left, weight = 0.0, 0.0
    for side, light in state.reflections.lights.items() if state.reflections is not None else ():
        one = truth.side(side)
        if light.shape != one.clean.shape:
            return None
        height, width = one.stops.shape
        y, x = np.mgrid[0:height, 0:width] + 0.5
        reach = np.hypot(x - one.circle.x, y - one.circle.y) / one.circle.radius
        ratio = np.log2((_luminance(light) + 1e-12) / (_luminance(one.clean) + 1e-12))
        arcs = (one.stops > 0.3) & (reach < 0.985)
        if arcs.any():
            beside = (one.stops < 0.02) & (reach > reach[arcs].min()) & (reach < 0.985)
            left += float((ratio[arcs] - np.median(ratio[beside])).sum())
            weight += float(arcs.sum())
    return left / weight if weight else None


def angle_between(a: F64, b: F64) -> float:
    """Degrees of the turn from one rotation (3, 3) to another."""
    cosine = (np.trace(a.T @ b) - 1) / 2
    sine = np.linalg.norm(a.T @ b - b.T @ a) / (2 * np.sqrt(2))
    return float(np.degrees(np.arctan2(sine, cosine)))


@dataclass(frozen=True)
class ResponseError:
    """`rms`: of the exposure, in shares of the full one; `log2`: of its logarithm, stops; worst channel."""

    rms: float
    log2: float


def response_error(found: Response, curve: Curve) -> ResponseError:
    """Over the numbers that the response says it knows, 4 % above black, each channel scaled best."""
    levels = found.curve.shape[1]
    numbers = np.linspace(0, 1, levels)
    rms, logs = [], []
    for channel in range(3):
        low = max(found.black[channel] / found.top, curve.pedestal) + 0.04
        known = (numbers >= low) & (numbers <= min(found.white[channel] / found.top, 1.0) - 1 / levels)
        exact = curve.exposure(numbers[known], channel)
        made = 2.0 ** found.curve[channel][known]
        made = made * best_scale(made, exact)
        rms.append(float(np.sqrt(np.mean((made - exact) ** 2)) / exact.max()))
        difference = np.log2(made / exact)
        logs.append(float(np.std(difference)))
    return ResponseError(max(rms), max(logs))


def exposure_error(state: CaptureState, truth: Truth) -> float:
    """`exposure_ev_max`: the largest error of a step between neighbouring exposures of either lens, EV."""
    worst = 0.0
    for side in SIDES:
        if side in state.lights:
            solved = np.sort(state.lights[side].exposures.solved)
            exact = np.sort(truth.side(side).evs)
            if len(solved) != len(exact):
                return float("inf")
            worst = max(worst, float(np.abs(np.diff(solved) - np.diff(exact)).max(initial=0)))
    return worst


def nonfinite(state: CaptureState) -> int:
    """Numbers of the results that are not finite, or below 0."""
    assert state.captured is not None
    parts = (state.captured.environment.pixels, state.captured.faces)
    return int(sum((~np.isfinite(part) | (part < 0)).sum() for part in parts))


def finished_from_room(state: CaptureState, truth: Truth) -> F64:
    """(3, 3): where the finished picture shows a direction of the room, as far as the capture knows."""
    upright = state.stitched.upright if state.stitched is not None else HALF_TURN
    return np.asarray(upright @ truth.room_from_front.T, np.float64)
