"""Parts of `lucarne bench cuts` that are no drag of a hand: settling, opening a project, memory.

`settle`: an object was dragged and stands where it began; how long until the refined picture is final, and
how wrong that is: matte materials that Mitsuba has, `settle-glossy` with its metal, `settle-own` the room as
it is, where only our own brute force can tell. `precompute`: everything with an empty cache folder, and with
a full one. `memory`: what is stored, `memory-working`: what one view's shading takes on top.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from studio.bench.cuts_cases import State, drags
from studio.bench.cuts_measure import Editor, Measured, kept_bytes
from studio.bench.cuts_scenes import NATIVE, OWN, prefix_of
from studio.bench.harness import Timing
from studio_core.shading.artifacts import Radiance
from studio_core.shading.error_meter import ErrorMeter
from studio_core.shading.job import Job

if TYPE_CHECKING:
    from studio.bench.cuts import Suite

PLACES = 1024
DRAGGED = 4
SETTLES = {"settle": NATIVE["diffuse"], "settle-glossy": NATIVE["glossy"], "settle-own": OWN}


def settle(suite: Suite, environment: str, case: str) -> None:
    """Antialiased, refined pictures at rest after a drag; `case` is one of SETTLES."""
    name, materials = f"{prefix_of(environment)}{case}", SETTLES[case]
    suite.say(name)
    base = suite.base(environment, materials)
    rest = State(base.scene, dataclasses.replace(base.view, antialias=2))
    moving, exact = suite.params(), suite.params(refine=True)
    editor = Editor(suite.backend, suite.services)
    editor.go(base, moving, moving=False)
    found = Measured()
    vertices = 0
    for _ in range(suite.setup.settles):
        for state in drags(base, DRAGGED + 1, materials):
            editor.go(state, moving, moving=True)
        step, picture = editor.go(rest, exact, moving=False)
        found.steps.append(step)
        vertices = len(picture.radiance.valid)
    suite.rows(name, found)
    suite.report.add(name, "vertices", vertices, "1")
    peer = suite.peer(environment, materials)
    if peer is not None:
        suite.compare(name, "picture_rel_rmse", peer, picture.linear, found.timing("seconds").median)
    assert editor.frame is not None
    meter = ErrorMeter(suite.services, PLACES)(editor.pipeline, editor.frame, Job("bench"))
    if meter is not None:
        value = meter.picture
        suite.report.add(name, "metered_picture_rel_rmse", value.relative_rmse, "1", value.uncertainty)


def opening(suite: Suite, prefix: str, method: str) -> None:
    """Seconds from nothing to everything, again with the cache, and the bytes of both."""
    name = f"{prefix}precompute"
    suite.say(name)
    base = suite.base("windows", "glossy")
    params = suite.params(method=method)
    make = getattr(suite.backend, "precompute", None)
    cold: dict[str, list[float]] = {}
    warm: dict[str, list[float]] = {}
    told: Mapping[str, int | float] = {}
    size = 0
    for number in range(suite.setup.opens):
        services = suite.services_in(f"{method}-{number}")
        for into in (cold, warm):
            editor = Editor(suite.backend, services)
            step, _ = editor.go(base, params, moving=False)
            into.setdefault("first", []).append(step.first)
            into.setdefault("all", []).append(step.seconds)
        if make is not None:
            services = suite.services_in(f"{method}-{number}-all")
            for into in (cold, warm):
                started = time.perf_counter()
                told = make(base.scene, base.view, params, services, Job("bench"))
                into.setdefault("made", []).append(time.perf_counter() - started)
        size = folder_bytes(suite.folder / f"{method}-{number}{'-all' if make is not None else ''}")
    key = "made" if make is not None else "all"
    for metric, values in (
        ("ms", cold[key]),
        ("cached_ms", warm[key]),
        ("first_picture_ms", cold["first"]),
        ("cached_first_picture_ms", warm["first"]),
        ("view_ms", cold["all"]),
        ("cached_view_ms", warm["all"]),
    ):
        timing = Timing.of(values)
        suite.report.add(name, metric, 1000 * timing.median, "ms", 1000 * timing.spread)
    suite.report.add(name, "bytes", size, "B")
    if told:
        suite.detail(name, told=dict(told))
    memory(suite, prefix, editor, step.counts)


def memory(suite: Suite, prefix: str, editor: Editor, counts: Mapping[str, int]) -> None:
    """Bytes that the backend says it holds, and those of all arrays found in its artifacts."""
    for case, count in (("memory", "bytes_stored"), ("memory-working", "bytes_working")):
        if count in counts:
            suite.report.add(f"{prefix}{case}", "bytes", counts[count], "B")
    found = held(editor)
    suite.report.add(f"{prefix}memory", "found_bytes", sum(found.values()), "B")
    suite.detail(f"{prefix}memory", bytes=found)


def held(editor: Editor) -> dict[str, int]:
    """Bytes of the arrays in what the backend's own stages gave and keep, by kind of artifact.

    What all backends have (surfaces, casters, light trees) and the radiance itself do not count.
    """
    own = (type(editor.backend).__module__.rpartition(".")[0],)
    found: dict[str, int] = {}
    seen: set[int] = set()
    stages = [stage for stage in editor.pipeline.stages if type(stage).__module__.startswith(own)]
    for stage in stages:
        if stage.gives is not Radiance:
            artifact = editor.pipeline.artifact(stage.gives)
            found[stage.gives.__name__] = kept_bytes(artifact, own, seen)
    found["stages"] = sum(kept_bytes(stage, own, seen) for stage in stages)
    return found


def folder_bytes(folder: Path) -> int:
    """Bytes of all files below."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
