"""`lucarne capture`: photographs of a room through a fisheye, at several exposures, become its light."""

from __future__ import annotations

import argparse
import dataclasses
import os
import secrets
from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studio.headless import Headless
from studio.verbs import check_target, result
from studio_core.errors import InputError

if TYPE_CHECKING:
    from studio_core.capturing.artifacts import CaptureState
    from studio_core.capturing.settings import CaptureSettings, Shot
    from studio_core.imaging.photograph import Photograph
    from studio_core.scene.capture import KeptPhotograph
    from studio_core.shading.job import Job

CAPTURER = "fisheye"
PICTURES = (".exr", ".hdr")
TOO_DARK = 2  # of `Captured.unresolved`, or never seen


@dataclass(frozen=True)
class Given:
    """A photograph as it was named: its file, which side it is said to be, its EV where that was typed."""

    path: Path
    side: str | None = None
    ev: float | None = None


def capture(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne capture`."""
    _check_targets(options)
    given, layout = _given(options)
    settings = _settings(options)
    with program.job("Capturing") as job:
        taken, shots, notes = _read(given, job)
        photographs = [photograph for photograph, _ in taken]
        settings = _with_shots(settings, shots, layout)
        run = program.registry.get("capturer", CAPTURER).open(program.services)
        state: CaptureState = run.run(photographs, settings, job)
    if state.captured is None:
        raise InputError("the photographs gave no environment")
    if (state.captured.unresolved >= TOO_DARK).all():
        raise InputError("the photographs are black: there is no light in them")
    notes = list(dict.fromkeys([*notes, *state.notes, *state.captured.notes]))
    for note in notes:
        program.say(note)
    _write(options, program, state, settings, [kept for _, kept in taken], notes)
    _tell(options, program, state, notes, len(photographs))


def _check_targets(options: argparse.Namespace) -> None:
    """InputError for whatever cannot be written, before the work."""
    if options.out is None and options.project is None and options.cubemap is None:
        raise InputError("there is nothing to write: name an environment with -o, or a --project")
    if options.out is not None:
        check_target(options.out, PICTURES, "environments")
    if options.report is not None:
        check_target(options.report, (".json",), "reports")
    if options.project is not None:
        from studio_core.project.lock import acquire
        from studio_core.project.store import info

        check_target(options.project, (".lucarne",), "projects")
        if _holds_something(options.project):
            info(options.project)  # refuses what is no project
            with acquire(options.project):  # and what is open elsewhere
                pass
    if options.cubemap is not None:
        if options.cube_layout != "six":
            check_target(options.cubemap, PICTURES, "cube maps")
        elif options.cubemap.exists() and not options.cubemap.is_dir():
            raise InputError(
                f"{options.cubemap} cannot be written: it is a file, and six faces need a folder"
            )
        elif not options.cubemap.parent.is_dir():
            raise InputError(
                f"{options.cubemap} cannot be written: there is no folder {options.cubemap.parent}"
            )
    written = [p for p in (options.out, options.report, options.project, options.cubemap) if p is not None]
    for place, path in enumerate(written):
        if path.resolve() in [other.resolve() for other in written[:place]]:
            raise InputError(f"{path} is named for two results")


def _holds_something(path: Path) -> bool:
    return os.path.lexists(path) and path.stat().st_size > 0


def _given(options: argparse.Namespace) -> tuple[list[Given], str]:
    """The photographs in order, and their layout as far as the command tells it."""
    from studio_core.capturing.settings import (
        AUTOMATIC,
        BACK,
        DUAL,
        EQUIRECTANGULAR,
        FRONT,
        SINGLE,
        TWO_PICTURES,
    )

    layouts = {"dual": DUAL, "single": SINGLE, "equirect": EQUIRECTANGULAR}
    kinds = [name for name in layouts if getattr(options, name)]
    sided = bool(options.front or options.back)
    if len(kinds) + sided + bool(options.files) > 1:
        raise InputError(
            "photographs are given as --front and --back, or --dual, or --single, or --equirect, or without"
            " any of these"
        )
    if options.back and not options.front:
        raise InputError("--back without --front: a single view is given as --single")
    if kinds:
        return [_one(text, FRONT) for text in getattr(options, kinds[0])], layouts[kinds[0]]
    if sided:
        made = [_one(text, FRONT) for text in options.front] + [_one(text, BACK) for text in options.back]
        return made, TWO_PICTURES if options.back else AUTOMATIC
    if not options.files:
        raise InputError("there are no photographs; see lucarne capture --help")
    return [_one(text, None) for text in options.files], AUTOMATIC


def _one(text: str, side: str | None) -> Given:
    """FILE or FILE@EV, where a file with all of that name is meant first."""
    import math

    name, at, number = text.rpartition("@")
    if at and name and not Path(text).exists():
        with suppress(ValueError):
            ev = float(number)
            if not math.isfinite(ev) or abs(ev) > 64:
                raise InputError(f"{text!r}: expected an exposure between -64 and 64 EV after the @")
            return Given(Path(name), side, ev)
    return Given(Path(text), side)


def _settings(options: argparse.Namespace) -> CaptureSettings:
    from studio_core.capturing.settings import CaptureSettings
    from studio_core.capturing.settings_file import settings_from_json, with_values

    settings = CaptureSettings()
    if options.settings is not None:
        try:
            text = options.settings.read_text(encoding="utf-8")
        except UnicodeDecodeError:
            raise InputError(f"{options.settings} is no settings file: it is not UTF-8 text") from None
        settings = settings_from_json(text, str(options.settings))
    try:
        return with_values(settings, options.set)
    except InputError as error:
        raise InputError(f"--set: {error}") from None


def _read(
    given: Sequence[Given], job: Job
) -> tuple[list[tuple[Photograph, KeptPhotograph]], list[Shot], list[str]]:
    """The photographs that can be read, what is said of each, and a sentence for each other one.

    A file that is named twice counts once; InputError where it is said to be both views, or when no file
    can be read.
    """
    from studio_core.capturing.keeping import take
    from studio_core.capturing.settings import Shot
    from studio_core.imaging.io import ImageDecoder

    taken: list[tuple[Photograph, KeptPhotograph]] = []
    shots: dict[str, Shot] = {}
    notes: list[str] = []
    with ImageDecoder() as decoder:
        for done, one in enumerate(given):
            job.checkpoint(done, 20 * len(given))  # reading is a small part of the work
            try:
                photograph, kept = take(one.path, decoder)
            except InputError as error:
                if len(given) == 1:
                    raise
                notes.append(str(error))
                continue
            before = shots.get(photograph.digest)
            if before is not None:
                if before.side != one.side:
                    raise InputError(f"{one.path} is given as front and as back view")
                notes.append(f"{one.path} was given twice.")
                continue
            shots[photograph.digest] = Shot(photograph.digest, one.side, one.ev)
            if kept.data is not None:  # the project holds it: where it was is nobody's business
                kept = dataclasses.replace(kept, path="")
            taken.append((photograph, kept))
    if not taken:
        raise InputError(notes[0] if len(notes) == 1 else f"no photograph can be used; {notes[0]}")
    return taken, list(shots.values()), notes


def _with_shots(settings: CaptureSettings, shots: Sequence[Shot], layout: str) -> CaptureSettings:
    """What the command says of photographs, over what the settings file says of them."""
    from studio_core.capturing.settings import AUTOMATIC

    decided = {shot.photograph: shot for shot in settings.bracket.shots}
    made = []
    for shot in shots:
        before = decided.get(shot.photograph)
        if before is not None:
            ev = before.ev if shot.ev is None else shot.ev
            shot = dataclasses.replace(before, side=shot.side or before.side, ev=ev)
        if before is not None or shot.side is not None or shot.ev is not None:
            made.append(shot)
    chosen = settings.bracket.layout if layout == AUTOMATIC else layout
    bracket = dataclasses.replace(settings.bracket, shots=tuple(made), layout=chosen)
    return dataclasses.replace(settings, bracket=bracket)


def _write(
    options: argparse.Namespace,
    program: Headless,
    state: CaptureState,
    settings: CaptureSettings,
    kept: Sequence[KeptPhotograph],
    notes: Sequence[str],
) -> None:
    from studio_core.imaging.environment_out import write_cube, write_environment

    captured = state.captured
    assert captured is not None
    scale = captured.calibration.luminance_scale
    if options.out is not None:
        pixels, unresolved = captured.environment.pixels, captured.unresolved
        write_environment(options.out, pixels, unresolved=unresolved, luminance_scale=scale)
    if options.cubemap is not None:
        write_cube(options.cubemap, captured.faces, options.cube_layout, luminance_scale=scale)
    if options.project is not None:
        with program.job("Saving"):
            _save(options.project, state, settings, kept)
    if options.report is not None:
        _write_report(options.report, {**captured.report, "notes": list(notes)})


def _write_report(path: Path, report: Mapping[str, Any]) -> None:
    from studio_core.capturing.report import report_text

    beside = path.with_name(f".{path.stem[:40]}-{secrets.token_hex(6)}.json")
    try:
        beside.write_text(report_text(report) + "\n", encoding="utf-8")
        beside.replace(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        beside.unlink(missing_ok=True)


def _save(path: Path, state: CaptureState, settings: CaptureSettings, kept: Sequence[KeptPhotograph]) -> None:
    """The capture and its environment as one step of a project's history."""
    from studio.verbs_script import open_project
    from studio_core.capturing import edits
    from studio_core.project.lock import acquire
    from studio_core.project.records import History
    from studio_core.project.store import save

    assert state.captured is not None
    there = _holds_something(path)
    with acquire(path) if there else nullcontext():
        document, project = open_project(path if there else None)
        add = edits.add_capture(tuple(kept), settings)
        with document.grouped("Capture the room's light"):
            document.apply(add)
            document.apply(edits.use_capture(document.scene, add.nodes[0].id, state.captured))
        history = History(document.history, document.position)
        session = project.session if project else None
        save(path, document.scene, label="Capture", history=history, session=session)


def _percent(share: float) -> str:
    return f"{100 * share:.0f}" if share > 0.1 else f"{100 * share:.2g}"


def _tell(
    options: argparse.Namespace,
    program: Headless,
    state: CaptureState,
    notes: Sequence[str],
    photographs: int,
) -> None:
    from studio_core.capturing.report import plain

    captured = state.captured
    assert captured is not None
    height, width = captured.environment.pixels.shape[:2]
    lost = float((captured.unresolved > 0).mean())
    places = [p for p in (options.out, options.cubemap, options.report, options.project) if p is not None]
    values = {
        "out": None if options.out is None else str(options.out),
        "written": [str(place) for place in places],
        "photographs": photographs,
        "width": width,
        "height": height,
        "unresolved": lost,
        "notes": list(notes),
        "report": plain(captured.report),
    }
    text = f"{places[0]}: {width} × {height} from {photographs} photograph{'s' if photographs > 1 else ''}"
    result(options, program, values, f"{text}, {_percent(lost)} % unresolved" if lost else text)
