"""The end of a capture: calibrated light, the cube map, what was not resolved, and the report."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from studio_core.capturing.artifacts import Captured, CaptureState, Registration, Response
from studio_core.capturing.report import plain
from studio_core.capturing.settings import CaptureSettings
from studio_core.capturing.standing import angles_of
from studio_core.imaging.latlong import pixel_solid_angles
from studio_core.shading.job import Job
from studio_plugins.capture.calibrate import calibrate, finished

_CURVE = 65  # points of the response curve that are told


def captured(state: CaptureState, settings: CaptureSettings, job: Job) -> Captured:
    """The last stage: `state` has everything before it."""
    stitched = state.stitched
    if stitched is None:
        raise ValueError("there is no picture yet")
    job.checkpoint(0, 2)
    light, calibration = calibrate(stitched, settings.calibration)
    job.checkpoint(1, 2)
    made = finished(stitched, light, calibration, settings.stitch.face, (*state.notes, *calibration.notes))
    return dataclasses.replace(made, report=plain(_report(state, made)))


def _report(state: CaptureState, made: Captured) -> dict[str, Any]:
    """What was found, in plain numbers; angles in degrees, exposures in EV, curves in log2."""
    height, width = made.unresolved.shape
    area = np.broadcast_to(pixel_solid_angles(height, width)[:, None], (height, width)) / (4 * np.pi)
    shares = {
        name: float(area[made.unresolved == kind].sum())
        for kind, name in enumerate(("clipped", "dark", "unseen"), 1)
    }
    return {
        "layout": state.brackets.layout if state.brackets else "",
        "photographs": _photographs(state),
        "response": _response(state.response),
        "circles": {
            side: _fields(one.circle) | {"confidence": one.confidence} for side, one in state.circles.items()
        },
        "registration": _registration(state.registration),
        "reflections": [_fields(patch) for patch in state.reflections.patches] if state.reflections else [],
        "levelled": state.stitched.levelled if state.stitched else None,
        "size": [width, height],
        "share_of_all_directions": shares,
        "calibration": _fields(made.calibration),
        "notes": list(dict.fromkeys((*state.notes, *made.calibration.notes))),
    }


def _photographs(state: CaptureState) -> list[dict[str, Any]]:
    """Each shot as often as a lens uses it: two circles in one picture are told twice."""
    told = []
    for side, light in state.lights.items():
        brackets = state.brackets.sides if state.brackets else {}
        bracket = brackets.get(side) or next(iter(brackets.values()))
        exposures = light.exposures
        for i, shot in enumerate(bracket.shots):
            told.append(
                {
                    "name": shot.facts.name,
                    "side": side,
                    "listed_ev": exposures.listed[i],
                    "certain": bracket.certain[i],
                    "ev": exposures.solved[i],
                    "wrong": i in exposures.wrong,
                    "motion": _fields(light.motions[i]),
                }
            )
    return told


def _response(response: Response | None) -> dict[str, Any] | None:
    if response is None:
        return None
    at = np.linspace(0, response.curve.shape[1] - 1, _CURVE)
    levels = np.arange(response.curve.shape[1])
    return {
        "measured": response.measured,
        "rms_log2": response.rms,
        "top": response.top,
        "black": response.black,
        "white": response.white,
        "noise": response.noise,
        "number": at / levels[-1],
        "log2_exposure": [np.interp(at, levels, curve) for curve in response.curve],
    }


def _registration(found: Registration | None) -> dict[str, Any] | None:
    if found is None:
        return None
    yaw, pitch, roll = angles_of(found.rotation)
    return {
        "yaw": yaw,
        "pitch": pitch,
        "roll": roll,
        "lens": found.lens.model,
        "fov": found.lens.fov,
        "gain": found.gain,
        "falloff": found.falloff,
        "spread": found.spread,
        "matches": found.matches,
        "trusted": found.trusted,
    }


def _fields(value: Any) -> dict[str, Any]:
    return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
