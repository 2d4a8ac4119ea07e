"""Light is shared among neighbours, where it is likely to be the same."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from studio_core.parallel import Workers
from studio_core.scene.shading_mesh import shade_mesh
from studio_core.scene.transform import Transform
from studio_core.scene.world_mesh import Placed, assemble
from studio_core.transport.hits import NOTHING, HitTable
from studio_plugins.interreflection.gather.smooth import (
    NEIGHBOURS,
    Neighbours,
    Spacing,
    nearest,
    smoothed,
)


def plate(step: float = 0.1) -> Any:
    from studio_core.scene.geometry import Geometry

    corners = np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], np.float32)
    faces = np.array([[0, 2, 1], [0, 3, 2]], np.uint32)
    return shade_mesh(Geometry(corners, faces), step)


def receivers(count: int, length: Any = 10.0, inside: Any = 0.0) -> Any:
    table = HitTable.empty(count, 4)
    table.distance[:] = np.broadcast_to(np.asarray(length, np.float16).reshape(-1, 1), (count, 4))
    return SimpleNamespace(
        rows=np.arange(count),
        row_of=np.arange(count, dtype=np.int32),
        table=table,
        share_back=np.broadcast_to(np.float32(inside), (count,)).astype(np.float32),
    )


class Plate:
    """A square plate of 2 m, its upper and lower sides."""

    def __init__(self, workers: Workers) -> None:
        self.mesh = assemble([Placed("plate", plate(), Transform(), (0,))])
        self.workers, self.count = workers, len(self.mesh)
        self.neighbours = Neighbours()(self.mesh)

    def shared(self, light: Any, rays: int = 64, wanted: Any = None, **other: Any) -> Any:
        kept = receivers(self.count, **other)
        every = np.ones(self.count, np.bool_) if wanted is None else wanted
        spacing = Spacing.of(kept, self.workers)
        values = np.asarray(light, np.float32)
        return smoothed(values, kept, every, spacing, self.mesh, self.neighbours, rays, self.workers)


def test_noise_becomes_less_and_its_mean_stays(workers: Workers) -> None:
    of = Plate(workers)
    light = 1 + 0.3 * np.random.default_rng(1).normal(size=(of.count, 3))
    made = of.shared(light)
    assert made.std() < 0.45 * light.std()
    assert made.mean() == pytest.approx(light.mean(), rel=0.01)
    assert of.shared(light, rays=4096).std() > made.std()


@given(value=hnp.arrays(np.float32, 3, elements=st.floats(0, 100, width=32)))
def test_what_is_even_stays(workers: Workers, value: np.ndarray) -> None:
    of = Plate(workers)
    np.testing.assert_allclose(
        of.shared(np.tile(value, (of.count, 1))), np.tile(value, (of.count, 1)), rtol=1e-5
    )


def test_the_two_sides_of_a_plate_do_not_share(workers: Workers) -> None:
    of = Plate(workers)
    up = of.mesh.normals[:, 1] > 0
    light = np.where(up[:, None], 1.0, 0.0).repeat(3, axis=1)
    np.testing.assert_allclose(of.shared(light), light)


def test_near_things_keep_their_light_to_themselves(workers: Workers) -> None:
    """With something close by, light changes over short ways."""
    of = Plate(workers)
    light = np.random.default_rng(2).random((of.count, 3))
    np.testing.assert_allclose(of.shared(light, length=0.01), light, rtol=1e-6)


def test_who_sees_insides_gives_nothing_away(workers: Workers) -> None:
    of = Plate(workers)
    inside = np.where(of.mesh.positions[:, 0] > 0, 0.9, 0.0)
    light = np.where(inside[:, None] > 0, 0.0, 1.0).repeat(3, axis=1)
    np.testing.assert_allclose(of.shared(light, inside=inside), light)


def test_who_is_not_wanted_is_not_asked(workers: Workers) -> None:
    of = Plate(workers)
    wanted = of.mesh.positions[:, 0] < 0.3
    light = np.where(wanted[:, None], 1.0, np.nan).repeat(3, axis=1)
    assert np.isfinite(of.shared(light, wanted=wanted)[wanted]).all()


def test_neighbours_are_the_nearest_of_their_side() -> None:
    mesh = plate()
    found = nearest(mesh)
    rng = np.random.default_rng(3)
    for v in rng.integers(0, len(mesh), 20):
        away = np.linalg.norm(mesh.positions - mesh.positions[v], axis=1)
        away[mesh.side != mesh.side[v]] = np.inf
        away[v] = np.inf
        np.testing.assert_allclose(away[found[v]].max(), np.sort(away)[NEIGHBOURS - 1], rtol=1e-5)
        assert v not in found[v]


def test_meshes_with_few_vertices_have_fewer_neighbours() -> None:
    found = nearest(plate(10.0))
    assert found.shape[1] == NEIGHBOURS
    assert (found[:, -1] == -1).all()
    assert (found[:, 0] >= 0).all()


def test_instances_share_and_others_are_kept() -> None:
    mesh = plate()
    keeper = Neighbours()
    one = assemble([Placed("a", mesh, Transform(), (0,)), Placed("b", mesh, Transform(), (0,))])
    found = keeper(one)
    count = len(mesh)
    np.testing.assert_array_equal(found[count:], np.where(found[:count] >= 0, found[:count] + count, -1))
    moved = one.moved(0, Transform((1.0, 0.0, 0.0)))
    assert keeper(moved) is found


def test_harmonic_means_leave_out_what_met_nothing() -> None:
    rng = np.random.default_rng(4)
    distance = rng.uniform(0.1, 20, (50, 16)).astype(np.float16)
    distance[rng.random(distance.shape) < 0.3] = np.inf
    distance[7] = np.inf
    kept = SimpleNamespace(
        rows=np.arange(50),
        table=HitTable(np.full((50, 16), NOTHING, np.uint32), np.zeros((50, 16), np.uint16), distance),
        share_back=np.zeros(50, np.float32),
    )
    with Workers(1) as alone:
        found = Spacing.of(kept, alone).length  # type: ignore[arg-type]
    for own, length in zip(distance.astype(np.float64), found, strict=True):
        met = np.isfinite(own)
        expected = met.sum() / (1 / own[met]).sum() if met.any() else np.inf
        assert length == pytest.approx(expected, rel=1e-5)
