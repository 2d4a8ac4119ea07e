"""Columns: against finite differences of the gather, and their kernels against plain sums."""

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
from studio_plugins.slf.changeable import Look, changeables_of
from studio_plugins.slf.fixates import Rows, rows_of
from studio_plugins.slf.further import Importance, carry_back, groups_of, spread_first, sum_regions
from studio_plugins.slf.influence import Sight, add_columns
from studio_plugins.slf.ladder import level_of_alpha
from studio_plugins.slf.receiving import Arrivals, add_received
from studio_plugins.slf.trials import TRIED

LAMP = AreaLamp(
    id="lamp", intensity=6.0, width=1.0, height=0.6, transform=looking((0.8, 2.4, 0.9), (-0.5, 0, -0.5))
)
CAMERA = Camera(id="camera", transform=looking((0, 2.2, 4.5), (0, 0.8, 0)))
SHINY = Material(id="paint", name="Paint", model="phong", values={"exponent": 12.0, "specular": (0.4,) * 3})


@pytest.fixture(scope="module")
def painting(workers: Any, host: Any) -> Painting:
    return Painting(separate(furnished((LAMP, CAMERA), SHINY)), Services(workers, host))


@pytest.fixture(scope="module")
def rows(painting: Painting) -> Rows:
    some = painting.vertices("floor", (-1.4, 0, 0.3), 120)
    shown = painting.radiance(painting.lit, some)
    return rows_of([painting.stroke(some, shown + 1)], painting.room.handed()[Surfaces])


@pytest.fixture(scope="module")
def sights(painting: Painting, rows: Rows) -> tuple[Sight, ...]:
    handed = painting.room.handed()
    known = painting.lit.sent
    return painting.solver._sights.of(painting.scene, handed[Surfaces], handed[Casters], known, rows, JOB)


def seen(painting: Painting, sights: tuple[Sight, ...], made: Any) -> Any:
    """(P, 3) of what vertices send along the kept rays, by all sets of these."""
    return np.mean([_seen_along(painting, sight, made) for sight in sights], axis=0)


def _seen_along(painting: Painting, sight: Sight, made: Any) -> Any:
    lit = sight.met < len(painting.mesh)
    light = np.zeros((*sight.met.shape, 3), np.float32)
    to = sight.met[lit].astype(np.int64), sight.cell[lit].astype(np.int64)
    light[lit] = sent_towards(made.light, made.surface, *to, painting.services.workers)
    return (sight.weight * light).sum(axis=1, dtype=np.float64)


def test_rays_of_rows_see_what_the_gather_shows(
    painting: Painting, rows: Rows, sights: tuple[Sight, ...]
) -> None:
    made = seen(painting, sights, painting.lit.sent)
    shown = painting.radiance(painting.lit, rows.vertex)
    np.testing.assert_allclose(made.mean(axis=0), shown.mean(axis=0), rtol=0.03)


@pytest.mark.parametrize(
    ("node", "role", "value"),
    [
        ("side", "diffuse", (0.5, 0.75, 0.6)),
        ("box", "diffuse", (0.1, 0.2, 0.3)),
        ("back", "diffuse", (0.75, 0.55, 0.55)),
        ("side", "specular", (0.3, 0.3, 0.3)),
        ("side", "gloss", 5.0),
    ],
)
def test_columns_are_finite_differences(
    painting: Painting, rows: Rows, sights: tuple[Sight, ...], node: str, role: str, value: Any
) -> None:
    registry, surfaces = painting.services.registry, painting.room.handed()[Surfaces]
    known = painting.lit.sent
    before = seen(painting, sights, known)
    regions, region = changeables_of(painting.scene, surfaces, [], registry)
    number = [one.node for one in regions].index(node)
    trials = painting.solver._trials
    nodes = trials(painting.scene, surfaces, known, rows, sights, regions, region, JOB)
    look: Look = regions[number].now
    name = look.roles[role]
    then = painting.light(recoloured(painting.scene, node, **{name: value}))
    wanted = seen(painting, sights, then.sent) - before
    painting.become(painting.scene)
    if role == "gloss":
        level = float(level_of_alpha(look.resolved.brdf.alpha(value)))  # type: ignore[attr-defined]
        whole = [np.mean([side.whole[:, number] for side in one.sides], axis=0) for one in nodes]
        sent = np.stack(whole[1:])
        at = np.interp(level, TRIED, np.arange(len(TRIED)))
        low, share = int(at), at - int(at)
        made = (1 - share) * sent[low] + share * sent[low + 1] - whole[0]
    else:
        change = look.coefficients({role: np.array([value])})[0] - look.plain
        terms = np.mean([side.terms[:, number, : len(change)] for side in nodes[0].sides], axis=0)
        made = np.einsum("ptc,tc->pc", terms, change)
    size = np.sqrt((wanted**2).mean())
    assert np.sqrt(((made - wanted) ** 2).mean()) < (0.3 if role == "gloss" else 0.15) * size
    if role != "gloss":
        np.testing.assert_allclose(made.mean(), wanted.mean(), rtol=0.12)


def test_what_arrives_at_materials_as_they_are_is_what_the_gather_sends_back(painting: Painting) -> None:
    """Light that was received, weighed anew, is sent back as it was: bounces that were left out aside."""
    from studio_core.transport.bounces import reflected

    known, surfaces = painting.lit.sent, painting.room.handed()[Surfaces]
    some = np.ones(len(painting.mesh), np.bool_)
    arrivals = Arrivals(known, surfaces, some, painting.services.workers, JOB)
    surface = known.surface
    light, made = arrivals.weighed(known.shapes, surface.row, surface.separated, surface.coefficients)
    again = reflected(light, made, painting.services.workers)
    assert (again.matte >= known.light.matte - 1e-5).all()  # in hand there is one bounce more
    np.testing.assert_allclose(again.matte.mean(), known.light.matte.mean(), rtol=0.08)


def test_kernels_are_plain_sums() -> None:
    rng = np.random.default_rng(3)
    vertices, rays, count, width = 12, 20, 4, 2
    met = rng.integers(0, vertices + 2, (count, rays)).astype(np.uint32)
    met[met >= vertices] = 0xFFFFFFFF
    cell = rng.integers(0, 8, (count, rays)).astype(np.uint16)
    weight = rng.random((count, rays, 3)).astype(np.float32)
    region = rng.integers(-1, 3, vertices).astype(np.int32)
    row = rng.integers(-1, 2, vertices).astype(np.int32)
    matte = np.array([[0.3, 0.0], [0.2, 0.1]], np.float32)
    functions = np.array([0, 3], np.int64)
    base, first = np.array([0, 0], np.int64), np.array([0, 0], np.int64)
    term, outgoing = np.array([1, 1, 0], np.int32), rng.random(8 * 3).astype(np.float32)
    slot = np.where(row == 1, 3 * np.arange(vertices), -1).astype(np.int64)
    irradiance = rng.random((vertices, 3)).astype(np.float32)
    received = rng.random((3 * vertices, 3)).astype(np.float32)
    coefficients = rng.random((vertices, width, 3)).astype(np.float32)
    terms, whole = np.zeros((count, 3, width, 3)), np.zeros((count, 3, 3))
    add_columns(
        0, count, met, cell, weight, region, irradiance, received, coefficients, slot, row, matte, base,
        functions, first, term, outgoing, terms, whole,
    )  # fmt: skip
    wanted = np.zeros_like(terms)
    for p in range(count):
        for j in range(rays):
            v = int(met[p, j])
            if v >= vertices or region[v] < 0 or row[v] < 0:
                continue
            sent = matte[row[v]][:, None] * irradiance[v]
            if row[v] == 1:
                for k in range(3):
                    sent[term[k]] = sent[term[k]] + outgoing[cell[p, j] * 3 + k] * received[slot[v] + k]
            wanted[p, region[v]] += weight[p, j] * sent
    np.testing.assert_allclose(terms, wanted, rtol=1e-5)
    by = np.zeros_like(whole)
    for p in range(count):
        for j in range(rays):
            v = int(met[p, j])
            if v < vertices and region[v] >= 0 and row[v] >= 0:
                alone, every = np.zeros((1, 3, width, 3)), np.zeros((1, 3, 3))
                one = slice(p, p + 1), slice(j, j + 1)
                add_columns(
                    0, 1, met[one], cell[one], weight[one], region, irradiance, received, coefficients, slot,
                    row, matte, base, functions, first, term, outgoing, alone, every,
                )  # fmt: skip
                by[p, region[v]] += (alone[0, region[v]] * coefficients[v]).sum(axis=0)
    np.testing.assert_allclose(whole, by, rtol=1e-5)


def test_importance_is_the_transpose_of_a_bounce() -> None:
    """⟨a, T x⟩ = ⟨Tᵀ a, x⟩ with T x of a receiver: what it reflects of the mean along its rays."""
    rng = np.random.default_rng(4)
    vertices, rays, groups = 15, 6, 2
    rows = rng.permutation(vertices)[:10].astype(np.int64)
    hits = rng.integers(0, vertices + 3, (10, rays)).astype(np.uint32)
    hits[hits >= vertices] = 0xFFFFFFFF
    reflects = rng.random((vertices, 3)).astype(np.float32)
    many = np.full(vertices, rays, np.float32)
    matters = rng.random((vertices, groups, 3)).astype(np.float32)
    sent = rng.random((vertices, 3))
    carried = np.zeros_like(matters)
    carry_back(rows, hits, reflects, many, matters, carried)
    bounced = np.zeros((vertices, 3))
    for i, u in enumerate(rows):
        lit = hits[i][hits[i] < vertices]
        bounced[u] = reflects[u] * sent[lit].sum(axis=0) / rays
    one = np.einsum("vkc,vc->kc", matters, bounced)
    other = np.einsum("vkc,vc->kc", carried, sent)
    np.testing.assert_allclose(one, other, rtol=1e-5)


def test_first_importance_and_sums_over_regions() -> None:
    rng = np.random.default_rng(5)
    met = np.array([[0, 1, 9], [1, 1, 2]], np.uint32)
    weight = rng.random((2, 3, 3)).astype(np.float32)
    out = np.zeros((3, 1, 3), np.float32)
    spread_first(met, weight, np.zeros(2, np.int64), np.array([0.5], np.float32), out)
    np.testing.assert_allclose(out[1, 0], 0.5 * (weight[0, 1] + weight[1, 0] + weight[1, 1]), rtol=1e-6)
    region, row = np.array([0, 1, 1], np.int32), np.array([0, 1, -1], np.int32)
    albedos, coefficients = rng.random((2, 2)), rng.random((3, 2, 3)).astype(np.float32)
    terms, whole = np.zeros((1, 2, 2, 3)), np.zeros((1, 2, 3))
    sum_regions(region, row, albedos, coefficients, out, terms, whole)
    np.testing.assert_allclose(terms[0, 1], albedos[1][:, None] * out[1, 0], rtol=1e-6)
    np.testing.assert_allclose(whole[0, 0], (terms[0, 0] * coefficients[0]).sum(axis=0), rtol=1e-6)


def test_received_light_is_weighed_by_functions() -> None:
    rng = np.random.default_rng(6)
    light = rng.random((2, 5, 3)).astype(np.float32)
    cells = rng.integers(0, 4, (2, 5)).astype(np.uint16)
    incoming = rng.random(4 * 2).astype(np.float32)
    irradiance, received = np.zeros((3, 3), np.float32), np.zeros((2, 3), np.float32)
    add_received(
        0, 2, np.array([2, 0]), cells, light, np.full(3, 0.25, np.float32), np.array([0, -1, -1]),
        np.array([0, -1, 0], np.int32), np.array([0]), np.array([2]), incoming, irradiance, received,
    )  # fmt: skip
    np.testing.assert_allclose(irradiance[2], 0.25 * light[0].sum(axis=0), rtol=1e-6)
    wanted = 0.25 * np.einsum("jk,jc->kc", incoming.reshape(4, 2)[cells[1]], light[1])
    np.testing.assert_allclose(received, wanted, rtol=1e-6)


def test_groups_count_for_rows_near_them(painting: Painting, rows: Rows) -> None:
    group, share = groups_of(rows, painting.mesh)
    np.testing.assert_allclose(share.sum(axis=1), 1)
    assert (share.argmax(axis=1) == group).mean() > 0.8
    importance = Importance(
        painting.lit.sent, painting.room.handed()[Surfaces], [_nothing(rows, painting)], rows, JOB
    )
    assert not importance.matter.any()


def _nothing(rows: Rows, painting: Painting) -> Sight:
    met = np.full((len(rows), 3), len(painting.mesh), np.uint32)
    return Sight(met, np.zeros_like(met, np.uint16), np.zeros((len(rows), 3, 3), np.float32), 0)
