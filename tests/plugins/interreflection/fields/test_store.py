"""Fields are kept by content: shared, found on disk, and coarser where memory is short."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from field_support import JOB, body, services
from scenes import cube, floor

from studio_core.contract import Services
from studio_core.errors import Cancelled
from studio_core.shading.cache import DiskCache
from studio_core.shading.job import Job
from studio_plugins.interreflection.fields.store import FieldStore, Settings, fitted

FEW = Settings(shells=4, cells=6, components=4, lights=16, rays=16, bands=3)


def test_equal_bodies_share_their_fields(workers):
    store = FieldStore(services(workers))
    one, same, other = body(cube(), 0.5), body(cube(), 0.5), body(cube(), 0.5, lobes=2)
    fields = store.fields([one, same, other], [FEW] * 3, None, JOB)
    assert store.made == 2
    assert fields[0] is fields[1]
    assert fields[2].values.shape == (3 * len(fields[2].basis), len(fields[2].lattice), 9)
    again = store.fields([one], [FEW], None, JOB)
    assert again[0] is fields[0]
    assert store.made == 2
    store.fields([other], [FEW], None, JOB)
    assert store.made == 3  # it was forgotten


def test_a_disk_keeps_them(workers, tmp_path):
    keeping = Services(workers, None, DiskCache(tmp_path))
    own = body(floor(), 0.5, lobes=1)
    made = FieldStore(keeping).fields([own], [FEW], None, JOB)[0]
    second = FieldStore(keeping)
    found = second.fields([own], [FEW], None, JOB)[0]
    assert second.made == 0
    np.testing.assert_array_equal(found.values, made.values)
    np.testing.assert_array_equal(found.basis.functions, made.basis.functions)
    light = np.random.default_rng(0).normal(size=(len(own.mesh), 2, 3))
    np.testing.assert_allclose(found.basis.weights(light), made.basis.weights(light))
    for changed in (dataclasses.replace(FEW, rays=17), dataclasses.replace(FEW, components=3)):
        third = FieldStore(keeping)
        third.fields([own], [changed], None, JOB)
        assert third.made == 1


def test_cancelled_work_keeps_what_is_done(workers):
    bodies = [body(cube(), 0.5), body(floor(), 0.5)]

    class Stopping(Job):
        def checkpoint(self, done=0, total=0):
            if store.made == 1:
                self.cancel()
            super().checkpoint(done, total)

    store = FieldStore(services(workers))
    with pytest.raises(Cancelled):
        store.fields(bodies, [FEW] * 2, None, Stopping("test"))
    store.fields(bodies, [FEW] * 2, None, JOB)
    assert store.made == 2


def test_small_objects_get_coarser_fields_first():
    bodies = [body(cube(), 0.5), body(floor(), 0.5), body(cube(), 0.25)]
    whole = Settings()
    each = whole.bytes_of(bodies[0])
    assert fitted(bodies, [6, 16, 6], whole, 3 * each) == [whole] * 3
    tight = fitted(bodies, [6.0, 16.0, 3.0], whole, 2 * each + each // 4)
    assert [s.shells for s in tight] == [16, 16, 8]
    tighter = fitted(bodies, [6.0, 16.0, 3.0], whole, 1)
    assert [(s.shells, s.cells) for s in tighter] == [(4, 6)] * 3
    assert fitted([bodies[0], bodies[0]], [1.0, 2.0], whole, each) == [whole] * 2
