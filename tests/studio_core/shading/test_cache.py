"""Arrays on disk: what is kept comes back, what is damaged is a miss, and it stays bounded."""

from __future__ import annotations

import os

import numpy as np
import pytest

from studio_core.shading.cache import DiskCache


def test_what_is_kept_comes_back_bit_for_bit(tmp_path):
    cache = DiskCache(tmp_path / "new" / "folder")
    arrays = {"a": np.arange(6, dtype=np.float32).reshape(2, 3), "b": np.array([1, 2], np.uint16)}
    assert cache.get("m", "key", 1.5) is None
    cache.put(arrays, "m", "key", 1.5)
    found = cache.get("m", "key", 1.5)
    assert found is not None
    for name, array in arrays.items():
        np.testing.assert_array_equal(found[name], array)
        assert found[name].dtype == array.dtype


def test_other_inputs_and_other_methods_are_other_entries(tmp_path):
    cache = DiskCache(tmp_path)
    cache.put({"a": np.zeros(1)}, "m", "x", 1)
    assert cache.get("m", "x", 2) is None
    assert cache.get("n", "x", 1) is None
    assert cache.get("m", "x1") is None


@pytest.mark.parametrize("damage", [b"", b"garbage", None])
def test_damage_is_a_miss_and_can_be_replaced(tmp_path, damage):
    cache = DiskCache(tmp_path)
    cache.put({"a": np.arange(1000.0)}, "m")
    (entry,) = tmp_path.glob("*.npz")
    content = entry.read_bytes()
    entry.write_bytes(content[: len(content) // 2] if damage is None else damage)
    assert cache.get("m") is None
    cache.put({"a": np.arange(3.0)}, "m")
    np.testing.assert_array_equal(cache.get("m")["a"], np.arange(3.0))


def test_no_wrong_byte_is_worse_than_a_miss(tmp_path):
    cache = DiskCache(tmp_path)
    array = np.arange(4, dtype=np.float32)
    cache.put({"a": array}, "m")
    (entry,) = tmp_path.glob("*.npz")
    content = entry.read_bytes()
    for place in range(len(content)):
        for wrong in (0, 9, 255, content[place] ^ 1):
            entry.write_bytes(content[:place] + bytes([wrong]) + content[place + 1 :])
            found = cache.get("m")
            assert found is None or not found or np.array_equal(found["a"], array)


def test_what_a_crash_left_half_written_goes_with_time(tmp_path):
    cache = DiskCache(tmp_path)
    old, new = tmp_path / "x.0.part", tmp_path / "y.0.part"
    for part in (old, new):
        part.write_bytes(b"half")
    os.utime(old, (1e9, 1e9))
    cache.put({"a": np.zeros(1)}, "m")
    assert not old.exists()
    assert new.exists()


def test_pickles_are_not_read(tmp_path):
    cache = DiskCache(tmp_path)
    cache.put({"a": np.zeros(1)}, "m")
    (entry,) = tmp_path.glob("*.npz")
    np.savez(entry, a=np.array([object()], dtype=object))
    assert cache.get("m") is None


def test_the_least_recently_used_goes_first(tmp_path):
    cache = DiskCache(tmp_path, limit=30_000)
    for number in range(3):
        cache.put({"a": np.full(1000, float(number))}, "m", number)
    for age, number in enumerate((0, 2, 1)):  # 1 is the oldest
        os.utime(cache._path("m", (number,)), (1e9 - age, 1e9 - age))
    assert cache.get("m", 0) is not None
    cache.put({"a": np.zeros(1000)}, "m", 3)
    assert cache.get("m", 1) is None
    assert cache.get("m", 0) is not None
    assert sum(p.stat().st_size for p in tmp_path.iterdir()) <= 30_000


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path):
    (tmp_path / "file").write_text("in the way")
    cache = DiskCache(tmp_path / "file")
    cache.put({"a": np.zeros(1)}, "m")
    assert cache.get("m") is None
