"""`lucarne`: without a verb it opens the window; all other verbs run without a display and without Qt."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from studio.values import add_values
from studio_core import __version__
from studio_core.errors import InputError, LucarneError

VERBS = (
    *("demo", "new", "info", "copy", "compact", "render", "frames", "radiance", "precompute", "export"),
    *(
        "strokes",
        "stylise",
        "capture",
        "fit-brdf",
        "fit-material",
        "materials",
        "script",
        "bench",
        "stress",
        "doctor",
    ),
)
BAD_INPUT, OUR_FAULT, INTERRUPTED, NOBODY_READS = 2, 70, 130, 141
TRACEBACK = "LUCARNE_TRACEBACK"
MOST_THREADS = 1024


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; the exit status.

    Bad input gives one line on stderr and 2, a mistake of ours 70, Ctrl-C 130, a reader of our output
    that went away 141. With LUCARNE_TRACEBACK=1 the place is shown as well.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, OSError, ValueError):  # closed, or a test's own
            stream.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]
    try:
        status = _command(given)
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except KeyboardInterrupt:
        _complain("stopped")
        return INTERRUPTED
    except BrokenPipeError:
        with contextlib.suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # nothing is left to flush
        return NOBODY_READS
    except LucarneError as error:
        _complain(str(error))
    except OSError as error:
        _complain(_of_the_system(error))
    except MemoryError:
        _complain("there is not enough memory; fewer vertices, directions or pixels take less")
    except Exception as error:  # what is left is our own fault, and is said in one line too
        where = "" if os.environ.get(TRACEBACK) else f"; {TRACEBACK}=1 shows where"
        _complain(f"this is a mistake in Lucarne: {type(error).__name__}: {error}{where}")
        return OUR_FAULT
    return BAD_INPUT


def _complain(text: str) -> None:
    """One line on stderr, whatever a file or a library put into the text."""
    from studio_core.project.faults import plain

    if os.environ.get(TRACEBACK):
        import traceback

        traceback.print_exc()
    with contextlib.suppress(OSError):
        print(f"lucarne: {plain(' '.join(text.split()))}", file=sys.stderr)


def _of_the_system(error: OSError) -> str:
    from studio_core.project.faults import cause

    return f"{error.filename}: {cause(error)}" if error.filename else cause(error)


def _command(given: list[str]) -> int:
    if not given or (given[0] not in VERBS and not given[0].startswith("-")):
        return _window(given)
    try:
        options = parser().parse_args(given)
    except SystemExit as done:  # --help, --version
        return int(done.code or 0)
    return _run(options)


def _window(given: list[str]) -> int:
    from studio.display import why_no_window

    path = Path(given[0]) if given else None
    if path is not None and not path.is_file():
        what = "is a folder, not a project" if path.is_dir() else "is neither a verb nor a project file"
        raise InputError(f"{given[0]!r} {what}; verbs: {', '.join(VERBS)}")
    if len(given) > 1:
        raise InputError("a window shows one project or material: lucarne [FILE]")
    reason = why_no_window()
    if reason:
        raise LucarneError(
            f"no window can be opened ({reason}); try lucarne demo --headless or lucarne render"
        )
    from studio.app import run_window

    return run_window(path)


def _run(options: argparse.Namespace) -> int:
    from studio import verbs
    from studio.headless import Headless

    progress = getattr(options, "progress", "text")
    program = Headless(quiet=options.quiet, threads=options.threads, progress=progress)
    try:
        if options.verb in ("bench", "stress"):
            if options.json is not None:
                verbs.check_target(options.json)
            from studio.bench import run

            return run(options, program)
        if options.verb == "script":
            from studio.verbs_script import script

            return script(options, program)
        # What libraries and plugins print must not meet a result that a machine reads.
        with contextlib.redirect_stdout(sys.stderr) if options.json else contextlib.nullcontext():
            if options.verb == "doctor":
                from studio.doctor import doctor

                return doctor(options, program)
            if options.verb in ("render", "frames"):
                from studio import verbs_pictures

                return getattr(verbs_pictures, options.verb)(options, program) or 0
            if options.verb in ("copy", "compact"):
                from studio import verbs_project

                return getattr(verbs_project, options.verb)(options, program) or 0
            if options.verb in ("strokes", "stylise"):
                from studio import verbs_strokes

                return getattr(verbs_strokes, options.verb)(options, program) or 0
            if options.verb == "precompute":
                from studio.verbs_precompute import precompute

                return precompute(options, program) or 0
            if options.verb == "fit-brdf":
                from studio.verbs_materials import fit_brdf

                return fit_brdf(options, program) or 0
            if options.verb == "fit-material":
                from studio.verbs_captured import fit_material

                return fit_material(options, program) or 0
            if options.verb == "materials":
                from studio.verbs_exchange import materials

                return materials(options, program) or 0
            if options.verb == "capture":
                from studio.verbs_capture import capture

                return capture(options, program) or 0
            return getattr(verbs, options.verb)(options, program) or 0
    finally:
        program.close()


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, as everything else here does."""

    def error(self, message: str) -> NoReturn:
        verb = self.prog.partition(" ")[2]
        raise InputError(f"{verb}: {message}; see {self.prog} --help" if verb else f"{message}; see --help")


def _threads(text: str) -> int:
    try:
        count = int(text)
    except ValueError:
        count = 0
    if not 1 <= count <= MOST_THREADS:
        raise argparse.ArgumentTypeError(f"expected a number from 1 to {MOST_THREADS}, not {text!r}")
    return count


def parser() -> argparse.ArgumentParser:
    """All verbs and their options."""
    made = _Parser(
        prog="lucarne",
        usage="lucarne [FILE]\n       lucarne VERB …",
        description="Furnish and light a room truthfully. Without a verb: the window.",
        allow_abbrev=False,
    )
    made.add_argument("--version", action="version", version=f"lucarne {__version__}")
    verbs = made.add_subparsers(dest="verb", required=True, metavar="VERB", prog="lucarne")

    def verb(name: str, text: str, json: bool = True) -> argparse.ArgumentParser:
        one = verbs.add_parser(name, help=text, description=text, allow_abbrev=False)
        if json:
            one.add_argument("--json", action="store_true", help="machine-readable result on stdout")
        one.add_argument("--quiet", action="store_true", help="no progress on stderr")
        one.add_argument("--threads", type=_threads, metavar="N", help="kernel threads (default: all cores)")
        return one

    from studio import indirect_options

    demo = verb("demo", "the sample room in a window, or as a picture where there is no display")
    demo.add_argument("--headless", action="store_true", help="render even where a window could be opened")
    demo.add_argument("-o", "--out", type=Path, metavar="PNG", help="render to this picture")
    _backend_options(demo)
    indirect_options.add_options(demo)
    _picture_options(demo)

    new = verb("new", "make a project from files")
    new.add_argument("out", type=Path, metavar="OUT.lucarne", help="a project that is there is kept as OUT~")
    new.add_argument(
        "--mesh",
        action="append",
        default=[],
        metavar="FILE[@x,y,z[,degrees_y[,scale]]]",
        help="a model and where it stands: metres, turned about the vertical, scaled; may be repeated",
    )
    new.add_argument("--unit", choices=("m", "cm", "mm", "in"), default="m", help="of the mesh files")
    new.add_argument("--env", type=Path, metavar="FILE", help="HDR environment")
    new.add_argument(
        "--ground",
        type=float,
        metavar="HEIGHT",
        help="see the environment on the ground; it was photographed so many metres above it",
    )
    new.add_argument("--floor", type=float, metavar="SIZE", help="a square floor, metres")
    new.add_argument("--shadow-floor", action="store_true", help="a floor that only catches shadows")
    _room_options(new)
    new.add_argument(
        "--material",
        action="append",
        default=[],
        metavar="NODE=KIND:key=value,…",
        help="another material for a node and all under it; colours are r/g/b or #rrggbb; may be repeated",
    )
    new.add_argument(
        "--camera",
        action="append",
        default=[],
        metavar="from=x,y,z:to=x,y,z:fov=deg",
        help="a camera (default: one that shows everything); may be repeated",
    )

    info = verb("info", "what a project file holds")
    info.add_argument("file", type=Path, metavar="PROJECT")

    copy = verb("copy", "a project's newest version alone, without its history: for clients")
    copy.add_argument("project", type=Path, metavar="PROJECT")
    copy.add_argument("-o", "--out", type=Path, required=True, metavar="OUT.lucarne")
    copy.add_argument("--revision", type=int, metavar="N", help="an earlier version: see info --json")

    compact = verb("compact", "drop a project's earlier versions to make it smaller")
    compact.add_argument("project", type=Path, metavar="PROJECT")

    render = verb("render", "render a project to a picture")
    render.add_argument("project", type=Path, metavar="PROJECT")
    render.add_argument("-o", "--out", type=Path, required=True, metavar="OUT.(png|exr)")
    _backend_options(render)
    indirect_options.add_options(render)
    _picture_options(render)
    render.add_argument("--preview", type=Path, metavar="PNG", help="a small picture of what is there so far")

    frames = verb("frames", "numbered pictures: around a point, of turning light, or along a path of cameras")
    frames.add_argument("project", type=Path, metavar="PROJECT")
    out = "DIR/NAME.(png|exr), numbered: NAME_0001.png"
    frames.add_argument("-o", "--out", type=Path, required=True, metavar="OUT", help=out)
    kind = frames.add_mutually_exclusive_group(required=True)
    kind.add_argument("--turntable", type=int, metavar="N", help="N pictures around what the camera looks at")
    kind.add_argument("--relight", type=int, metavar="N", help="N pictures while the light goes around")
    kind.add_argument("--path", metavar="NAMES", help="a smooth path through cameras, with commas between")
    frames.add_argument("--frames", type=int, metavar="N", help="how many pictures along the path")
    frames.add_argument(
        "--degrees", type=float, default=360.0, metavar="D", help="of the turn (default: 360)"
    )
    frames.add_argument("--around", metavar="NAME|x,y,z", help="turn around this thing or point")
    frames.add_argument("--closed", action="store_true", help="the path comes back to its first camera")
    frames.add_argument("--ease", action="store_true", help="start and stop slowly")
    even = "as many pictures between any two cameras, instead of even speed"
    frames.add_argument("--uneven", action="store_true", help=even)
    frames.add_argument("--resume", action="store_true", help="keep pictures of that size that are there")
    frames.add_argument("--sheet", type=Path, metavar="PNG", help="all of them, small, on one sheet")
    _backend_options(frames)
    indirect_options.add_options(frames)
    _picture_options(frames)

    radiance = verb("radiance", "radiance and irradiance of every shading vertex as .npz")
    radiance.add_argument("project", type=Path, metavar="PROJECT")
    radiance.add_argument("-o", "--out", type=Path, required=True, metavar="OUT.npz")
    radiance.add_argument("--directions", type=int, metavar="S", help="the same as --param directions=S")
    radiance.add_argument("--camera", metavar="NAME", help="towards this camera (default: the first)")
    _backend_options(radiance)
    indirect_options.add_options(radiance)

    precompute = verb("precompute", "make now what a backend keeps on disk for a project")
    precompute.add_argument("project", type=Path, metavar="PROJECT")
    precompute.add_argument("--camera", metavar="NAME", help="from here first (default: the first camera)")
    _backend_options(precompute)

    export = verb("export", "write a project as GLB or MaterialX, or as a Mitsuba 3 scene folder")
    export.add_argument("project", type=Path, metavar="PROJECT")
    export.add_argument("-o", "--out", type=Path, required=True, metavar="(OUT.glb|OUT.mtlx|DIR)")

    from studio import capture_options, verbs_captured, verbs_exchange, verbs_materials, verbs_strokes

    strokes = verb("strokes", "paint the light that is wanted, and find the materials that explain it")
    verbs_strokes.add_options(strokes)
    _backend_options(strokes)
    indirect_options.add_options(strokes)
    stylise = verb("stylise", "sharpen or smooth the light of a whole scene by its materials")
    verbs_strokes.add_stylise_options(stylise)
    _backend_options(stylise)
    indirect_options.add_options(stylise)
    text = "a room's light from photographs of it, taken at several exposures"
    capture_options.add_options(verb("capture", text))
    text = "the values with which reflectance models come nearest to a measured material"
    verbs_materials.add_options(verb("fit-brdf", text))
    text = "a material from photographs of a ball of it under known lights"
    verbs_captured.add_options(verb("fit-material", text))
    text = "the materials of a file: list them, keep them, or write them as another kind"
    verbs_exchange.add_options(verb("materials", text))

    script = verb("script", "run a Python file with the names of the console", json=False)
    text = "what the script's names mean; saved where it says save()"
    script.add_argument("--project", type=Path, metavar="PROJECT", help=text)
    script.add_argument("file", type=Path, metavar="FILE.py")
    script.add_argument("args", nargs=argparse.REMAINDER, metavar="ARGS", help="its sys.argv[1:]")

    bench = verb("bench", "measure time against error", json=False)
    stress = verb("stress", "numbers that the tests don't assert", json=False)
    for one in (bench, stress):
        one.add_argument("name", metavar="NAME", help="which one; an unknown name lists them")
        one.add_argument("--quick", action="store_true", help="within 3 minutes")
        one.add_argument("--json", type=Path, metavar="OUT", help="write the rows here, after every case")
    only = "of cuts and capture: only cases of these names, such as 'sun/*,settle*'"
    bench.add_argument("--only", default="*", metavar="PATTERNS", help=only)
    growth = "of cuts: all sizes, up to 100,000 vertices and 2^15 directions, or none"
    bench.add_argument("--growth", choices=("full", "quick", "none"), default="full", help=growth)
    verb("doctor", "check this installation")
    return made


def _room_options(verb: argparse.ArgumentParser) -> None:
    verb.add_argument(
        "--room",
        metavar="WxDxH[-WxD]",
        help="a room of that width, depth and height inside, metres; -WxD: an L",
    )
    for name, form, text in (
        ("window", "WALL:WxH[@SILL[,ALONG]]", "a window in a wall of the room (back, right, front, left)"),
        ("door", "WALL:WxH[@ALONG]", "a closed door"),
        ("passage", "WALL:WxH[@ALONG]", "a hole to walk through"),
        ("without", "WALL", "a wall that is left out"),
    ):
        again = f"{text}; may be repeated"
        verb.add_argument(f"--{name}", action="append", default=[], metavar=form, help=again)
    verb.add_argument("--open-top", action="store_true", help="a room without a ceiling")


def _backend_options(verb: argparse.ArgumentParser) -> None:
    verb.add_argument("--backend", default="cuts", metavar="ID", help="how light is summed (default: cuts)")
    add_values(verb, "--param", "the backend, such as directions=4096 or vertices=100000")


def _picture_options(verb: argparse.ArgumentParser) -> None:
    from studio import indirect_options

    verb.add_argument("--camera", metavar="NAME", help="what this camera sees (default: the first)")
    verb.add_argument("--size", default="960x540", metavar="WxH", help="pixels (default: 960x540)")
    indirect_options.add_light_option(verb)
    verb.add_argument("--exposure", type=float, default=0.0, metavar="EV", help="of a PNG")
    verb.add_argument(
        "--tonemap", choices=("srgb", "filmic", "raw"), default="srgb", help="tone curve of a PNG"
    )
    verb.add_argument(
        "--antialias",
        type=int,
        choices=range(1, 9),
        default=2,
        metavar="N",
        help="N×N samples a pixel; from 2 on 16 at edges",
    )
    bits = "a channel: 8 or 16 in PNG (default: 8), 16 or 32 in EXR (default: 32)"
    verb.add_argument("--bits", type=int, choices=(8, 16, 32), default=0, metavar="N", help=bits)
    verb.add_argument(
        "--alpha", action="store_true", help="transparent where nothing is before the background"
    )
    verb.add_argument("--lights", action="store_true", help="a layer for every light as well (EXR)")
    verb.add_argument("--dpi", type=float, default=0.0, metavar="N", help="dots per inch that the file names")
    progress = "on stderr: for people, or one JSON line a step for a program"
    verb.add_argument("--progress", choices=("text", "json"), default="text", help=progress)
    verb.set_defaults(preview=None)
    verb.add_argument(
        "--measure",
        type=int,
        nargs="?",
        const=256,
        metavar="N",
        help="also measure the picture's error by brute force at N random places (256)",
    )


if __name__ == "__main__":
    sys.exit(main())
