"""What `lucarne fit-material` starts from: photographs of a ball or of a flat sample, or a BTF."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studio_core.errors import InputError

if TYPE_CHECKING:
    from studio.headless import Headless
    from studio_plugins.residual.pictures import Pictures
    from studio_plugins.residual.result import ResidualFit, Settings
    from studio_plugins.residual.samples import Ball, Samples


_OF_PHOTOGRAPHS = (
    "lights",
    "mirror_ball",
    "ball",
    "flat",
    "mask",
    "white",
    "white_at",
    "distance",
    "no_refine",
)
"""Options that a BTF has no use for."""


@dataclass(frozen=True, eq=False)
class Source:
    """Samples, what was found out about them (for reports), and sentences."""

    samples: Samples
    found: dict[str, Any]
    notes: tuple[str, ...]


def add_options(verb: argparse.ArgumentParser) -> None:
    """How a source is to be read."""
    verb.add_argument("--lights", type=Path, metavar="FILE.lp|TABLE", help="where lamps were")
    verb.add_argument("--mirror-ball", metavar="X,Y,R", help="lamps are seen on a mirror ball there (pixels)")
    verb.add_argument("--ball", metavar="X,Y,R", help="where the ball is, instead of finding it (pixels)")
    verb.add_argument("--flat", action="store_true", help="a flat sample fills the picture or the mask")
    verb.add_argument("--mask", type=Path, metavar="PICTURE", help="white where the sample is")
    verb.add_argument("--white", metavar="R,G,B", help="colour in the pictures of what is neutral")
    verb.add_argument("--white-at", metavar="X,Y,R", help="a neutral spot of the pictures (pixels)")
    verb.add_argument(
        "--response",
        choices=("automatic", "measured", "sRGB", "linear"),
        default="automatic",
        help="how numbers became of light (default: measured on brackets, else sRGB)",
    )
    verb.add_argument("--distance", type=float, metavar="R", help="of the camera, in radii of the ball")


def read_source(options: argparse.Namespace, program: Headless) -> Source:
    """What the options name, as samples. InputError in one sentence."""
    return _photographs(options, program)


def is_btf(options: argparse.Namespace) -> bool:
    """Whether the source is a bidirectional texture function."""
    from studio_plugins.residual import btf

    return btf.is_btf(options.source)


def fit_btf_source(
    options: argparse.Namespace, settings: Settings, program: Headless
) -> tuple[ResidualFit, dict[str, Any]]:
    """The fit of a BTF, and the values of its report."""
    from studio_plugins.residual.btf import open_btf, unique_directions
    from studio_plugins.residual.btf_fit import fit_btf, lights_held

    given = [f"--{name.replace('_', '-')}" for name in _OF_PHOTOGRAPHS if getattr(options, name)]
    if given:
        raise InputError(f"{given[0]} is of photographs, and {options.source} is a BTF")
    btf = open_btf(options.source, options.response)
    held = None
    if options.holdout is not None:
        try:
            held = lights_held(btf, float(options.holdout))
        except ValueError:
            raise InputError(f"--holdout {options.holdout}: of a BTF it is a share of the lights") from None
    workers = program.services.workers
    with program.job("Fitting") as job:
        made, errors = fit_btf(btf, settings, held, job, size=options.size, workers=workers)
    for note in made.notes:
        program.say(note)
    found = {
        "pictures": len(btf.lights),
        "lights": len(unique_directions(btf.lights)[0]),
        "views": len(unique_directions(btf.views)[0]),
        "texels": list(btf.size[::-1]),
    }
    values: dict[str, Any] = {"source": str(options.source), "btf": found, "fit": made.report()}
    if errors is not None:
        values["holdout"] = {
            "pictures": errors.pictures,
            "as_given": {
                "holdout_nmse": errors.made.whole,
                "holdout_nmse_outside": errors.made.outside,
                "parametric_nmse": errors.alone.whole,
                "parametric_nmse_outside": errors.alone.outside,
            },
        }
    return made, values


def _photographs(options: argparse.Namespace, program: Headless) -> Source:
    from studio_plugins.residual.flat import flat_samples
    from studio_plugins.residual.lights import from_mirror_ball, read_list
    from studio_plugins.residual.pictures import read_folder, read_mask
    from studio_plugins.residual.reading import on_ball
    from studio_plugins.residual.samples import Lights

    least = 0.1 if options.flat else 1.01
    if options.distance is not None and not options.distance > least:
        outside = "in front of the sample" if options.flat else "outside of the ball"
        raise InputError(f"--distance {options.distance:g}: the camera is {outside}")
    if options.lights is not None and options.mirror_ball is not None:
        raise InputError("--lights and --mirror-ball: lamps are told by one of them")
    listed = read_list(options.lights) if options.lights is not None else None
    mirror = _numbers("--mirror-ball", options.mirror_ball)
    with program.job("Reading") as job:
        pictures = read_folder(
            options.source, listed, job, response=options.response, directions=mirror is None
        )
    factor = pictures.factor
    height, width = pictures.size
    if mirror is not None:
        lights = from_mirror_ball(pictures.light, _ball(mirror, factor, None), pictures.lights.names)
        pictures = pictures.with_lights(
            Lights(lights.directions, lights.strengths, lights.names, lights.source)
        )
    mask = pictures.mask
    if options.mask is not None:
        mask = read_mask(options.mask, pictures.size, factor)
    distance = options.distance or float("inf")
    found: dict[str, Any] = {"pictures": [width, height], "lights": len(pictures.lights)}
    pictures = _balanced(pictures, options, found)
    if options.flat:
        return Source(flat_samples(pictures, options.size, mask, distance), found, pictures.notes)
    given = _numbers("--ball", options.ball)
    ball = _ball(given, factor, distance) if given is not None else None
    check = not options.no_refine
    samples, found["ball"], notes = on_ball(pictures, ball, mask, distance, options.size, check)
    if check:
        found["notes"] = list(notes)
    return Source(samples, found, notes)


def _balanced(pictures: Pictures, options: argparse.Namespace, found: dict[str, Any]) -> Pictures:
    """By a colour, or by a spot."""
    white, spot = _numbers("--white", options.white), _numbers("--white-at", options.white_at)
    if white is not None and spot is not None:
        raise InputError("--white and --white-at: what is neutral is told by one of them")
    if spot is not None:
        r, g, b = pictures.spot(*spot).tolist()
        white = r, g, b
    if white is None:
        return pictures
    found["white"] = list(white)
    return pictures.balanced(white)


def _ball(numbers: tuple[float, float, float], factor: int, distance: float | None) -> Ball:
    from studio_plugins.residual.samples import Ball

    x, y, radius = (n / factor for n in numbers)
    if not radius > 4:
        raise InputError(f"a ball of {numbers[2]:g} pixels is too small")
    return Ball(x, y, radius, distance or float("inf"))


def _numbers(option: str, text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(f"{option} {text}: three numbers are expected, with commas between") from None
    return x, y, z
