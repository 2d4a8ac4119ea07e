"""What a backend gives is looked at before a kernel indexes with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scenes import little_scene

from studio_core.contract import Services
from studio_core.parallel import Workers
from studio_core.raster import PictureStage
from studio_core.registry import PluginHost
from studio_core.scene.diff import Changes
from studio_core.session import View
from studio_core.shading.artifacts import Hits, Radiance, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, scene_view
from studio_core.shading.pipeline import Inputs, Pipeline
from studio_core.shading.soundness import Soundness, UnsoundError


@pytest.fixture(scope="module")
def made(host: PluginHost, workers: Workers) -> tuple[Radiance, Hits]:
    """Radiance of the little scene and what its view sees."""
    backend = host.get("backend", "reference")
    pipeline = Pipeline(backend.stages(Services(workers, host)))
    scene = little_scene()
    view: View = replace(scene_view(scene, None, 24, 16), antialias=1)
    params = backend_params(backend, {"directions": "1024"})
    radiance = pipeline.update(Frame(scene, view, params, 1), Changes(), Job("x"))
    hits = pipeline.artifact(Hits) if radiance.hits is None else radiance.hits
    assert hits is not None
    return radiance, hits


def with_layer(radiance: Radiance, **fields: Any) -> Radiance:
    (node, layer), *_ = radiance.layers.items()
    return replace(radiance, layers={node: replace(layer, **fields)})


def test_what_backends_give_is_sound(made: tuple[Radiance, Hits]) -> None:
    check = Soundness().check
    check(*made)
    check(*made)


def test_numbers_that_are_none_are_found_where_something_is_lit(made: tuple[Radiance, Hits]) -> None:
    radiance, hits = made
    terms = next(iter(radiance.layers.values())).terms.copy()
    lit, unlit = int(np.argmax(radiance.valid)), int(np.argmin(radiance.valid))
    soundness = Soundness()
    soundness.check(radiance, hits)
    if not radiance.valid[unlit]:
        terms[unlit] = np.nan
        soundness.check(with_layer(radiance, terms=terms.copy()), hits)
    terms[lit, 0, 1] = np.inf
    with pytest.raises(UnsoundError, match="1 vertices have light that is no number, first at "):
        soundness.check(with_layer(radiance, terms=terms), hits)
    with pytest.raises(UnsoundError):
        soundness.check(with_layer(radiance, terms=terms), hits)


@pytest.mark.parametrize(
    ("fields", "why"),
    [
        ({"terms": np.zeros((3, 3, 3), np.float32)}, "terms of .* should be float32"),
        ({"terms": [1, 2, 3]}, "and is list"),
        ({"irradiance": None}, "irradiance of .* and is NoneType"),
    ],
)
def test_shapes_that_do_not_fit_are_refused(
    made: tuple[Radiance, Hits], fields: dict[str, Any], why: str
) -> None:
    radiance, hits = made
    with pytest.raises(UnsoundError, match=why):
        Soundness().check(with_layer(radiance, **fields), hits)


def test_types_and_masks_that_do_not_fit_are_refused(made: tuple[Radiance, Hits]) -> None:
    radiance, hits = made
    layer = next(iter(radiance.layers.values()))
    for wrong in (
        replace(radiance, valid=radiance.valid[:-1]),
        replace(radiance, valid=radiance.valid.astype(np.float32)),
        with_layer(radiance, terms=layer.terms.astype(np.float64)),
    ):
        with pytest.raises(UnsoundError, match="should be"):
            Soundness().check(wrong, hits)
    with pytest.raises(UnsoundError, match="gave NoneType and Hits"):
        Soundness().check(None, hits)


def test_hits_on_faces_that_there_are_not_are_refused(made: tuple[Radiance, Hits]) -> None:
    radiance, hits = made
    for value in (-2, len(radiance.surfaces.mesh.faces)):
        face = hits.face.copy()
        face[0] = value
        with pytest.raises(UnsoundError, match="faces that there are not"):
            Soundness().check(radiance, replace(hits, face=face))
    with pytest.raises(UnsoundError, match="distance of its hits"):
        Soundness().check(radiance, replace(hits, distance=hits.distance[:-1]))


WRONG: dict[str, Callable[[Any], Any]] = {
    "numbers that are none": lambda layer: replace(layer, terms=np.full_like(layer.terms, np.nan)),
    "a vertex too few": lambda layer: replace(layer, terms=layer.terms[:-1].copy()),
    "another type": lambda layer: replace(layer, irradiance=layer.irradiance.astype(np.float64)),
}


@pytest.mark.parametrize("how", list(WRONG))
def test_a_stage_that_gives_something_wrong_makes_no_picture(
    how: str, made: tuple[Radiance, Hits], host: PluginHost, workers: Workers
) -> None:
    radiance, hits = made
    services = Services(workers, host)
    wrong = replace(radiance, layers={node: WRONG[how](layer) for node, layer in radiance.layers.items()})
    stage = PictureStage(services)
    frame = Frame(little_scene(), hits.view, None, 1)
    given = {Surfaces: radiance.surfaces, Hits: hits, Radiance: wrong}
    with pytest.raises(UnsoundError):
        stage.run(frame, Inputs(given, Changes()), Job("x"))
    given[Radiance] = radiance
    assert np.isfinite(stage.run(frame, Inputs(given, Changes()), Job("x")).linear).all()
