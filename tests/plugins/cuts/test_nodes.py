"""Tables of nodes: what is replaced, dropped or numbered otherwise, and what the BRDF sum makes of it."""

from __future__ import annotations

import dataclasses
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import cuts as oracle
from oracles import tilted
from oracles.radiance import view_direction

from studio_core.kernels.radiance import frame
from studio_core.params import defaults
from studio_core.scene.tangents import arbitrary_tangents
from studio_core.shading.artifacts import TERMS, ChosenPoints, Shapes
from studio_core.shading.job import Job
from studio_plugins.cuts.nodes import NO_BLOCK, Detail, NodeBlock, NodeTable

MODELS = ("lambert", "ggx", "phong")


def block_of(rng, points, most=5):
    """Random nodes above the horizon of some points."""
    counts = rng.integers(0, most + 1, len(points))
    first = np.concatenate([[0], np.cumsum(counts)])
    data = []
    for count in counts:
        ways = rng.normal(size=(count, 3))
        ways[:, 2] = np.abs(ways[:, 2]) + 0.05
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        data.append(np.concatenate([ways.T, rng.uniform(-1, 2, (3, count))]).ravel())
    flat = np.concatenate([*data, np.zeros(0)]).astype(np.float32)
    return NodeBlock(np.array(points, np.int64), first.astype(np.int64), flat)


def nodes_of(block, number):
    """(N, 6)."""
    begin, end = 6 * block.first[number], 6 * block.first[number + 1]
    return block.data[begin:end].reshape(6, -1).T.astype(np.float64)


@pytest.fixture(scope="session")
def shapes(host):
    brdfs = [host.brdf(model) for model in MODELS]
    values = [{}, {"roughness": 0.5, "metallic": 0.0}, {"exponent": 30.0}]
    data = [np.atleast_1d(b.shape({**defaults(b.Params), **v})) for b, v in zip(brdfs, values, strict=True)]
    offset = np.cumsum([0, *map(len, data)])[:-1]
    flat = np.concatenate([*data, np.zeros(1)]).astype(np.float32)
    address = np.array([b.address for b in brdfs], np.int64)
    made = Shapes(address, np.array([b.terms for b in brdfs], np.int64), offset.astype(np.int64), flat)
    return made, brdfs, data


def points_of(rng, count):
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    zero = np.zeros((count, 3), np.float32)
    places = rng.uniform(-1, 1, (count, 3)).astype(np.float32)
    normals = normals.astype(np.float32)
    return ChosenPoints(
        np.zeros(3),
        places,
        normals,
        arbitrary_tangents(normals),
        normals,
        zero,
        rng.integers(0, len(MODELS), count).astype(np.int32),
    )


EYE = np.array([0.3, 2.0, 4.0], np.float32)


def expected(mesh, shapes, held, wanted):
    """Terms (V, T, 3) of what every vertex holds."""
    _, brdfs, data = shapes
    made = np.zeros((len(mesh.positions), TERMS, 3))
    for p, nodes in held.items():
        if wanted[p]:
            axes = np.zeros((3, 3))
            frame(*mesh.normals[p].astype(np.float64), axes)
            wo = view_direction(mesh.positions[p], EYE, axes, 1e-3)
            m = mesh.material[p]
            made[p, : brdfs[m].terms] = oracle.brdf_sum(brdfs[m], data[m], wo, nodes)
    return made


def shaded(table, mesh, shapes, wanted, workers):
    out = np.zeros((len(mesh.positions), TERMS, 3), np.float32)
    looked = table.shade(mesh, shapes[0], EYE, wanted, out, workers, Job("test"))
    return out, looked


@pytest.mark.parametrize("slope", [0.05, 0.5, 1.0])
def test_leaning_normals_are_summed_as_by_the_oracle(shapes, workers, slope):
    """Terms are as without, tilts the oracle's differences; materials without a slope have none."""
    rng = np.random.default_rng(7)
    count = 12
    mesh, table, wanted = points_of(rng, count), NodeTable(count), rng.random(count) < 0.8
    block = block_of(rng, range(count))
    table.replace([block])
    tilt = np.array([slope, slope, 0.0], np.float32)
    leaning = dataclasses.replace(shapes[0], tilt=tilt)
    found, tilts = np.zeros((count, TERMS, 3), np.float32), np.zeros((count, 3, TERMS, 3), np.float32)
    looked = table.shade(mesh, leaning, EYE, wanted, found, workers, Job("test"), tilts)
    plain, before = shaded(table, mesh, shapes, wanted, workers)
    np.testing.assert_array_equal(found, plain)
    of_leaning = sum(len(nodes_of(block, p)) for p in range(count) if wanted[p] and tilt[mesh.material[p]])
    assert looked == before + 4 * of_leaning > before
    axes = np.zeros((3, 3))
    for p in range(count):
        m = mesh.material[p]
        nodes = nodes_of(block, p)
        if not wanted[p] or tilt[m] == 0 or not len(nodes):
            assert not tilts[p].any()
            continue
        frame(*mesh.normals[p].astype(np.float64), axes)
        to_eye = axes @ (EYE - mesh.positions[p]).astype(np.float64)
        to_eye /= np.linalg.norm(to_eye)
        given_of = (shapes[1][m], shapes[2][m], to_eye, nodes)
        expected = tilted.tilts(partial(tilted.leaning_sum, *given_of), slope)
        scale = np.abs(expected).max() + np.abs(found[p]).max() / slope**2
        np.testing.assert_allclose(tilts[p, :, : shapes[1][m].terms], expected, rtol=2e-3, atol=2e-5 * scale)


@given(st.integers(0, 2**32 - 1))
def test_a_table_through_everything_that_happens_to_it(shapes, workers, seed):
    """Blocks that replace others, dropped and renumbered vertices: always the sum over what each holds."""
    rng = np.random.default_rng(seed)
    count = 14
    table, held = NodeTable(count), {}
    for _ in range(5):
        what = rng.integers(0, 3)
        if what == 0:
            chosen = rng.permutation(count)[: rng.integers(1, count)]
            halves = np.split(chosen, [len(chosen) // 2])
            blocks = [block_of(rng, half) for half in halves if len(half)]
            before = table.version.copy()
            table.replace(blocks)
            for block in blocks:
                held.update({int(p): nodes_of(block, i) for i, p in enumerate(block.points)})
            assert (table.version[chosen] == table.newest).all()
            rest = np.setdiff1d(np.arange(count), chosen)
            np.testing.assert_array_equal(table.version[rest], before[rest])
            assert table.newest > before.max()
        elif what == 1:
            gone = rng.random(count) < 0.3
            table.drop(gone)
            held = {p: nodes for p, nodes in held.items() if not gone[p]}
        else:
            to = rng.permutation(count)
            to[rng.random(count) < 0.3] = -1
            table = table.renumbered(count, to)
            held = {int(to[p]): nodes for p, nodes in held.items() if to[p] >= 0}
        np.testing.assert_array_equal(np.flatnonzero(table.owned), sorted(held))
    assert table.nodes == sum(map(len, held.values()))
    mesh, wanted = points_of(rng, count), rng.random(count) < 0.8
    found, looked = shaded(table, mesh, shapes, wanted, workers)
    np.testing.assert_allclose(found, expected(mesh, shapes, held, wanted), rtol=2e-3, atol=2e-4)
    assert looked == sum(len(nodes) for p, nodes in held.items() if wanted[p])


def test_vertices_that_are_gone_stay_gone(shapes, workers):
    """Renumbered twice: the last vertex does not inherit what one had that was left out before."""
    rng = np.random.default_rng(4)
    block = block_of(rng, [0, 1, 2])
    table = NodeTable(3)
    table.replace([block])
    table = table.renumbered(2, np.array([-1, 0, 1])).renumbered(2, np.array([0, 1]))
    mesh = points_of(rng, 2)
    found, _ = shaded(table, mesh, shapes, np.ones(2, np.bool_), workers)
    held = {0: nodes_of(block, 1), 1: nodes_of(block, 2)}
    np.testing.assert_allclose(found, expected(mesh, shapes, held, np.ones(2)), rtol=2e-3, atol=2e-4)
    assert table.nodes == len(held[0]) + len(held[1])


def test_blocks_nobody_needs_are_let_go():
    rng = np.random.default_rng(1)
    table = NodeTable(8)
    table.replace([block_of(rng, range(4)), block_of(rng, range(4, 8))])
    size = table.nbytes
    table.replace([block_of(rng, [0, 1, 2])])
    assert len(table.blocks) == 3
    table.replace([block_of(rng, range(8))])
    assert len(table.blocks) == 1
    assert table.nbytes < 2 * size
    table.drop(np.ones(8, np.bool_))
    assert not table.owned.any()
    assert table.nodes == 0
    table.replace([])
    assert not table.blocks
    assert (table.owner == NO_BLOCK).all()


def test_an_emptied_table_goes_on_with_newer_versions():
    rng = np.random.default_rng(2)
    table = NodeTable(4)
    table.replace([block_of(rng, range(4))])
    newest = table.newest
    other = table.resized(6)
    assert len(other) == 6
    assert not other.owned.any()
    other.replace([block_of(rng, [5])])
    assert other.version[5] > newest
    assert other.irradiance.shape == (6, 3)


def test_nothing_is_added_for_vertices_without_nodes_or_wish(shapes, workers):
    rng = np.random.default_rng(3)
    mesh, table = points_of(rng, 5), NodeTable(5)
    table.replace([block_of(rng, range(4))])
    out = np.ones((5, TERMS, 3), np.float32)
    assert not table.shade(mesh, shapes[0], EYE, np.zeros(5, np.bool_), out, workers, Job("test"))
    assert (out == 1).all()
    table.shade(mesh, shapes[0], EYE, np.ones(5, np.bool_), out, workers, Job("test"))
    assert (out[4] == 1).all()
    assert np.isfinite(out).all()


def test_bytes_are_counted_with_what_splitting_needs():
    block = block_of(np.random.default_rng(5), range(3))
    more = Detail(np.zeros(4, np.float32), np.zeros(4, np.int32))
    whole = NodeBlock(block.points, block.first, block.data, more)
    assert whole.nbytes - block.nbytes == more.nbytes == 16 + 16
    assert block.most == np.diff(block.first).max()
