"""Paths look for the sky where it is open; what they find stays the same in the mean."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from gathered_rooms import Room
from path_rooms import furnished
from scenes import sky

from studio_core.contract import Services
from studio_core.kernels.directions import SMALLEST
from studio_core.scene.nodes import AreaLamp, Environment
from studio_core.shading.artifacts import Casters, Lighting, Surfaces
from studio_core.shading.path_world import PathWorld, PathWorlds
from studio_plugins.interreflection.gather.skylight import looking_out

CELLS = 1 << SMALLEST


def world_of(lights: Any, services: Services) -> tuple[PathWorld, Any]:
    room = Room(furnished(lights), services, 700)
    handed = room.handed()
    lighting = handed[Lighting]
    made = PathWorlds(services.registry)(room.scene, handed[Surfaces], handed[Casters], lighting)
    return made, lighting


@pytest.fixture
def outside(workers: Any, host: Any) -> tuple[PathWorld, Any]:
    return world_of((Environment(id="sky", image=sky(32), intensity=1.0),), Services(workers, host))


def test_open_directions_are_chosen_more_often_and_none_never(outside: Any) -> None:
    before, lighting = outside
    worth = np.zeros(CELLS)
    worth[: CELLS // 8] = 1.0
    after = looking_out(before, worth)
    was, now = before.lights, after.lights
    size = np.full(len(now.chance), lighting.tree.solid_angle)
    assert (now.chance.astype(np.float64) * size).sum() == pytest.approx(1, rel=1e-4)
    shares = np.diff(now.upto, prepend=0.0) / now.upto[-1]
    np.testing.assert_allclose(now.chance * size, shares, rtol=1e-3, atol=1e-9)
    assert (now.chance[was.chance > 0] > 0).all()
    bright = was.chance > 0
    part = np.arange(len(was.chance)) < len(was.chance) // 8
    if (bright & part).any():
        assert (now.chance[bright & part] > was.chance[bright & part]).all()
    assert (now.chance[bright & ~part] < was.chance[bright & ~part]).all()
    np.testing.assert_array_equal(was.radiance, now.radiance)


def test_what_is_worth_the_same_everywhere_changes_nothing(outside: Any) -> None:
    before, _ = outside
    after = looking_out(before, np.ones(CELLS))
    np.testing.assert_allclose(after.lights.chance, before.lights.chance, rtol=1e-4, atol=1e-12)


def test_without_a_sky_or_a_pilot_the_world_is_the_same(outside: Any, workers: Any, host: Any) -> None:
    before, _ = outside
    assert looking_out(before, None) is before
    closed, _ = world_of((AreaLamp(id="lamp", intensity=1.0),), Services(workers, host))
    assert looking_out(closed, np.ones(CELLS)) is closed
