from __future__ import annotations

import dataclasses
import importlib
from typing import Any

import numpy as np
import pytest

from studio_core.brdfs import chi_square as module
from studio_core.brdfs.chi_square import chi_square, pearson, tail
from studio_core.brdfs.promises import seen_from
from studio_core.params import defaults


def model_of(name: str) -> Any:
    return importlib.import_module(f"studio_plugins.brdfs.{name}").MODEL


def test_p_is_uniform_where_all_is_right() -> None:
    model = model_of("ggx")
    shape = model.shape({**defaults(model.Params), "roughness": 0.3})
    p = np.sort([chi_square(model, shape, seen_from(0.6), 1, 6000, seed).p for seed in range(24)])
    # Kolmogorov–Smirnov: 1.95 / √24 is passed once in a thousand
    assert np.abs(p - (np.arange(24) + 0.5) / 24).max() < 1.95 / np.sqrt(24)


@dataclasses.dataclass
class Wrong:
    """A model whose density is not that of its draws."""

    draws: Any
    says: Any
    terms: int

    @property
    def sampler(self) -> int:
        return int(self.draws.sampler)

    @property
    def density(self) -> int:
        return int(self.says.density)


@pytest.mark.parametrize("degrees", [0.0, 60.0, 89.0])
def test_a_wrong_density_is_found(degrees: float, monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of("ggx")
    wo = seen_from(np.radians(degrees))
    plain = module.density
    for roughness in (0.02, 0.3):
        shape = model.shape({**defaults(model.Params), "roughness": roughness})
        assert chi_square(model, shape, wo, 2, 40_000, 3).p > 1e-3
        with monkeypatch.context() as patched:
            patched.setattr(module, "density", lambda b, s, o, i: plain(b, np.float32(s * 1.06), o, i))
            assert chi_square(model, shape, wo, 2, 40_000, 3).p < 1e-6


def test_a_density_of_another_lobe_is_found() -> None:
    phong, blinn = model_of("phong"), model_of("blinn_phong")
    shape = phong.shape({"exponent": 80.0})
    assert chi_square(Wrong(phong, blinn, 2), shape, seen_from(0.8), 1, 20_000).p < 1e-12  # type: ignore[arg-type]


def test_losing_more_than_said_is_found() -> None:
    seen, expected = np.array([500.0, 480.0, 20.0]), np.array([500.0, 500.0, 0.5])
    statistic, freedom = pearson(seen, expected)
    assert freedom == 1
    assert statistic == pytest.approx(((520 - 500.5) ** 2 / 500.5 + 400 / 500) * 1, rel=0.5)


def test_small_boxes_are_pooled() -> None:
    expected = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 100.0])
    statistic, freedom = pearson(expected, expected)
    assert statistic == 0
    assert freedom == 1
    statistic, _ = pearson(np.array([1.0, 2, 3, 4, 25, 80]), expected)
    assert statistic == pytest.approx(20**2 / 15 + 20**2 / 100)


@pytest.mark.parametrize(
    ("statistic", "freedom", "p"), [(3.841, 1, 0.05), (18.307, 10, 0.05), (23.209, 10, 0.01)]
)
def test_tail_is_the_tables(statistic: float, freedom: int, p: float) -> None:
    assert tail(statistic, freedom) == pytest.approx(p, rel=1e-3)
