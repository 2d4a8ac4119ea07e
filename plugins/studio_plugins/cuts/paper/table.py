"""The figures of section VI again: sizes of cuts in three codes, and errors by number of samples (figure 8).

The paper's scene is not ours, so sizes are given beside its numbers, not in place of them; of errors it
shows pictures only.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_core.kernels.directions import direction_set
from studio_core.kernels.light_tree import LightTree
from studio_core.kernels.raycast import RayCaster
from studio_core.kernels.visibility import trace_visibility
from studio_core.parallel import Checkpoints, Workers
from studio_core.scene.world_mesh import WorldMesh
from studio_plugins.cuts.paper.path import PaperPath
from studio_plugins.cuts.paper.records import BINARY_BITS, VALUE_BITS, CutSizes
from studio_plugins.cuts.paper.settings import PaperParams

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

PAPER_SVC, PAPER_VCF = 428.0, 710.0
PAPER_HEIGHTS, PAPER_INDICES = 270e6, 687e6
SHELLS = (8, 16, 32, 64)
_POINTS = 64  # of which exact light is summed at once


@dataclass(frozen=True)
class Row:
    """One line: what, ours, the paper's (None where it says nothing), in which unit."""

    what: str
    ours: float
    paper: float | None
    unit: str


@dataclass(frozen=True)
class ShellRow:
    """A field of n spheres of 6·n² samples, beside figure 8: what was traced of it, and its error.

    Errors are of irradiance against tracing: relative RMSE, worst in means, and bias. `seconds` are for
    tracing and for multiplying.
    """

    shells: int
    samples: int
    possible: int
    bytes: float
    relative_rmse: float
    worst: float
    bias: float
    seconds_tracing: float
    seconds_products: float


def whole_fields(
    path: PaperPath, samples: int = 200, seed: int = 1, job: Checkpoints | None = None
) -> CutSizes:
    """Sizes of all samples of all fields, estimated from `samples` random ones of each.

    What is traced lazily lies near other objects; the paper's average is over all samples.
    """
    rng = np.random.default_rng(seed)
    cuts, nodes, leaves = 0, 0.0, 0.0
    for found, possible in path.placed.sampled_fields(samples, rng, job):
        share = possible / max(found.cuts, 1)
        cuts, nodes, leaves = cuts + possible, nodes + found.nodes * share, leaves + found.leaves * share
    return CutSizes(cuts, round(nodes), round(leaves))


def size_rows(path: PaperPath, whole: CutSizes) -> list[Row]:
    """Average cut sizes and bytes of what the path keeps, and of its fields if they were traced whole."""
    counts = path.counts
    svc, lazy = counts.svc, counts.vcf
    rows = [
        Row("average nodes of an SVC", svc.average, PAPER_SVC, ""),
        Row("average nodes of a VCF sample, whole fields", whole.average, PAPER_VCF, ""),
        Row("average nodes of a VCF sample, samples touched", lazy.average, None, ""),
        Row("SVCs kept", svc.cuts, None, ""),
        Row("VCF samples kept", lazy.cuts, None, ""),
        Row("VCF samples there are", counts.vcf_possible, None, ""),
    ]
    for name, fields, paper in (("whole fields", whole, True), ("samples touched", lazy, False)):
        heights = svc.height_bytes(VALUE_BITS) + fields.height_bytes(BINARY_BITS)
        indices = svc.index_bytes(VALUE_BITS) + fields.index_bytes(BINARY_BITS)
        splits = svc.split_bytes(VALUE_BITS) + fields.split_bytes(BINARY_BITS)
        rows += [
            Row(f"SVC and VCF with heights, {name}", heights, PAPER_HEIGHTS if paper else None, "bytes"),
            Row(
                f"SVC and VCF with 2-byte indices, {name}", indices, PAPER_INDICES if paper else None, "bytes"
            ),
            Row(f"SVC and VCF with split bits, {name}", splits, None, "bytes"),
            Row(
                f"saved by heights, {name}",
                1 - heights / indices if indices else 0.0,
                1 - PAPER_HEIGHTS / PAPER_INDICES if paper else None,
                "",
            ),
        ]
    return rows


def exact_irradiance(
    mesh: WorldMesh,
    shadow: RayCaster,
    points: I64,
    tree: LightTree,
    k: int,
    workers: Workers,
    job: Checkpoints | None = None,
) -> F64:
    """(P, 3): equation (2) with a BRDF of 1, by tracing all of 2^k directions."""
    directions = direction_set(k)
    light = tree.coarsened(k).radiance.astype(np.float64) * directions.solid_angle
    out = np.empty((len(points), 3))
    for begin in range(0, len(points), _POINTS):
        some = points[begin : begin + _POINTS]
        found = trace_visibility(
            shadow,
            mesh.positions[some] + mesh.origin,
            mesh.normals[some],
            directions,
            workers,
            job,
            geometric_normals=mesh.geometric[some],
            inset=mesh.inset[some],
        )
        bits = np.unpackbits(found.words.view(np.uint8), axis=1, bitorder="little")
        cosines = np.maximum(mesh.normals[some] @ directions.directions.T, 0)
        out[begin : begin + len(some)] = (bits * cosines) @ light
    return out


def shell_rows(
    mesh: WorldMesh,
    shadow: RayCaster,
    identities: Sequence[Hashable],
    points: I64,
    tree: LightTree,
    workers: Workers,
    params: PaperParams | None = None,
    shells: Sequence[int] = SHELLS,
    job: Checkpoints | None = None,
) -> list[ShellRow]:
    """Figure 8 as numbers: n spheres of 6·n² samples for each n, at `points` of a scene of the caller's."""
    base = params or PaperParams()
    true = exact_irradiance(mesh, shadow, points, tree, base.k, workers, job)
    mean = max(float(true.mean()), 1e-30)
    rows = []
    for n in shells:
        path = PaperPath(workers, dataclasses.replace(base, shells=n, cells=n))
        path.place(mesh, shadow, identities)
        started = time.perf_counter()
        found = path.irradiance(points, tree, job)
        counts = path.counts
        products = counts.seconds["product"]
        off = found - true
        rows.append(
            ShellRow(
                shells=n,
                samples=counts.vcf.cuts,
                possible=counts.vcf_possible,
                bytes=counts.vcf.height_bytes(BINARY_BITS),
                relative_rmse=float(np.sqrt((off**2).mean())) / mean,
                worst=float(np.abs(off).max()) / mean,
                bias=float(off.mean()) / mean,
                seconds_tracing=time.perf_counter() - started - products,
                seconds_products=products,
            )
        )
    return rows
