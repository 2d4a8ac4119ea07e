"""Parts of `lucarne bench cuts` that are no drag of a hand: settling, opening a project, memory.

`settle`: an object was dragged and stands where it began; how long until the refined picture is final, and
how wrong that is: matte materials that Mitsuba has, `settle-glossy` with its metal, `settle-own` the room as
it is, where only our own brute force can tell, `settle-truer…` with the control further to truer.
`precompute`: everything with an empty cache folder, and with a full one. `memory`: visibility as it is held,
`memory-working`: what one view's shading takes on top.
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass
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
TARGETS = (0.05, 0.03, 0.02)
DRAGGED = 4


@dataclass(frozen=True)
class Settle:
    """Materials, and the quality control (None: as it comes)."""

    materials: str
    quality: float | None = None


SETTLES = {
    "settle": Settle(NATIVE["diffuse"]),
    "settle-glossy": Settle(NATIVE["glossy"]),
    "settle-own": Settle(OWN),
    "settle-truer": Settle(NATIVE["diffuse"], 0.75),
    "settle-truer-glossy": Settle(NATIVE["glossy"], 0.75),
}


def settle(suite: Suite, environment: str, case: str) -> None:
    """Antialiased, refined pictures at rest after a drag; `case` is one of SETTLES."""
    name, wanted = f"{prefix_of(environment)}{case}", SETTLES[case]
    materials = wanted.materials
    base = suite.base(environment, materials)
    rest = State(base.scene, dataclasses.replace(base.view, antialias=2, fine_edges=True))
    quality = {} if wanted.quality is None else {"quality": wanted.quality}
    moving, exact = suite.params(**quality), suite.params(refine=True, **quality)
    found = Measured()
    for _ in range(suite.setup.settles):
        editor = Editor(suite.backend, suite.services)
        editor.go(base, moving, moving=False)
        for state in drags(base, DRAGGED + 1, materials):
            editor.go(state, moving, moving=True)
        step, picture = editor.go(rest, exact, moving=False)
        found.steps.append(step)
    suite.rows(name, found)
    suite.report.add(name, "vertices", len(picture.radiance.valid), "1")
    peer = suite.peer(environment, materials)
    if peer is not None:
        errors = [(seconds, peer.error(linear)) for seconds, linear in editor.shown]
        suite.report.add(name, "picture_rel_rmse", errors[-1][1], "1", peer.noise)
        for target in TARGETS:
            reached = [seconds for seconds, error in errors if error <= target]
            if reached:
                suite.report.add(name, f"ms_to_{target:g}", 1000 * reached[0], "ms")
        suite.detail(name, pictures=[(round(seconds, 3), round(error, 5)) for seconds, error in errors])
    assert editor.frame is not None
    meter = ErrorMeter(suite.services, PLACES)(editor.pipeline, editor.frame, Job("bench"))
    if meter is not None:
        value = meter.picture
        suite.report.add(name, "metered_picture_rel_rmse", value.relative_rmse, "1", value.uncertainty)


def opening(suite: Suite, prefix: str, method: str) -> None:
    """Seconds from nothing to everything, again with the cache, and the bytes of both."""
    name = f"{prefix}precompute"
    base = suite.base("windows", "glossy")
    params = suite.params(method=method)
    make = getattr(suite.backend, "precompute", None)
    taken: dict[str, list[float]] = {}
    told: list[dict[str, int | float]] = []
    size = 0

    def note(metric: str, seconds: float) -> None:
        taken.setdefault(metric, []).append(1000 * seconds)

    for number in range(suite.setup.opens):
        services = suite.services_in(f"{method}-{number}")
        first, _ = Editor(suite.backend, services).go(base, params, moving=False)
        note("first_picture_ms", first.first)
        note("view_ms", first.seconds)
        if make is not None:
            services = suite.services_in(f"{method}-{number}-all")
            for metric in ("ms", "cached_ms"):
                started = time.perf_counter()
                told.append(dict(make(base.scene, base.view, params, services, Job("bench"))))
                note(metric, time.perf_counter() - started)
        editor = Editor(suite.backend, services)
        again, _ = editor.go(base, params, moving=False)
        note("cached_first_picture_ms", again.first)
        note("cached_view_ms", again.seconds)
        size = folder_bytes(suite.folder / f"{method}-{number}{'' if make is None else '-all'}")
    for metric, values in taken.items():
        timing = Timing.of(values)
        suite.report.add(name, metric, timing.median, "ms", timing.spread)
    suite.report.add(name, "bytes", size, "B")
    if told:
        suite.detail(name, told=told[:2])
    memory(suite, prefix, editor)


def memory(suite: Suite, prefix: str, editor: Editor) -> None:
    """Bytes of the arrays that the backend's first own stage keeps (visibility), and of the later ones."""
    found = held(editor)
    first = next(iter(found), "")
    suite.report.add(f"{prefix}memory", "bytes", found.get(first, 0), "B")
    suite.report.add(f"{prefix}memory-working", "bytes", sum(found.values()) - found.get(first, 0), "B")
    suite.detail(f"{prefix}memory", bytes=found)


def held(editor: Editor) -> dict[str, int]:
    """Bytes of the arrays in what the backend's own stages gave and keep, by kind of artifact.

    What all backends have (surfaces, casters, light trees) and the radiance itself do not count.
    """
    own = (type(editor.backend).__module__.rpartition(".")[0],)
    found: dict[str, int] = {}
    seen: set[int] = set()
    for stage in editor.pipeline.stages:
        if type(stage).__module__.startswith(own):
            given = None if stage.gives is Radiance else editor.pipeline.artifact(stage.gives)
            found[stage.gives.__name__] = sum(kept_bytes(part, own, seen) for part in (given, stage))
    return found


def folder_bytes(folder: Path) -> int:
    """Bytes of all files below."""
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
