"""The part of `lucarne bench materials` that is named by model: energy, reciprocity, draws, cost.

Figures are the worst over a grid of shapes (all parameters of the shape along their ways, and mixed where
there are several), angles and every corner of the colours.
"""

from __future__ import annotations

import importlib
import sys
import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report, Timing, timed
from studio.headless import Headless
from studio_core.brdfs.albedo import flat_coefficients, forget, quadrature_albedo, term_albedo
from studio_core.brdfs.calls import density, is_sampled, repeatable, sample
from studio_core.brdfs.chi_square import chi_square
from studio_core.brdfs.promises import (
    EXACT,
    furnace,
    hard_directions,
    reciprocity,
    seen_from,
    weight_bound,
)
from studio_core.brdfs.quadrature import over_hemisphere
from studio_core.brdfs.ranges import colour_corners, shaped, shapes, shaping
from studio_core.contract import Brdf, SampledBrdf
from studio_core.params import Value

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Material = Mapping[str, Value]
Oracle = Callable[[Any, Any, Any], Any]

MIXED = 4
GOLDEN = np.pi * (3 - np.sqrt(5))  # between the azimuths of neighbouring angles
DRAWN_AT = np.radians([0.5, 30, 60, 80, 89])
DRAWN = (0.0, 0.25, 0.5, 0.75, 1.0)
SHOWN = (0.0, 0.3, 1.0)
SHOWN_AT = (0, 45, 80, 89)
PLOT = np.radians(np.linspace(0, 89.5, 32))
MANY = 4096
TESTS = Path(__file__).resolve().parents[2] / "tests"


def run(report: Report, program: Headless) -> None:
    """Rows MODEL for every registered model."""
    registry = program.registry
    wanted = [name for name in registry.names("brdf") if report.wants(name)]
    if not wanted:
        return
    oracles = _oracles()
    if not oracles:
        report.notes.append("furnace_error needs the float64 models of a checkout's tests: left out.")
    plain = registry.brdf("lambert")
    table = [
        "White furnace: largest albedo over all colours, by angle; the shape at 0, 0.3, 1 of its way.",
        "",
        "| model | shape | " + " | ".join(f"{angle}°" for angle in SHOWN_AT) + " |",
        "|---|---|" + "---:|" * len(SHOWN_AT),
    ]
    for name in wanted:
        brdf = registry.brdf(name)
        with program.job(name):
            _energy(report, name, brdf, oracles.get(brdf.id))
            if is_sampled(brdf):
                _draws(report, name, cast(SampledBrdf, brdf))
            _cost(report, name, brdf, plain)
            table += _shown(name, brdf)
        report.keep()
    report.notes.append("\n".join(table))


def _energy(report: Report, name: str, brdf: Brdf, oracle: Oracle | None) -> None:
    count = 4 if report.quick else 16
    angles = np.radians(np.linspace(0, 89, count))
    azimuths = GOLDEN * np.arange(count)
    materials = list(shapes(brdf, tuple(np.linspace(0, 1, count)), MIXED))
    low, high = furnace(brdf, materials, angles, azimuths)
    report.add(name, "furnace_max", high.max(), "1")
    if low.min() < 0:
        report.add(name, "furnace_min", low.min(), "1")
    if oracle is not None:
        report.add(name, "furnace_error", _against(brdf, oracle, materials, angles, azimuths), "1")
    report.add(name, "albedo_error", _table_error(brdf, materials), "1")
    directions = hard_directions(40 if report.quick else 160)
    worst = max(reciprocity(brdf, brdf.shape(values), directions) for values in materials)
    report.add(name, "reciprocity_max", worst, "1")


def _oracles() -> Mapping[str, Oracle]:
    """The textbook models of the tests, where there is a checkout."""
    if not (TESTS / "oracles" / "brdf.py").is_file():
        return {}
    sys.path.insert(0, str(TESTS))
    try:
        found: Mapping[str, Oracle] = importlib.import_module("oracles.brdf").ORACLES
    finally:
        sys.path.remove(str(TESTS))
    return found


def _against(brdf: Brdf, oracle: Oracle, materials: Sequence[Material], angles: F64, azimuths: F64) -> float:
    """Largest difference of albedo from the oracle's, relative to it; below 1e-3 to that."""
    wo = seen_from(angles, azimuths)
    worst = 0.0
    for values in materials:
        every = [{**values, **corner} for corner in colour_corners(brdf)]

        def integrand(row: int, wi: F32, every: Sequence[Material] = every) -> F64:
            w = wi.astype(np.float64)
            w /= np.linalg.norm(w, axis=1, keepdims=True)
            o = np.broadcast_to(wo[row].astype(np.float64), w.shape)
            columns = [np.asarray(oracle(_grey(one), o, w))[:, :1] for one in every]
            return np.asarray(np.concatenate(columns, 1) * w[:, 2:])

        truth = over_hemisphere(integrand, wo, EXACT)
        terms = quadrature_albedo(brdf, brdf.shape(values), wo, EXACT)
        made = np.stack([(terms @ flat_coefficients(brdf, one))[:, 0] for one in every], 1)
        worst = max(worst, float((np.abs(made - truth) / np.maximum(truth, 1e-3)).max()))
    return worst


def _grey(values: Material) -> dict[str, Any]:
    """Colours as one channel."""
    return {name: np.array(v[:1]) if isinstance(v, tuple) else v for name, v in values.items()}


def _table_error(brdf: Brdf, materials: Sequence[Material]) -> float:
    """Largest difference of the live albedo table from quadrature, over the material's largest albedo."""
    worst = 0.0
    for values in materials[:: max(len(materials) // 8, 1)]:
        shape = brdf.shape(values)
        live, exact = term_albedo(brdf, shape, PLOT), quadrature_albedo(brdf, shape, seen_from(PLOT), EXACT)
        for corner in colour_corners(brdf):
            colours = flat_coefficients(brdf, {**values, **corner})
            truth = exact @ colours
            worst = max(worst, float(np.abs(live @ colours - truth).max() / max(truth.max(), 1e-3)))
    return worst


def _draws(report: Report, name: str, brdf: SampledBrdf) -> None:
    materials = list(shapes(brdf, (0.0, 1.0) if report.quick else DRAWN, MIXED))
    count = 20_000 if report.quick else 200_000
    rng = np.random.default_rng(7)
    u, others = rng.random((2000, 2), np.float32), hard_directions(500)
    least, tests, where, weight = 1.0, 0, {}, 0.0
    for values in materials:
        shape = brdf.shape(values)
        for angle, wo in zip(DRAWN_AT, seen_from(DRAWN_AT, 0.7), strict=True):
            drawn = density(brdf, shape, wo, others)
            for term in range(brdf.terms):
                weight = max(weight, weight_bound(brdf, shape, wo, term, u, others))
                if any(np.array_equal(drawn[:, term], drawn[:, k]) for k in range(term)):
                    continue
                place = f"{np.degrees(angle):g}° term {term} {[f'{v:g}' for v in shape[:4]]}"
                found = chi_square(brdf, shape, wo, term, count, zlib.crc32(f"{name} {place}".encode()))
                tests += 1
                if found.p <= least:
                    least, where = found.p, {"at": place, "statistic": found.statistic, "of": found.freedom}
    report.add(name, "chi2_p_min", least, "1")
    report.add(name, "chi2_p_bonferroni", min(least * tests, 1.0), "1")
    report.add(name, "weight_max", weight, "1")
    report.details[name] = {"chi2_tests": tests, "chi2_draws": count, "chi2_worst": where}


def _cost(report: Report, name: str, brdf: Brdf, plain: Brdf) -> None:
    values = shaped(brdf, 0.5)
    shape, wo, wi = brdf.shape(values), seen_from(0.6, 0.3), hard_directions(MANY // 2)
    repeats = 20 if report.quick else 200
    base = timed(repeatable(plain, plain.shape({}), wo, wi), repeats, 5)
    made = timed(repeatable(brdf, shape, wo, wi), repeats, 5)
    report.add(name, "eval_ratio", made.median / base.median, "1", made.spread / base.median)
    report.add(name, "eval_ns", 1e9 * made.median / len(wi), "ns", 1e9 * made.spread / len(wi))
    if is_sampled(brdf):
        sampled, u = cast(SampledBrdf, brdf), np.random.default_rng(2).random((MANY, 2), np.float32)
        drawn = timed(lambda: sample(sampled, shape, wo, brdf.terms - 1, u), repeats // 4, 2)
        report.add(name, "sample_ns", 1e9 * drawn.median / MANY, "ns", 1e9 * drawn.spread / MANY)

    spent = []
    for _ in range(3 if report.quick else 15):
        forget()
        started = time.process_time()
        term_albedo(brdf, shape, PLOT)
        spent.append(time.process_time() - started)
    taken = Timing.of(spent)
    report.add(name, "albedo_ms", 1000 * taken.median, "ms", 1000 * taken.spread)


def _shown(name: str, brdf: Brdf) -> list[str]:
    fractions = SHOWN if shaping(brdf)[0] else SHOWN[:1]
    _, high = furnace(brdf, list(shapes(brdf, fractions)), np.radians(SHOWN_AT))
    rows = zip(fractions, high, strict=True)
    return [f"| {name} | {fraction:g} | {' | '.join(f'{v:.3f}' for v in row)} |" for fraction, row in rows]
