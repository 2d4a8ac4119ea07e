"""Sums over kept hits, against the slow way; bounces, against what they must add up to."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from oracles import bounces as oracle

from studio_core.parallel import Workers
from studio_core.transport.bounces import Light, Surface, bounced, ray_cells, received, reflected
from studio_core.transport.cells import CELLS
from studio_core.transport.hits import BLACK, NOTHING, HitTable
from studio_core.transport.patterns import Pattern, cosine_pattern, variants_of

VERTICES, RAYS = 300, 24


def table(seed: int, vertices: int = VERTICES, rays: int = RAYS, missed: float = 0.2) -> Any:
    """Random hits; some rays leave, some meet insides."""
    rng = np.random.default_rng(seed)
    vertex = rng.integers(0, vertices, (vertices, rays)).astype(np.uint32)
    fate = rng.random(vertex.shape)
    vertex[fate < missed] = NOTHING
    vertex[fate < missed / 2] = BLACK
    hits = HitTable(
        vertex,
        rng.integers(0, CELLS, vertex.shape).astype(np.uint16),
        np.ones(vertex.shape, np.float16),
    )
    rows = np.arange(vertices)
    variant = variants_of(rows, 16)
    return SimpleNamespace(rows=rows, variant=variant, table=hits, pattern=cosine_pattern(rays, 16, seed))


def surface(seed: int, vertices: int = VERTICES, signed: bool = True) -> Surface:
    """Rows 0: matte; 1: five functions of two terms; 2: three functions; −1: no material."""
    rng = np.random.default_rng(seed)
    count = np.array([0, 5, 3])
    base = np.array([0, 0, 5 * CELLS])
    values = rng.normal(size=(2, 8 * CELLS)) if signed else rng.random((2, 8 * CELLS))
    known: Any = SimpleNamespace(
        matte=np.array([[1, 0], [1, 0], [0, 0]], np.float32) / np.float32(np.pi),
        count=count,
        base=base,
        first=np.array([0, 0, 5]),
        term=np.array([0, 1, 1, 0, 1, 0, 1, 1], np.int32),
        incoming=values[0].astype(np.float32),
        outgoing=values[1].astype(np.float32),
    )
    row = rng.integers(-1, 3, vertices).astype(np.int32)
    own = np.where(row >= 0, count[row], 0)
    slot = np.where(own > 0, np.cumsum(own) - own, -1)
    coefficients = rng.random((vertices, 2, 3)).astype(np.float32) * 0.5
    return Surface(row, slot, int(own.sum()), coefficients, known)


def light(seed: int, of: Surface, sent: bool = True) -> Light:
    rng = np.random.default_rng(seed)
    functions = rng.normal(size=3 * of.size if sent else (of.size, 3)).astype(np.float32)
    return Light(rng.random((len(of.row), 3)).astype(np.float32), functions)


def test_what_is_received_is_the_sum_over_rays(workers: Workers) -> None:
    of, given, sent = surface(1), table(2), light(3, surface(1))
    found = received(sent, [given], of, workers)
    cells = ray_cells(given.pattern)
    matte, functions = oracle.received(sent, given.rows, given.table, cells, given.variant, of)
    np.testing.assert_allclose(found.matte, matte, rtol=2e-4, atol=2e-5)
    np.testing.assert_allclose(found.functions, functions, rtol=2e-3, atol=5e-4)


def test_several_tables_are_one_with_all_their_rays(workers: Workers) -> None:
    of, sent = surface(1), light(3, surface(1))
    a, b = table(4, rays=8), table(5, rays=24)
    both = received(sent, [a, b], of, workers)
    first, second = received(sent, [a], of, workers), received(sent, [b], of, workers)
    np.testing.assert_allclose(both.matte, 0.25 * first.matte + 0.75 * second.matte, rtol=1e-4, atol=1e-5)
    together = 0.25 * first.functions + 0.75 * second.functions
    np.testing.assert_allclose(both.functions, together, rtol=1e-3, atol=1e-4)


def test_each_vertex_has_the_mean_over_the_rays_that_it_has(workers: Workers) -> None:
    of, sent = surface(1), light(3, surface(1))
    whole, half = table(4, rays=8), table(5, rays=24)
    some = np.arange(0, VERTICES, 2)
    part = SimpleNamespace(
        rows=half.rows[some], variant=half.variant[some], table=half.table[some], pattern=half.pattern
    )
    made, alone = received(sent, [whole, part], of, workers), received(sent, [whole], of, workers)  # type: ignore[list-item]
    both = received(sent, [whole, half], of, workers)
    np.testing.assert_allclose(made.matte[some], both.matte[some], rtol=1e-6)
    np.testing.assert_allclose(made.matte[some + 1], alone.matte[some + 1], rtol=1e-6)


def test_what_is_sent_back_is_a_term_times_its_coefficient(workers: Workers) -> None:
    of = surface(6)
    given = light(7, of, sent=False)
    made = reflected(given, of, workers)
    matte, functions = oracle.reflected(given.matte, given.functions, of)
    np.testing.assert_allclose(made.matte, matte, rtol=1e-5, atol=1e-7)
    np.testing.assert_allclose(made.functions, functions, rtol=1e-5, atol=1e-7)


def closed(albedo: float) -> tuple[Any, Surface]:
    """Rays that always meet something, matte surfaces of one albedo."""
    of = surface(1)
    row = np.zeros(VERTICES, np.int32)
    coefficients = np.full((VERTICES, 2, 3), albedo, np.float32)
    return table(8, missed=0.0), Surface(row, np.full(VERTICES, -1), 0, coefficients, of.separated)


@pytest.mark.parametrize("albedo", [0.5, 0.8, 0.9])
def test_a_furnace_adds_up_bounce_by_bounce(workers: Workers, albedo: float) -> None:
    given, of = closed(albedo)
    straight = Light(np.ones((VERTICES, 3), np.float32), np.zeros(0, np.float32))
    for bounces in (1, 2, 3, 7):
        made = bounced(straight, bounces, [given], of, workers)
        assert made.steps == bounces - 1
        np.testing.assert_allclose(made.light.matte, sum(albedo**i for i in range(bounces)), rtol=1e-5)
    made = bounced(straight, None, [given], of, workers)
    np.testing.assert_allclose(made.light.matte, 1 / (1 - albedo), rtol=1e-4)
    assert made.steps <= 6  # and not the 40 to 90 of plain steps


def test_settled_light_is_what_many_plain_steps_give(workers: Workers) -> None:
    given, of = table(9, missed=0.1), surface(1, signed=False)
    sent = light(10, of)
    straight = Light(sent.matte, np.abs(sent.functions) * 0.1)
    smaller = Surface(of.row, of.slot, of.size, of.coefficients * 0.3, of.separated)
    settled = bounced(straight, None, [given], smaller, workers)
    plain = bounced(straight, 60, [given], smaller, workers)
    scale = float(plain.light.matte.max())
    assert np.abs(settled.light.matte - plain.light.matte).max() < 1e-3 * scale
    assert settled.left < 1e-4


def test_nothing_negative_is_ever_received(workers: Workers) -> None:
    of, given = surface(1), table(2)
    sent = Light(np.zeros((VERTICES, 3), np.float32), light(3, of).functions * 10)
    assert (received(sent, [given], of, workers).matte >= 0).all()


def test_a_scene_without_vertices_is_dark(workers: Workers) -> None:
    of = surface(1, vertices=0)
    nothing = Light(np.zeros((0, 3), np.float32), np.zeros(0, np.float32))
    given = SimpleNamespace(
        rows=np.zeros(0, np.int64),
        variant=np.zeros(0, np.int32),
        table=HitTable.empty(0, 8),
        pattern=Pattern.of(np.array([[[0, 0, 1.0]] * 8]), np.pi / 8),
    )
    for bounces in (3, None):
        made: Any = bounced(nothing, bounces, [given], of, workers)
        assert made.light.matte.shape == (0, 3)
