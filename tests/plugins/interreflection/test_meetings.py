"""Kept rays of all vertices: who has how many, and that nobody has rows of two kinds."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from transport_support import Stand, furnished

from studio_core.contract import Services
from studio_core.shading.artifacts import Casters, Surfaces
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs
from studio_plugins.interreflection.gather.meetings import MeetingsStage, crowded, fewer
from studio_plugins.interreflection.gather.tiers import CLOSE, HAND, REST, Chosen, Tier

FRAME: Any = SimpleNamespace()


@pytest.fixture
def services(workers: Any, host: Any) -> Services:
    return Services(workers, host)


class Runner:
    """The stage over one stand, as a pipeline runs it."""

    def __init__(self, services: Services, stand: Stand) -> None:
        self.stage, self.stand = MeetingsStage(services), stand
        self.made: Any = None

    def __call__(self, tier: Tier = HAND) -> Any:
        given = {Surfaces: self.stand.surfaces, Casters: self.stand.casters, Chosen: Chosen(tier, 0)}
        inputs: Any = Inputs(given, SimpleNamespace(), self.made)  # type: ignore[arg-type]
        self.made = self.stage.run(FRAME, inputs, Job("test"))
        return self.made


def rays_of(met: Any, count: int) -> Any:
    many = np.zeros(count, np.int64)
    for table in met.tables:
        many[table.rows] += table.table.rays
    return many


@given(hnp.arrays(np.float32, st.integers(0, 60), elements=st.floats(0, 8, width=32)))
def test_those_that_crowd_stand_for_little(area: Any) -> None:
    few = crowded(area)
    assert few.shape == area.shape
    assert area[few].sum() <= area.sum() / 4 + 1e-6
    if not few.all():
        assert area[~few].min(initial=np.inf) >= area[few].max(initial=0.0)


def test_even_meshes_crowd_nowhere() -> None:
    assert not crowded(np.full(9, 0.01, np.float32)).any()
    assert crowded(np.array([1, 1, 1, 0.01], np.float32)).tolist() == [False, False, False, True]


def test_a_little_more_area_changes_nobody() -> None:
    area = np.array([1, 1, 1, 1, 0.2, 0.01], np.float32)
    np.testing.assert_array_equal(crowded(area), crowded(np.append(area, np.float32(1.1)))[:6])


def test_every_vertex_has_the_rays_of_its_kind(services: Services) -> None:
    run = Runner(services, Stand(furnished((0, 0, 0)), 1500))
    few = crowded(run.stand.mesh.area)
    assert 0.1 < few.mean() < 0.9
    for tier in (HAND, REST):
        expected = np.where(few, sum(fewer(tier.inner)), sum(tier.inner))
        np.testing.assert_array_equal(rays_of(run(tier), len(few)), expected)


def test_a_thing_that_grows_has_rows_of_one_kind(services: Services) -> None:
    run = Runner(services, Stand(furnished((0, 0, 0)), 1500))
    run()
    before = crowded(run.stand.mesh.area)
    ball = run.stand.scene["ball"].transform
    run.stand.place(ball=ball.__class__(ball.translation, ball.rotation, 4.0 * ball.scale))
    few = crowded(run.stand.mesh.area)
    assert (before & ~few).any()
    many = rays_of(run(), len(few))
    np.testing.assert_array_equal(many, np.where(few, sum(fewer(HAND.inner)), sum(HAND.inner)))


def test_what_did_not_move_is_the_same(services: Services) -> None:
    run = Runner(services, Stand(furnished((0, 0, 0)), 600))
    first = run()
    assert first.rays > 0
    assert run() is first


def test_tiers_that_follow_more_rays_send_the_same() -> None:
    assert REST.sends_as(CLOSE)
    assert not HAND.sends_as(REST)
