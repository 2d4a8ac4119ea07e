"""How time and memory of `lucarne bench cuts` grow: with vertices, with objects, with directions.

Each quantity is fitted by a power law; `…_exponent` is what it grows by (1: in proportion). Rows of single
places are named growth/KIND/SIZE. Opening is timed once, and so is the one edit of each kind at the largest.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from studio.bench.cuts_cases import Path, State, drags, sliders
from studio.bench.cuts_keeping import held
from studio.bench.cuts_measure import Editor, measured
from studio.bench.cuts_scenes import hall
from studio.bench.harness import PowerLaw
from studio_core.scene.nodes import Environment
from studio_core.shading.offline import scene_view

if TYPE_CHECKING:
    from studio.bench.cuts import Suite

METRICS = {"open_ms": "ms", "brdf_ms": "ms", "preview_ms": "ms", "exact_ms": "ms", "bytes": "B"}
FEW, MANY = 5, 64


@dataclass(frozen=True)
class Steps:
    """Where it is measured, and by how many edits."""

    vertices: tuple[int, ...] = (3000, 10_000, 30_000, 100_000, 300_000)
    objects: tuple[int, ...] = (1, 2, FEW, 16, MANY)
    directions: tuple[int, ...] = (10, 12, 14, 15, 16, 17)
    edits: int = 3


QUICK = Steps((3000, 10_000, 30_000, 100_000), (FEW, MANY), (11, 13, 15), 2)
LARGE_VERTICES, LARGE_LEVEL = 100_000, 15
"""Beyond, one edit is timed."""


def run(suite: Suite, steps: Steps) -> None:
    """All three; and dragging one of many objects against one of few."""
    room = suite.base("windows", "glossy")

    def at_vertices(size: int) -> dict[str, float]:
        edits = steps.edits if size <= LARGE_VERTICES else 1
        return place(suite, room, suite.params(vertices=size), edits)

    def at_directions(level: int) -> dict[str, float]:
        edits = steps.edits if level <= LARGE_LEVEL else 1
        return place(suite, room, suite.params(directions=str(1 << level)), edits)

    def at_objects(count: int) -> dict[str, float]:
        scene = hall(count, next(room.scene.of(Environment)).image)
        view = scene_view(scene, None, suite.view.width, suite.view.height)
        state = State(scene, dataclasses.replace(view, antialias=1))
        return place(suite, state, suite.params(), steps.edits, f"table-{count // 2}")

    grow(suite, "vertices", steps.vertices, at_vertices)
    grow(suite, "directions", [1 << level for level in steps.directions], lambda s: at_directions(log2(s)))
    found = grow(suite, "objects", steps.objects, at_objects)
    if FEW in found and MANY in found:
        for metric in ("preview_ms", "exact_ms"):
            ratio = found[MANY][metric] / found[FEW][metric]
            suite.report.add("growth/objects", f"{metric[:-3]}_{MANY}_over_{FEW}", ratio, "1")


def log2(size: int) -> int:
    """Of a power of two."""
    return size.bit_length() - 1


def grow(
    suite: Suite, kind: str, sizes: Sequence[int], at: Callable[[int], dict[str, float]]
) -> dict[int, dict[str, float]]:
    """Measure at each size and fit; what was found by size."""
    found: dict[int, dict[str, float]] = {}

    def measure(name: str, size: int) -> None:
        found[size] = at(size)
        for metric, value in found[size].items():
            suite.report.add(name, metric, value, METRICS.get(metric, "1"))

    for size in sizes:
        name = f"growth/{kind}/{size}"
        suite.part(name, partial(measure, name, size))
    for metric in METRICS:
        pairs = [(size, values[metric]) for size, values in found.items() if values.get(metric, 0) > 0]
        if len(pairs) > 1:
            law = PowerLaw.fit(*zip(*pairs, strict=True))
            suite.report.add(f"growth/{kind}", f"{metric}_exponent", law.exponent, "1", law.misfit)
    suite.report.keep()
    return found


def place(suite: Suite, base: State, params: Any, edits: int, node: str | None = None) -> dict[str, float]:
    """Milliseconds of the backend's stages: opening without a cache, materials, preview, exact; bytes."""
    editor = Editor(suite.backend, suite.uncached())
    first, picture = editor.go(base, params, moving=False)

    def dragging(state: State, count: int, materials: str) -> list[State]:
        return drags(state, count, materials, node)

    def median(path: Path, moving: bool) -> float:
        states = path(base, edits + 1, "glossy")
        done = measured(editor, states, moving, params, suite.program.registry, ())
        return 1000 * done.timing("own").median

    return {
        "open_ms": 1000 * first.own,
        "brdf_ms": median(sliders, True),
        "preview_ms": median(dragging, True),
        "exact_ms": median(dragging, False),
        "bytes": float(sum(held(editor).values())),
        "vertices": float(len(picture.radiance.valid)),
        "visible": float(picture.radiance.valid.sum()),
    }
