"""The verbs that make, render, measure and export projects, without a display and without Qt."""

from __future__ import annotations

import argparse
import json
import os
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from studio.headless import Headless
from studio.indirect_options import chosen_indirect
from studio.values import key_values
from studio_core.contract import ShadingBackend
from studio_core.errors import InputError, ProjectError
from studio_core.scene.nodes import Light, Scene


def result(options: argparse.Namespace, program: Headless, values: dict[str, Any], text: str) -> None:
    """The machine-readable result with --json, else a line for people, on stdout."""
    program.result(json.dumps(values, indent=1, allow_nan=False) if options.json else text)


def check_target(path: Path, suffixes: Sequence[str] = (), what: str = "files") -> None:
    """InputError when a file of that name cannot be written: asked before the work, not after it."""
    if suffixes and path.suffix.lower() not in suffixes:
        raise InputError(f"{path}: {what} are written as {' or '.join(suffixes)}")
    folder = path.parent
    if not folder.is_dir():
        raise InputError(f"{path} cannot be written: there is no folder {folder}")
    if path.is_dir():
        raise InputError(f"{path} cannot be written: it is a folder")
    if not os.access(folder, os.W_OK):
        raise InputError(f"{path} cannot be written: access to the folder {folder} is denied")


def new(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne new`."""
    from studio.build_scene import build
    from studio_core.project.store import save

    out = options.out
    check_target(out, (".lucarne",), "projects")
    with replacing_if_there(out, program):
        scene, notes = build(options, program.registry)
        for note in notes:
            program.say(note)
        save(out, scene, label="New", fresh=True)
    faces = sum(len(node.geometry.faces) for node in scene.nodes.values() if hasattr(node, "geometry"))
    values = {"project": str(out), "nodes": len(scene.nodes), "faces": faces, "notes": notes}
    result(options, program, values, f"{out}: {len(scene.nodes)} nodes, {faces} faces")


def replacing_if_there(path: Path, program: Headless) -> AbstractContextManager[None]:
    """Around the writing of a project; InputError where what is there is none, or somebody has it open."""
    return _replacing(path, program) if _holds_something(path) else nullcontext()


def _holds_something(path: Path) -> bool:
    return os.path.lexists(path) and not (path.is_file() and path.stat().st_size == 0)


@contextmanager
def _replacing(path: Path, program: Headless) -> Iterator[None]:
    """Around a save over a project: nobody has it open, and what it held is kept beside it as NAME~."""
    from studio_core.project.lock import acquire
    from studio_core.project.recovery import discard, recovery_path
    from studio_core.project.store import info as project_info

    try:
        project_info(path)
    except ProjectError as error:
        raise InputError(f"{path} is there and is no project that can be replaced ({error})") from None
    path = path.resolve()
    kept = path.with_name(f"{path.name}~")
    with acquire(path):
        if kept.is_dir():
            raise InputError(f"{path} cannot be replaced: the folder {kept} is where it would be kept")
        beside = path.with_name(f".{path.name}.{secrets.token_hex(4)}.old")
        try:
            try:
                os.link(path, beside)
            except OSError:
                shutil.copy2(path, beside)
            yield
            beside.replace(kept)
        finally:
            beside.unlink(missing_ok=True)
        discard(recovery_path(path))  # of a session with what is now in NAME~
    program.say(f"{path.name} was there: it is now {kept.name}")


def open_scene(path: Path) -> Scene:
    """The scene of a project file."""
    from studio_core.project.store import load

    return load(path).scene


def chosen_backend(
    options: argparse.Namespace, program: Headless, **extra: Any
) -> tuple[ShadingBackend, Any]:
    """Backend and parameters from --backend, --param, --directions."""
    from studio_core.shading.offline import backend_params

    backend: ShadingBackend = program.registry.get("backend", options.backend)
    values = {**extra, **key_values("--param", options.param)}
    try:
        return backend, backend_params(backend, values)
    except InputError as error:
        raise InputError(f"--param: {error}") from None


def radiance(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne radiance`."""
    from studio_core.shading.offline import ray_origins, scene_view, shaded_pipeline

    check_target(options.out, (".npz",), "vertices")
    extra = {} if options.directions is None else {"directions": str(options.directions)}
    backend, params = chosen_backend(options, program, everywhere=True, **extra)
    choice = chosen_indirect(options, program)
    scene = open_scene(options.project)
    view = scene_view(scene, options.camera, 320, 180)
    with program.job("Shading") as job:
        given = (scene, view, backend, params, program.services, job)
        made, pipeline = shaded_pipeline(*given, indirect=choice)
    write_radiance(options.out, scene, made, ray_origins(pipeline, made), program)
    values = {
        "project": str(options.project),
        "out": str(options.out),
        "backend": backend.id,
        "indirect": choice.method if choice is not None else None,
        "vertices": len(made.valid),
        "directions": made.directions,
    }
    result(
        options,
        program,
        values,
        f"{options.out}: {len(made.valid)} vertices, {made.directions} directions",
    )


def write_radiance(path: Path, scene: Scene, made: Any, origins: Any, program: Headless) -> None:
    """Per shading vertex: node, position, normal, area, radiance towards the camera, irradiance (npz).

    `origin` is where the vertex' rays start: in creases another origin sees something else.
    """
    from studio_core.shading.vertex_radiance import vertex_radiance

    lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
    mesh = made.surfaces.mesh
    columns = {
        "nodes": np.array(made.surfaces.nodes, str),
        "names": np.array([scene[node].name for node in made.surfaces.nodes], str),
        "node": mesh.object,
        "position": mesh.positions + mesh.origin,
        "origin": origins,
        "normal": mesh.normals,
        "area": mesh.area,
        "side": mesh.side,
        "radiance": vertex_radiance(scene, made, program.registry),
        "irradiance": made.irradiance(lights),
        "valid": made.valid,
        "directions": np.int64(made.directions),
    }
    beside = path.with_name(f".{path.stem[:40]}-{secrets.token_hex(6)}.npz")
    try:
        with beside.open("wb") as file:
            np.savez_compressed(file, **columns)
        beside.replace(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
    finally:
        beside.unlink(missing_ok=True)


def info(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne info`."""
    from studio_core.project.store import info as project_info

    found = project_info(options.file)
    revisions = [{"id": r.id, "parent": r.parent, "label": r.label, "time": r.time} for r in found.revisions]
    values: dict[str, Any] = {
        "project": str(found.path),
        "format": found.format,
        "saved_by": found.program,
        "file_bytes": found.file_bytes,
        "array_bytes": found.array_bytes,
        "arrays": found.arrays,
        "items": found.items,
        "undo_steps": found.steps,
        "nodes": dict(found.nodes),
        "materials": dict(found.materials),
        "opened_by": found.opened_by,
        "revisions": revisions,
    }
    shown = {**values, "opened_by": found.opened_by or "nobody", "revisions": len(revisions)}
    for key in ("nodes", "materials"):
        shown[key] = ", ".join(f"{count} {kind}" for kind, count in values[key].items()) or "none"
    lines = [f"{key.replace('_', ' '):<12} {value}" for key, value in shown.items()]
    result(options, program, values, "\n".join(lines))


def export(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne export`."""
    out = options.out
    suffix = "" if out.is_dir() else out.suffix.lower()
    offered = [program.registry.get("exporter", name) for name in program.registry.names("exporter")]
    fitting = [one for one in offered if suffix in one.extensions or (not suffix and not one.extensions)]
    if not fitting:
        known = ", ".join(sorted(kind for one in offered for kind in one.extensions)) or "none"
        raise InputError(f"{out}: write to a file ({known}), or to a folder for Mitsuba 3")
    if suffix:
        check_target(out)
    elif out.exists() and not out.is_dir():
        raise InputError(f"{out} cannot be written: it is a file, and Mitsuba's scene is a folder")
    scene = open_scene(options.project)
    notes = list(fitting[0].save(scene, out, program.registry))
    for note in notes:
        program.say(note)
    values = {"project": str(options.project), "out": str(out), "notes": notes}
    result(options, program, values, f"{out}: {fitting[0].label}")


def demo(options: argparse.Namespace, program: Headless) -> int:
    """`lucarne demo`: the sample room in a window, or rendered where there is no display."""
    from studio.display import why_no_window
    from studio.samples import sample
    from studio.verbs_pictures import check_picture, render

    options.project = sample()
    if options.headless or options.out is not None:
        reason = "a picture was asked for"
    else:
        reason = why_no_window()
    if not reason:
        from studio.app import run_window

        return run_window(options.project)
    if options.out is None:
        options.out = Path("living-room.png")
    check_picture(options, options.out)
    chosen_backend(options, program)
    program.say(f"Rendering the sample room to {options.out.resolve()} ({reason})")
    render(options, program)
    return 0
