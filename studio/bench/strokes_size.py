"""All elements at the paper's size: `size/…`, among furniture (27,000 vertices, 10,000 elements).

`size/visibility` rays and links, `size/full-solve` light, tool, moments of 20 levels and the mixed choice,
`size/three-bounces`, `size/splatting` a frame's picture of the sky once the eye has moved, `size/memory` what
all of it keeps. `ms` is wall time, `cpu_ms` the time of all processors, both the least of some repeats:
machines are shared.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from studio.bench import strokes_lobes
from studio.bench.harness import Report
from studio.bench.interreflection_operator import Stand
from studio.bench.interreflection_scenes import setting
from studio.headless import Headless
from studio_core.scene.nodes import Light
from studio_core.shading.artifacts import Casters, Hits, Lighting, Shapes, Surfaces
from studio_core.shading.job import Job
from studio_core.shading.primary import visible_vertices
from studio_core.transport.operator import Transport
from studio_core.transport.reflectance import VertexCoefficients
from studio_plugins.slf.appearance import Appearance
from studio_plugins.slf.backend import ElementStage, Params
from studio_plugins.slf.links import cell_pattern, links
from studio_plugins.slf.lumitexels import LightField
from studio_plugins.slf.whole import Reflectances, Whole

CASES = ("visibility", "full-solve", "three-bounces", "splatting", "memory")
REPEATS = 3
NOISE = 0.02


def run(report: Report, program: Headless) -> None:
    """All that is wanted of lobes and sizes."""
    strokes_lobes.run(report)
    if not any(report.wants(f"size/{case}") for case in CASES):
        return
    one = setting("furniture", program)
    if one is None:
        report.notes.append("size/… needs the shared furniture, which is absent")
        return
    stand = Stand.of(one, program)
    surfaces, casters, lighting = (stand.get(kind) for kind in (Surfaces, Casters, Lighting))
    everything = np.ones(len(surfaces.mesh), np.bool_)
    lights = {light.id: light for light in stand.scene.of(Light) if stand.scene.shown(light.id)}
    whole = Whole(program.services.workers)
    whole.update(surfaces, casters, lighting, lights, everything, Job("bench"))
    if report.wants("size/visibility"):
        _visibility(report, whole, stand, program)
    row = stand.get(Shapes).rows(surfaces.mesh)[whole.elements.vertex].astype(np.int64)
    coefficients = VertexCoefficients(program.services)(stand.scene, surfaces)[whole.elements.vertex]
    now = Appearance().of(stand.get(Shapes), row, coefficients)
    if report.wants("size/full-solve"):
        _solve(report, whole, now)
    if report.wants("size/three-bounces"):
        _least(report, "size/three-bounces", lambda: whole.after(3, now))
    if report.wants("size/splatting"):
        _splatting(report, stand, program)
    if report.wants("size/memory"):
        field = LightField(len(whole.elements)).nbytes
        report.add("size/memory", "bytes", whole.nbytes + 2 * field, "B")


def _least(report: Report, case: str, call: Callable[[], Any]) -> Any:
    """`ms` and `cpu_ms` of a call, after one that is not measured; what it gave last."""
    made, wall, used = call(), [], []
    for _ in range(REPEATS):
        started, before = time.perf_counter(), time.process_time()
        made = call()
        wall.append(time.perf_counter() - started)
        used.append(time.process_time() - before)
    report.add(case, "ms", 1000 * min(wall), "ms", 500 * (max(wall) - min(wall)))
    report.add(case, "cpu_ms", 1000 * min(used), "ms", 500 * (max(used) - min(used)))
    return made


def _visibility(report: Report, whole: Whole, stand: Stand, program: Headless) -> None:
    surfaces, casters, workers = stand.get(Surfaces), stand.get(Casters), program.services.workers
    some = np.zeros(len(surfaces.mesh), np.bool_)
    some[whole.elements.vertex] = True

    def traced() -> int:
        made = Transport(workers, cell_pattern(), 1 << 30)
        counts = made.update(surfaces, casters, some, Job("bench"))
        links(surfaces.mesh, whole.elements, made, whole.frames, 0, workers)
        return counts.rays

    rays = _least(report, "size/visibility", traced)
    report.add("size/visibility", "rays", rays, "1")
    report.add("size/visibility", "elements", len(whole.elements), "1")


def _solve(report: Report, whole: Whole, now: Reflectances) -> None:
    """Wanted is what elements send that have half the matte part, with noise."""
    rng = np.random.default_rng(1)
    other = Reflectances(0.5 * now.diffuse, now.specular, now.level)
    dark = whole.dark()
    noise = 1 + NOISE * rng.standard_normal((len(whole.elements), 3, 1, 1)).astype(np.float32)

    def tool(own: slice, sent: Any) -> Any:
        half = whole.sent(whole.incident(dark, own.start, own.stop), other, own.start)
        return half * noise[own]

    made = _least(
        report, "size/full-solve", lambda: whole.solve(lambda own, sent: sent * noise[own], now, dark)
    )
    for metric, count in made.counts.items():
        report.add("size/full-solve", metric, count, "1")
    changed = whole.solve(tool, now, dark)
    lit = ~changed.flagged & (now.diffuse.max(axis=1) > 0.02)
    off = np.abs(changed.reflectances.diffuse - other.diffuse)[lit].mean() / other.diffuse[lit].mean()
    report.add("size/full-solve", "value_error", float(off), "1")


def _splatting(report: Report, stand: Stand, program: Headless) -> None:
    """The sky's layer of what the camera sees, elements and what they see being known."""
    surfaces, shapes, hits = stand.get(Surfaces), stand.get(Shapes), stand.get(Hits)
    stage = ElementStage(program.services)
    elements = Params().elements
    stage.follow(surfaces, stand.get(Casters), stand.get(Lighting), elements, Job("bench"))
    points = np.flatnonzero(visible_vertices(surfaces, hits))
    eye = np.array([0.3, 1.5, 5.4]) - surfaces.mesh.origin
    _least(report, "size/splatting", lambda: stage.splatted(surfaces, shapes, points, eye))
    report.add("size/splatting", "vertices", len(points), "1")
    report.add("size/splatting", "bytes", stage.nbytes, "B")
