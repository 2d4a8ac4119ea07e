"""The verbs that make, render, measure and export projects, without a display and without Qt."""

from __future__ import annotations

import argparse
import json
import runpy
import sys
from pathlib import Path
from typing import Any

import numpy as np

from studio.headless import Headless
from studio_core.contract import ShadingBackend
from studio_core.errors import InputError
from studio_core.scene.nodes import Light, Scene

PICTURES = (".png", ".exr")


def result(options: argparse.Namespace, values: dict[str, Any], text: str) -> None:
    """The machine-readable result with --json, else a line for people, on stdout."""
    print(json.dumps(values, indent=1) if options.json else text)


def new(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne new`."""
    from studio.build_scene import build
    from studio_core.project.store import save

    if options.out.suffix != ".lucarne":
        raise InputError(f"{options.out}: a project's name ends in .lucarne")
    scene, notes = build(options, program.registry)
    for note in notes:
        program.say(note)
    save(options.out, scene, label="New", fresh=True)
    faces = sum(len(node.geometry.faces) for node in scene.nodes.values() if hasattr(node, "geometry"))
    values = {"project": str(options.out), "nodes": len(scene.nodes), "faces": faces, "notes": notes}
    result(options, values, f"{options.out}: {len(scene.nodes)} nodes, {faces} faces")


def open_scene(path: Path) -> Scene:
    """The scene of a project file."""
    from studio_core.project.store import load

    return load(path).scene


def chosen_backend(
    options: argparse.Namespace, program: Headless, **extra: Any
) -> tuple[ShadingBackend, Any]:
    """Backend and parameters from --backend, --param, --directions."""
    from studio_core.shading.offline import backend_params

    if options.indirect is not None:
        raise InputError(f"--indirect {options.indirect}: no indirect layer of that name is installed")
    backend: ShadingBackend = program.registry.get("backend", options.backend)
    values: dict[str, object] = dict(extra)
    for text in options.param:
        name, equals, value = text.partition("=")
        if not equals:
            raise InputError(f"--param {text!r}: write KEY=VALUE")
        values[name] = value
    return backend, backend_params(backend, values)


def parse_size(text: str) -> tuple[int, int]:
    """(width, height) from WxH."""
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        raise InputError(f"--size {text!r}: write WIDTHxHEIGHT") from None
    if not (1 <= width <= 16384 and 1 <= height <= 16384):
        raise InputError(f"--size {text!r}: expected 1 to 16384 pixels each way")
    return width, height


def render(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne render`."""
    if options.out.suffix.lower() not in PICTURES:
        raise InputError(f"{options.out}: pictures are written as .png or .exr")
    if not options.out.parent.is_dir():
        raise InputError(f"{options.out}: the folder {options.out.parent} does not exist")
    backend, params = chosen_backend(options, program)
    scene = open_scene(options.project)
    values = render_scene(scene, options, program, backend, params)
    values |= {"project": str(options.project), "backend": backend.id}
    result(
        options, values, f"{options.out}: {values['width']}×{values['height']}, {values['vertices']} vertices"
    )


def render_scene(
    scene: Scene, options: argparse.Namespace, program: Headless, backend: ShadingBackend, params: Any
) -> dict[str, Any]:
    """Write the picture of a scene; what was done, as values."""
    import dataclasses

    from studio_core.imaging.picture import write_picture
    from studio_core.shading.offline import picture, scene_view

    width, height = parse_size(options.size)
    view = dataclasses.replace(scene_view(scene, options.camera, width, height), antialias=options.antialias)
    with program.job("Rendering") as job:
        made = picture(scene, view, backend, params, program.services, job)
    write_picture(options.out, made.linear, exposure=options.exposure, kind=options.tonemap)
    finite = bool(np.isfinite(made.linear).all())
    return {
        "picture": str(options.out),
        "width": width,
        "height": height,
        "vertices": len(made.radiance.valid),
        "shaded": int(made.radiance.valid.sum()),
        "directions": made.radiance.directions,
        "finite": finite,
        "mean": float(made.linear.mean()),
        "counts": dict(made.radiance.counts),
    }


def radiance(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne radiance`."""
    from studio_core.shading.offline import scene_view, shade

    extra: dict[str, Any] = {"directions": str(options.directions)} if options.directions else {}
    backend, params = chosen_backend(options, program, everywhere=True, **extra)
    scene = open_scene(options.project)
    view = scene_view(scene, options.camera, 320, 180)
    with program.job("Shading") as job:
        made = shade(scene, view, backend, params, program.services, job)
    write_radiance(options.out, scene, made, program)
    values = {"out": str(options.out), "vertices": len(made.valid), "directions": made.directions}
    result(options, values, f"{options.out}: {len(made.valid)} vertices, {made.directions} directions")


def write_radiance(path: Path, scene: Scene, made: Any, program: Headless) -> None:
    """Per shading vertex: node, position, normal, area, radiance towards the camera, irradiance (npz)."""
    from studio_core.shading.vertex_radiance import vertex_radiance

    lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
    mesh = made.surfaces.mesh
    with path.open("wb") as file:
        np.savez_compressed(
            file,
            nodes=np.array(made.surfaces.nodes),
            names=np.array([scene[node].name for node in made.surfaces.nodes]),
            node=mesh.object,
            position=mesh.positions + mesh.origin,
            normal=mesh.normals,
            area=mesh.area,
            side=mesh.side,
            radiance=vertex_radiance(scene, made, program.registry),
            irradiance=made.irradiance(lights),
            valid=made.valid,
            directions=np.int64(made.directions),
        )


def info(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne info`."""
    from studio_core.project.store import info as project_info

    found = project_info(options.file)
    revisions = [{"id": r.id, "parent": r.parent, "label": r.label, "time": r.time} for r in found.revisions]
    values: dict[str, Any] = {
        "project": str(found.path),
        "format": found.format,
        "saved by": found.program,
        "file bytes": found.file_bytes,
        "array bytes": found.array_bytes,
        "arrays": found.arrays,
        "items": found.items,
        "undo steps": found.steps,
        "nodes": dict(found.nodes),
        "materials": dict(found.materials),
        "opened by": found.opened_by,
        "revisions": revisions,
    }
    shown = {**values, "opened by": found.opened_by or "nobody", "revisions": len(revisions)}
    shown |= {
        key: ", ".join(f"{n} {kind}" for kind, n in values[key].items()) for key in ("nodes", "materials")
    }
    result(options, values, "\n".join(f"{key:<12} {value}" for key, value in shown.items()))


def export(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne export`."""
    scene = open_scene(options.project)
    suffix = options.out.suffix.lower()
    found = None
    for name in program.registry.names("exporter"):
        exporter = program.registry.get("exporter", name)
        if suffix in exporter.extensions or (not suffix and not exporter.extensions):
            found = exporter
            break
    if found is None:
        raise InputError(f"{options.out}: write to a .glb file, or to a folder for Mitsuba 3")
    notes = found.save(scene, options.out, program.registry)
    for note in notes:
        program.say(note)
    result(options, {"out": str(options.out), "notes": list(notes)}, f"{options.out}: {found.label}")


def script(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne script`: a Python file with `studio_core` at hand, as `__main__`."""
    if not options.file.is_file():
        raise InputError(f"{options.file}: no such file")
    sys.argv = [str(options.file), *options.args]
    sys.path.insert(0, str(options.file.resolve().parent))
    runpy.run_path(str(options.file), run_name="__main__")


def demo(options: argparse.Namespace, program: Headless) -> int:
    """`lucarne demo`: the sample room in a window, or rendered where there is no display."""
    from studio.display import why_no_window
    from studio.samples import sample

    path = sample()
    reason = "asked for with --headless" if options.headless else why_no_window()
    if not reason:
        from studio.app import run_window

        return run_window(path)
    options.project, options.backend, options.param, options.indirect = path, "reference", [], None
    if options.out is None:
        options.out = Path("living-room.png")
    program.say(f"Rendering the sample room to {options.out.resolve()} ({reason})")
    render(options, program)
    return 0
