"""Part of `lucarne bench cuts`: the tables of the paper's section VI on the sample room.

`paper/table`: average sizes of cuts and bytes in three codes, for what the receivers that are seen touch and
for whole fields; what the paper says stands beside it in the details. `paper/shells-N`: fields of N spheres
of 6·N² samples, with their error of irradiance against tracing (figure 8).
"""

from __future__ import annotations

import dataclasses
import re
from typing import TYPE_CHECKING

import numpy as np

from studio_core.scene.diff import Changes
from studio_core.shading.artifacts import Casters, Hits, Lighting, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.primary import visible_vertices
from studio_core.shading.stages import SurfaceParams, common_stages

if TYPE_CHECKING:
    from studio.bench.cuts import Suite

LARGEST_K = 15  # heights have 4 bits


@dataclasses.dataclass(frozen=True)
class Sizes:
    """How much is looked at: seen receivers, samples of each whole field, receivers of figure 8, spheres."""

    receivers: int = 1 << 30
    samples: int = 200
    points: int = 1000
    shells: tuple[int, ...] = (8, 16, 32, 64)


def tables(suite: Suite, sizes: Sizes) -> None:
    """Both tables, under daylight through windows."""
    from studio_plugins.cuts.paper.path import PaperPath
    from studio_plugins.cuts.paper.settings import PaperParams
    from studio_plugins.cuts.paper.table import shell_rows, size_rows, whole_fields

    services, workers, job = suite.services, suite.services.workers, Job("bench")
    pipeline = Pipeline(common_stages(services))
    base = suite.base("windows", "diffuse")
    frame = Frame(base.scene, base.view, SurfaceParams(vertices=suite.setup.vertices), 1, True)
    pipeline.update(frame, Changes(), job)
    surfaces, casters = pipeline.artifact(Surfaces), pipeline.artifact(Casters)
    hits, lighting = pipeline.artifact(Hits), pipeline.artifact(Lighting)
    assert surfaces is not None
    assert casters is not None
    assert hits is not None
    assert lighting is not None
    if lighting.tree is None:
        return
    k = min(LARGEST_K, suite.setup.directions.bit_length() - 1)
    params, tree = PaperParams(k=k), lighting.tree.coarsened(k)
    seen = np.flatnonzero(visible_vertices(surfaces, hits))
    rng = np.random.default_rng(0)

    def some(count: int) -> np.ndarray:
        return np.sort(rng.choice(seen, min(count, len(seen)), replace=False))

    path = PaperPath(workers, params)
    path.place(surfaces.mesh, casters.shadow, casters.meshes)
    path.irradiance(some(sizes.receivers), tree, job)
    said = {}
    for row in size_rows(path, whole_fields(path, sizes.samples, job=job)):
        suite.report.add("paper/table", slug(row.what), row.ours, row.unit.replace("bytes", "B") or "1")
        said[slug(row.what)] = row.paper
    suite.detail("paper/table", paper=said, directions=1 << k)
    points = some(sizes.points)
    for field in shell_rows(
        surfaces.mesh, casters.shadow, casters.meshes, points, tree, workers, params, sizes.shells, job
    ):
        name = f"paper/shells-{field.shells}"
        for metric, value, unit in (
            ("irradiance_rel_rmse", field.relative_rmse, "1"),
            ("irradiance_worst", field.worst, "1"),
            ("irradiance_bias", field.bias, "1"),
            ("samples", field.samples, "1"),
            ("samples_possible", field.possible, "1"),
            ("bytes", field.bytes, "B"),
            ("seconds_tracing", field.seconds_tracing, "s"),
            ("seconds_products", field.seconds_products, "s"),
        ):
            suite.report.add(name, metric, value, unit)


def slug(text: str) -> str:
    """A metric's name of a sentence."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")
