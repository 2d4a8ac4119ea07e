"""The kernels' tests once more with checked array bounds: outside of an array is a crash, or worse, is not.

`NUMBA_BOUNDSCHECK=1` makes numba check every index (a warm cache ignores the flag, so its kernels have a
folder of their own). It must be set before numba is imported: a child process.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parents[1]

CHECKS = """
import numpy as np
from studio_core.jit import kernel

@kernel
def outside(values: np.ndarray, index: int) -> float:
    return values[index]

try:
    outside(np.zeros(3, np.float32), 3)
except IndexError:
    print("checked")
"""


def child(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    paths = os.pathsep.join(str(TESTS.parent / folder) for folder in (".", "ui", "plugins"))
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=TESTS.parent,
        env={**os.environ, "PYTHONPATH": paths, "NUMBA_BOUNDSCHECK": "1", **environment},
        capture_output=True,
        text=True,
        check=False,
        timeout=900,
    )


def test_the_flag_is_heard_in_spite_of_a_warm_cache(tmp_path: Path) -> None:
    (tmp_path / "probe.py").write_text(CHECKS)
    for flag, said in (("0", ""), ("1", "checked"), ("1", "checked"), ("0", "")):
        cache = {"LUCARNE_CACHE": str(tmp_path / "cache")}
        done = child(str(tmp_path / "probe.py"), NUMBA_BOUNDSCHECK=flag, **cache)
        assert (done.returncode, done.stdout.strip()) == (0, said), done.stderr


@pytest.mark.slow
def test_no_kernel_leaves_its_arrays() -> None:
    files = ["studio_core/kernels", "studio_core/shading/test_brute_force.py", "studio_core/test_raster.py"]
    options = ["-q", "-W", "error", "-p", "no:cacheprovider"]
    done = child("-m", "pytest", *options, *(str(TESTS / file) for file in files))
    assert done.returncode == 0, done.stdout[-3000:]
    assert " passed" in done.stdout
