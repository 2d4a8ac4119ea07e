"""Strokes as values: marks there and back, saved, and without effect on light."""

from __future__ import annotations

import numpy as np
import pytest

from studio_core.project.codec import TAGS
from studio_core.scene.diff import Aspect, diff
from studio_core.scene.geometry import Table
from studio_core.scene.nodes import Scene
from studio_core.strokes.marks import WIDTH, Marks
from studio_core.strokes.stroke import Stroke


def marks(count: int = 5) -> Marks:
    rng = np.random.default_rng(3)
    three = [rng.normal(size=(count, 3)).astype(np.float32) for _ in range(5)]
    offset = np.full((count, 3), np.nan, np.float32)
    offset[0] = 0.25
    place, normal, eye, shown, wanted = three
    whole = np.arange(count) % 2
    return Marks(whole, place, normal, whole + 3, eye, shown, wanted, np.ones(count, np.float32), offset)


def test_marks_come_back_from_their_table() -> None:
    before = marks()
    table = before.table()
    assert table.values.shape == (1, 1, 5, WIDTH)
    assert np.isfinite(table.values).all(), "project files hold finite numbers"
    after = Marks.of_table(table)
    assert after.object.tolist() == [0, 1, 0, 1, 0]
    assert after.slot.tolist() == [3, 4, 3, 4, 3]
    for name in ("place", "normal", "eye", "shown", "wanted", "weight", "offset"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    assert len(after.some(np.array([0, 3]))) == 2


def test_other_tables_are_no_marks() -> None:
    with pytest.raises(ValueError, match="numbers each"):
        Marks.of_table(Table(np.zeros((1, 1, 4, 3), np.float32)))


def test_strokes_change_no_light() -> None:
    stroke = Stroke(id="s", name="Red", objects=("a", "b"), table=marks().table())
    before = Scene()
    assert diff(before, before.with_nodes(stroke)).aspects is Aspect.NAME
    assert TAGS["stroke"] is Stroke


@pytest.mark.parametrize(("column", "value"), [(0, 2), (0, -1), (0, 0.5), (7, 1e30)])
def test_strokes_refuse_marks_that_count_wrong(column: int, value: float) -> None:
    values = marks().table().values.copy()
    values[0, 0, 2, column] = value
    with pytest.raises(ValueError, match="mark"):
        Stroke(id="s", objects=("a", "b"), table=Table(values))
