"""What `lucarne capture` takes, apart from what it does, so that the other verbs start quickly."""

from __future__ import annotations

import argparse
from pathlib import Path

CUBES = ("six", "strip", "cross")


def add_options(verb: argparse.ArgumentParser) -> None:
    """What `lucarne capture` takes."""
    verb.add_argument("files", nargs="*", metavar="FILE", help="photographs: which is which is found out")
    kinds = (
        ("front", "of the front view"),
        ("back", "of the back view"),
        ("dual", "with both lenses' circles in one picture"),
        ("single", "of one lens alone"),
        ("equirect", "that are equirectangular already"),
    )
    for name, text in kinds:
        verb.add_argument(
            f"--{name}",
            nargs="+",
            action="extend",
            default=[],
            metavar="FILE[@EV]",
            help=f"photographs {text}",
        )
    verb.add_argument("--settings", type=Path, metavar="JSON", help="what differs from the defaults")
    verb.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="STEP.NAME=VALUE",
        help="one setting, such as lens.fov=195; may be repeated",
    )
    verb.add_argument("-o", "--out", type=Path, metavar="ENV.(exr|hdr)", help="the environment")
    verb.add_argument("--cubemap", type=Path, metavar="DIR|FILE", help="its cube map as well")
    verb.add_argument("--cube-layout", choices=CUBES, default="six", help="of the cube map (default: six)")
    verb.add_argument("--report", type=Path, metavar="JSON", help="what was found and measured")
    project = "add the capture and its environment; a project that is not there is made"
    verb.add_argument("--project", type=Path, metavar="PROJECT", help=project)
    progress = "on stderr: for people, or one JSON line a step for a program"
    verb.add_argument("--progress", choices=("text", "json"), default="text", help=progress)
