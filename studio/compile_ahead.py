"""Compile ahead: what the first drag of a fresh installation would otherwise wait for.

Kernels are compiled when they are first called, which takes seconds each, and kept on disk. `work` goes
through the edits of the window on a small picture of the sample room. The window starts this module as a
process of low priority after its first picture, so that its own threads stay free, and once for each state of
the sources.
"""

from __future__ import annotations

import dataclasses
import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from studio.headless import Headless

LOW = 15  # niceness


def mark() -> Path | None:
    """The file that says that all is compiled for these sources; None where nothing is kept on disk."""
    from studio_core import jit

    if jit.CACHE_FOLDER is None:
        return None
    root = Path(jit.__file__).parents[1]
    facts = []
    for package in ("studio_core", "plugins/studio_plugins", "studio_plugins"):
        for path in sorted((root / package).rglob("*.py")):
            stat = path.stat()
            facts.append(f"{path.relative_to(root)} {stat.st_size} {stat.st_mtime_ns}")
    return (
        jit.CACHE_FOLDER / f"ahead-{hashlib.blake2b(chr(10).join(facts).encode(), digest_size=8).hexdigest()}"
    )


def start() -> subprocess.Popen[bytes] | None:
    """The process that compiles, or None where there is nothing to do or it cannot be started."""
    path = mark()
    if path is None or path.exists():
        return None
    quiet: dict[str, Any] = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    if sys.platform == "win32":
        quiet["creationflags"] = subprocess.BELOW_NORMAL_PRIORITY_CLASS | subprocess.CREATE_NO_WINDOW
    try:
        return subprocess.Popen([sys.executable, "-m", "studio.compile_ahead"], **quiet)
    except OSError:
        return None


def work(program: Headless) -> None:
    """The edits of the window, once each, on a small picture; nothing is kept but compiled kernels."""
    from studio.samples import sample
    from studio_core.edits import Move
    from studio_core.project.store import load
    from studio_core.raster import PictureStage
    from studio_core.scene.diff import Changes, diff, view_changed
    from studio_core.scene.nodes import Environment, Group, Scene
    from studio_core.scene.transform import Transform
    from studio_core.session import Session, View
    from studio_core.shading.error_meter import ErrorMeter
    from studio_core.shading.frame import Frame
    from studio_core.shading.job import Job
    from studio_core.shading.offline import backend_params, scene_view
    from studio_core.shading.pipeline import Pipeline

    services = dataclasses.replace(program.services, cache=None)
    backend = program.registry.get("backend", Session().backend)
    params = backend_params(backend, {"vertices": 1500, "directions": "4096"})
    pipeline = Pipeline([*backend.stages(services), PictureStage(services)])
    first: list[Frame] = []

    def show(scene: Scene, view: View, moving: bool) -> None:
        frame = Frame(scene, view, params, len(first) + 1, moving)
        changes = diff(first[-1].scene, scene) | view_changed() if first else Changes()
        pipeline.update(frame, changes, Job("compiling ahead", on_publish=lambda _: None))
        first.append(frame)

    scene = load(sample()).scene
    view = dataclasses.replace(scene_view(scene, None, 160, 90), fine_edges=True)
    moving = dataclasses.replace(view, antialias=1, fine_edges=False)
    sky = next(scene.of(Environment))
    turned = scene.with_nodes(dataclasses.replace(sky, azimuth=sky.azimuth + 20))
    step = Transform((0.1, 0.0, 0.05))
    moved = [Move({group.id: step @ group.transform})(scene) for group in scene.of(Group)]
    aside = dataclasses.replace(view, transform=Transform((0.1, 0.0, 0.0)) @ view.transform)
    show(scene, view, False)
    for at in (*moved, turned):
        show(at, moving, True)
    show(turned, view, False)
    show(moved[0], view, False)
    show(scene, dataclasses.replace(aside, antialias=1, fine_edges=False), True)
    show(scene, aside, False)
    show(_embossed(scene), aside, False)
    ErrorMeter(services)(pipeline, first[-1], Job("measuring ahead"))
    pipeline.complete(first[-1], Job("completing ahead"))
    _bounce(program, first[-1])
    _stroke(program, first[0])


def _bounce(program: Headless, frame: Any) -> None:
    """Light between surfaces: by path tracing, which errors are measured by, and as the window shows it."""
    from studio_core.shading.offline import backend_params, indirect_choice, measured_picture

    backend = program.registry.get("backend", "reference")
    params = backend_params(backend, {"vertices": 1500, "directions": "1024"})
    services = dataclasses.replace(program.services, cache=None)
    paths = indirect_choice(program.registry, "paths", {"samples": 4})
    gather = indirect_choice(program.registry, "gather", {})
    for scene, method in ((frame.scene, paths), (frame.scene, gather), (_embossed(frame.scene), gather)):
        measured_picture(scene, frame.view, backend, params, services, 4, indirect=method)
    _bounce_in_hand(frame, services, backend, params, gather)


def _bounce_in_hand(frame: Any, services: Any, backend: Any, params: Any, gather: Any) -> None:
    """What is traced again while something moves."""
    from studio_core.edits import Move
    from studio_core.raster import PictureStage
    from studio_core.scene.diff import Changes, diff
    from studio_core.scene.nodes import Group
    from studio_core.scene.transform import Transform
    from studio_core.shading.indirect import with_indirect
    from studio_core.shading.job import Job
    from studio_core.shading.pipeline import Pipeline

    pipeline = Pipeline([*with_indirect(backend.stages(services), services), PictureStage(services)])
    still = dataclasses.replace(frame, params=params, moving=True, indirect=gather)
    pipeline.update(still, Changes(), Job("compiling ahead"))
    group = next(frame.scene.of(Group))
    scene = Move({group.id: Transform((0.1, 0.0, 0.05)) @ group.transform})(frame.scene)
    moved = dataclasses.replace(still, scene=scene)
    pipeline.update(moved, diff(frame.scene, scene), Job("compiling ahead"))


def _stroke(program: Headless, frame: Any) -> None:
    """A stroke on the picture, and the painted scene."""
    from studio_core.shading.job import Job
    from studio_core.shading.offline import backend_params
    from studio_core.strokes.brush import Brush
    from studio_core.strokes.planned import Look, PaintedStroke
    from studio_core.strokes.session import Easel, paint_and_solve
    from studio_core.strokes.stroke import BRIGHTEN
    from studio_core.strokes.tools import Gesture

    solver = program.registry.get("solver", "joint")
    backend = program.registry.get("backend", "reference")
    services = dataclasses.replace(program.services, cache=None)
    easel = Easel(backend, backend_params(backend, {"vertices": 1500, "directions": "1024"}), services)
    gesture = Gesture.of(Brush(size=0.2), [(0.5, 0.5), (0.6, 0.6)])
    planned = PaintedStroke(BRIGHTEN, gesture, look=Look(width=160, height=90))
    made = paint_and_solve(frame.scene, [planned], solver, solver.Params(), easel, services)
    easel.picture(made.scene, planned.look.view(made.scene), Job("compiling ahead"))


def _embossed(scene: Any) -> Any:
    """The scene with a normal map on all that is drawn."""
    import numpy as np

    from studio_core.scene.geometry import Image, Texture
    from studio_core.shading.normal_maps import NORMAL

    slope = np.linspace(-0.5, 0.5, 8)
    across, up = np.meshgrid(slope, slope)
    texels = np.stack([0.5 + 0.5 * across, 0.5 + 0.5 * up, np.ones_like(up)], axis=2).astype(np.float32)
    bumps = Texture(Image(texels, "data"))
    made = [
        dataclasses.replace(material, textures={**material.textures, NORMAL: bumps})
        for material in scene.materials.values()
    ]
    return scene.with_materials(*made)


def main() -> int:
    """Compile what is not compiled yet."""
    path = mark()
    if path is None or path.exists():
        return 0
    if sys.platform != "win32":
        os.nice(LOW)
    program = Headless(quiet=True, threads=1, out=None)
    try:
        work(program)
        path.write_bytes(b"")
    finally:
        program.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
