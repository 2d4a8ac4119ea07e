"""Two lenses with five exposures of 12 megapixels each, from files to files, in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report, peak_bytes
from studio.bench.phone import Arc, Phone, shoot
from studio.bench.phone_files import write_shots
from studio.bench.phone_response import Curve
from studio.headless import Headless
from studio_core.errors import LucarneError
from studio_core.imaging.projection import Circle

CHILD = "from studio.bench.capture_pipeline import child; child()"


def measure(
    report: Report, program: Headless, room: npt.NDArray[np.float32], megapixels: float, folder: Path
) -> None:
    """Rows `pipeline`: `s` and `peak_bytes` (of the program and, on top, of its largest child process)."""
    with program.job(f"{megapixels:g} megapixels") as job:
        job.checkpoint(0, 2)
        front, back = files(room, megapixels, folder)
        job.checkpoint(1, 2)
        command = ["capture", "--front", *front, "--back", *back]
        command += ["-o", str(folder / "room.exr"), "--cubemap", str(folder / "cube"), "--json", "--quiet"]
        found = in_child(command)
    report.add("pipeline", "s", found["seconds"], "s")
    report.add("pipeline", "cpu_s", found["cpu_seconds"], "s")
    report.add("pipeline", "peak_bytes", found["peak_bytes"], "B")
    report.add("pipeline", "own_peak_bytes", found["own_peak_bytes"], "B")
    report.details["pipeline"] = {"megapixels": megapixels, **found}


def files(room: npt.NDArray[np.float32], megapixels: float, folder: Path) -> tuple[list[str], list[str]]:
    """JPEG files of 4:3 photographs of the room."""
    width = int(round((megapixels * 1e6 * 4 / 3) ** 0.5 / 4) * 4)
    height = width * 3 // 4
    circle = Circle(0.503 * width, 0.495 * height, 0.46 * height)
    phone = replace(
        Phone(size=(width, height), circle=circle, samples=1),
        evs=(-6.0, -4.0, -2.0, 0.0, 2.0),
        curve=Curve("filmic", 2.2, 0.5),
        arcs=(Arc("front", 40, 50, 6, 1.2), Arc("back", 200, 35, 5, 1.0)),
        misalignment=(1.2, -0.8, 1.5),
        shake=0.1,
        parallax=1.0,
        falloff=0.2,
        jpeg=95,
    )
    front, back = write_shots(shoot(room, phone, 1), folder)
    return [str(path) for path in front], [str(path) for path in back]


def in_child(command: list[str]) -> dict[str, float]:
    """Runs `lucarne` in a fresh process: seconds with its start, and bytes of memory at their peak."""
    made = subprocess.run(
        [sys.executable, "-c", CHILD, *command], capture_output=True, text=True, check=False, timeout=1800
    )
    try:
        found = json.loads(made.stderr.strip().splitlines()[-1])
    except (IndexError, ValueError):
        found = {"status": made.returncode}
    if found.get("status") != 0:
        raise LucarneError(f"lucarne {command[0]} ended with {found.get('status')}: {made.stderr[-300:]}")
    return {name: float(value) for name, value in found.items()}


def child() -> None:
    """One command; the last line on stderr tells what it took."""
    import resource

    from studio.cli import main

    started = time.perf_counter()
    status = main(sys.argv[1:])
    seconds = time.perf_counter() - started
    mine, others = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    own, other = peak_bytes(), others.ru_maxrss * 1024
    cpu = sum(used.ru_utime + used.ru_stime for used in (mine, others))
    told = {"status": status, "seconds": seconds, "cpu_seconds": cpu}
    told |= {"own_peak_bytes": own, "peak_bytes": own + other}
    print(json.dumps(told), file=sys.stderr)
