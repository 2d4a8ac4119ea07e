"""`lucarne fit-material`: photographs of a ball under known lights become a captured material."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studio import captured_sources
from studio_core.errors import InputError

if TYPE_CHECKING:
    from studio.headless import Headless
    from studio_plugins.residual.material import SceneMaterial
    from studio_plugins.residual.result import ResidualFit, Settings
    from studio_plugins.residual.samples import Flags, Lights, Samples


def add_options(verb: argparse.ArgumentParser) -> None:
    """The options of `fit-material`."""
    verb.add_argument("source", type=Path, metavar="SOURCE", help="photographs, one lamp each, or a BTF")
    captured_sources.add_options(verb)
    verb.add_argument("--holdout", metavar="FRACTION|NAME,…", help="lights kept back, to be asked about")
    verb.add_argument("--basis", default="", metavar="NAME", help="of each spot's own part")
    verb.add_argument("--no-refine", action="store_true", help="take lights as given")
    verb.add_argument("--size", type=int, default=256, metavar="N", help="texels a side (default: 256)")
    verb.add_argument(
        "-o", "--out", type=Path, metavar="NAME.lucmat|OUT.exr", help="the material, or its maps as layers"
    )
    verb.add_argument("--report", type=Path, metavar="OUT.json", help="how it was fitted and how well")


def fit_material(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne fit-material`."""
    from studio.verbs import check_target, result
    from studio_core.library.lucmat import SUFFIX
    from studio_plugins.residual.material import SHOWN, scene_material
    from studio_plugins.residual.result import Settings

    if not 8 <= options.size <= 2048:
        raise InputError(f"--size {options.size}: maps have 8 to 2048 texels a side")
    targets = (options.out, (SUFFIX, ".exr"), "materials and maps"), (options.report, (".json",), "reports")
    for path, suffixes, what in targets:
        if path is not None:
            check_target(path, suffixes, what)
    for_scene = options.out is not None and options.out.suffix.lower() == SUFFIX
    settings = Settings(basis=options.basis, refine=0 if options.no_refine else Settings().refine)
    if for_scene:
        settings = replace(settings, among=SHOWN)
    if captured_sources.is_btf(options):
        made, values = captured_sources.fit_btf_source(options, settings, program)
    else:
        made, values = _fit_photographs(options, settings, program)
    if for_scene:
        found = scene_material(made, options.source.stem)
        for note in found.notes:
            program.say(note)
        values["scene"] = {"off": found.off, "width": found.width}
        _write_material(options.out, found, made)
    elif options.out is not None:
        _write_maps(options.out, made)
    if options.report is not None:
        options.report.write_text(json.dumps(values, indent=1, allow_nan=False), "utf-8")
    result(options, program, values, _text(values))


def _fit_photographs(
    options: argparse.Namespace, settings: Settings, program: Headless
) -> tuple[ResidualFit, dict[str, Any]]:
    from studio_plugins.residual.fit import fit

    source = captured_sources.read_source(options, program)
    samples = source.samples
    held = _held(options.holdout, samples.lights)
    with program.job("Fitting") as job:
        made = fit(samples.some(~held), settings, job)
    for note in (*source.notes, *made.notes):
        program.say(note)
    values: dict[str, Any] = {"source": str(options.source), **source.found, "fit": made.report()}
    if held.any():
        values["holdout"] = _errors(made, samples.some(held), bool(settings.refine))
    return made, values


def _write_material(path: Path, found: SceneMaterial, made: ResidualFit) -> None:
    """With tags that the library finds it by."""
    from studio_core.library.lucmat import Kept, write

    wide = f" The pattern is as wide as {found.width:.2f} radii of the ball." if found.width else ""
    about = f"Captured under {len(made.lights)} lamps; basis {made.basis.name}.{wide}"
    write(path, Kept(found.material, ("captured",), about))


def _write_maps(path: Path, made: ResidualFit) -> None:
    """A layer a column of the basis."""
    import numpy as np

    from studio_core.imaging.encode import write_exr

    if not made.basis.size:
        raise InputError("there are no maps to write: no spot has anything of its own that lights bear out")
    layers = {f"s{k}": np.ascontiguousarray(made.coefficients[:, :, k]) for k in range(made.basis.size)}
    write_exr(path, layers, {"lucarne:basis": made.basis.name})


def _held(text: str | None, lights: Lights) -> Flags:
    """Which lights `--holdout` keeps back."""
    import numpy as np

    from studio_plugins.residual.splits import SPLITS, fraction

    if text is None:
        return np.zeros(len(lights), np.bool_)
    if text in SPLITS:
        held = SPLITS[text](lights)
    else:
        try:
            held = fraction(lights, float(text))
        except ValueError:
            names = {name.strip() for name in text.split(",")}
            known = {alias: i for i, name in enumerate(lights.names) for alias in (name, Path(name).stem)}
            missing = sorted(names - known.keys())
            if missing:
                raise InputError(f"--holdout {missing[0]}: there is no such picture") from None
            held = np.isin(np.arange(len(lights)), [known[name] for name in names])
    if not held.any() or held.all():
        raise InputError(f"--holdout {text}: some lights must be kept back, and some not")
    return held


def _errors(made: ResidualFit, test: Samples, refine: bool) -> dict[str, Any]:
    """nMSE on lights kept back, as given and, if refined, as the finished material says."""
    from studio_plugins.residual.errors import errors
    from studio_plugins.residual.fit import relit
    from studio_plugins.residual.masks import lit, outside_highlight

    told: dict[str, Any] = {"lights": list(test.lights.names)}
    for name, samples in (("as_given", test), ("refined", relit(made, test) if refine else None)):
        if samples is None:
            continue
        use, outside = samples.usable & lit(samples), outside_highlight(samples)
        whole = errors(made.predict(samples.lights), samples.values, use, outside)
        alone = errors(made.alone(samples.lights), samples.values, use, outside)
        told[name] = {
            "holdout_nmse": whole.whole,
            "holdout_nmse_outside": whole.outside,
            "parametric_nmse": alone.whole,
            "parametric_nmse_outside": alone.outside,
            "by_light": list(whole.by_light),
        }
    return told


def _text(values: dict[str, Any]) -> str:
    fit = values["fit"]
    shapes = ", ".join(f"{shape:.4g}" for shape in fit["shapes"])
    lines = [
        f"model {fit['model']} {f'({shapes})' if shapes else ''}".rstrip(),
        f"basis {fit['basis']}, {fit['bytes_per_texel']} bytes a texel",
    ]
    for name, words in (("as_given", "as given"), ("refined", "as refined")):
        if name in values.get("holdout", {}):
            one = values["holdout"][name]
            lines.append(
                f"lights kept back, {words}: nMSE {one['holdout_nmse']:.3%},"
                f" outside highlights {one['holdout_nmse_outside']:.3%};"
                f" the model alone {one['parametric_nmse']:.3%}"
            )
    return "\n".join(lines)
