"""What a pipeline has for solvers, and when it has nothing."""

from __future__ import annotations

from typing import Any

import pytest
from counting_stages import StoppingJob
from painting_support import lit_room

from studio_core.contract import Services
from studio_core.edits import Move, SetMaterial, SetPaint
from studio_core.errors import Cancelled
from studio_core.parallel import Workers
from studio_core.registry import PluginHost
from studio_core.scene.diff import Changes, diff
from studio_core.scene.nodes import Scene
from studio_core.scene.paint import Paint
from studio_core.scene.transform import Transform
from studio_core.session import View
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.indirect import UnrefinedShapes
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Pipeline
from studio_core.shading.stages import SurfaceParams, common_stages
from studio_core.strokes.lit import lit_of
from studio_plugins.brdfs import plugin as brdfs

MOVED = Move({"stool": Transform((2.0, 0.0, 0.0))})


class Bench:
    """The stages that every backend has, over one scene."""

    def __init__(self, workers: Workers) -> None:
        services = Services(workers, PluginHost([brdfs]))
        self.pipeline, self.unrefined = Pipeline(common_stages(services)), UnrefinedShapes(services)
        self.scene = Scene()

    def show(self, scene: Scene, job: Job | None = None) -> None:
        changes, self.scene = diff(self.scene, scene) if self.scene.nodes else Changes(), scene
        view = View(Transform((0.0, 1.0, 6.0)), width=32, height=24, antialias=1)
        self.pipeline.update(Frame(scene, view, SurfaceParams(vertices=300)), changes, job or Job("test"))

    def lit(self, scene: Scene) -> Any:
        return lit_of(self.pipeline, scene, self.unrefined)


@pytest.fixture
def bench(workers: Workers) -> Bench:
    made = Bench(workers)
    made.show(lit_room())
    return made


def test_there_is_nothing_before_the_first_frame(workers: Workers) -> None:
    assert Bench(workers).lit(lit_room()) is None


def test_it_is_that_of_the_newest_frame(bench: Bench) -> None:
    lit = bench.lit(bench.scene)
    assert lit.surfaces is bench.pipeline.artifact(Surfaces)
    assert set(lit.surfaces.nodes) == {"seat", "back", "stool"}
    assert lit.hits is not None
    assert lit.indirect is None
    assert lit.lighting.environment is bench.scene["sky"]


def test_other_paint_and_other_materials_do_not_matter(bench: Bench) -> None:
    paint = Paint.of([[0, 0, 0]], [[0, 1, 0]], [0], {"base_color": [[0.1, 0, 0]]})
    for edit in (SetPaint("stool", paint), SetMaterial("blue", {}, name="Sky blue")):
        assert bench.lit(edit(bench.scene)) is not None


def test_what_stands_elsewhere_has_other_light(bench: Bench) -> None:
    moved = MOVED(bench.scene)
    assert bench.lit(moved) is None
    bench.show(moved)
    assert bench.lit(moved) is not None


@pytest.mark.parametrize("stop", [1, 2])
def test_work_that_was_cancelled_has_nothing(bench: Bench, stop: int) -> None:
    before, moved = bench.scene, MOVED(bench.scene)
    with pytest.raises(Cancelled):
        bench.show(moved, StoppingJob(stop))
    assert bench.lit(moved) is None
    assert bench.lit(before) is None
    bench.show(moved)
    assert bench.lit(moved) is not None
