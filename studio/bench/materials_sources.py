"""Folders as strangers leave them, through `lucarne fit-material`, with half of the lights withheld.

Rows `sources/MATERIAL/KIND`: a ball of the lab, nine radii from the camera, under 38 lamps told with 0.5° and
3 % of error, a lamp that drifts by 1° and is 0.5° wide. `exr`: linear pictures; `jpeg`: one 8-bit exposure
each; `brackets`: five JPEG exposures of a camera with an S-shaped curve and a warm white, a folder a lamp,
azimuths counted to the wrong side, one exposure 1 EV off.
"""

from __future__ import annotations

import io
import json
import tempfile
import time
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path
from typing import Any

from studio.bench.harness import Report
from studio.bench.lab import LabShots, Rig, dome, shoot
from studio.bench.lab_cameras import Camera, write_bracketed
from studio.bench.lab_files import write_shots
from studio.bench.lab_surfaces import library
from studio.bench.phone_response import Curve
from studio.cli import main
from studio_core.errors import LucarneError
from studio_plugins.residual.samples import Ball, Lights

MATERIALS = ("textured", "glossy")
KINDS = ("exr", "jpeg", "brackets")
RIG = Rig(
    ball=Ball(118.4, 114.3, 104.7, 9.0), white=1e6,
    direction_error=0.5, strength_error=0.03, drift=1.0, lamp_size=0.5,
)  # fmt: skip
_WHITE = (1.2, 1.0, 0.7)
_TEXELS, _QUICK_TEXELS = 40, 24


def run(report: Report, program: object = None) -> None:
    """All that is asked for; `--quick`: brackets of one material on small maps."""
    before = len(report.rows)
    for material in MATERIALS[:1] if report.quick else MATERIALS:
        shots: LabShots | None = None
        for kind in KINDS[-1:] if report.quick else KINDS:
            name = f"sources/{material}/{kind}"
            if not report.wants(name):
                continue
            shots = shots or shoot(library()[material], dome((-30.0, 0.0, 30.0)), RIG, 3)
            found = fitted(shots, kind, _QUICK_TEXELS if report.quick else _TEXELS)
            for words, told in (
                ("", found["holdout"]["refined"]),
                ("as_told_", found["holdout"]["as_given"]),
            ):
                report.add(name, f"{words}holdout_nmse", told["holdout_nmse"], "1")
                report.add(name, f"{words}holdout_nmse_outside", told["holdout_nmse_outside"], "1")
            report.add(name, "parametric_nmse", found["holdout"]["refined"]["parametric_nmse"], "1")
            report.add(name, "ball_off", _off(found["ball"]), "px")
            report.add(name, "s", found["seconds"], "s")
            report.details[name] = found
            report.keep()
    if len(report.rows) > before:
        report.notes.append(
            "sources: a random half of the lights is withheld; as told, and refined by the finished material."
        )


def fitted(shots: LabShots, kind: str, texels: int) -> dict[str, Any]:
    """What `fit-material --report` says of the files of a kind, and the seconds it took."""
    with tempfile.TemporaryDirectory(prefix="lucarne-sources-") as made:
        folder, target = Path(made) / "pictures", Path(made) / "report.json"
        folder.mkdir()
        _WRITERS[kind](shots, folder)
        command = ["fit-material", str(folder), "--holdout", "0.5", "--size", str(texels), "--quiet"]
        if kind == "brackets":
            command += ["--white", ",".join(map(str, _WHITE))]
        started, said = time.perf_counter(), io.StringIO()
        with redirect_stdout(io.StringIO()), redirect_stderr(said):
            status = main([*command, "--report", str(target)])
        if status:
            raise LucarneError(f"lucarne fit-material ended with {status}: {said.getvalue()[-300:]}")
        found: dict[str, Any] = json.loads(target.read_text("utf-8"))
    return {**found, "seconds": time.perf_counter() - started}


def _off(ball: dict[str, float]) -> float:
    truth = {"x": RIG.ball.x, "y": RIG.ball.y, "radius": RIG.ball.radius}
    return max(abs(ball[key] - value) for key, value in truth.items())


def _exr(shots: LabShots, folder: Path) -> None:
    write_shots(shots, folder)


def _jpeg(shots: LabShots, folder: Path) -> None:
    write_bracketed(shots, folder, Camera(quality=92), lambda a, h, k, ev: f"ball_az{a:+.0f}_el{h:+.0f}")


def _brackets(shots: LabShots, folder: Path) -> None:
    told = Lights(shots.told.directions * [-1, 1, 1], shots.told.strengths, shots.told.names)
    camera = Camera(
        Curve("filmic"), quality=92, white=_WHITE, evs=(-5, -3, -1, 1, 2), listed=(-5, -3, -1, 1, 3)
    )
    write_bracketed(
        replace(shots, told=told), folder, camera, lambda a, h, k, ev: f"az{a:+.0f}_el{h:+.0f}/IMG_{k:04}"
    )


_WRITERS: dict[str, Callable[[LabShots, Path], None]] = {"exr": _exr, "jpeg": _jpeg, "brackets": _brackets}
