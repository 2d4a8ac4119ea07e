"""`lucarne bench window`: what another light, a moved object and another view cost the GPU's canvas.

The sample room's meshes at two sizes, in made-up light. Bytes and calls are counted where vispy hands them to
OpenGL, not where we ask for them; times end when OpenGL has finished. Needs EGL, and no window.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report, Timing
from studio.headless import Headless
from studio_core.errors import LucarneError
from studio_core.scene.diff import Changes
from studio_core.scene.nodes import Scene
from studio_core.scene.transform import Transform
from studio_core.session import View

if TYPE_CHECKING:
    from studio_core.shading.artifacts import Picture
    from studio_core.shading.job import Job
    from studio_ui.canvas.gl_context import Offscreen

SIZES = {"27k": 27_000, "300k": 300_000}
PIXELS = (1280, 720)
COLOUR = 12  # bytes
Bools = npt.NDArray[np.bool_]


class Counted:
    """Bytes, uploads and draw calls that go through `vispy.gloo.gl`, from when this is made."""

    def __init__(self) -> None:
        from vispy.gloo import gl

        self._gl = gl
        self._kept: dict[str, Any] = {}
        self.begin()
        for name in ("glBufferData", "glBufferSubData", "glTexSubImage2D"):
            self._wrap(name, self._upload)
        for name in ("glDrawElements", "glDrawArrays"):
            self._wrap(name, self._draw)

    def begin(self) -> None:
        """From zero."""
        self.bytes = self.uploads = self.draws = 0

    def close(self) -> None:
        """Count no more."""
        for name, call in self._kept.items():
            setattr(self._gl, name, call)

    def _wrap(self, name: str, count: Callable[..., None]) -> None:
        call = self._kept[name] = getattr(self._gl, name)

        def counted(*arguments: Any) -> Any:
            count(*arguments)
            return call(*arguments)

        setattr(self._gl, name, counted)

    def _upload(self, *arguments: Any) -> None:
        for data in arguments:
            if isinstance(data, np.ndarray):
                self.bytes += data.nbytes
                self.uploads += 1

    def _draw(self, *_: Any) -> None:
        self.draws += 1


def run(report: Report, program: Headless) -> None:
    """Rows SIZE/CASE: bytes that changed and that were moved, calls, milliseconds of upload and drawing."""
    try:
        from studio_ui.canvas.gl_context import Offscreen, names

        screen = Offscreen()
    except Exception as error:
        raise LucarneError(f"OpenGL without a window does not work here: {error}") from error
    report.notes.append(f"Drawn by {names()[0]}, {PIXELS[0]}×{PIXELS[1]} pixels of four samples.")
    counted = Counted()
    try:
        for name, vertices in SIZES.items():
            with program.job(f"{name} vertices") as job:
                _measure(report, name, _picture(program, vertices, job), screen, counted)
    finally:
        counted.close()
        screen.close()


def _measure(report: Report, name: str, picture: Picture, screen: Offscreen, counted: Counted) -> None:
    from studio_ui.canvas.gl_renderer import Look

    mesh, view = picture.radiance.surfaces.mesh, _view(picture)
    seen = picture.radiance.valid
    everything = dataclasses.replace(picture.radiance, valid=np.ones_like(seen))
    picture = dataclasses.replace(picture, radiance=everything)
    report.add(name, "vertices", len(mesh), "1")
    report.add(name, "objects", len(mesh.objects), "1")
    one = np.zeros_like(seen)
    one[mesh.vertices_of(int(np.argmax(np.diff(mesh.vertex_offsets))))] = True
    changes = {"all": np.ones_like(seen), "seen": seen, "one_object": one, "nothing": np.zeros_like(seen)}
    rng = np.random.default_rng(0)
    with screen.target(view.width, view.height):

        def show(picture: Picture, view: View = view) -> tuple[float, float]:
            """Seconds of upload and of drawing."""
            counted.begin()
            begun = time.perf_counter()
            screen.renderer.show(picture)
            screen.finish()
            uploaded = time.perf_counter()
            screen.renderer.draw(Look(view))
            screen.finish()
            return uploaded - begun, time.perf_counter() - uploaded

        report.add(name, "first_ms", 1000 * sum(show(picture)), "ms")
        report.add(name, "first_bytes", counted.bytes, "B")
        for case, changed in changes.items():
            expected = _changed_bytes(picture, changed, screen)
            times = [show(picture := _relit(picture, changed, rng)) for _ in range(3 if report.quick else 15)]
            _rows(report, f"{name}/{case}", expected, counted, times)
        moved, turned = _moved(picture), dataclasses.replace(view, fov=view.fov * 0.9)
        _rows(report, f"{name}/moved", 0, counted, [show(moved)])
        _rows(report, f"{name}/turned", 0, counted, [show(moved, turned)])


def _rows(
    report: Report, case: str, expected: int, counted: Counted, times: list[tuple[float, float]]
) -> None:
    report.add(case, "changed", expected, "B")
    report.add(case, "moved", counted.bytes, "B")
    report.add(case, "uploads", counted.uploads, "1")
    report.add(case, "draw_calls", counted.draws, "1")
    for metric, seconds in zip(("upload_ms", "draw_ms"), zip(*times, strict=True), strict=True):
        timing = Timing.of(seconds)
        report.add(case, metric, 1000 * timing.median, "ms", 1000 * timing.spread)


def _changed_bytes(picture: Picture, changed: Bools, screen: Offscreen) -> int:
    """What the colours take that change: one for each vertex, two where a picture is on it, or four."""
    from studio_core.kernels.compose import AFFINE, GENERAL

    mesh = picture.radiance.surfaces.mesh
    total = 0
    for index, body in enumerate(screen.renderer.scene.bodies):
        kinds = {batch.kind for batch in body.batches}
        colours = 1 + (AFFINE in kinds) + 3 * (GENERAL in kinds)
        total += COLOUR * colours * int(changed[mesh.vertices_of(index)].sum())
    return total


def _relit(picture: Picture, changed: Bools, rng: np.random.Generator) -> Picture:
    """The picture with other colours at some vertices."""
    colours = picture.colours
    assert colours is not None
    record, sums = colours.record.copy(), colours.sums.copy()
    for values in (record[:, :6], sums):
        if len(values):
            values[changed] = rng.random((int(changed.sum()), values.shape[1]), np.float32)
    return dataclasses.replace(picture, colours=dataclasses.replace(colours, record=record, sums=sums))


def _moved(picture: Picture) -> Picture:
    """The picture with its first object elsewhere."""
    surfaces = picture.radiance.surfaces
    mesh = surfaces.mesh.moved(0, Transform((0.1, 0.0, 0.1)) @ surfaces.mesh.objects[0].transform)
    radiance = dataclasses.replace(picture.radiance, surfaces=dataclasses.replace(surfaces, mesh=mesh))
    return dataclasses.replace(picture, radiance=radiance)


def _view(picture: Picture) -> View:
    hits = picture.radiance.hits
    assert hits is not None
    return dataclasses.replace(hits.view, width=PIXELS[0], height=PIXELS[1])


def _picture(program: Headless, vertices: int, job: Job) -> Picture:
    """The sample room, dark: hits, meshes and maps are real, and nothing was summed."""
    from studio.samples import sample
    from studio_core.project.store import load
    from studio_core.raster import PictureStage
    from studio_core.shading.artifacts import TERMS, Hits, LayerRadiance, Radiance, Surfaces
    from studio_core.shading.frame import Frame
    from studio_core.shading.offline import scene_view
    from studio_core.shading.pipeline import Inputs, Pipeline
    from studio_core.shading.primary import visible_vertices
    from studio_core.shading.stages import SurfaceParams, common_stages

    scene: Scene = load(sample()).scene
    view = dataclasses.replace(scene_view(scene, None, 640, 360), antialias=1)
    stages = common_stages(program.services)
    pipeline = Pipeline(stages)
    pipeline.update(Frame(scene, view, SurfaceParams(vertices=vertices), 1), Changes(), job)
    surfaces, hits = pipeline.artifact(Surfaces), pipeline.artifact(Hits)
    assert surfaces is not None
    assert hits is not None
    count = len(surfaces.mesh)
    nothing = LayerRadiance(np.zeros((count, TERMS, 3), np.float32), np.zeros((count, 3), np.float32))
    seen = visible_vertices(surfaces, hits)
    radiance = Radiance(surfaces, hits, {"none": nothing}, seen, 1024, True)
    inputs = Inputs({Surfaces: surfaces, Hits: hits, Radiance: radiance}, Changes())
    made: Picture = PictureStage(program.services).run(Frame(scene, view, None, 1), inputs, job)
    return made
