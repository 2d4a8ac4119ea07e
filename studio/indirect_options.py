"""Options of light between surfaces, and which light is looked at."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from studio.values import add_values, key_values
from studio_core.errors import InputError
from studio_core.session import ALL, INDIRECT, LIGHTS, SHARE

if TYPE_CHECKING:
    from studio.headless import Headless
    from studio_core.shading.frame import IndirectChoice

NONE, USUAL = "none", "gather"
BOUNCES = "bounces"
"""The parameter of a method that `--bounces` is."""


def add_options(verb: argparse.ArgumentParser) -> None:
    """How light goes on between surfaces."""
    text = "how light goes on between surfaces: gather, fields, paths, or none (default: %(default)s)"
    verb.add_argument("--indirect", default=USUAL, metavar="ID", help=text)
    verb.add_argument("--bounces", type=int, metavar="N", help="from how many surfaces light comes at most")
    add_values(verb, "--indirect-param", "that method")


def add_light_option(verb: argparse.ArgumentParser) -> None:
    """Which light a picture shows."""
    text = (
        "show all light, that straight from lamps and sky, that from other surfaces, or its share in colours"
    )
    verb.add_argument("--light", choices=LIGHTS, default=ALL, help=text)


def chosen_indirect(options: argparse.Namespace, program: Headless) -> IndirectChoice | None:
    """The method with its parameters; InputError where options do not go together."""
    from studio_core.params import param_infos
    from studio_core.shading.indirect import KIND
    from studio_core.shading.offline import indirect_choice

    light, method = getattr(options, "light", ALL), options.indirect
    if method == NONE:
        if options.bounces is not None or options.indirect_param:
            name = "--bounces" if options.bounces is not None else "--indirect-param"
            raise InputError(f"{name}: there is no light between surfaces; name a method with --indirect")
        if light in (INDIRECT, SHARE):
            raise InputError(
                f"--light {light}: there is none between surfaces; name a method with --indirect"
            )
        return None
    known = program.registry.names(KIND)
    if method not in known:
        raise InputError(f"--indirect {method!r}: known are {', '.join((*known, NONE))}")
    values = key_values("--indirect-param", options.indirect_param)
    if options.bounces is not None:
        if BOUNCES not in param_infos(program.registry.get(KIND, method).Params):
            raise InputError(f"--bounces: {method} has no such parameter")
        values[BOUNCES] = str(options.bounces)
    try:
        return indirect_choice(program.registry, method, values)
    except InputError as error:
        raise InputError(f"--indirect {method}: {error}") from None


def check_light(options: argparse.Namespace) -> None:
    """InputError for parts of a picture that false colours do not have."""
    if options.light == SHARE:
        for name in ("alpha", "lights", "measure"):
            if getattr(options, name):
                raise InputError(f"--light share: false colours do not go together with --{name}")


__all__ = ["add_light_option", "add_options", "check_light", "chosen_indirect"]
