"""`lucarne`: without a verb it opens the window; all other verbs run without a display and without Qt."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from studio_core import __version__
from studio_core.errors import LucarneError

VERBS = ("demo", "new", "info", "render", "radiance", "export", "script", "bench", "stress", "doctor")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; the exit status. Bad input gives one line on stderr and status 2."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        if not given or (given[0] not in VERBS and not given[0].startswith("-")):
            return _window(given)
        options = _parser().parse_args(given)
        return _run(options)
    except LucarneError as error:
        print(f"lucarne: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"lucarne: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("lucarne: stopped", file=sys.stderr)
        return 130


def _window(given: list[str]) -> int:
    from studio.display import why_no_window

    if len(given) > 1:
        raise LucarneError("a window shows one project: lucarne [FILE]")
    reason = why_no_window()
    if reason:
        raise LucarneError(
            f"no window can be opened ({reason}); try lucarne demo --headless or lucarne render"
        )
    from studio.app import run_window

    return run_window(Path(given[0]) if given else None)


def _run(options: argparse.Namespace) -> int:
    from studio import verbs
    from studio.headless import Headless

    program = Headless(quiet=options.quiet, threads=options.threads)
    try:
        if options.verb in ("bench", "stress"):
            from studio.bench import run

            return run(options, program)
        if options.verb == "doctor":
            from studio.doctor import doctor

            return doctor(options)
        return getattr(verbs, options.verb)(options, program) or 0
    finally:
        program.close()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="lucarne", description="Furnish and light a room truthfully. Without a verb: the window."
    )
    parser.add_argument("--version", action="version", version=f"lucarne {__version__}")
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB")

    def verb(name: str, text: str, json: bool = True) -> argparse.ArgumentParser:
        made = verbs.add_parser(name, help=text, description=text)
        if json:
            made.add_argument("--json", action="store_true", help="machine-readable result on stdout")
        made.add_argument("--quiet", action="store_true", help="no progress on stderr")
        made.add_argument("--threads", type=int, metavar="N", help="kernel threads (default: all cores)")
        return made

    demo = verb("demo", "the sample room in a window, or as a picture where there is no display")
    demo.add_argument("--headless", action="store_true", help="render even where a window could be opened")
    demo.add_argument("-o", "--out", type=Path, metavar="PNG")
    _picture_options(demo)

    new = verb("new", "make a project from files")
    new.add_argument("out", type=Path, metavar="OUT.lucarne")
    new.add_argument("--mesh", action="append", default=[], metavar="FILE[@x,y,z[,degrees_y[,scale]]]")
    new.add_argument("--unit", choices=("m", "cm", "mm", "in"), default="m", help="of the mesh files")
    new.add_argument("--env", type=Path, metavar="FILE", help="HDR environment")
    new.add_argument("--floor", type=float, metavar="SIZE", help="a square floor, metres")
    new.add_argument("--material", action="append", default=[], metavar="NODE=KIND:key=value,…")
    new.add_argument("--camera", action="append", default=[], metavar="from=x,y,z:to=x,y,z:fov=deg")

    info = verb("info", "what a project file holds")
    info.add_argument("file", type=Path)

    render = verb("render", "render a project to a picture")
    render.add_argument("project", type=Path)
    render.add_argument("-o", "--out", type=Path, required=True, metavar="OUT.(png|exr)")
    _backend_options(render)
    _picture_options(render)

    radiance = verb("radiance", "radiance and irradiance of every shading vertex as .npz")
    radiance.add_argument("project", type=Path)
    radiance.add_argument("-o", "--out", type=Path, required=True, metavar="OUT.npz")
    radiance.add_argument("--directions", type=int, metavar="S")
    radiance.add_argument("--camera", metavar="NAME")
    _backend_options(radiance)

    export = verb("export", "write a project as GLB, or as a Mitsuba 3 scene folder")
    export.add_argument("project", type=Path)
    export.add_argument("-o", "--out", type=Path, required=True, metavar="(OUT.glb|DIR)")

    script = verb("script", "run a Python file that uses studio_core")
    script.add_argument("file", type=Path)
    script.add_argument("args", nargs=argparse.REMAINDER)

    bench = verb("bench", "measure time against error", json=False)
    stress = verb("stress", "numbers that the tests don't assert", json=False)
    for made in (bench, stress):
        made.add_argument("name")
        made.add_argument("--quick", action="store_true", help="within 3 minutes")
        made.add_argument("--json", type=Path, metavar="OUT", help="write the rows here")
    verb("doctor", "check this installation")
    return parser


def _backend_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--backend", default="reference", metavar="ID")
    parser.add_argument("--param", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--indirect", metavar="ID")
    parser.add_argument("--bounces", type=int, metavar="N")


def _picture_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--camera", metavar="NAME")
    parser.add_argument("--size", default="960x540", metavar="WxH")
    parser.add_argument("--exposure", type=float, default=0.0, metavar="EV")
    parser.add_argument("--tonemap", choices=("srgb", "filmic", "raw"), default="srgb")
    parser.add_argument(
        "--antialias", type=int, choices=range(1, 9), default=2, metavar="N", help="N×N samples"
    )


if __name__ == "__main__":
    sys.exit(main())
