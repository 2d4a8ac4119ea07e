"""The part of `lucarne bench materials` about normal maps: a floor with each, cases `normals/NAME/KIND`.

`normal_flat_error` is the relative RMSE of the picture without the map, `normal_error` with it, against each
place's own normal, by `ErrorMeter`. `sum_cost_ratio`, `pixel_cost_ratio` and `shader_cost_ratio` are what
light sums, pixels and OpenGL's drawing cost with a map over what they cost without, where all of the floor
has one.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report, Timing
from studio.headless import Headless
from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.raster import PictureStage
from studio_core.scene.diff import everything, view_changed
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import Camera, Environment, Material, MeshObject, PointLamp, Scene
from studio_core.scene.transform import Transform, looking
from studio_core.session import View
from studio_core.shading.artifacts import Error, Picture
from studio_core.shading.error_meter import ErrorMeter
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.normal_maps import NORMAL
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Pipeline

F64 = npt.NDArray[np.float64]

TEXELS = 64
REPEATS = 4
WIDTH, HEIGHT = 480, 270
PIXELS = (900, 600)
PLACES = 1500
VERTICES = 20_000


def of_heights(heights: F64) -> Image:
    """A normal map of heights (N, N), a texel's side each, repeated; rows from v = 0 up."""
    across = (np.roll(heights, -1, 1) - np.roll(heights, 1, 1)) / 2
    up = (np.roll(heights, -1, 0) - np.roll(heights, 1, 0)) / 2
    normals = np.stack([-across, -up, np.ones_like(heights)], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return Image(np.rint((normals[::-1] + 1) * 127.5).astype(np.uint8), "data")


def pictures() -> dict[str, Image]:
    """Made-up surfaces by name."""
    v, u = (np.indices((TEXELS, TEXELS)) + 0.5) / TEXELS
    turn = 2 * np.pi
    row = np.floor(4 * v)
    along = (2 * u + 0.5 * (row % 2)) % 1
    edge = np.minimum(np.minimum(along, 1 - along) / 2, np.minimum(4 * v % 1, 1 - 4 * v % 1) / 4)
    joint = np.clip(edge * TEXELS / 3, 0, 1)
    over = np.sin(turn * 4 * u) * np.sin(turn * 4 * v) > 0
    weave = np.where(over, np.abs(np.sin(turn * 4 * u)), np.abs(np.sin(turn * 4 * v)))
    rng = np.random.default_rng(4)
    hammered = np.zeros((TEXELS, TEXELS))
    for x, y in rng.random((40, 2)):
        du, dv = (u - x + 0.5) % 1 - 0.5, (v - y + 0.5) % 1 - 0.5
        hammered -= np.exp(-(du**2 + dv**2) / (2 * 0.06**2))
    waves = np.sin(turn * (2 * u + np.sin(turn * v) / turn)) * np.cos(turn * 2 * v)
    return {
        "ripples": of_heights(0.5 * waves),
        "hammered": of_heights(2.0 * hammered),
        "weave": of_heights(2.0 * weave),
        "bricks": of_heights(1.5 * joint),
    }


KINDS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "matte": ("lambert", {"base_color": (0.6, 0.5, 0.4)}),
    "plastic-0.6": ("ggx", {"base_color": (0.5, 0.1, 0.1), "roughness": 0.6}),
    "plastic-0.4": ("ggx", {"base_color": (0.5, 0.1, 0.1), "roughness": 0.4}),
    "metal-0.6": ("ggx", {"base_color": (0.9, 0.7, 0.4), "roughness": 0.6, "metallic": 1.0}),
    "metal-0.4": ("ggx", {"base_color": (0.9, 0.7, 0.4), "roughness": 0.4, "metallic": 1.0}),
}


def floor_scene(kind: str, image: Image | None) -> Scene:
    """A floor of 4 m with a box on it, under a sky and a lamp."""
    model, values = KINDS[kind]
    textures = {} if image is None else {NORMAL: Texture(image, (REPEATS, REPEATS))}
    floor = Material(
        id="floor", name="Floor", model=model, values=frozen_map(values), textures=frozen_map(textures)
    )
    grey = Material(id="grey", name="Grey", values=frozen_map({"base_color": (0.5, 0.5, 0.5)}))
    nodes = (
        MeshObject(id="ground", name="Ground", geometry=_ground(4.0), materials=("floor",)),
        MeshObject(
            id="box",
            name="Box",
            geometry=_box(0.8),
            materials=("grey",),
            transform=Transform((0.3, 0.4, -0.4)),
        ),
        Camera(id="camera", name="Camera", transform=looking((2.2, 1.7, 2.6), (0, 0.2, 0))),
        Environment(id="sky", name="Sky", image=_sky()),
        PointLamp(id="lamp", name="Lamp", transform=Transform((-1.2, 1.6, 0.8)), intensity=6.0),
    )
    return Scene().with_materials(floor, grey).with_nodes(*nodes)


def _ground(size: float) -> Geometry:
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    places = np.stack([corners[:, 0] - 0.5, 0 * corners[:, 0], 0.5 - corners[:, 1]], axis=1)
    up = np.tile(np.array([0, 1, 0], np.float32), (4, 1))
    return Geometry(
        (size * places).astype(np.float32), np.array([(0, 1, 2), (0, 2, 3)], np.uint32), up, corners
    )


def _box(size: float) -> Geometry:
    corners = (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5) * size
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [(4 * q, 4 * q + i, 4 * q + i + 1) for q in range(6) for i in (1, 2)]
    return Geometry(corners[np.array(quads).ravel()].astype(np.float32), np.array(faces, np.uint32))


def _sky() -> Image:
    v, u = (np.indices((64, 128)) + 0.5) / np.array([64, 128]).reshape(2, 1, 1)
    up, around = np.cos(np.pi * v), 2 * np.pi * (u - 0.3)
    window = np.exp(-((up - 0.5) ** 2) / 0.05 - (np.cos(around) - 1) ** 2 / 0.2)
    grey = 0.3 + 0.15 * up + 4 * window
    return Image(np.stack([grey, grey, 0.1 + 1.05 * grey], axis=2).astype(np.float32))


def run(report: Report, program: Headless) -> None:
    """Rows `normals/NAME/KIND`, and `normals/cost`."""
    for name, image in pictures().items():
        for kind in KINDS:
            case = f"normals/{name}/{kind}"
            if not report.wants(case) or (report.quick and (name, kind) != ("bricks", "plastic-0.4")):
                continue
            flat, mapped = measured(program.services, kind, image)
            report.add(case, "normal_flat_error", flat.relative_rmse, "ratio", flat.uncertainty)
            report.add(case, "normal_error", mapped.relative_rmse, "ratio", mapped.uncertainty)
    case = "normals/cost"
    if report.wants(case):
        pair = floor_scene("plastic-0.4", None), floor_scene("plastic-0.4", pictures()["bricks"])
        for metric, (value, spread) in costs(program.services, pair, 1 if report.quick else 9).items():
            report.add(case, metric, value, "ratio", spread)


def measured(services: Services, kind: str, image: Image, backend: str = "cuts") -> tuple[Error, Error]:
    """Errors of the picture without and with the map, both against what the map's normals make."""
    found, true = [], floor_scene(kind, image)
    for shown in (floor_scene(kind, None), true):
        pipeline, frame = shaded(services, shown, backend)
        made = ErrorMeter(services)(
            pipeline, dataclasses.replace(frame, scene=true), Job("measuring"), PLACES
        )
        assert made is not None
        found.append(made.picture)
    return found[0], found[1]


def shaded(services: Services, scene: Scene, name: str = "cuts") -> tuple[Pipeline, Frame]:
    """A pipeline that has shaded a scene once, and for what."""
    backend = services.registry.get("backend", name)
    pipeline = Pipeline([*backend.stages(services), PictureStage(services)])
    frame = Frame(
        scene, scene_view(scene, None, WIDTH, HEIGHT), backend_params(backend, {"vertices": VERTICES}), 1
    )
    pipeline.update(frame, everything(scene), Job("shading"))
    return pipeline, frame


def costs(services: Services, scenes: tuple[Scene, Scene], repeats: int) -> dict[str, tuple[float, float]]:
    """What light sums and pixels of the second scene cost over those of the first, and how sure that is.

    The eye moves a little, in turn in front of both, so that what slows the machine slows both.
    """
    both = [shaded(services, scene) for scene in scenes]
    taken: dict[str, list[float]] = {"sum_cost_ratio": [], "pixel_cost_ratio": []}
    for step in range(1, repeats + 1):
        seconds = []
        for number, (pipeline, frame) in enumerate(both):
            aside = Transform((0.002 * step, 0.0, 0.0)) @ frame.view.transform
            view = dataclasses.replace(frame.view, transform=aside)
            both[number] = pipeline, dataclasses.replace(frame, view=view, revision=frame.revision + 1)
            pipeline.update(both[number][1], view_changed(), Job("looking aside"))
            ran = {run.name: run.seconds for run in pipeline.report if run.round == 0}
            seconds.append((ran["RadianceStage"], ran["PictureStage"]))
        for name, without, mapped in zip(taken, *seconds, strict=True):
            taken[name].append(mapped / without)
    made = {name: Timing.of(ratios) for name, ratios in taken.items()}
    found = {name: (ratio.median, ratio.spread) for name, ratio in made.items()}
    drawn = _drawn([pipeline.artifact(Picture) for pipeline, _ in both], both[0][1].view, repeats)
    return found if drawn is None else {**found, "shader_cost_ratio": drawn}


def _drawn(shown: Sequence[Any], view: View, repeats: int) -> tuple[float, float] | None:
    """The same of drawing by OpenGL, where there is one."""
    try:
        from studio_ui.canvas.gl_context import Offscreen
        from studio_ui.canvas.gl_renderer import Look

        screen = Offscreen()
    except Exception:
        return None
    look = Look(dataclasses.replace(view, width=PIXELS[0], height=PIXELS[1]))
    ratios = []
    try:
        with screen.target(*PIXELS):
            for _ in range(repeats + 1):
                seconds = []
                for picture in shown:
                    screen.renderer.show(picture)
                    screen.finish()
                    begun = time.perf_counter()
                    screen.renderer.draw(look)
                    screen.finish()
                    seconds.append(time.perf_counter() - begun)
                ratios.append(seconds[1] / seconds[0])
    finally:
        screen.close()
    ratio = Timing.of(ratios[1:])
    return ratio.median, ratio.spread
