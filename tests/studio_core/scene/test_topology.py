"""Welding, parts, edges and T-junctions against trying everything."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from oracles import meshes
from oracles.meshes import box, floor, joined

from studio_core.scene.topology import components, edges, partners, t_junctions, tolerance, weld


@given(st.integers(1, 40), st.lists(st.tuples(st.integers(0, 39), st.integers(0, 39)), max_size=60))
def test_components_are_those_of_a_walk(count: int, links: list[tuple[int, int]]) -> None:
    links = [(a % count, b % count) for a, b in links]
    expected = list(range(count))
    for _ in range(count):
        for a, b in links:
            expected[a] = expected[b] = min(expected[a], expected[b])
    pairs = np.array(links, np.int64).reshape(-1, 2)
    assert components(count, pairs[:, 0], pairs[:, 1]).tolist() == expected


def test_components_of_a_long_shuffled_chain() -> None:
    order = np.random.default_rng(3).permutation(20_000)
    assert not components(20_000, order[:-1], order[1:]).any()


points = hnp.arrays(
    np.float32,
    st.tuples(st.integers(1, 30), st.just(3)),
    elements=st.integers(-3, 3).map(float) | st.floats(-3, 3, width=32),
)


@given(points, st.sampled_from([0.0, 1e-3, 0.2]))
def test_welding_joins_what_is_near_and_nothing_else(positions: npt.NDArray[np.float32], near: float) -> None:
    made, index = weld(positions, near)
    assert np.array_equal(np.unique(index), np.arange(len(made)))
    away = np.abs(positions[:, None].astype(float) - positions[None]).max(axis=2)
    same = index[:, None] == index[None]
    assert same[away <= 0.999 * near].all()
    assert same[away == 0].all()
    reach = np.linalg.norm(positions[:, None].astype(float) - positions[None], axis=2)
    linked = reach <= 2 * np.sqrt(3) * near + 1e-12
    pairs = np.argwhere(linked)
    chain = components(len(positions), pairs[:, 0], pairs[:, 1])
    assert not same[chain[:, None] != chain[None]].any()
    taken = [np.flatnonzero(index == k)[0] for k in range(len(made))]
    originals = {tuple(p) for p in (positions + np.float32(0)).tolist()}
    assert all(tuple(p) in originals for p in made.astype(np.float32).tolist())
    assert taken == sorted(taken)


def test_minus_zero_is_zero() -> None:
    _, index = weld(np.array([[0.0, 0, 0], [-0.0, 0, -0.0]], np.float32), 0.0)
    assert index.tolist() == [0, 0]


faces = hnp.arrays(np.int64, st.tuples(st.integers(0, 15), st.just(3)), elements=st.integers(0, 7)).filter(
    lambda f: all(len(set(row)) == 3 for row in f.tolist())
)


@given(faces)
def test_edges_are_counted(chosen: npt.NDArray[np.int64]) -> None:
    made = edges(chosen)
    counted = {tuple(end): count for end, count in zip(made.ends.tolist(), made.count.tolist(), strict=True)}
    assert counted == meshes.edge_faces(chosen)
    for e in range(len(made.ends)):
        half = made.order[made.start[e] : made.start[e] + made.count[e]]
        assert (made.of.reshape(-1)[half] == e).all()


def test_partners_of_solids_that_touch_stay_within_each() -> None:
    """Two boxes along an edge, two across a whole face: every half-edge has its partner in its own box."""
    for at in ((1.0, 1.0, 0.0), (1.0, 0.0, 0.0)):
        pair = joined(box(), box(at=at))
        made, index = weld(pair.positions, tolerance(pair.positions))
        welded = index[pair.faces.astype(np.int64)]
        across = partners(made, welded, edges(welded))
        assert (across >= 0).all()
        assert np.array_equal(across[across], np.arange(len(across)))
        assert np.array_equal(np.arange(len(across)) // 36, across // 36)


def test_three_sheets_at_an_edge_have_no_partners_there() -> None:
    spread = np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0], [-1, 1, 0], [-1, -1, 0]], float)
    fins = np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    assert (partners(spread, fins, edges(fins)) == -1).all()


@given(st.integers(0, 10**6))
def test_t_junctions_are_those_that_trying_all_finds(seed: int) -> None:
    rng = np.random.default_rng(seed)
    base = rng.integers(-2, 3, (8, 3)).astype(float)
    picks = np.array([rng.choice(8, 3, replace=False) for _ in range(6)])
    a, b, c = base[picks[:, 0]], base[picks[:, 1]], base[picks[:, 2]]
    chosen = picks[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-6]
    _, first, index = np.unique(base, axis=0, return_index=True, return_inverse=True)
    chosen = index.reshape(-1)[chosen]
    made = edges(chosen)
    edge, point, where = t_junctions(base[first], chosen, made, 1e-6)
    found = {(tuple(made.ends[e].tolist()), int(p)) for e, p in zip(edge, point, strict=True)}
    assert found == set(meshes.t_junctions(base[first], chosen, 1e-6))
    at = (
        base[first][made.ends[edge, 0]] * (1 - where[:, None])
        + base[first][made.ends[edge, 1]] * where[:, None]
    )
    assert np.allclose(at, base[first][point])


def test_t_junctions_on_edges_of_all_lengths() -> None:
    """A fan of triangles from tiny to huge, each with a vertex of a neighbour on its long side."""
    parts = []
    for k in range(8):
        size, x = 10.0 ** (k - 4), 3 * 10.0 ** (k - 4)
        parts.append(joined(floor(size), floor(size / 3)))
        parts[-1] = type(parts[-1])(parts[-1].positions + np.float32([x, k, 0]), parts[-1].faces)
    whole = joined(*parts)
    made, index = weld(whole.positions, 0.0)
    welded = index[whole.faces.astype(np.int64)]
    found = t_junctions(made, welded, edges(welded), 1e-6)
    assert {(int(e), int(p)) for e, p in zip(found[0], found[1], strict=True)}
    expected = meshes.t_junctions(made, welded, 1e-6)
    assert len(found[0]) == len(expected) == pytest.approx(16, abs=2)
