"""`lucarne bench interreflection`: what it says of methods that are wrong by a known amount."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bouncing import BouncingHost

from studio.bench import interreflection
from studio.bench.harness import Report
from studio.bench.interreflection import Setup, errors_of, measure, red_to_green
from studio.bench.interreflection_edits import EDITS
from studio.bench.interreflection_furnace import over_kept_rays
from studio.bench.interreflection_measure import Editor
from studio.bench.interreflection_meshes import box, shell
from studio.bench.interreflection_operator import Stand, kept_rays, products, source_light
from studio.bench.interreflection_scenes import Setting, bleeding, furnace, pot_on_floor
from studio.bench.interreflection_truth import Light3, Places, Truth, scene_key
from studio.headless import Headless
from studio_core.contract import Services
from studio_core.params import param
from studio_core.registry import PluginHost
from studio_core.scene.diff import Aspect
from studio_core.scene.transform import Transform, looking
from studio_core.shading.artifacts import (
    Casters,
    Indirect,
    LayerRadiance,
    Lighting,
    Receivers,
    Shapes,
    Surfaces,
)
from studio_core.shading.brute_force import blank_layer
from studio_core.shading.offline import scene_view
from studio_core.shading.path_tracing import PathSettings, chosen_points, indirect_layer
from studio_core.shading.path_world import PathWorlds


class TooBrightStage:
    """Paths at every seen vertex, and some per cent on top."""

    needs: tuple[type, ...] = (Surfaces, Casters, Shapes, Lighting, Receivers)
    gives = Indirect
    dirtied_by = ~Aspect.NAME

    def __init__(self, services: Services) -> None:
        self._services = services
        self._worlds = PathWorlds(services.registry)

    def run(self, frame: Any, inputs: Any, job: Any) -> Indirect:
        surfaces, seen = inputs[Surfaces], inputs[Receivers].seen
        mesh, shapes = surfaces.mesh, inputs[Shapes]
        rows = np.flatnonzero(seen)
        world = self._worlds(frame.scene, surfaces, inputs[Casters], inputs[Lighting])
        settings = PathSettings(frame.indirect.params.bounces, frame.indirect.params.samples, seed=99)
        points = chosen_points(mesh, rows)
        own = shapes.of_points(rows)
        eye, workers = inputs[Receivers].eye, self._services.workers
        made = indirect_layer(points, own, eye, world, settings, workers, job)
        layer: LayerRadiance = blank_layer(mesh, shapes)
        wrong = np.float32(1 + frame.indirect.params.wrong)
        layer.terms[rows] = wrong * made.terms
        layer.irradiance[rows] = wrong * made.irradiance
        return Indirect(surfaces, layer, seen, True, {"rays": len(rows)}, {})


@dataclass(frozen=True)
class TooBrightParams:
    """How many paths, and how much too bright."""

    bounces: int = param(3, "Bounces", low=1, high=16)
    samples: int = param(512, "Samples", low=1, high=1 << 16)
    wrong: float = param(0.05, "Wrong", low=0.0, high=1.0)


class TooBright:
    """A method that is wrong by 5 %, if nothing else is asked for."""

    id = "too-bright"
    label = "Too bright"
    Params = TooBrightParams

    def stages(self, services: Services) -> Sequence[Any]:
        return [TooBrightStage(services)]


METHOD = TooBright()


def little_room() -> Setting:
    """A red box in a white room without a front, a few hundred vertices."""
    start = bleeding()
    walls = shell((-1.0, 0.0, -1.0), (1.0, 1.6, 1.0), 0.1, (4, 3, 4))
    thing = box((-0.2, 0.0, -0.2), (0.2, 0.7, 0.2), (2, 3, 2))
    nodes = [
        dataclasses.replace(start.scene["walls"], geometry=walls),
        dataclasses.replace(start.scene["cabinet"], geometry=thing, transform=Transform((-0.5, 0.0, -0.3))),
        dataclasses.replace(start.scene["bulb"], transform=Transform((0.3, 0.9, 0.4))),
        dataclasses.replace(start.scene["camera"], transform=looking((0.1, 0.9, 3.2), (0.0, 0.75, 0.0))),
    ]
    kept = {name: node for name, node in start.scene.nodes.items() if name not in ("vase", "lamp")}
    scene = dataclasses.replace(start.scene, nodes=kept).with_nodes(*nodes)
    return dataclasses.replace(
        start,
        scene=scene,
        movable=("cabinet",),
        low=(-1.0, -1.0),
        high=(1.0, 1.0),
        painted="glossy",
        light="bulb",
    )


def painted(setting: Setting) -> Setting:
    """With something glossy, so that a change of it can be timed."""
    glossy = dataclasses.replace(setting.scene.material("vase"), id="glossy")
    cabinet = dataclasses.replace(setting.scene["cabinet"], materials=("glossy",))
    return dataclasses.replace(setting, scene=setting.scene.with_materials(glossy).with_nodes(cabinet))


@pytest.fixture
def program() -> Headless:
    made = Headless(quiet=True, threads=2)
    made.registry = BouncingHost(PluginHost.discover(), {"too-bright": METHOD})  # type: ignore[misc]
    return made


def figures(report: Report) -> dict[str, float]:
    return {row.metric: row.value for row in report.rows}


def test_a_method_that_is_5_percent_too_bright_is_5_percent_wrong(program: Headless, tmp_path: Path) -> None:
    """Relative to the mean, bright places count more; twice as wrong is twice the error."""
    start, found = painted(little_room()), {}
    for wrong in (0.05, 0.1):
        report = Report("interreflection", True)
        setup = Setup(96, 54, 2, 80, 512, 1, dragged=1, steps=2, choices={"wrong": wrong}, cache=tmp_path)
        measure(report, program, "little", start, "too-bright", setup, peers=False)
        found[wrong] = figures(report)
    one, other = found.values()
    for tier in ("moving", "rest", "dragged"):
        for metric in ("indirect_rel_rmse", "indirect_rel_rmse_diffuse", "picture_rel_rmse"):
            assert other[f"{metric}_{tier}"] == pytest.approx(2 * one[f"{metric}_{tier}"], rel=0.12)
        assert 0.045 < one[f"indirect_rel_rmse_{tier}"] < 0.075
        assert one[f"indirect_rel_rmse_{tier}_worst"] >= one[f"indirect_rel_rmse_{tier}"]
        assert one[f"picture_rel_rmse_{tier}"] < one[f"indirect_rel_rmse_{tier}"]
        assert one[f"direct_rel_rmse_{tier}"] < 0.01
        assert 0 < one[f"rg_error_{tier}"] < 0.03
    for kind in EDITS:
        assert 0 < one[f"ms_{kind}"] < one[f"ms_{kind}_whole"]
    assert 0 < one["visible"] <= one["vertices"]
    assert one["bytes_rest"] > 0
    assert len(list(tmp_path.glob("*.npz"))) == 4, "both were compared with the same truth"
    program.close()


def test_a_method_that_is_not_there_is_said(program: Headless) -> None:
    report = Report("interreflection", True)
    measure(report, program, "little", little_room(), "nobody", Setup(), peers=False)
    assert not report.rows
    assert "nobody" in report.notes[0]
    program.close()


def lights(scale: float, noise: float, seed: int) -> Light3:
    rng = np.random.default_rng(seed)
    true = np.random.default_rng(0).uniform(0.2, 1.0, (4000, 3))
    straight = np.random.default_rng(1).uniform(0.0, 2.0, (4000, 3))
    made = (scale * true + noise * rng.normal(size=true.shape)).astype(np.float32)
    return Light3(straight.astype(np.float32), made, np.pi * straight.astype(np.float32), np.pi * made)


def test_noise_of_the_truth_is_no_error() -> None:
    truth = Truth(lights(1.0, 0.1, 5), lights(1.0, 0.1, 6))
    right = errors_of(lights(1.0, 0.0, 0), truth, np.zeros(4000, np.bool_))
    wrong = errors_of(lights(1.05, 0.0, 0), truth, np.zeros(4000, np.bool_))
    size = np.sqrt((np.random.default_rng(0).uniform(0.2, 1.0, (4000, 3)) ** 2).mean()) / 0.6
    assert right["indirect_rel_rmse"] < 0.02
    assert wrong["indirect_rel_rmse"] == pytest.approx(0.05 * size, rel=0.15)
    assert wrong["indirect_rel_rmse_diffuse"] == pytest.approx(wrong["indirect_rel_rmse"], rel=1e-3)
    assert wrong["direct_rel_rmse"] == 0
    assert "rg_error" not in wrong


def test_tints_are_judged_by_red_over_green() -> None:
    truth = Truth(lights(1.0, 0.0, 0), lights(1.0, 0.0, 0))
    light = lights(1.0, 0.0, 0)
    tinted = dataclasses.replace(
        light,
        direct=light.direct * np.float32([1.03, 1, 1]),
        indirect=light.indirect * np.float32([1.03, 1, 1]),
    )
    found = errors_of(tinted, truth, np.ones(4000, np.bool_))
    assert found["rg_error"] == pytest.approx(0.03, rel=1e-3)
    assert found["rg_error_max"] == pytest.approx(0.03, rel=1e-3)
    assert found["rg_noise"] == 0


@pytest.mark.parametrize("kind", EDITS)
def test_every_step_of_an_edit_is_another_scene(kind: str) -> None:
    start = pot_on_floor()
    steps = EDITS[kind](start, 4)
    keys = {scene_key(scene) for scene in [start.scene, *steps]}
    assert len(steps) == 4
    assert len(keys) == 5 if kind != "light" else len(keys) >= 4


def test_a_key_tells_scenes_apart_but_not_cameras() -> None:
    one, other = furnace(0.5), furnace(0.8)
    moved = one.with_nodes(dataclasses.replace(one["camera"], transform=Transform((0.1, 0.0, 0.0))))
    assert scene_key(one) == scene_key(moved) == scene_key(furnace(0.5))
    assert len({scene_key(one), scene_key(other), scene_key(furnace(0.5, curved=True))}) == 3


def test_parts_of_the_operator_are_measured(program: Headless) -> None:
    report, start = Report("interreflection", True), painted(little_room())
    kept_rays(report, "rays", Stand.of(start, program), program, 16)
    rays = figures(report)
    assert 0 < rays["share_redone"] < 1
    assert rays["bytes"] > 16 * 6 * 400
    assert rays["mrays_per_s"] > 0
    report = Report("interreflection", True)
    source_light(report, "light", Stand.of(start, program), program)
    assert set(figures(report)) == {"ms_trace", "ms_sums", "ms_move", "bytes"}
    report = Report("interreflection", True)
    products(report, "lobe", program, 10.0)
    found = figures(report)
    assert found["products_5"] > found["products_15"] > found["products_30"] > 1
    assert all(found[f"error_{tolerance}"] <= tolerance / 100 for tolerance in (5, 15, 30))
    program.close()


@pytest.mark.parametrize("curved", [False, True])
def test_closed_rooms_of_one_albedo_are_as_bright_as_they_must_be(program: Headless, curved: bool) -> None:
    settled, partial = over_kept_rays(furnace(0.8, curved), program, 0.8)
    assert settled < 1e-3
    assert partial < 1e-5
    leaky, _ = over_kept_rays(furnace(0.8, curved), program, 0.7)
    assert leaky == pytest.approx(0.3 / 0.2 - 1, rel=1e-3), "and it is seen where they are not"
    program.close()


def test_a_red_box_tints_what_is_beside_it_wherever_it_stands(program: Headless) -> None:
    start = little_room()
    view = dataclasses.replace(scene_view(start.scene, None, 96, 54), antialias=1)
    backend = program.registry.get("backend", "cuts")
    values = {"vertices": start.budget, "refine": False}
    editor = Editor(backend, program.services, "too-bright", view, values, {"wrong": 0.0})
    tints = []
    for x in (-0.5, 0.5):
        box_there = dataclasses.replace(start.scene["cabinet"], transform=Transform((x, 0.0, -0.3)))
        scene = start.scene.with_nodes(box_there)
        editor.go(scene, False)
        surfaces = editor.pipeline.artifact(Surfaces)
        assert surfaces is not None
        mesh, seen = surfaces.mesh, editor.seen()
        at = mesh.positions[seen] + mesh.origin
        wall = seen[(at[:, 2] < -0.99) & (at[:, 1] < 1.0) & (at[:, 1] > 0.1) & (np.abs(at[:, 0]) < 0.9)]
        light = editor.light(Places.of(scene, surfaces, wall, program.services))
        left = (mesh.positions[wall] + mesh.origin)[:, 0] < -0.1
        right = (mesh.positions[wall] + mesh.origin)[:, 0] > 0.1
        tints.append(red_to_green(light.all[left]).max() / red_to_green(light.all[right]).max())
    assert tints[0] > 1.03
    assert tints[1] < 1 / 1.03
    program.close()


def test_the_suite_knows_its_methods() -> None:
    assert interreflection.IN_PARTS
    assert set(interreflection.METHODS.values()) == {"gather", "fields"}
