from __future__ import annotations

import importlib
from typing import Any

import numpy as np
import pytest

from studio_core.brdfs import calls
from studio_core.brdfs.promises import furnace, hard_directions, reciprocity, seen_from, weight_bound
from studio_core.brdfs.ranges import colour_corners, shaped, shapes, shaping
from studio_core.params import defaults


def model_of(name: str) -> Any:
    return importlib.import_module(f"studio_plugins.brdfs.{name}").MODEL


def test_shaping_parts_the_parameters() -> None:
    assert shaping(model_of("ggx")) == (
        ["roughness", "keep_energy"],
        ["base_color", "metallic", "specular"],
    )
    assert shaping(model_of("lambert")) == ([], ["base_color"])
    assert len(list(colour_corners(model_of("ggx")))) == 8
    assert shaped(model_of("ggx"), 0.25)["roughness"] == 0.25
    assert len(list(shapes(model_of("ggx"), (0.0, 0.5), mixed=3))) == 2
    assert len(list(shapes(model_of("lambert"), (0.0, 0.5)))) == 1


def test_furnace_of_white_paint_is_one() -> None:
    low, high = furnace(model_of("lambert"), [{"base_color": (0.5, 0.5, 0.5)}] * 2, np.radians([0, 60, 89]))
    np.testing.assert_allclose(high, np.ones((2, 3)), rtol=1e-3)
    np.testing.assert_allclose(low, 0, atol=1e-9)


def test_furnace_finds_the_whitest_corner() -> None:
    model = model_of("ggx")
    rough = [{**defaults(model.Params), "roughness": 1.0}]
    low, high = furnace(model, rough, [0.0], 0.3)
    assert 0.9 < high[0, 0] <= 1.001
    assert 0 <= low[0, 0] < 0.1


def test_a_model_that_is_not_reciprocal_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of("ggx")
    shape = model.shape({**defaults(model.Params), "roughness": 0.4})
    w = hard_directions(40)
    assert reciprocity(model, shape, w) < 1e-4
    plain = calls.evaluate
    monkeypatch.setattr(
        "studio_core.brdfs.promises.evaluate", lambda b, s, o, i: plain(b, s, o, i) * (1 + 0.01 * o[2])
    )
    assert reciprocity(model, shape, w) > 1e-3


def test_what_is_never_drawn_has_no_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    model = model_of("phong")
    shape = model.shape({"exponent": 30.0})
    u, others = np.random.default_rng(0).random((200, 2), np.float32), hard_directions(100)
    assert weight_bound(model, shape, seen_from(0.5), 1, u, others) < 1.2
    plain = calls.density
    monkeypatch.setattr(
        "studio_core.brdfs.promises.density",
        lambda b, s, o, i: np.where(i[:, :1] > 0.5, plain(b, s, o, i), 0),
    )
    assert weight_bound(model, shape, seen_from(0.5), 1, u, others) == np.inf
