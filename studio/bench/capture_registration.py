"""How well lenses are registered: whole captures up to that step, of more phones than the other rows have."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from studio.bench import capture
from studio.bench.capture_measure import angle_between
from studio.bench.harness import Report
from studio.bench.phone import shoot
from studio.headless import Headless

CASE = "registration"


def measure(
    report: Report,
    program: Headless,
    rooms: Mapping[str, npt.NDArray[np.float32]],
    phones: int,
    radius: float,
) -> None:
    """Row `registration`: median, ninth of ten and worst angle of those that were registered, degrees.

    Without parallax and glare, as `MAP/default`. `unregistered`: share that was refused.
    """
    found: list[float] = []
    details: list[dict[str, object]] = []
    for index, (name, room) in enumerate(rooms.items()):
        for seed in range(phones):
            phone = replace(capture.drawn_phone(room, index, seed, radius), glare=0.0, parallax=0.0)
            shots = shoot(capture.dimmed(room, phone), phone, seed)
            settings = capture.with_sides(capture.settings_for(capture.CASES["default"], phone, 512), shots)
            run = program.registry.get("capturer", capture.CAPTURER).open(program.services)
            with program.job(f"{CASE} {name} {seed + 1}/{phones}") as job:
                state = run.run((*shots.front, *shots.back), settings, job, "registration")
            made = state.registration
            off = angle_between(made.rotation, shots.truth.rotation)
            details.append({"room": name, "phone": seed, "off": off, "trusted": made.trusted})
            if made.trusted:
                found.append(off)
    quantiles = np.quantile(found, (0.5, 0.9, 1.0)) if found else np.full(3, np.nan)
    for metric, value in zip(("median", "p90", "deg"), quantiles, strict=True):
        report.add(CASE, f"registration_{metric}", float(value), "°")
    report.add(CASE, "unregistered", 1 - len(found) / len(details), "1")
    report.add(CASE, "captures", len(details), "1")
    report.details[CASE] = details
