"""Kernels: compiled once, found on disk again, never found there when stale or damaged."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numba
import numpy as np
import pytest

from studio_core import jit_cache
from studio_core.jit import address_of, batch_function, call_address, kernel, pointer

pytestmark = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="kernels are not compiled")

USER = """
import numba
from lucarne_trial.helper import HALF, twice
from studio_core.jit import batch_function, call_address, kernel

@kernel
def four_times(x):
    return HALF * twice(twice(twice(x)))

@batch_function("void(CPointer(float32), int64, float32)")
def scale(values, count, factor):
    array = numba.carray(values, count)
    for i in range(count):
        array[i] *= factor

@kernel
def scale_rows(address, rows, factor):
    for i in range(rows.shape[0]):
        call_address(address, rows[i], rows.shape[1], factor)
"""
HELPER = """
from studio_core.jit import kernel
HALF = 0.5

@kernel
def twice(x):
    return 2.0 * x
"""

Load = Callable[[], ModuleType]


def _forget() -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "lucarne_trial"]:
        del sys.modules[name]


@pytest.fixture
def package(tmp_path: Path) -> Path:
    folder = tmp_path / "lucarne_trial"
    folder.mkdir()
    (folder / "__init__.py").write_text("")
    (folder / "user.py").write_text(USER)
    (folder / "helper.py").write_text(HELPER)
    return folder


@pytest.fixture
def load(package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Load]:
    """Imports the trial package afresh, as a new process would."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "kernels"))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)

    def fresh() -> ModuleType:
        _forget()
        importlib.invalidate_caches()
        return importlib.import_module("lucarne_trial.user")

    yield fresh
    _forget()


def _hits(module: ModuleType) -> int:
    return sum(module.four_times.stats.cache_hits.values())


def test_a_kernel_is_found_on_disk(load: Load) -> None:
    assert load().four_times(3.0) == 12.0
    again = load()
    assert again.four_times(3.0) == 12.0
    assert _hits(again) == 1


def test_an_edited_helper_or_constant_is_noticed(load: Load, package: Path) -> None:
    load().four_times(3.0)
    (package / "helper.py").write_text(HELPER.replace("2.0 * x", "3.0 * x"))
    assert load().four_times(2.0) == 27.0
    (package / "helper.py").write_text(HELPER.replace("HALF = 0.5", "HALF = 1.5"))
    edited = load()
    assert edited.four_times(2.0) == 24.0
    assert _hits(edited) == 0
    (package / "helper.py").write_text(HELPER)
    restored = load()
    assert restored.four_times(3.0) == 12.0
    assert _hits(restored) == 1


@pytest.mark.parametrize("damage", ["empty", "short", "flipped", "not numba's"])
def test_a_damaged_file_is_compiled_again(
    load: Load, tmp_path: Path, damage: str, caplog: pytest.LogCaptureFixture
) -> None:
    load().four_times(3.0)
    files = list((tmp_path / "kernels").rglob("user.four_times*.nbc"))
    assert len(files) == 1
    content = files[0].read_bytes()
    if damage == "empty":
        files[0].write_bytes(b"")
    elif damage == "short":
        files[0].write_bytes(content[: len(content) // 2])
    elif damage == "flipped":
        files[0].write_bytes(content[:100] + bytes([content[100] ^ 8]) + content[101:])
    else:
        import hashlib

        files[0].write_bytes(b"\x80\x05junk" + hashlib.sha256(b"\x80\x05junk").digest())
    repaired = load()
    assert repaired.four_times(3.0) == 12.0
    assert _hits(repaired) == 0
    assert "kernel" in caplog.text
    once_more = load()
    once_more.four_times(3.0)
    assert _hits(once_more) == 1


def test_a_full_disk_costs_only_the_file(load: Load, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(jit_cache._KernelFile, "save", refuse)
    assert load().four_times(3.0) == 12.0


def test_c_functions_are_called_by_address_and_kept(load: Load, tmp_path: Path) -> None:
    for _ in range(2):
        module = load()
        rows = np.arange(6, dtype=np.float32).reshape(2, 3)
        module.scale_rows(module.scale.address, rows, np.float32(2.0))
        np.testing.assert_array_equal(rows, 2.0 * np.arange(6).reshape(2, 3))
    assert sum(module.scale_rows.stats.cache_hits.values()) == 1
    assert len(list((tmp_path / "kernels").rglob("user.scale-*.nbc"))) == 1


def test_old_environments_are_deleted(tmp_path: Path) -> None:
    import os

    for age in range(6):
        folder = tmp_path / f"old{age}"
        folder.mkdir()
        os.utime(folder, (1e9 - age, 1e9 - age))
    opened = jit_cache.open_cache(tmp_path)
    assert opened is not None
    assert {path.name for path in tmp_path.iterdir()} == {opened.name, "old0", "old1"}


def test_the_environment_decides_the_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    before = jit_cache.environment_hash()
    assert jit_cache.environment_hash() == before
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1" if not numba.config.BOUNDSCHECK else "0")
    assert jit_cache.environment_hash() != before


def test_a_folder_that_cannot_be_made_means_no_cache(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert jit_cache.open_cache(blocked) is None


@kernel
def _peek(address: int, count: int) -> float:
    array = numba.carray(pointer(address), count, np.float32)
    return float(array.sum())


@kernel
def _peek_own(values: np.ndarray) -> float:
    return _peek(address_of(values), values.size)


@kernel
def _is_finite(x: float) -> bool:
    return bool(np.isfinite(x))


@kernel
def _divide(a: float, b: float) -> float:
    return a / b


def test_addresses_lead_to_arrays() -> None:
    values = np.arange(10, dtype=np.float32)
    assert _peek(values.ctypes.data, 10) == 45.0
    assert _peek_own(values) == 45.0


def test_fast_arithmetic_still_sees_infinities() -> None:
    assert _is_finite(1.0)
    assert not _is_finite(np.inf)
    assert not _is_finite(np.nan)
    assert _divide(1.0, 0.0) == np.inf


@batch_function("void(CPointer(float64), float32, int32)")
def _store(out, factor, count):  # type: ignore[no-untyped-def]
    out[0] = factor * count


@kernel
def _call(address: int, out: np.ndarray, factor: float, count: int) -> None:
    call_address(address, out, factor, count)


def test_arguments_arrive_in_order_and_type() -> None:
    out = np.zeros(1)
    _call(_store.address, out, np.float32(2.5), 3)
    assert out[0] == 7.5
    assert _store.address == _store.address
    out[0] = 0.0
    _store(out, 2.0, 4)
    assert out[0] == 8.0
