"""Captured materials under environment light: the sum that backends make against that of f_r + δ* itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from captured_fits import made_up
from scenes import sky

from studio.bench.materials_scene import fusion
from studio_core.contract import Services
from studio_core.scene.geometry import Image


def window() -> Image:
    """A sky with one bright window."""
    pixels = np.array(sky(64).pixels)
    pixels[10:16, 18:24] *= 40
    return Image(pixels)


@pytest.mark.parametrize("basis", ["half", "albedo-light"])
@pytest.mark.parametrize(("backend", "most"), [("reference", 1e-4), ("cuts", 5e-3)])
def test_light_sums_hold_the_whole_residual(
    backend: str, most: float, basis: str, host: Any, workers: Any
) -> None:
    found = fusion(Services(workers, host), made_up("blinn", basis), window(), backend, places=60)
    assert found < most
