"""The reflectance model of captured materials, with every kind of capture."""

from __future__ import annotations

from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio_core.brdfs.bound import bound
from studio_core.brdfs.calls import evaluate, sample
from studio_core.brdfs.chi_square import chi_square
from studio_core.brdfs.promises import hard_directions, seen_from
from studio_core.errors import InputError
from studio_core.params import defaults
from studio_core.scene.geometry import Table
from studio_plugins.residual.model import (
    BLINN,
    GGX,
    HALF_VECTOR,
    LIGHT,
    MODEL,
    NODES,
    PHONG,
    RESIDUAL,
    SLOT,
    Capture,
)  # fmt: skip
from studio_plugins.residual.shading import GRAZING

NODE_VALUES = np.random.default_rng(2).uniform(-0.2, 0.3, NODES).astype(np.float32)
CAPTURES = {
    "matte": Capture(1, 0.7),
    "tabled": Capture(1, 0.2, nodes=NODE_VALUES),
    "blinn": Capture(2, 0.3, BLINN, (900.0, 12.0), (0.7, 0.3)),
    "phong": Capture(2, 0.0, PHONG, (3e4, 1.0), (1.0, 0.0)),
    "ggx": Capture(5, 0.0, GGX, (2e-3, 0.4), (0.5, 0.5)),
    "light": Capture(5, 0.3, BLINN, (60.0, 1.0), (1.0, 0.0), LIGHT, NODE_VALUES),
}
every_capture = pytest.mark.parametrize("capture", CAPTURES.values(), ids=CAPTURES.keys())


def of(capture: Capture) -> Any:
    return bound(cast(Any, MODEL), {SLOT: capture.table()})


def shape_of(model: Any, **values: float) -> Any:
    return model.shape({**defaults(MODEL.Params), **values})


@every_capture
def test_what_is_parametric_is_reciprocal(capture: Capture) -> None:
    if capture.nodes is not None:
        capture = Capture(**{**vars(capture), "nodes": None})
    model, w = of(capture), hard_directions(60)
    shape = shape_of(model)
    there = np.stack([evaluate(model, shape, o, w) for o in w])[..., :2]
    np.testing.assert_allclose(there, there.transpose(1, 0, 2), rtol=2e-4, atol=1e-6 * float(there.max()))


component = st.one_of(st.sampled_from([0.0, 1e-45, 1e-30, 1e-7, 1.0]), st.floats(-1, 1, width=32))
vectors = st.tuples(component, component, component)


@every_capture
@settings(max_examples=80, deadline=None)
@given(
    wo=st.tuples(component, component, component),
    wi=st.lists(st.tuples(component, component, component), min_size=1, max_size=5),
)
def test_it_is_finite_everywhere_and_dark_from_below(capture: Capture, wo: Any, wi: Any) -> None:
    def unit(w: Any) -> Any:
        length = float(np.linalg.norm(w))
        return (
            np.array(w, np.float32) / np.float32(length) if length > 1e-3 else np.array([0, 0, 1], np.float32)
        )

    model, seen, lit = of(capture), unit(wo), np.array([unit(w) for w in wi])
    made = evaluate(model, shape_of(model), seen, lit)
    assert np.isfinite(made).all()
    assert not made[lit[:, 2] <= 0].any()
    assert (made[:, :2] >= 0).all()
    assert np.abs(made[:, 2:] * lit[:, 2:]).max(initial=0) <= 1 / np.pi + 1e-6


@pytest.mark.parametrize("columns", [HALF_VECTOR, LIGHT])
def test_the_residual_is_light_without_a_cosine(columns: int) -> None:
    """Over π n·l it is H's or L's parts along the pattern, but for the last degrees."""
    model, turn = of(Capture(5, columns=columns)), 35.0
    rng = np.random.default_rng(4)
    o = seen_from(np.radians(40.0), 0.3)
    wi = rng.normal(size=(200, 3))
    wi[:, 2] = np.abs(wi[:, 2])
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    made = evaluate(model, shape_of(model, direction=turn), o, wi)[:, 2:] * np.pi * wi[:, 2:]
    way = wi if columns == LIGHT else wi + o
    way = way / np.linalg.norm(way, axis=1, keepdims=True)
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    along = np.stack([c * way[:, 0] + s * way[:, 1], c * way[:, 1] - s * way[:, 0], way[:, 2]], axis=1)
    fade = np.minimum(wi[:, 2:] / GRAZING, 1)
    np.testing.assert_allclose(made, along * fade, atol=2e-6)


@every_capture
def test_draws_are_as_dense_as_said(capture: Capture) -> None:
    model = of(capture)
    shape = shape_of(model)
    for term in (0, min(1, model.terms - 1), model.terms - 1):
        for degrees in (10.0, 65.0):
            assert chi_square(model, shape, seen_from(np.radians(degrees)), term, 20_000, 7).p > 1e-4


def test_draws_stay_above_the_surface_that_is_seen() -> None:
    model = of(CAPTURES["ggx"])
    u = np.random.default_rng(1).random((50, 2)).astype(np.float32)
    for term in range(model.terms):
        assert (sample(model, shape_of(model), np.array([0.6, 0, -0.8]), term, u)[:, 2] <= 0).all()


def test_colours_are_those_of_the_maps_and_character_is_the_residuals() -> None:
    values = {"albedo": np.array([0.5, 0.4, 0.3]), "shine": np.full(3, 0.1), "character": np.array(2.0)}
    assert MODEL.coefficients(values).shape == (2, 3)
    maps = {axis: np.array([0.1, -0.2, k]) for k, axis in enumerate(RESIDUAL)}
    made = MODEL.coefficients({**values, **maps})
    np.testing.assert_allclose(made[2:], [[0.2, -0.4, 0], [0.2, -0.4, 2], [0.2, -0.4, 4]], rtol=1e-6)
    np.testing.assert_allclose(made[0], [0.5, 0.4, 0.3])
    bright = MODEL.coefficients({**values, "albedo": np.array([1.5, 0.4, 0.3])})
    assert bright[:2].sum(axis=0).max() <= 1 + 1e-6


@pytest.mark.parametrize(
    "table",
    [
        Table(np.zeros((1, 1, 1, 4), np.float32)),
        Capture(3).table(),
        Capture(2, 0.0, 7).table(),
        Capture(2, 0.0, BLINN, (1e9, 1.0), (1.0, 0.0)).table(),
        Capture(2, -1.0).table(),
        Capture(5, columns=4).table(),
    ],
)
def test_a_table_that_is_no_capture_is_refused(table: Table) -> None:
    with pytest.raises(InputError):
        bound(cast(Any, MODEL), {SLOT: table}).shape(defaults(MODEL.Params))
