"""`lucarne strokes`: light that is wanted, painted by a file, and the materials that explain it.

`lucarne stylise`: a scene whose light is sharpened, or smoothed, by its materials.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studio.headless import Headless
from studio.indirect_options import chosen_indirect
from studio.values import add_values, key_values
from studio.verbs import check_target, chosen_backend, replacing_if_there, result
from studio_core.errors import InputError

if TYPE_CHECKING:
    from studio_core.contract import StrokeSolver
    from studio_core.document import Document
    from studio_core.edits import Edit
    from studio_core.project.records import LoadedProject
    from studio_core.scene.nodes import Scene
    from studio_core.strokes.session import Painted

USUAL = "joint"
MOST_ROUNDS = 16


def add_options(verb: argparse.ArgumentParser) -> None:
    """All of `strokes` but those of backends and of light between surfaces."""
    verb.add_argument("project", type=Path, metavar="PROJECT")
    verb.add_argument("strokes", type=Path, metavar="STROKES.json", help="see docs/strokes.md")
    _add_out(verb)
    text = "how materials are found: joint, mixed, l0 or l2 (default: %(default)s)"
    verb.add_argument("--solver", default=USUAL, metavar="ID", help=text)
    add_values(verb, "--solver-param", "the solver")
    text = "paint each stroke on the picture that those before have made, instead of all on one"
    verb.add_argument("--one-by-one", action="store_true", help=text)
    text = "how often strokes are explained, each time under the light that the last answer brings"
    verb.add_argument("--rounds", type=int, default=1, metavar="N", help=f"{text} (default: %(default)s)")
    verb.add_argument("--report", type=Path, metavar="JSON", help="what was found, and why")


def add_stylise_options(verb: argparse.ArgumentParser) -> None:
    """All of `stylise` but those of backends and of light between surfaces."""
    verb.add_argument("project", type=Path, metavar="PROJECT")
    _add_out(verb)
    text = "how much stronger differences of light become, -1 to 4; below 0 weaker (default: %(default)s)"
    verb.add_argument("--amount", type=float, default=1.0, metavar="A", help=text)
    verb.add_argument("--solver", default=USUAL, metavar="ID", help="who finds the materials (%(default)s)")
    verb.add_argument(
        "--camera", metavar="NAME", help="shading is finest where it looks (default: the first)"
    )
    verb.set_defaults(solver_param=[])


def _add_out(verb: argparse.ArgumentParser) -> None:
    text = "a project that is there is kept as OUT~"
    verb.add_argument("-o", "--out", type=Path, required=True, metavar="OUT.lucarne", help=text)


def strokes(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne strokes`."""
    from studio.verbs_script import open_project
    from studio_core.strokes.files import strokes_from_file
    from studio_core.strokes.session import Easel, paint_and_solve

    out: Path = options.out
    check_target(out, (".lucarne",), "projects")
    if options.report is not None:
        check_target(options.report, (".json",), "reports")
    if not 1 <= options.rounds <= MOST_ROUNDS:
        raise InputError(f"--rounds: 1 to {MOST_ROUNDS}")
    backend, params = chosen_backend(options, program)
    choice = chosen_indirect(options, program)
    solver, solver_params = _chosen_solver(options, program)
    planned = strokes_from_file(options.strokes)
    document, project = open_project(options.project)
    easel, services = Easel(backend, params, program.services, choice), program.services
    with replacing_if_there(out, program):
        started = time.perf_counter()
        with program.job("Painting") as job:
            given = (document.scene, planned, solver, solver_params, easel, services, job)
            made = paint_and_solve(*given, one_by_one=options.one_by_one, rounds=options.rounds)
        seconds = time.perf_counter() - started
        for note in made.notes:
            program.say(note)
        _save(out, "Strokes", document, project, made.edits)
    told = report(made, document.scene)
    if options.report is not None:
        _write(options.report, told)
    values: dict[str, Any] = {
        "project": str(options.project),
        "out": str(out),
        "solver": options.solver,
        "backend": backend.id,
        "indirect": None if choice is None else choice.method,
        **told,
        "seconds": round(seconds, 3),
    }
    result(
        options, program, values, "\n".join([f"{out}: {_count(len(made.strokes), 'stroke')}", *_lines(told)])
    )


def stylise(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne stylise`."""
    from studio.verbs_script import open_project
    from studio_core.params import build
    from studio_core.scene.nodes import MeshObject
    from studio_core.strokes.planned import Look
    from studio_core.strokes.session import Easel
    from studio_core.strokes.stylising import Stylising, stylised

    out: Path = options.out
    check_target(out, (".lucarne",), "projects")
    wanted = build(Stylising, {"amount": options.amount})
    backend, params = chosen_backend(options, program)
    choice = chosen_indirect(options, program)
    solver, _ = _chosen_solver(options, program)
    document, project = open_project(options.project)
    scene, services = document.scene, program.services
    view, easel = Look(options.camera).view(scene), Easel(backend, params, services, choice)
    with replacing_if_there(out, program):
        started = time.perf_counter()
        with program.job("Stylising") as job:
            solution = stylised(scene, view, wanted, solver, easel, services, job)
        seconds = time.perf_counter() - started
        for note in solution.notes:
            program.say(note)
        _save(out, "Stylise", document, project, [solution.edit])
    painted = sum(node.paint is not None for node in document.scene.of(MeshObject))
    values = {
        "project": str(options.project),
        "out": str(out),
        "amount": options.amount,
        "solver": options.solver,
        "backend": backend.id,
        "painted": painted,
        "counts": dict(solution.counts),
        "notes": list(solution.notes),
        "seconds": round(seconds, 3),
    }
    result(options, program, values, f"{out}: {_count(painted, 'object')} painted")


def _save(
    out: Path, label: str, document: Document, project: LoadedProject | None, edits: Sequence[Edit]
) -> None:
    """The project with those steps."""
    from studio_core.project.records import History
    from studio_core.project.store import save

    for edit in edits:
        document.apply(edit)
    history = History(document.history, document.position)
    session = None if project is None else project.session
    save(out, document.scene, label=label, history=history, session=session, fresh=True)


def _write(path: Path, told: dict[str, Any]) -> None:
    try:
        path.write_text(json.dumps(told, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None


def report(made: Painted, scene: Scene) -> dict[str, Any]:
    """What was found, as JSON has it: strokes, findings with their reasons (best first), notes and counts."""

    def name(node: str) -> str:
        return scene.nodes[node].name if node in scene.nodes else node

    strokes = [
        {
            "id": stroke.id,
            "name": stroke.name,
            "tool": stroke.tool,
            "objects": [name(node) for node in stroke.objects],
            "places": 0 if stroke.marks is None else len(stroke.marks),
            "flat": stroke.flat,
            "indirect": stroke.indirect,
        }
        for stroke in made.strokes
    ]
    findings = [
        {
            "object": name(found.node),
            "slot": found.slot,
            "strokes": [name(stroke) for stroke in found.strokes],
            "reasons": [
                {
                    "meaning": reason.meaning or "nothing",
                    "explained": float(reason.explained),
                    "score": float(reason.score),
                    "values": dict(reason.values),
                }
                for reason in found.reasons
            ],
            "close": found.close,
            "cannot_tell": list(found.silent),
            "instead": found.rivals and before is not None and before.strokes == found.strokes,
        }
        for before, found in zip((None, *made.findings), made.findings, strict=False)
    ]
    return {"strokes": strokes, "findings": findings, "notes": list(made.notes), "counts": dict(made.counts)}


def _lines(told: dict[str, Any]) -> list[str]:
    """One a finding, for people."""
    made = []
    for found in told["findings"]:
        if not found["reasons"]:
            continue
        best = found["reasons"][0]
        line = f"{found['object']}, slot {found['slot']}: {best['meaning']}, explains {best['explained']:.0%}"
        line = f"or {line}" if found["instead"] else line
        if found["close"]:
            line += f" ({_count(found['close'], 'other')} nearly as well)"
        if found["cannot_tell"]:
            line += f"; cannot tell {', '.join(found['cannot_tell'])} from here"
        made.append(line)
    return made


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _chosen_solver(options: argparse.Namespace, program: Headless) -> tuple[StrokeSolver, Any]:
    """Solver and parameters; InputError for those that there are not."""
    from studio_core.shading.offline import backend_params
    from studio_core.strokes.session import KIND

    names = program.registry.names(KIND)
    if options.solver not in names:
        raise InputError(f"--solver {options.solver!r}: known are {', '.join(names) or 'none'}")
    solver: StrokeSolver = program.registry.get(KIND, options.solver)
    values = key_values("--solver-param", options.solver_param)
    try:
        return solver, backend_params(solver, values)
    except InputError as error:
        raise InputError(f"--solver-param: {error}") from None


__all__ = ["add_options", "add_stylise_options", "report", "strokes", "stylise"]
