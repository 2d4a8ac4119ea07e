"""Captured materials: known ones photographed in the lab, fitted to some lights, asked about the others.

`measure` adds rows for every material, split and basis; `switched_off` the same with one part of the fit
off at a time. Everything starts from pictures: the ball is found, the maps are made, lights are told with
their errors.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from studio.bench.harness import Report
from studio.bench.lab import LabShots, Rig, dome, shoot, truth_map
from studio.bench.lab_surfaces import library
from studio_plugins.residual.ball import find_ball
from studio_plugins.residual.errors import Errors, errors
from studio_plugins.residual.fit import fit, relit
from studio_plugins.residual.masks import Masks, lit, outside_highlight
from studio_plugins.residual.reflectance_map import reflectance_maps
from studio_plugins.residual.result import ResidualFit, Settings
from studio_plugins.residual.samples import Flags, Samples
from studio_plugins.residual.splits import SPLITS

EXACT = Rig()
REAL = replace(
    EXACT, evs=(0.0, -3.0), bits=16, full_well=30_000.0, read_noise=5.0,
    direction_error=0.5, strength_error=0.03, drift=1.0, lamp_size=0.5,
)  # fmt: skip
"""A lab without faults, and one like a careful person's."""
PAPER = Settings(
    models=("paper",), basis="half", table=False, refine=0, masks=Masks(), cautious=False,
)  # fmt: skip
"""The paper's own model and residual, with our masks and solver."""
CHOSEN = Settings()
FIXED = ("half", "constant-half", "ptm", "harmonics", "albedo", "albedo-gloss", "albedo-half", "albedo-light")
MATERIALS = tuple(library())
QUICK_MATERIALS = ("textured", "bumpy", "glossy")
_MAP, _QUICK_MAP = 64, 40


@dataclass(frozen=True, eq=False)
class Case:
    """A material's maps under all lights, and which texels truly had light (n, h, w)."""

    samples: Samples
    lit: Flags
    shots: LabShots


@dataclass(frozen=True, eq=False)
class Outcome:
    """Of one fit, on lights that were held back: errors of the fit and of its model alone, and the fit
    itself.

    `lights_off`: mean degrees between where held-back lights were and where they were taken to be.
    """

    made: Errors
    alone: Errors
    fitted: ResidualFit
    seconds: float
    lights_off: float


def photographed(material: str, rig: Rig, size: int = _MAP, seed: int = 1) -> Case:
    """A material of the lab under the paper's row of lights at three heights (38)."""
    surface = library()[material]
    shots = shoot(surface, dome((-40.0, 0.0, 40.0)), rig, seed)
    found = find_ball(shots.pictures)
    samples = reflectance_maps(shots.pictures, shots.clipped, found.ball, shots.told, size)
    _, truly = truth_map(surface, samples.normals, samples.views, shots.were)
    return Case(samples, truly, shots)


def outcome(case: Case, split: str, settings: Settings) -> Outcome:
    """Fit to what the split leaves. Where lights are refined, those held back are too, by the finished
    material.
    """
    held = SPLITS[split](case.samples.lights)
    started = time.perf_counter()
    found = fit(case.samples.some(~held), settings)
    seconds = time.perf_counter() - started
    test = case.samples.some(held)
    if settings.refine:
        test = relit(found, test)
    use = test.usable & lit(test) & case.lit[held]
    outside = outside_highlight(test)
    cosine = (test.lights.directions * case.shots.were.some(held).directions).sum(axis=1)
    return Outcome(
        errors(found.predict(test.lights), test.values, use, outside),
        errors(found.alone(test.lights), test.values, use, outside),
        found,
        seconds,
        float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean()),
    )


def measure(report: Report, materials: Sequence[str] = MATERIALS, rig: Rig = REAL) -> None:
    """Rows `captured/MATERIAL/SPLIT`: the basis chosen by held-out error, and the paper's, for every split.

    Metrics as in the issue; `paper_nmse` and `paper_nmse_outside` of s·H over the paper's model, lights
    as told.
    """
    splits = ("checkerboard",) if report.quick else tuple(SPLITS)
    for material in materials:
        if not any(report.wants(f"captured/{material}/{split}") for split in splits):
            continue
        case = photographed(material, rig, _QUICK_MAP if report.quick else _MAP)
        for split in splits:
            name = f"captured/{material}/{split}"
            if not report.wants(name):
                continue
            made = outcome(case, split, CHOSEN)
            add(report, name, made)
            paper = outcome(case, split, PAPER)
            report.add(name, "paper_nmse", paper.made.whole, "1")
            report.add(name, "paper_nmse_outside", paper.made.outside, "1")
            report.add(name, "paper_parametric_nmse", paper.alone.whole, "1")
            report.details[name] = {"fit": made.fitted.report(), "by_light": list(made.made.by_light)}
            report.keep()


def add(report: Report, name: str, made: Outcome) -> None:
    """The rows of one outcome."""
    report.add(name, "holdout_nmse", made.made.whole, "1")
    report.add(name, "holdout_nmse_outside", made.made.outside, "1")
    report.add(name, "parametric_nmse", made.alone.whole, "1")
    report.add(name, "parametric_nmse_outside", made.alone.outside, "1")
    report.add(name, "rank", float(np.median(made.fitted.rank)), "1")
    report.add(name, "bytes_per_texel", made.fitted.bytes_per_texel, "B")
    report.add(name, "lights_off", made.lights_off, "°")
    report.add(name, "s", made.seconds, "s")


def every_basis(report: Report, materials: Sequence[str] = MATERIALS, rig: Rig = EXACT) -> None:
    """Rows `basis/MATERIAL/SPLIT/BASIS`: each basis over the best model, exact lights, nothing held to be
    cautious.
    """
    for material in materials:
        case: Case | None = None
        for split in SPLITS:
            for basis in ("none", *FIXED):
                name = f"basis/{material}/{split}/{basis}"
                if not report.wants(name):
                    continue
                case = case or photographed(material, rig, _QUICK_MAP)
                fixed = replace(CHOSEN, basis=basis, table=False, refine=0, cautious=False)
                add(report, name, outcome(case, split, fixed))
        report.keep()


def switched_off(report: Report, materials: Sequence[str] = MATERIALS, rig: Rig = REAL) -> None:
    """Rows `without/PART/MATERIAL`: one part of the fit off at a time, over a checkerboard and over one
    row.
    """
    solver = CHOSEN.solver
    parts = {
        "nothing": CHOSEN,
        "masks": replace(CHOSEN, masks=Masks(False, False, False)),
        "highlight-mask": replace(CHOSEN, masks=Masks(highlight=False)),
        "reweighting": replace(CHOSEN, solver=replace(solver, tukey=False)),
        "truncation": replace(CHOSEN, solver=replace(solver, truncation=1e-10)),
        "shrinking": replace(CHOSEN, solver=replace(solver, shrink=False)),
        "refinement": replace(CHOSEN, refine=0),
        "table": replace(CHOSEN, table=False),
    }
    for material in materials:
        case: Case | None = None
        for part, settings in parts.items():
            for split in ("checkerboard", "one-row"):
                name = f"without/{part}/{material}/{split}"
                if report.wants(name):
                    case = case or photographed(material, rig, _QUICK_MAP)
                    add(report, name, outcome(case, split, settings))
        report.keep()


def run(report: Report, program: object = None) -> None:
    """All of it that is asked for; `--quick`: a checkerboard of three materials on small maps."""
    before = len(report.rows)
    measure(report, QUICK_MATERIALS if report.quick else MATERIALS)
    if not report.quick:
        every_basis(report)
        switched_off(report)
    if len(report.rows) == before:
        return
    report.notes.append(
        "nMSE: Σ difference² / Σ measured² over texels that are lit and not clipped, on lights held back;"
        " outside: more than 10° between half vector and normal."
        " Lights held back are refined by the finished material."
    )
