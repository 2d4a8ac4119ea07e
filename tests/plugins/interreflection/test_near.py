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
from studio_plugins.interreflection.gather.near import Near, followed, near_rays, trusted

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
    for name, last in (("vertices", tiers.REST), ("followed", tiers.CLOSE)):
        monkeypatch.setattr(tiers, "tiers", lambda _, last=last: (tiers.HAND, tiers.replace(last, last=True)))
        room = Room(furnished((LAMP,), *material), services, 700, bounces=bounces)
        made = room.light(moving=False)
        assert made.final
        assert (made.counts["rays_followed"] > 0) == (name == "followed")
        assert (made.layer.irradiance >= 0).all()
        found[name] = irradiance_error(room, made, bounces)
    assert found["followed"] < 0.9 * found["vertices"]


@pytest.mark.parametrize(("receivers", "rays"), [(4_000, 1024), (9_000, 512), (30_000, 256)])
def test_a_small_scene_gets_the_rays_that_a_large_one_has_no_time_for(receivers: int, rays: int) -> None:
    assert sum(tiers.CLOSE.rays_for(receivers)) == rays
    assert sum(tiers.REST.rays_for(receivers)) == 256
    assert sum(tiers.HAND.rays_for(receivers)) == 64


def test_paths_are_counted_and_have_a_budget(services: Services, monkeypatch: pytest.MonkeyPatch) -> None:
    last = tiers.replace(tiers.CLOSE, paths=5000, last=True)
    monkeypatch.setattr(tiers, "tiers", lambda _: (tiers.HAND, last))
    made = Room(furnished((LAMP,)), services, 700).light(moving=False)
    assert 4000 < made.counts["rays_followed"] <= 5002


def follower(*lights: float) -> Any:
    """Paths of a ray i find light[i] more than vertices tell, and noise."""
    rng = np.random.default_rng(1)

    def follow(rays: Any, row: Any, ray: Any, turn: Any, seed: int) -> Any:
        assert len({*zip(row.tolist(), ray.tolist(), turn.tolist(), strict=True)}) == len(row)
        found = np.asarray(lights)[ray] + 0.1 * rng.normal(size=len(ray))
        return np.repeat(found[:, None], 3, axis=1).astype(np.float32)

    return follow


@pytest.mark.parametrize("budget", [1500, 100_000])
def test_differences_come_back_by_table_row_and_ray(budget: int) -> None:
    one, two = (table_of(np.full((900, 3), 5), np.ones((900, 3))) for _ in range(2))
    row, ray = np.divmod(np.arange(2700), 3)
    (a, b), paths = followed([(one, row, ray), (two, row[:1800], ray[:1800])], budget, follower(1, 2, 3))
    assert paths <= budget + 2
    assert (len(a.row), len(b.row)) == (2700, 1800)
    for made in (a, b):
        means = [made.change[made.ray == i].mean() for i in range(3)]
        np.testing.assert_allclose(means, (1, 2, 3), rtol=0.2)
    found = a.numbered(one)
    np.testing.assert_array_equal(found[a.row, a.ray], np.arange(2700))


def test_nobody_near_is_nothing() -> None:
    nothing = np.zeros(0, np.int64)
    table = table_of([[NOTHING]], [[np.inf]])
    (made,), paths = followed([(table, nothing, nothing)], 1000, follower(1))
    assert paths == len(made.change) == 0


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
    alone = np.full((vertices, 3), -1, np.int32)
    near = ((np.arange(vertices)[:, None] + [1, 2, 3]) % vertices).astype(np.int32)
    noise = rng.normal(size=(len(row), 1)).repeat(3, axis=1)
    by_itself, among = (
        trusted([(table, Near(row, ray, noise.astype(np.float32)))], neighbours)
        for neighbours in (alone, near)
    )
    assert by_itself.mean() < 0.4
    assert among.mean() < 0.4
    assert among.std() < 0.8 * by_itself.std()
    sure = (noise + 2).astype(np.float32)
    assert trusted([(table, Near(row, ray, sure))], near).min() > 0.9
    nothing = np.zeros(0, np.int64)
    assert not trusted([(table, Near(nothing, nothing, np.zeros((0, 3), np.float32)))], near).any()
