"""The part of `lucarne bench strokes` about how changes reach surface: case `size/upsampling`.

At the paper's size (10,000 elements, about 27,000 vertices, a stroke of 300 marks), in the sample room. `ms`
is likeness to the stroke by all three weights, and changes of elements brought to all vertices, as both are
made while somebody paints; `ms_shares` finds which elements count where, once a mesh; `ms_paint` lays a
change near the stroke on objects as points, and `ms_lay` weighs these at the vertices. `error` is the most
that paint is off from what is wanted at vertices, relative to the largest change.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from studio.bench.harness import Report, timed
from studio.bench.interreflection_scenes import setting
from studio.headless import Headless
from studio_core.scene.diff import Changes
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import scene_view
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.stages import SurfaceParams, common_stages
from studio_plugins.slf.elements import Elements
from studio_plugins.slf.field import Decided, Field
from studio_plugins.slf.similarity import Reach, likeness_of
from studio_plugins.slf.spots import SLOTS, Spots
from studio_plugins.slf.spread import Spread
from studio_plugins.slf.upsampling import Upsampling

CASE = "size/upsampling"
VERTICES, ELEMENTS, MARKS = 27_000, 10_000, 300
RADIUS = 0.4
WIDTH = 7
"""Numbers of an element: matte colour, shine's colour, gloss."""
ALL, NEAR = Reach(1.0, 1.0, 1.0), Reach(near=20.0)
CHANGE = {"base_color": (0.1, -0.1, 0.05), "roughness": -0.1}
REPEATS = 7


def upsampling(report: Report, program: Headless) -> None:
    """`ms`, `ms_likeness`, `ms_upsampling`, `ms_shares`, `ms_paint`, `ms_lay`, and counts and `error`."""
    one = setting("sample", program)
    if not report.wants(CASE) or one is None:
        return
    scene, workers = one.scene, program.services.workers
    pipeline = Pipeline(common_stages(program.services))
    view = replace(scene_view(scene, None, 960, 540), antialias=1)
    pipeline.update(Frame(scene, view, SurfaceParams(VERTICES), 1), Changes(), Job("bench"))
    surfaces = pipeline.artifact(Surfaces)
    spread = Spread(program.services)
    spots = spread.spots(scene, surfaces)
    marks = stroke(spots)
    elements = Elements.of(surfaces.unrefined.mesh, spots.model >= 0, ELEMENTS)
    sources = spots.some(elements.vertex)
    changes = np.random.default_rng(0).normal(size=(len(elements), WIDTH)).astype(np.float32)
    shares = Upsampling.of(sources, spots)
    repeats = 1 if report.quick else REPEATS
    likeness = timed(lambda: likeness_of(spots, marks, ALL, workers), repeats)
    between = timed(lambda: shares(changes), repeats)
    found = timed(lambda: Upsampling.of(sources, spots), repeats)
    field = Field([[Decided(marks, NEAR, CHANGE)]])
    laid = timed(lambda: spread(scene, surfaces, field), repeats)
    report.add(CASE, "vertices", len(spots), "1")
    report.add(CASE, "elements", len(elements), "1")
    report.add(CASE, "marks", len(marks), "1")
    report.add(CASE, "ms", 1000 * (likeness.median + between.median), "ms")
    for name, timing in (("likeness", likeness), ("upsampling", between), ("shares", found), ("paint", laid)):
        report.add(CASE, f"ms_{name}", 1000 * timing.median, "ms", 1000 * timing.spread)
    paint = spread(scene, surfaces, field)
    report.add(CASE, "points", sum(len(one.places) for one in paint.values()), "1")
    wanted, mesh = field.at(spots), surfaces.unrefined.mesh
    worst, most = 0.0, 0.0
    for node, coat in paint.items():
        own = mesh.vertices_of(mesh.index_of(node))
        placed = mesh.objects[mesh.index_of(node)].mesh
        weights = coat.weights(placed.positions, placed.normals, placed.slot)
        for name in coat.changes:
            scale = np.abs(wanted[name]).max()
            worst = max(worst, np.abs(weights(coat.change(name)) - wanted[name][own]).max() / scale)
        taken = timed(lambda: coat.weights(placed.positions, placed.normals, placed.slot), repeats)  # noqa: B023
        most += 1000 * taken.median
    report.add(CASE, "ms_lay", most, "ms")
    report.add(CASE, "error", worst, "1")


def stroke(spots: Spots) -> Spots:
    """Marks about the middle of the largest part that faces up, like its nearest vertices."""
    up = np.flatnonzero(spots.normal[:, 1] > 0.9)
    parts, counts = np.unique(spots.part[up], return_counts=True)
    own = up[spots.part[up] == parts[np.argmax(counts)]]
    middle = np.median(spots.place[own], axis=0)
    centre = own[np.argmin(np.linalg.norm(spots.place[own] - middle, axis=1))]
    turn = np.arange(MARKS) * 2.399963
    away = RADIUS * np.sqrt((np.arange(MARKS) + 0.5) / MARKS)
    places = spots.place[centre] + np.stack([away * np.cos(turn), 0 * turn, away * np.sin(turn)], axis=1)
    near = own[np.argmin(np.linalg.norm(spots.place[own][None] - places[:, None], axis=2), axis=1)]
    assert (spots.part[near] // SLOTS == spots.part[centre] // SLOTS).all()
    return replace(spots.some(near), place=places.astype(np.float32))


__all__ = ["CASE", "stroke", "upsampling"]
