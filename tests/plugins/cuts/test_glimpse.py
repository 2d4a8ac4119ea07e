"""Glimpses: as fine as light asks for, and right wherever they look leaf by leaf."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from oracles import cuts as oracle

from studio_core.kernels.directions import direction_set
from studio_core.kernels.light_tree import LightTree
from studio_plugins.cuts.beams import BLOCKS
from studio_plugins.cuts.glimpse import BEFORE, NOW, Glow, ones
from studio_plugins.cuts.store import VisibilityStore
from studio_plugins.cuts.tracer import RAYS

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
K = 12
FINENESSES = (2, 4, 6, 8, 40)


def light(k, seed=0, contrast=0.1):
    return np.random.default_rng(seed).gamma(contrast, 1, (1 << k, 3)).astype(np.float32)


@given(st.integers(0, (1 << 64) - 1))
def test_set_bits_are_counted(word):
    assert ones(np.uint64(word)) == word.bit_count()


@pytest.mark.parametrize("held", [10, 12, 13])
def test_glow_is_the_light_of_blocks(held):
    leaves = light(held)
    luminous = leaves.astype(np.float64) @ LUMINANCE * 4 * np.pi / (1 << held)
    glow = Glow.of(LightTree.build(leaves), K)
    own = np.repeat(luminous, max(1 << (K - held), 1)) / max(1 << (K - held), 1) if held < K else luminous
    expected = np.concatenate([own.reshape((1 << K) // block, -1).sum(axis=1) for block in BLOCKS])
    np.testing.assert_allclose(glow.power, expected, rtol=1e-5, atol=1e-7)
    of_parts = [own.reshape((1 << K) // block, 8, -1).sum(axis=2).max(axis=1) for block in BLOCKS[:-1]]
    assert glow.peak[-((1 << K) // 8) :].max() == 0
    np.testing.assert_allclose(glow.peak[: -((1 << K) // 8)], np.concatenate(of_parts), rtol=1e-5, atol=1e-7)
    assert glow.k == K


def test_even_light_is_a_sphere_of_it():
    power = Glow.even(K).power
    assert power[: (1 << K) // BLOCKS[0]].sum() == pytest.approx(4 * np.pi)
    assert len(power) == sum(max((1 << K) // block, 1) for block in BLOCKS)


@pytest.fixture
def looked(kit, workers, job):
    """Irradiance (V, 3) by finenesses under a spotty light, exact last, and rays that it took."""
    room, leaves = kit.room, light(K)
    directions = direction_set(K)
    found, rays = [], []
    for fineness in (*FINENESSES, None):
        store = VisibilityStore(K, workers)
        store.follow(room.surfaces, room.occluders)
        if fineness is None:
            store.trace(room.everything, job)
        else:
            store.preview(room.everything, fineness, job, Glow.of(LightTree.build(leaves), K))
        rays.append(int(store.counts[RAYS]))
        seen = kit.seen_by(store)
        found.append(
            [
                oracle.irradiance(free, normal, leaves, directions)
                for free, normal in zip(seen, room.mesh.normals, strict=True)
            ]
        )
    return np.array(found), rays


def test_finer_glimpses_take_more_rays_and_err_less(looked):
    found, rays = looked
    error = np.sqrt(((found - found[-1]) ** 2).mean(axis=(1, 2))) / found[-1].mean()
    assert error[0] > error[2] > error[3]
    assert error[3] < 0.02
    assert error[-2] == 0
    assert rays[0] < rays[1] < rays[2] < rays[3] < rays[-2] < rays[-1]


def test_bright_leaves_are_looked_at_more_closely(kit, workers, job):
    """With fewer rays, light that comes from a few leaves is seen more truly by who knows which."""
    room = kit.room
    leaves = np.full((1 << K, 3), 1e-3, np.float32)
    leaves[:: 1 << 7] = 50.0
    errors, rays = [], []
    exact = VisibilityStore(K, workers)
    exact.follow(room.surfaces, room.occluders)
    exact.trace(room.everything, job)
    truth = kit.seen_by(exact)
    for glow, fineness in ((Glow.of(LightTree.build(leaves), K), 6), (None, 8)):
        store = VisibilityStore(K, workers)
        store.follow(room.surfaces, room.occluders)
        store.preview(room.everything, fineness, job, glow)
        wrong = kit.seen_by(store) != truth
        errors.append((wrong @ leaves[:, 0].astype(np.float64)).mean())
        rays.append(int(store.counts[RAYS]))
    assert rays[0] < rays[1]
    assert errors[0] < 0.5 * errors[1]


@pytest.mark.parametrize("fineness", [3, 40])
def test_a_glimpse_tells_what_was_hidden_before_but_not_by_others(kit, workers, job, fineness):
    store = VisibilityStore(K, workers)
    store.follow(kit.room.surfaces, kit.room.occluders)
    store.trace(kit.room.everything, job)
    still = kit.seen_by(store)
    box = kit.room.things["box"].transform
    moved = kit.room.placed(box=type(box)((0.15, 0.0, 0.1)) @ box)
    store.follow(moved.surfaces, moved.occluders)
    store.preview(moved.everything, fineness, job)
    sources = store.sources()
    others = kit.seen_by(store)
    looked_at = 0
    for p in np.flatnonzero(sources.row > 0):
        first = sources.coarse_start[p]
        record = sources.coarse_pool[first : first + sources.coarse_length[p]].tolist()
        if not record or moved.mesh.object[p] == 1:
            continue
        now, before = (~oracle.seen(record, 1 << K, [skipped]) for skipped in (BEFORE, NOW))
        rest = others[p] | now  # what is free of all that stands still
        np.testing.assert_array_equal(still[p], rest & ~before)
        assert not (before & ~rest).any()
        looked_at += 1
    assert looked_at > 10
