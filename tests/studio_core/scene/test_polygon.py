from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from studio_core.scene.polygon import area, clearance, triangulate


@st.composite
def rings(draw: st.DrawFn) -> np.ndarray:
    """Counter-clockwise, simple, with corners also on straight sides."""
    count = draw(st.integers(3, 9))
    turns = [2 * math.pi * (k + draw(st.floats(-0.4, 0.4))) / count for k in range(count)]
    far = [draw(st.floats(1, 6)) for _ in range(count)]
    corners = np.array([(r * math.cos(a), r * math.sin(a)) for r, a in zip(far, turns, strict=True)])
    more = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        shares = sorted(draw(st.lists(st.sampled_from((0.1, 0.25, 0.5, 0.75)), max_size=3, unique=True)))
        more += [a, *(a + share * (b - a) for share in shares)]
    return np.array(more)


@given(rings())
def test_triangles_fill_a_polygon_with_every_corner_and_no_other_edge(ring: np.ndarray) -> None:
    made = np.array(triangulate(ring))
    assert len(made) == len(ring) - 2
    corners = ring[made]
    sizes = np.array([area(corner) for corner in corners])
    assert (sizes > 0).all()
    assert sizes.sum() == pytest.approx(area(ring))
    edges = {(int(t[k]), int(t[(k + 1) % 3])) for t in made for k in range(3)}
    border = {(k, (k + 1) % len(ring)) for k in range(len(ring))}
    assert {edge for edge in edges if edge[::-1] not in edges} == border


def test_a_square_s_worse_diagonal_is_not_taken() -> None:
    kite = [(0, -1), (5, 0), (0, 1), (-5, 0)]
    assert {frozenset(t) for t in triangulate(kite)} == {frozenset((0, 1, 2)), frozenset((0, 2, 3))}


@pytest.mark.parametrize("ring", [[(0, 0), (1, 0)], [(0, 0), (1, 0), (2, 0)], [(0, 0), (0, 1), (1, 1)]])
def test_what_encloses_nothing_is_refused(ring: list[tuple[float, float]]) -> None:
    with pytest.raises(ValueError, match="polygon"):
        triangulate(ring)


def test_a_bow_tie_is_refused() -> None:
    with pytest.raises(ValueError, match="polygon must"):
        triangulate([(0, 0), (2, 2), (2, 0), (0, 2)])


def test_clearance_is_the_least_distance_between_sides_that_do_not_meet() -> None:
    assert clearance([(0, 0), (3, 0), (3, 2), (0, 2)]) == pytest.approx(2)
    assert clearance([(0, 0), (2, 2), (2, 0), (0, 2)]) == 0
    assert clearance([(0, 0), (1, 0), (0, 1)]) == math.inf
    u = [(0, 0), (3, 0), (3, 3), (1.7, 3), (1.7, 1), (1.3, 1), (1.3, 3), (0, 3)]
    assert clearance(u) == pytest.approx(0.4)
