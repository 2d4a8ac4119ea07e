"""The main job on real furniture and light (shared data; skipped where it is absent).

`lucarne new` from model and picture files, then render, save, reopen, export, and the check against
Mitsuba 3, whose rays, sampling and integration are not ours.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from oracles.meshes import read_obj
from oracles.primary import camera_rays
from scenes import sky

from studio.build_scene import parse_camera
from studio.cli import main
from studio_core.contract import Services
from studio_core.imaging.encode import write_exr
from studio_core.imaging.io import ImageDecoder
from studio_core.parallel import Workers
from studio_core.project.store import load, save
from studio_core.registry import PluginHost
from studio_core.scene.bounds import scene_bounds
from studio_core.scene.nodes import Camera, Light, MeshObject, Scene
from studio_core.session import View
from studio_core.shading.artifacts import Picture
from studio_core.shading.offline import (
    backend_params,
    picture,
    ray_origins,
    scene_view,
    shaded_pipeline,
)

NAMES = (
    *("JapaneseLantern", "armchair2", "bedWithTexture", "bedsideTable2", "bookcase", "chair2", "desklamp"),
    *("glassDoorCabinet", "lamp2", "oakChair", "oakTable", "osakaChair", "pianoAQueue", "plant", "sofa2"),
    *("table", "tableWithTablecloth", "tatami", "teddyBear", "winchesterSofa"),
)
PLACES = {"sofa2": (0.0, 0.0, 0.0), "oakTable": (1.5, 0.0, 0.4)}  # scaled by 0.01
LOOK = "from=1.9,1.3,3.2:to=0.7,0.35,0:fov=38"
QUICK = ("--size", "64x36", "--antialias", "1", "--param", "directions=1024", "--param", "vertices=500")
Command = Callable[..., Any]


@pytest.fixture
def services(host: PluginHost, workers: Workers) -> Services:
    """Two threads and all plugins."""
    return Services(workers, host)


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Command:
    """Runs a verb that must succeed; its JSON."""

    def call(*arguments: object) -> Any:
        capsys.readouterr()
        status = main([*map(str, arguments), "--json"])
        said = capsys.readouterr()
        assert status == 0, said.err
        return json.loads(said.out)

    return call


@pytest.fixture(scope="module")
def furniture(shared_data: Path) -> Path:
    """Where the models are."""
    return shared_data / "cc0" / "furniture_blendswap_cc0"


@pytest.fixture(scope="module")
def project(shared_data: Path, furniture: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Made by the very command of the plan."""
    path = tmp_path_factory.mktemp("main-job") / "room.lucarne"
    arguments = ["new", str(path)]
    arguments += ["--mesh", f"{furniture / 'sofa2' / 'sofa2.obj'}@0,0,0,0,0.01"]
    arguments += ["--mesh", f"{furniture / 'oakTable' / 'oakTable.obj'}@1.5,0,0.4,0,0.01"]
    arguments += ["--env", str(shared_data / "cc0" / "hdri_polyhaven_cc0" / "courtyard.exr"), "--floor", "6"]
    assert main(arguments) == 0
    before = path.read_bytes()
    yield path
    assert path.read_bytes() == before  # nothing but a save writes to a project


def shown(scene: Scene, view: View, services: Services, **values: object) -> Picture:
    """The picture by the reference backend."""
    backend = services.registry.get("backend", "reference")
    return picture(scene, view, backend, backend_params(backend, values), services)


def relative_rmse(made: npt.ArrayLike, truth: npt.ArrayLike) -> float:
    a, b = np.asarray(made, np.float64), np.asarray(truth, np.float64)
    return float(np.sqrt(((a - b) ** 2).mean()) / b.mean())


def test_info_shows_what_is_there(project: Path, command: Command) -> None:
    found = command("info", project)
    assert found["nodes"] == {"camera": 1, "environment": 1, "group": 1, "mesh": 5}
    assert sum(found["materials"].values()) == 6
    names = {node.name for node in load(project).scene.nodes.values()}
    assert {"sofa2", "oakTable", "Floor", "courtyard", "Camera"} <= names


def test_render_is_finite_and_shows_a_lit_room(project: Path, command: Command, tmp_path: Path) -> None:
    out = tmp_path / "room.exr"
    options = ("--size", "160x90", "--param", "directions=1024", "--param", "vertices=3000")
    said = command("render", project, "-o", out, *options)
    with ImageDecoder() as decoder:
        linear = decoder.read(out).pixels
    assert linear.shape == (90, 160, 3)
    assert np.isfinite(linear).all()
    assert said["finite"]
    assert linear.min() >= 0
    assert 0.2 < linear.mean() < 5
    assert linear.std() > 0.1


def test_silhouettes_equal_ray_cast_masks(project: Path, furniture: Path, services: Services) -> None:
    """Other readers (trimesh), other placing (NumPy), other rays (trimesh through embree)."""
    import trimesh

    scene = load(project).scene
    view = dataclasses.replace(scene_view(scene, None, 320, 180), antialias=1)
    made = shown(scene, view, services, directions="1024", vertices=3000)

    solids = {}
    for name, place in PLACES.items():
        mesh = trimesh.load(furniture / name / f"{name}.obj", force="mesh", process=False)
        solids[name] = trimesh.Trimesh(mesh.vertices * 0.01 + place, mesh.faces, process=False)
    square = np.array([[-3, 0, -3], [3, 0, -3], [3, 0, 3], [-3, 0, 3]], float)
    solids["Floor"] = trimesh.Trimesh(square, [[0, 2, 1], [0, 3, 2]], process=False)
    names = list(solids)
    owner = np.concatenate([[index] * len(solids[name].faces) for index, name in enumerate(names)])
    together = trimesh.util.concatenate(list(solids.values()))
    rays = camera_rays(view.transform.matrix(), view.fov, view.width, view.height).reshape(-1, 3)
    eye = np.broadcast_to(view.transform.translation, rays.shape)
    face = together.ray.intersects_first(eye, rays)
    expected = np.where(face >= 0, owner[face], -1).reshape(view.height, view.width)

    tops = []
    for node in made.nodes:
        above = [scene[node], *scene.ancestors(node)]
        tops.append(names.index(above[-1].name))
    ours = np.where(made.node >= 0, np.array(tops)[made.node], -1)
    assert set(np.unique(expected)) == {-1, 0, 1, 2}
    assert np.array_equal(made.coverage > 0, made.node >= 0)
    for index, name in enumerate(names):
        differs = (ours == index) != (expected == index)
        assert differs.sum() <= 2, name  # a ray may graze an edge


def test_saved_and_reopened_it_renders_the_same_bits(
    project: Path, services: Services, tmp_path: Path
) -> None:
    scene = load(project).scene
    again = tmp_path / "again.lucarne"
    save(again, scene)
    reopened = load(again).scene
    view = scene_view(scene, None, 96, 54)
    assert scene_view(reopened, None, 96, 54) == view
    values = {"directions": "1024", "vertices": 3000}
    first, second = (shown(each, view, services, **values) for each in (scene, reopened))
    assert np.array_equal(first.linear, second.linear)
    assert np.array_equal(first.node, second.node)


def test_the_exported_glb_comes_back_with_the_same_bounds(
    project: Path, command: Command, tmp_path: Path
) -> None:
    import trimesh

    scene = load(project).scene
    bounds = np.array(scene_bounds(scene))
    command("export", project, "-o", tmp_path / "room.glb")
    by_another = trimesh.load(tmp_path / "room.glb")
    assert by_another.bounds == pytest.approx(bounds, abs=1e-5)
    command("new", tmp_path / "back.lucarne", "--mesh", tmp_path / "room.glb")
    back = load(tmp_path / "back.lucarne").scene
    assert np.array(scene_bounds(back)) == pytest.approx(bounds, abs=1e-5)
    areas = [sum(area(each, node) for node in each.of(MeshObject)) for each in (scene, back)]
    assert areas[0] == pytest.approx(areas[1], rel=1e-4)


def area(scene: Scene, node: MeshObject) -> float:
    """World area of all faces, m²."""
    placed = node.geometry.positions.astype(np.float64) * scene.world(node.id).scale
    a, b, c = (placed[node.geometry.faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.slow
def test_irradiance_against_mitsuba(
    project: Path, command: Command, services: Services, tmp_path: Path
) -> None:
    """60 visible vertices at 2^15 directions, from our own ray origins; noise of Mitsuba's included."""
    pytest.importorskip("mitsuba")
    from studio_plugins.export.mitsuba_run import vertex_irradiance

    command("export", project, "-o", tmp_path / "mitsuba")
    scene = load(project).scene
    backend = services.registry.get("backend", "reference")
    params = backend_params(backend, {"vertices": 3000, "directions": "32768"})
    view = scene_view(scene, None, 160, 90)
    made, pipeline = shaded_pipeline(scene, view, backend, params, services)
    chosen = np.random.default_rng(5).choice(np.flatnonzero(made.valid), 60, replace=False)
    lights = {light.id: light for light in scene.of(Light)}
    ours = made.irradiance(lights)[chosen]
    truth = vertex_irradiance(
        tmp_path / "mitsuba",
        ray_origins(pipeline, made)[chosen],
        made.surfaces.mesh.normals[chosen],
        1 << 14,
        offset=0.0,
    )
    assert truth.relative_error < 0.004
    assert relative_rmse(ours, truth.value) < 0.008


@pytest.mark.slow
def test_picture_against_mitsuba(project: Path, services: Services, tmp_path: Path) -> None:
    """Light, materials, textures, camera and background together, on a shading mesh fine enough.

    1.4 % against a converged picture; Mitsuba's noise at these samples is 1.7 %.
    """
    pytest.importorskip("mitsuba")
    from studio_plugins.export.mitsuba_run import render

    transform, fov, focus = parse_camera(LOOK)
    near = Camera(id="near", name="Near", transform=transform, fov=fov, focus=focus)
    scene = load(project).scene.with_nodes(near)
    exporter = dataclasses.replace(services.registry.get("exporter", "mitsuba"), camera="Near")
    exporter.save(scene, tmp_path / "mitsuba", services.registry)
    width, height = 160, 90
    view = dataclasses.replace(scene_view(scene, "Near", width, height), antialias=8)
    made = shown(scene, view, services, vertices=120_000, directions="4096")
    truth = render(tmp_path / "mitsuba", 512, (width, height))
    assert (made.coverage > 0.5).mean() > 0.3
    assert relative_rmse(made.linear, truth) < 0.03


def heights(furniture: Path) -> dict[str, float]:
    """True height in metres by model; their widths and depths were stretched by the catalog."""
    rows = [line.split("\t") for line in (furniture / "catalog.tsv").read_text().splitlines()[1:]]
    return {Path(row[7]).stem: float(row[5]) / 100 for row in rows}


@pytest.mark.parametrize("name", NAMES)
def test_every_model_opens_at_its_true_size_and_renders(
    name: str, furniture: Path, command: Command, tmp_path: Path
) -> None:
    height = heights(furniture)[name]
    source = furniture / name / f"{name}.obj"
    low, high = read_obj(source, scale=1.0).bounds
    path, scale = tmp_path / "one.lucarne", height / float(high[1] - low[1])
    write_exr(tmp_path / "sky.exr", sky().pixels)
    made = command("new", path, "--mesh", f"{source}@0,0,0,0,{scale!r}", "--env", tmp_path / "sky.exr")
    assert made["faces"] > 0
    size = np.subtract(*reversed(scene_bounds(load(path).scene)))
    assert size == pytest.approx((np.asarray(high, float) - low) * scale, rel=1e-5)
    assert size[1] == pytest.approx(height, rel=1e-5)
    lit = command("render", path, "-o", tmp_path / "one.png", *QUICK)
    assert lit["finite"]
    assert lit["shaded"] > 50
    assert lit["mean"] > 0.1
