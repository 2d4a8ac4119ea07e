"""`lucarne fit-brdf`: which reflectance model comes nearest to a measured material, and with what values."""

from __future__ import annotations

import argparse
import json
import secrets
from pathlib import Path
from typing import TYPE_CHECKING

from studio_core.errors import InputError, PluginError

if TYPE_CHECKING:
    from studio.headless import Headless
    from studio_core.brdfs.fitting import Fit
    from studio_core.brdfs.samples import Samples

_TEXT = (".astm", ".csv")


def add_options(verb: argparse.ArgumentParser) -> None:
    """The options of `fit-brdf`."""
    verb.add_argument("file", type=Path, metavar="FILE", help="measured: .binary (MERL), .astm or .csv")
    verb.add_argument(
        "--model",
        action="append",
        default=[],
        metavar="ID",
        help="such as ggx; may be repeated (default: every model)",
    )
    verb.add_argument("-o", "--out", type=Path, metavar="OUT.lucmat", help="the best one as a material")
    verb.add_argument("--report", type=Path, metavar="OUT.json", help="errors by angle of every model")


def fit_brdf(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne fit-brdf`."""
    from studio.verbs import check_target, result
    from studio_core.brdfs.fitting import fit
    from studio_core.library.lucmat import SUFFIX, Kept, write

    if options.out is not None:
        check_target(options.out, (SUFFIX,), "materials")
    if options.report is not None:
        check_target(options.report, (".json",), "reports")
    names = list(dict.fromkeys(options.model)) or _every(program)
    models = [program.registry.brdf(name) for name in names]
    for model in models:
        if getattr(model, "tables", ()):
            raise InputError(f"--model {model.id}: it is a measurement itself and has nothing to fit")
    samples, name = _samples(options.file, program)
    fits: list[Fit] = []
    with program.job("Fitting") as job:
        for n, model in enumerate(models):
            job.checkpoint(n, len(models))
            fits.append(fit(model, samples, job=job))
    fits.sort(key=lambda one: one.difference.metric)
    values = {"file": str(options.file), "samples": len(samples), "fits": [one.report() for one in fits]}
    if options.report is not None:
        beside = options.report.with_name(f".{options.report.name}.{secrets.token_hex(4)}")
        try:
            beside.write_text(json.dumps(values, indent=1, allow_nan=False) + "\n", encoding="utf-8")
            beside.replace(options.report)
        finally:
            beside.unlink(missing_ok=True)
    if options.out is not None:
        write(options.out, Kept(fits[0].material(name), about=f"Fitted to {options.file.name}"))
    result(options, program, values, "\n".join(map(_line, fits)))


def _every(program: Headless) -> list[str]:
    found = []
    for name in program.registry.names("brdf"):
        try:
            if not getattr(program.registry.brdf(name), "tables", ()):
                found.append(name)
        except PluginError as error:
            program.say(str(error))
    return found


def _samples(path: Path, program: Headless) -> tuple[Samples, str]:
    """What was measured, and its name; text as it stands in the file, nothing interpolated."""
    from studio.build_scene import load_model
    from studio_core.brdfs import tabulated
    from studio_core.brdfs.samples import of_table

    if path.suffix.lower() in _TEXT:
        found = tabulated.read(path)
        for note in found.notes:
            program.say(note)
        return found.samples, found.name
    model = load_model(path, program.registry)
    tables = [table for material in model.materials for table in material.tables.values()]
    if len(tables) != 1 or tables[0].values.shape[3] != 3:
        raise InputError(f"{path} holds no measured material")
    for note in model.notes:
        program.say(note)
    return of_table(tables[0]), tables[0].name


def _line(fit: Fit) -> str:
    def text(value: object) -> str:
        if isinstance(value, tuple):
            return "/".join(f"{number:.3g}" for number in value)
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    values = ",".join(f"{name}={text(value)}" for name, value in fit.values.items())
    error = fit.difference
    return f"{fit.model}:{values}  metric {error.metric:.3g}, relative RMSE {error.rmse:.3g}"
