"""A solved stroke in indirect mode changes the light between surfaces as path tracing says it should.

What is painted is what paths show after another object's change; the solver's edit is put into the scene, and
paths with the same random numbers go through that: nothing of this comes from the solver's rays.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from indirect_strokes import Painting, recoloured, separate
from path_rooms import furnished

from studio_core.contract import Services
from studio_core.scene.nodes import AreaLamp, Camera, Scene
from studio_core.scene.transform import looking

LAMP = AreaLamp(
    id="lamp", intensity=6.0, width=1.0, height=0.6, transform=looking((0.8, 2.4, 0.9), (-0.5, 0, -0.5))
)
CAMERA = Camera(id="camera", transform=looking((0, 2.2, 4.5), (0, 0.8, 0)))
PATHS = 1024


@pytest.fixture(scope="module")
def painting(workers: Any, host: Any) -> Painting:
    return Painting(separate(furnished((LAMP, CAMERA))), Services(workers, host), 2000)


def by_paths(painting: Painting, scene: Scene, some: Any) -> Any:
    """(N, 3) that came by way of others in a scene; the room is as before then."""
    room = painting.room
    room.light(scene)
    first, second = room.truth(some, PATHS)
    made = room.radiance((first.terms + second.terms) / 2, some).astype(np.float64)
    painting.lit = room.light(painting.scene)
    return made


@pytest.mark.parametrize(
    ("model", "values"),
    [
        ("lambert", {"base_color": (0.2, 0.75, 0.25)}),
        ("specgloss", {"diffuse": (0.7, 0.6, 0.5), "specular": (0.7, 0.7, 0.7), "roughness": 0.4}),
    ],
    ids=["colour", "shine"],
)
def test_paths_see_the_change_that_was_painted(painting: Painting, model: str, values: Any) -> None:
    some = painting.vertices("floor", (-1.4, 0, 0.3), 100)
    before = by_paths(painting, painting.scene, some)
    wanted = by_paths(painting, recoloured(painting.scene, "side", model, **values), some) - before
    shown = painting.radiance(painting.lit, some)
    found = painting.solve(painting.stroke(some, shown + wanted))
    best = found.findings[0]
    assert best.node == "side"
    made = by_paths(painting, best.reasons[0].edit(painting.scene), some) - before
    assert ((made - wanted) ** 2).sum() < 0.05 * (wanted**2).sum()
    np.testing.assert_allclose(made.mean(axis=0), wanted.mean(axis=0), rtol=0.1)
