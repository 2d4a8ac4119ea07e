"""Colour and absolute scale of what was stitched, and lamps that no exposure resolved, from a light meter.

With L_v a pixel's luminance (Rec.709 weights), s the scale in cd/m² and C the clipped part of the picture, a
meter facing n reads E = s · ∫ L_v max(0, n · ω) dω. One reading gives s; a second one, of the lamp that C
shows, gives the factor k by which C was too dark: E = s · (E_rest + k · E_C).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from studio_core.capturing.artifacts import F32, F64, Calibration, Captured, Mask, Stitched
from studio_core.capturing.settings import (
    AS_SHOT,
    GREY_CARD,
    KELVIN,
    LUMINANCE,
    LUX,
    NOT_CALIBRATED,
    CalibrationSettings,
)
from studio_core.colour import LUMINANCE as WEIGHTS
from studio_core.colour import kelvin
from studio_core.imaging.cubemap import faces_from_equirect
from studio_core.imaging.latlong import equirect_direction, pixel_directions, pixel_solid_angles
from studio_core.scene.geometry import Image
from studio_plugins.capture.clipped import lacking, places

METER = 0.05
"""Relative standard deviation of a light meter's reading (a good one: class B of DIN 5032-7 allows 10 %)."""
PICTURE = 0.03
"""Relative standard deviation of irradiance from a captured picture, where its range was captured."""
_STRONGEST = 20.0  # a white balance beyond this is a mistake or nearly monochromatic light
_SURE = 2.0  # standard deviations by which a gap must be more than none
_PARTS = 256  # rows summed at once


@dataclass(frozen=True)
class Readings:
    """What a picture says a meter would read, in its own units of luminance × steradian.

    `rest`: without clipped pixels, `clipped`: of these alone, `edge`: of the outermost of them, `lack`: of
    clipped light times the weights of what each place lacks.
    """

    rest: float
    clipped: float
    lack: float
    edge: float
    unseen: float

    @property
    def all(self) -> float:
        """As the picture is."""
        return self.rest + self.clipped


def calibrate(stitched: Stitched, settings: CalibrationSettings) -> tuple[F32, Calibration]:
    """The light (H, 2H, 3) with its white and lamps set right, and what was done, with uncertainties.

    What cannot be done is left out, and a note says why.
    """
    notes: list[str] = []
    white = _white(stitched, settings, notes)
    light = stitched.light if white == (1.0, 1.0, 1.0) else stitched.light * np.asarray(white, np.float32)
    sun, sun_uncertainty = 1.0, 0.0
    scale, uncertainty = _scale(stitched, light, settings, notes)
    if settings.sun:
        found = _recovered(stitched, light, settings, scale, uncertainty, notes)
        if found is not None:
            (scale, uncertainty), (sun, sun_uncertainty), raised = found
            light = light * raised[..., None]
    made = Calibration(white, scale, uncertainty, sun, sun_uncertainty, tuple(notes))
    return light, made


def finished(
    stitched: Stitched, light: F32, calibration: Calibration, face: int = 0, notes: tuple[str, ...] = ()
) -> Captured:
    """The end of a capture: environment, cube map of `face` pixels (0: a quarter of the width), what is
    unresolved."""
    unresolved = np.zeros(stitched.unseen.shape, np.uint8)
    if stitched.dark is not None:
        unresolved[stitched.dark] = 2
    if calibration.sun == 1.0:
        unresolved[stitched.clipped] = 1
    unresolved[stitched.unseen] = 3
    faces = faces_from_equirect(light, face or max(1, light.shape[1] // 4))
    return Captured(Image(light), faces, unresolved, calibration, notes=notes)


def illuminance(light: F32, facing: tuple[float, float, float]) -> float:
    """∫ L_v max(0, n · ω) dω of a picture (H, 2H, 3), L_v its luminance: what a meter facing n reads."""
    return _sums(light, facing, {})[0]


def _readings(
    stitched: Stitched, light: F32, facing: tuple[float, float, float], lack: F32 | None = None
) -> Readings:
    import cv2

    inner = cv2.erode(stitched.clipped.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    edge = stitched.clipped & ~inner
    masks: dict[str, Mask | F32] = {"clipped": stitched.clipped, "edge": edge, "unseen": stitched.unseen}
    if lack is not None:
        masks["lack"] = lack
    total, parts = _sums(light, facing, masks)
    clipped = parts["clipped"]
    return Readings(total - clipped, clipped, parts.get("lack", clipped), parts["edge"], parts["unseen"])


def _sums(
    light: F32, facing: tuple[float, float, float], masks: Mapping[str, Mask | F32]
) -> tuple[float, dict[str, float]]:
    """Of all of a picture, and of its pixels times each mask."""
    height, width = light.shape[:2]
    normal = np.asarray(facing, np.float64)
    length = float(np.linalg.norm(normal))
    normal = normal / length if length > 0 else np.array([0.0, 1.0, 0.0])
    angles = pixel_solid_angles(height, width)
    total, parts = 0.0, dict.fromkeys(masks, 0.0)
    for start in range(0, height, _PARTS):
        rows = slice(start, min(start + _PARTS, height))
        cosine = np.maximum(pixel_directions(height, width, rows) @ normal, 0) * angles[rows, None]
        caught = (light[rows] @ np.asarray(WEIGHTS, np.float32)) * cosine
        total += float(caught.sum())
        for name, mask in masks.items():
            parts[name] += float((caught * mask[rows]).sum())
    return total, parts


def _white(stitched: Stitched, settings: CalibrationSettings, notes: list[str]) -> tuple[float, float, float]:
    """Factors that make the light of a card or a black body neutral and leave its luminance as it is."""
    if settings.white == AS_SHOT:
        return (1.0, 1.0, 1.0)
    if settings.white == KELVIN:
        colour = np.array(kelvin(settings.kelvin))
    else:
        assert settings.white == GREY_CARD
        place = _place(stitched, stitched.light, settings.card, settings.card_size)
        if isinstance(place, str):
            notes.append(f"The grey card was not used: {place}.")
            return (1.0, 1.0, 1.0)
        colour = place.mean
    grey = float(colour @ np.array(WEIGHTS))
    if not grey > 0:
        notes.append("White was not set: the grey card is black.")
        return (1.0, 1.0, 1.0)
    factors = grey / np.maximum(colour, grey / _STRONGEST)
    if (colour * _STRONGEST < grey).any():
        notes.append(f"The light has hardly any of one colour; it was raised {_STRONGEST:g} times at most.")
    red, green, blue = (float(f) for f in factors)
    return (red, green, blue)


@dataclass(frozen=True)
class _Place:
    mean: F64
    uncertainty: float  # relative, of its luminance


def _place(stitched: Stitched, light: F32, at: tuple[float, float], size: float) -> _Place | str:
    """Mean colour of a disc `size` degrees across around (u, v), or why there is none."""
    height, width = light.shape[:2]
    centre = equirect_direction(at[0], at[1])
    radius = max(math.radians(size) / 2, 0.75 * math.pi / height)
    v = (np.arange(height) + 0.5) / height
    rows = np.flatnonzero(np.abs(v - at[1]) * math.pi <= radius)
    if not len(rows):
        rows = np.array([min(max(int(at[1] * height), 0), height - 1)])
    part = slice(int(rows[0]), int(rows[-1]) + 1)
    directions = pixel_directions(height, width, part)
    weight = (directions @ centre >= math.cos(radius)) * pixel_solid_angles(height, width)[part, None]
    if not weight.any():
        return "the picture is too small for it"
    bad = stitched.clipped[part] | stitched.unseen[part]
    good = weight * ~bad
    if good.sum() < 0.5 * weight.sum():
        clipped = (weight * stitched.clipped[part]).sum() > (weight * stitched.unseen[part]).sum()
        return "it is brighter than any exposure resolves" if clipped else "no lens has seen it"
    colours = light[part][good > 0].astype(np.float64)
    weights = good[good > 0] / good.sum()
    mean = weights @ colours
    grey = colours @ np.array(WEIGHTS)
    middle = float(weights @ grey)
    spread = math.sqrt(max(float(weights @ (grey - middle) ** 2), 0.0))
    return _Place(mean, spread / max(middle, 1e-12) / math.sqrt(max(1 / float((weights**2).sum()), 1.0)))


def _scale(
    stitched: Stitched, light: F32, settings: CalibrationSettings, notes: list[str]
) -> tuple[float | None, float]:
    """cd/m² a unit, and its relative standard deviation."""
    if settings.scale == NOT_CALIBRATED:
        return None, 0.0
    if settings.scale == LUMINANCE:
        place = _place(stitched, light, settings.place, settings.card_size)
        if isinstance(place, str):
            notes.append(f"The place of known luminance was not used: {place}.")
            return None, 0.0
        grey = float(place.mean @ np.array(WEIGHTS))
        if not (grey > 0 and settings.luminance > 0):
            notes.append("The place of known luminance was not used: there is no light.")
            return None, 0.0
        return float(settings.luminance) / grey, math.hypot(METER, place.uncertainty)
    assert settings.scale == LUX
    seen = _readings(stitched, light, settings.facing)
    used = seen.rest if _shaded(settings) else seen.all
    if not (used > 0 and settings.lux > 0):
        notes.append("The lux meter was not used: there is no light where it faced.")
        return None, 0.0
    lost = 0.0 if _shaded(settings) else seen.clipped / seen.all
    if lost > 0.01:
        notes.append(
            f"At least {lost:.0%} of the light at the meter comes from what no exposure resolved:"
            " the scale may be too high by as much or more. Recover clipped lamps, or shade the meter."
        )
    unseen = seen.unseen / seen.all
    if unseen > 0.02:
        notes.append(f"{unseen:.0%} of the light at the meter is a guess, where no lens looked.")
    return float(settings.lux) / used, math.hypot(math.hypot(METER, PICTURE), math.hypot(lost, unseen / 2))


def _shaded(settings: CalibrationSettings) -> bool:
    """Whether the first reading was of the room without the lamp: both were taken facing the same way."""
    return settings.sun and settings.sun_facing is None


def _recovered(
    stitched: Stitched,
    light: F32,
    settings: CalibrationSettings,
    scale: float | None,
    uncertainty: float,
    notes: list[str],
) -> tuple[tuple[float, float], tuple[float, float], F32] | None:
    """(scale, its relative uncertainty), (mean factor of clipped light, its standard deviation), the factor
    of every pixel (H, 2H); or None with a note why."""

    def refuse(why: str) -> None:
        notes.append(f"The clipped lamp was left as it is: {why}.")

    if not stitched.clipped.any():
        refuse("every part of the picture is resolved by an exposure")
        return None
    if scale is None:
        refuse("a second measurement is needed for the scale, of the room without it or of a place")
        return None
    facing = settings.facing if settings.sun_facing is None else settings.sun_facing
    labels, count = places(stitched.clipped)
    weights = lacking(light @ np.asarray(WEIGHTS, np.float32), labels, count)
    lack = weights.astype(np.float32)[labels]
    here = _readings(stitched, light, facing, lack)
    if here.clipped <= 1e-6 * here.rest:
        refuse("it does not shine on the meter where that faced")
        return None
    first = _readings(stitched, light, settings.facing, lack)
    solve = _solver(settings, scale)
    # relative standard deviations: both readings, rest and clipped light of the picture at both
    rims = here.edge / here.clipped / math.sqrt(12)  # rim pixels may be covered anywhere from 0 to 1
    names = ("first", "second", "rest", "clip")
    spreads = (METER if settings.scale == LUX else uncertainty, METER, PICTURE, math.hypot(PICTURE, rims))
    found = solve(first, here, dict.fromkeys(names, 1.0))
    if found is None:
        refuse("the two readings do not differ by the light it would give")
        return None
    factor, unit = found
    variance = scale_variance = gap = 0.0
    for name, spread in zip(names, spreads, strict=True):
        ends = [solve(first, here, {**dict.fromkeys(names, 1.0), name: 1 + d * spread}) for d in (-1, 1)]
        if ends[0] is None or ends[1] is None:
            refuse("the meter's uncertainty is larger than what it gives")
            return None
        variance += ((ends[1][0] - ends[0][0]) / 2) ** 2
        if name == "rest":
            gap = math.sqrt(variance)  # the clipped light's own doubts scale the factor, not what is lacking
        scale_variance += ((ends[1][1] - ends[0][1]) / 2 / unit) ** 2
    spread = math.sqrt(variance)
    if factor <= 1:
        refuse("the meter says that there is no more light than the picture has")
        return None
    if factor - 1 < _SURE * gap:
        refuse(f"what is lacking ({factor - 1:.2g} times its light) is within the uncertainty of ± {gap:.2g}")
        return None
    raised = 1 + (factor - 1) * here.clipped / here.lack * lack
    if count > 1:
        each = 1 + (factor - 1) * here.clipped / here.lack * weights[1:]
        notes.append(
            f"{count} separate clipped places were raised {each.min():.2g} to {each.max():.2g} times,"
            " by how far each outshines its rim: one reading does not tell them apart."
        )
    return (unit, math.sqrt(scale_variance)), (factor, spread), np.asarray(raised, np.float32)


_Solve = Callable[[Readings, Readings, dict[str, float]], tuple[float, float] | None]


def _solver(settings: CalibrationSettings, scale: float) -> _Solve:
    """Mean factor of clipped light at the second reading, and scale, from both readings and relative errors.

    Clipped light is C + t D, D what its places may lack: t follows from the readings, 1 + t D / C is told.
    """

    def solve(first: Readings, here: Readings, off: dict[str, float]) -> tuple[float, float] | None:
        second = float(settings.sun_lux) * off["second"]
        rest, clip, lack = here.rest * off["rest"], here.clipped * off["clip"], here.lack * off["clip"]
        if settings.scale == LUX and settings.sun_facing is not None:  # the lamp may count in both
            one_all = first.rest * off["rest"] + first.clipped * off["clip"]
            one_lack = first.lack * off["clip"]
            ratio = second / (settings.lux * off["first"])
            below = lack - ratio * one_lack
            if below <= 1e-3 * lack:
                return None
            more = (ratio * one_all - rest - clip) / below
            total = one_all + more * one_lack
            return (1 + more * lack / clip, settings.lux * off["first"] / total) if total > 0 else None
        unit = scale * off["first"]
        if settings.scale == LUX:  # scale was lux / rest
            unit /= off["rest"]
        return (second / unit - rest) / clip, unit

    return solve


__all__ = ["METER", "PICTURE", "Readings", "calibrate", "finished", "illuminance"]
