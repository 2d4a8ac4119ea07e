"""Rays that are followed on tell what vertices cannot."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from gathered_rooms import Room
from path_rooms import furnished

from studio.bench.harness import unbiased_rmse
from studio_core.contract import Services
from studio_core.scene.nodes import AreaLamp, Material
from studio_core.scene.transform import looking
from studio_core.transport.hits import BLACK, NOTHING
from studio_plugins.interreflection.gather import near, tiers
from studio_plugins.interreflection.gather.near import Near, near_rays, trusted

LAMP = AreaLamp(
    id="lamp", intensity=6.0, width=1.0, height=0.6, transform=looking((0.8, 2.4, 0.9), (-0.5, 0, -0.5))
)
METAL = Material(id="paint", name="Paint", model="ggx", values={"roughness": 0.4, "metallic": 1.0})


@pytest.fixture
def services(workers: Any, host: Any) -> Services:
    return Services(workers, host)


def irradiance_error(room: Room, made: Any, bounces: int) -> float:
    some = np.sort(np.random.default_rng(1).choice(len(made.valid), 300, replace=False))
    a, b = (half.irradiance for half in room.truth(some, 1024, bounces))
    return unbiased_rmse(made.layer.irradiance[some], a, b)


@pytest.mark.parametrize("bounces", [1, 3])
@pytest.mark.parametrize("material", [(), (METAL,)], ids=["matte", "metal"])
def test_followed_rays_do_without_a_fine_mesh(
    services: Services, monkeypatch: pytest.MonkeyPatch, material: Any, bounces: int
) -> None:
    """All rays followed on, in a room of few vertices."""
    monkeypatch.setattr(near, "NEAR", 1e6)
    monkeypatch.setattr(near, "NEAR_SHARP", 1e6)
    found = {}
    for name, last in (("vertices", tiers.REST), ("followed", tiers.CLOSER)):
        monkeypatch.setattr(tiers, "tiers", lambda _, last=last: (tiers.HAND, tiers.replace(last, last=True)))
        room = Room(furnished((LAMP,), *material), services, 700, bounces=bounces)
        made = room.light(moving=False)
        assert made.final
        assert (made.counts["rays_followed"] > 0) == (name == "followed")
        assert (made.layer.irradiance >= 0).all()
        found[name] = irradiance_error(room, made, bounces)
    assert found["followed"] < 0.9 * found["vertices"]


def table_of(vertex: Any, distance: Any) -> Any:
    met, far = np.asarray(vertex, np.uint32), np.asarray(distance, np.float16)
    return SimpleNamespace(vertex=met, distance=far, rows=np.arange(len(met)))


def test_short_rays_are_near_and_sharp_lobes_are_near_for_longer() -> None:
    table = table_of([[0, 1, 2, NOTHING, BLACK]], [[0.2, 0.2, 0.2, np.inf, 0.01]])
    area = np.array([0.01, 0.0001, 0.0005], np.float32)
    row, error = np.array([0, 0, 1], np.int32), np.array([0.1, 0.9], np.float32)
    rows, rays = near_rays(table, np.array([0]), area, row, error)
    np.testing.assert_array_equal(rows, [0, 0])
    np.testing.assert_array_equal(rays, [0, 2])


def test_what_is_noise_is_not_trusted_and_what_is_not_is() -> None:
    rng = np.random.default_rng(2)
    rays, vertices = 64, 400
    table = table_of(np.zeros((vertices, rays)), np.ones((vertices, rays)))
    row, ray = np.divmod(np.arange(vertices * rays), rays)
    noise = rng.normal(size=(len(row), 1)).repeat(3, axis=1)
    assert trusted([(table, Near(row, ray, noise.astype(np.float32)))], vertices).mean() < 0.4
    sure = (noise + 2).astype(np.float32)
    assert trusted([(table, Near(row, ray, sure))], vertices).min() > 0.9
    nothing = np.zeros(0, np.int64)
    assert not trusted([(table, Near(nothing, nothing, np.zeros((0, 3), np.float32)))], vertices).any()
