"""The part of `lucarne bench materials` about other programs' files: presets of one model, `exchange/MODEL`.

`glb_error` and `mtlx_error` are how far what was written is off, by the formulas of those formats;
`glb_again_error`, `mtlx_again_error` what comes in again from the files, by our kernels; `mitsuba_error` what
Mitsuba is given. Each is the median over the presets, the spread reaches to the worst of them; the metric is
the root mean square of Δ ln(1 + cos θ f) over pairs of directions (`studio_core.exchange.measuring`).
"""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from studio.bench.harness import Report
from studio.headless import Headless
from studio_core.contract import Registry
from studio_core.errors import InputError
from studio_core.exchange.files import materials_of, write_materials
from studio_core.exchange.measuring import Flat, between, distance
from studio_core.exchange.outgoing import surface_of
from studio_core.library.lucmat import Kept
from studio_core.library.presets import PRESETS
from studio_core.shading.materials import resolve

FILES = (".glb", ".mtlx")


def run(report: Report, program: Headless) -> None:
    """Rows of every model that presets have."""
    models = dict.fromkeys(kept.material.model for kept in PRESETS)
    for model in models:
        case = f"exchange/{model}"
        if report.wants(case):
            program.say(case)
            measure(report, case, [k for k in PRESETS if k.material.model == model], program.registry)
            report.keep()


def measure(report: Report, case: str, presets: Sequence[Kept], registry: Registry) -> None:
    """The rows of one case."""
    resolved = [resolve(kept.material, registry) for kept in presets]
    surfaces = [surface_of(kept.material, registry).surface for kept in presets]
    samples = [Flat.of(one).samples() for one in resolved]
    as_gltf = [surface.smooth().plain("edge_tint") for surface in surfaces]
    _add(report, case, "glb_error", [distance(*pair).metric for pair in zip(as_gltf, samples, strict=True)])
    _add(report, case, "mtlx_error", [distance(*pair).metric for pair in zip(surfaces, samples, strict=True)])
    for suffix in FILES:
        with tempfile.TemporaryDirectory(prefix="lucarne-") as folder:
            path = Path(folder) / f"presets{suffix}"
            try:
                write_materials(path, presets, registry)
                again = materials_of(path, registry)[0]
            except InputError as error:  # the extra is not there
                report.notes.append(f"{case}: {error}")
                continue
        made = [resolve(kept.material, registry) for kept in again]
        off = [between(*pair) for pair in zip(made, resolved, strict=True)]
        _add(report, case, f"{suffix[1:]}_again_error", off)
    mitsuba = importlib.import_module("studio_plugins.export.mitsuba_materials")
    near = [mitsuba.nearest(k.material, one, registry) for k, one in zip(presets, resolved, strict=True)]
    off = [between(resolve(one, registry), meant) for one, meant in zip(near, resolved, strict=True)]
    _add(report, case, "mitsuba_error", off)


def _add(report: Report, case: str, metric: str, off: Sequence[float]) -> None:
    median = float(np.median(off))
    report.add(case, metric, median, "", float(max(off)) - median)
