"""What each step says of itself: a mark, one line, and warnings. Pure functions of settings and results."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal
from weakref import ref

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import CaptureState, LensLight
from studio_core.capturing.settings import DUAL, NOT_CALIBRATED, CaptureSettings

MarkOf = Literal["done", "warning", "error", "working", "waiting"]
_SURE = 0.25  # relative noise of light that is resolved
_MOST = 6  # numbers that a line of the report tells


@dataclass(frozen=True)
class Told:
    """Of one step."""

    mark: MarkOf
    line: str = ""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class Step:
    """One of the panel: `parts` of a state belong to it, `section` of the settings is its first."""

    id: str
    title: str
    parts: tuple[str, ...]
    section: str


STEPS = (
    Step("photographs", "Photographs", ("brackets",), "bracket"),
    Step("light", "Light", ("response", "lights"), "radiance"),
    Step("lens", "Lens", ("circles", "registration"), "lens"),
    Step("reflections", "Reflections", ("reflections",), "reflections"),
    Step("join", "Join", ("stitched",), "stitch"),
    Step("calibration", "Calibration", ("captured",), "calibration"),
    Step("result", "Result", ("captured",), "calibration"),
)


def tell_all(
    state: CaptureState,
    settings: CaptureSettings,
    fresh: frozenset[str],
    *,
    busy: bool,
    error: str = "",
    missing: Sequence[str] = (),
) -> dict[str, Told]:
    """By step. The first step that is not up to date is the one at work, or the one that failed."""
    made: dict[str, Told] = {}
    blocked = False
    for step in STEPS:
        told = _LINES[step.id](state, settings)
        if step.id == "photographs" and missing:
            told = Told("warning", told.line, (*missing, *told.warnings))
        if not _there(step, fresh):
            mark: MarkOf = "waiting"
            if not blocked:
                mark = "error" if error and not busy else "working" if busy else "waiting"
            warnings = (error,) if mark == "error" else ()
            line = error if mark == "error" else told.line if _there(step, _parts(state)) else ""
            told, blocked = Told(mark, line, warnings), True
        made[step.id] = told
    return made


def _parts(state: CaptureState) -> frozenset[str]:
    names = {part for step in STEPS for part in step.parts}
    return frozenset(n for n in names if getattr(state, n) is not None and getattr(state, n) != {})


def _there(step: Step, parts: frozenset[str]) -> bool:
    if step.id == "lens":
        return "circles" in parts or "stitched" in parts
    if step.id == "light":
        return "lights" in parts
    if step.id == "reflections":
        return "reflections" in parts or "stitched" in parts
    return set(step.parts) <= parts


def _said(line: str, warnings: Sequence[str]) -> Told:
    return Told("warning" if warnings else "done", line, tuple(dict.fromkeys(warnings)))


def _photographs(state: CaptureState, settings: CaptureSettings) -> Told:
    brackets = state.brackets
    if brackets is None:
        return Told("waiting")
    parts = [f"{len(bracket.shots)} {side}" for side, bracket in brackets.sides.items()]
    line = (
        f"{' and '.join(parts)}, {brackets.layout}"
        if brackets.layout != DUAL
        else (f"{sum(len(b.shots) for b in brackets.sides.values())} exposures, {brackets.layout}")
    )
    return _said(line, brackets.notes)


def _light(state: CaptureState, settings: CaptureSettings) -> Told:
    warnings: list[str] = []
    if state.response is not None:
        warnings += state.response.notes
    for side, light in state.lights.items():
        warnings += light.exposures.notes or exposure_warnings(side, light)
        warnings += light.notes
        shaken = sum(not motion.trusted for motion in light.motions)
        if shaken:
            what = "exposure" if shaken == 1 else "exposures"
            warnings.append(f"{shaken} {what} of the {side} could not be aligned and stayed as they are.")
    if not state.lights:
        return Told("waiting")
    stops = [_once(light, span) for light in state.lights.values()]
    share = max(_once(light.clipped, _share) for light in state.lights.values())
    line = f"{max(stops):.0f} stops of light"
    if state.response is not None and not state.response.measured:
        line += ", response assumed"
    line += f", {percent(share)} clipped in every exposure" if share > 0 else ", nothing clipped"
    return _said(line, warnings)


_measured: dict[int, tuple[ref[Any], float]] = {}


def _once(thing: Any, measure: Callable[[Any], float]) -> float:
    """What was measured of a result is kept as long as it."""
    key = id(thing)
    found = _measured.get(key)
    if found is None or found[0]() is not thing:
        found = (ref(thing), measure(thing))
        _measured[key] = found
        for old in [k for k, (there, _) in _measured.items() if there() is None]:
            del _measured[old]
    return found[1]


def _share(mask: npt.NDArray[np.bool_]) -> float:
    return float(mask.mean())


def exposure_warnings(side: str, light: LensLight) -> list[str]:
    """A sentence for every exposure that is not what the photographs say."""
    found = []
    for index in light.exposures.wrong:
        listed, solved = light.exposures.listed[index], light.exposures.solved[index]
        found.append(
            f"Exposure {index + 1} of the {side} is listed as {listed:+.2f} EV and measured as {solved:+.2f}."
        )
    return found


def span(light: LensLight) -> float:
    """Stops between the darkest and the brightest light of a lens that is resolved."""
    skip = max(1, int((light.light.shape[0] * light.light.shape[1] / 100_000) ** 0.5))
    pixels, noise = light.light[::skip, ::skip].max(axis=-1), light.noise[::skip, ::skip]
    lit = pixels[(pixels > 0) & ~light.dark[::skip, ::skip] & (noise < _SURE)]
    if not lit.size:
        return 0.0
    low, high = np.percentile(lit, (0.5, 99.99))
    return float(np.log2(high / low))


def _lens(state: CaptureState, settings: CaptureSettings) -> Told:
    warnings = [
        f"The circle of the {side} is uncertain: look at it and drag it if it does not fit."
        for side, found in state.circles.items()
        if found.confidence < 0.5 and not found.by_hand
    ]
    registration = state.registration
    if registration is None:
        return _said(", ".join(f"{side} found" for side in state.circles), warnings)
    line = f"{registration.lens.model}, {registration.lens.fov:.1f}°"
    if registration.matches:
        line += f", {registration.spread:.2f}° between the lenses"
    if len(state.circles) > 1 and not registration.trusted and not registration.notes:
        warnings.append("How the lenses stand to each other could not be found: they are taken back to back.")
    return _said(line, [*warnings, *registration.notes])


def _reflections(state: CaptureState, settings: CaptureSettings) -> Told:
    if state.reflections is None:
        return Told("done", "No lens pictures") if state.stitched is not None else Told("waiting")
    used = [patch for patch in state.reflections.patches if patch.used]
    line = "None found" if not state.reflections.patches else f"{len(used)} replaced"
    if len(used) < len(state.reflections.patches):
        line += f", {len(state.reflections.patches) - len(used)} switched off"
    return _said(line, state.reflections.notes)


def _join(state: CaptureState, settings: CaptureSettings) -> Told:
    if state.stitched is None:
        return Told("waiting")
    height, width = state.stitched.light.shape[:2]
    unseen = _once(state.stitched.unseen, _share)
    line = f"{width} × {height}" + (f", {percent(unseen)} never seen" if unseen > 0 else "")
    if state.stitched.levelled is not None:
        line += f", levelled by {state.stitched.levelled:.1f}°"
    return _said(line, state.stitched.notes if state.stitched.levelled is None else ())


def _calibration(state: CaptureState, settings: CaptureSettings) -> Told:
    if state.captured is None:
        return Told("waiting")
    found = state.captured.calibration
    if found.luminance_scale is None:
        line = NOT_CALIBRATED.capitalize()
    else:
        line = f"{found.luminance_scale:.4g} cd/m² for 1, ± {percent(found.scale_uncertainty)}"
    if found.sun != 1:
        line += f"; clipped light × {found.sun:.3g} ± {percent(found.sun_uncertainty)}"
    return _said(line, found.notes)


def _result(state: CaptureState, settings: CaptureSettings) -> Told:
    if state.captured is None:
        return Told("waiting")
    image = state.captured.environment.pixels
    line = f"{image.shape[1]} × {image.shape[0]}, cube of {state.captured.faces.shape[1]}"
    return Told("done", line)


def percent(share: float) -> str:
    """Of a share; two digits, more where they stand before the point."""
    return f"{100 * share:.0f} %" if share >= 0.995 else f"{100 * share:.2g} %"


_LINES: Mapping[str, Callable[[CaptureState, CaptureSettings], Told]] = {
    "photographs": _photographs,
    "light": _light,
    "lens": _lens,
    "reflections": _reflections,
    "join": _join,
    "calibration": _calibration,
    "result": _result,
}


@dataclass(frozen=True)
class Line:
    """A line of the report, with those under it."""

    name: str
    value: str = ""
    below: tuple[Line, ...] = ()


def report_lines(report: Mapping[str, Any]) -> tuple[Line, ...]:
    """Name and value of everything in a report, what belongs together under one line."""
    return tuple(_line(_words(name), value) for name, value in report.items())


def _line(name: str, value: Any) -> Line:
    if isinstance(value, Mapping):
        below = report_lines({n: inner for n, inner in value.items() if n != "name"})
        return Line(name, str(value.get("name", "")), below)
    if isinstance(value, list | tuple):
        if any(isinstance(inner, Mapping) for inner in value):
            return Line(name, str(len(value)), tuple(_line(str(i), v) for i, v in enumerate(value, 1)))
        if value and all(isinstance(inner, str) for inner in value):
            return Line(name, str(len(value)), tuple(Line(str(i), v) for i, v in enumerate(value, 1)))
        if len(value) > _MOST:
            return Line(name, f"{len(value)} numbers")
        if any(isinstance(inner, list | tuple) for inner in value):
            return Line(name, "", tuple(_line(str(i), v) for i, v in enumerate(value, 1)))
    return Line(name, _value(value))


def _words(name: str) -> str:
    words = str(name).replace("_", " ")
    return words[:1].upper() + words[1:]


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        return f"{float(value):.4g}"
    if isinstance(value, np.ndarray):
        return _value(value.tolist())
    if isinstance(value, list | tuple):
        return ", ".join(_value(inner) for inner in value)
    return "–" if value is None else str(value)
