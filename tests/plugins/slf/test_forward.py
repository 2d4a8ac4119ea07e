"""Candidates carried forward: what the gather itself makes of the changed scene, along the same rays."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from indirect_strokes import JOB, Painting, recoloured, separate
from path_rooms import furnished

from studio_core.contract import Services
from studio_core.scene.nodes import AreaLamp, Camera, Material
from studio_core.scene.transform import looking
from studio_core.shading.artifacts import Casters, Surfaces
from studio_core.transport.bounces import sent_towards
from studio_plugins.slf.candidates import Candidate, fitted_again
from studio_plugins.slf.changeable import changeables_of
from studio_plugins.slf.fixates import rows_of
from studio_plugins.slf.forward import Forward
from studio_plugins.slf.influence import Sight

LAMP = AreaLamp(
    id="lamp", intensity=6.0, width=1.0, height=0.6, transform=looking((0.8, 2.4, 0.9), (-0.5, 0, -0.5))
)
CAMERA = Camera(id="camera", transform=looking((0, 2.2, 4.5), (0, 0.8, 0)))
SHINY = Material(id="paint", name="Paint", model="phong", values={"exponent": 12.0, "specular": (0.4,) * 3})


@pytest.fixture(scope="module")
def painting(workers: Any, host: Any) -> Painting:
    return Painting(separate(furnished((LAMP, CAMERA), SHINY)), Services(workers, host))


def seen(painting: Painting, sight: Sight, made: Any) -> Any:
    """(P, 3) of what vertices send along the rays."""
    lit = sight.met < len(painting.mesh)
    light = np.zeros((*sight.met.shape, 3), np.float32)
    to = sight.met[lit].astype(np.int64), sight.cell[lit].astype(np.int64)
    light[lit] = sent_towards(made.light, made.surface, *to, painting.services.workers)
    return (sight.weight * light).sum(axis=1, dtype=np.float64)


@pytest.mark.parametrize(
    ("node", "values", "model", "changes"),
    [
        ("side", {"diffuse": (0.1, 0.6, 0.2)}, "", {"diffuse": (0.1, 0.6, 0.2)}),
        ("side", {"gloss": 40.0}, "", {"exponent": 40.0}),
        (
            "back",
            {"specular": (0.6, 0.6, 0.6), "gloss": 0.4},
            "specgloss",
            {"diffuse": (0.7, 0.6, 0.5), "specular": (0.6,) * 3, "roughness": 0.4},
        ),
    ],
    ids=["colour", "gloss", "another model"],
)
def test_it_is_what_the_gather_makes_of_the_changed_scene(
    painting: Painting, node: str, values: Any, model: str, changes: Any
) -> None:
    handed, known = painting.room.handed(), painting.lit.sent
    surfaces = handed[Surfaces]
    some = painting.vertices("floor", (-1.4, 0, 0.3), 60)
    rows = rows_of([painting.stroke(some, painting.radiance(painting.lit, some) + 1)], surfaces)
    sights = painting.solver._sights.of(painting.scene, surfaces, handed[Casters], known, rows, JOB)
    regions, region = changeables_of(painting.scene, surfaces, [], painting.services.registry)
    number = [one.node for one in regions].index(node)
    look = regions[number].full if model else regions[number].now
    given = {role: np.asarray(value, np.float64) for role, value in values.items()}
    one = Candidate(number, "", look, given, 0.0, 0.0)
    trials = painting.solver._trials
    looks = trials.looks(painting.scene, surfaces)
    forward = Forward(known, surfaces, sights, trials.separator, painting.services, JOB)
    made = forward(one, regions[number], region == number, looks)
    before = [seen(painting, sight, known) for sight in sights]
    then = painting.light(recoloured(painting.scene, node, model, **changes)).sent
    wanted = [seen(painting, sight, then) - old for sight, old in zip(sights, before, strict=True)]
    painting.become(painting.scene)
    for ours, theirs in zip(made, wanted, strict=True):
        size = np.sqrt((theirs**2).mean())
        assert size > 0
        assert np.sqrt(((ours - theirs) ** 2).mean()) < 0.01 * size


def test_what_was_carried_forward_is_fitted_in_place_of_columns(painting: Painting) -> None:
    handed, known = painting.room.handed(), painting.lit.sent
    surfaces = handed[Surfaces]
    some = painting.vertices("floor", (-1.4, 0, 0.3), 60)
    rows = rows_of([painting.stroke(some, 1.1 * painting.radiance(painting.lit, some))], surfaces)
    sights = painting.solver._sights.of(painting.scene, surfaces, handed[Casters], known, rows, JOB)
    regions, region = changeables_of(painting.scene, surfaces, [], painting.services.registry)
    number = [one.node for one in regions].index("side")
    nodes = painting.solver._trials(painting.scene, surfaces, known, rows, sights, regions, region, JOB)
    one = Candidate(number, "colour", regions[number].now, {"diffuse": np.full(3, 0.9)}, 0.0, 0.0)
    columns = one.predicted(nodes)
    as_before = fitted_again(one, columns, rows, nodes, regions[number])
    twice = fitted_again(one, [rows.change + 0.0 for _ in columns], rows, nodes, regions[number])
    assert as_before.left > twice.left
    np.testing.assert_allclose(twice.values["diffuse"], 0.9, atol=0.02)
    assert twice.left < 0.01
