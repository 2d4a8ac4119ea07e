"""What is kept on disk, and the paper's path through the same stages."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scenes import little_scene

from studio_core.contract import Services
from studio_core.scene.diff import Changes, diff
from studio_core.scene.transform import Transform
from studio_core.shading.cache import DiskCache
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view, shade
from studio_core.shading.pipeline import Pipeline
from studio_plugins.cuts import keeping
from studio_plugins.cuts.visibility_stage import VisibilityStage

VALUES = {"directions": "1024", "vertices": 600, "refine": False}


@pytest.fixture
def services(host, workers, tmp_path):
    return Services(workers, host, DiskCache(tmp_path / "computed"))


def setup(host, scene, **values):
    backend = host.get("backend", "cuts")
    return backend, scene_view(scene, None, 48, 36), backend_params(backend, {**VALUES, **values})


def opened(services, backend, scene, view, params):
    pipeline = Pipeline(backend.stages(services))
    made = pipeline.update(Frame(scene, view, params, 1), Changes(), Job("test"))
    return pipeline, made, next(s for s in pipeline.stages if isinstance(s, VisibilityStage))


def test_a_scene_that_was_precomputed_is_opened_without_a_ray(host, services):
    scene = little_scene()
    backend, view, params = setup(host, scene)
    first = backend.precompute(scene, view, params, services, Job("test"))
    assert first["vertices_traced"] > 0
    assert first["bytes"] > 0
    assert backend.precompute(scene, view, params, services, Job("test"))["vertices_traced"] == 0
    _, made, stage = opened(services, backend, scene, view, params)
    assert stage._store.summary()["rays"] == 0
    cold = shade(scene, view, backend, params, dataclasses.replace(services, cache=None))
    for node, layer in cold.layers.items():
        np.testing.assert_array_equal(layer.terms, made.layers[node].terms)


def test_what_a_window_completes_in_idle_time_is_kept_too(host, services):
    scene = little_scene()
    backend, view, params = setup(host, scene)
    pipeline, _, stage = opened(services, backend, scene, view, params)
    hidden = len(stage._asked[0].mesh) - stage._store.known
    assert hidden > 0
    pipeline.complete(Frame(scene, view, params, 1), Job("test"))
    assert stage._store.known == len(stage._asked[0].mesh)
    _, _, again = opened(services, backend, scene, view, params)
    assert again._store.summary()["rays"] == 0


def test_another_scene_is_not_taken_for_it(host, services):
    scene = little_scene()
    backend, view, params = setup(host, scene)
    backend.precompute(scene, view, params, services, Job("test"))
    moved = scene.with_nodes(dataclasses.replace(scene["cube"], transform=Transform((0.2, 0.5, 0.0))))
    for other, values in ((moved, {}), (scene, {"directions": "2048"}), (scene, {"vertices": 900})):
        backend, view, changed = setup(host, other, **values)
        _, _, stage = opened(services, backend, other, view, changed)
        assert stage._store.summary()["rays"] > 0


@pytest.mark.parametrize("damage", ["shorter", "type", "missing"])
def test_entries_that_cannot_be_right_are_not_used(host, services, damage):
    scene = little_scene()
    backend, view, params = setup(host, scene)
    backend.precompute(scene, view, params, services, Job("test"))
    _, _, stage = opened(services, backend, scene, view, params)
    key = keeping.key_of(10, *stage._asked)
    kept = services.cache.get(keeping.METHOD, *key)
    broken = {
        "shorter": {"pool": kept["pool"][:-3], "length": kept["length"]},
        "type": {"pool": kept["pool"].astype(np.uint32), "length": kept["length"]},
        "missing": {"pool": kept["pool"]},
    }[damage]
    services.cache.put(broken, keeping.METHOD, *key)
    _, made, again = opened(services, backend, scene, view, params)
    assert again._store.summary()["rays"] > 0
    assert made.final


def test_the_papers_path_goes_through_the_same_stages(host, workers):
    services = Services(workers, host)
    scene = little_scene()
    backend, view, params = setup(host, scene, method="svc-vcf", shells=8)
    pipeline = Pipeline(backend.stages(services))
    made = pipeline.update(Frame(scene, view, params, 1), Changes(), Job("test"))
    reference = host.get("backend", "reference")
    values = {"directions": "1024", "vertices": 600, "quarters": False}
    true = shade(scene, view, reference, backend_params(reference, values), services)
    both = made.valid & true.valid
    ours, theirs = made.layers["sky"].irradiance[both], true.layers["sky"].irradiance[both]
    error = np.sqrt(((ours - theirs) ** 2).mean()) / theirs.mean()
    assert 1e-4 < error < 0.12  # fields are interpolated: right, but never exact
    paint = dataclasses.replace(scene.material("paint"), values={"base_color": (0.9, 0.1, 0.1)})
    painted = scene.with_materials(paint)
    pipeline.update(Frame(painted, view, params, 2), diff(scene, painted), Job("test"))
    ran = {line.name for line in pipeline.report if line.ran}
    assert "VisibilityStage" not in ran
