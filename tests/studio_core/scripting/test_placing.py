"""Placing by scripts: each call one step, refused in a sentence where it cannot be."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from studio_core.contract import Services
from studio_core.document import Document
from studio_core.edits import Add, SetFields
from studio_core.errors import EditError
from studio_core.parallel import Workers
from studio_core.registry import PluginHost
from studio_core.scene.nodes import MeshObject, Scene
from studio_core.scene.transform import Transform
from studio_core.scripting import Names
from studio_core.session import Session


@pytest.fixture
def names(little_scene: Callable[..., Scene], host: PluginHost, workers: Workers) -> Names:
    """A cube on a floor, and two smaller ones in the air."""
    scene = little_scene()
    more = tuple(
        MeshObject(
            id=name,
            name=name.title(),
            geometry=scene["cube"].geometry,
            materials=("paint",),
            transform=Transform(place, scale=0.4),
        )
        for name, place in (("left", (-1.4, 2.0, 0.2)), ("over", (0.3, 3.0, 0.1)))
    )
    return Names(Document(Add(more)(scene)), Session(), host, lambda: Services(workers, host))


def place(names: Names, node: str) -> tuple[float, float, float]:
    return names.scene.world(node).translation


def test_things_are_dropped_on_the_floor_and_on_each_other(names: Names) -> None:
    names.drop("Left", "Over")
    assert place(names, "left") == pytest.approx((-1.4, 0.2, 0.2))
    assert place(names, "over") == pytest.approx((0.3, 1.2, 0.1))
    assert [step.label for step in names._document.history] == ["Open", "Drop 2 objects"]


def test_a_thing_is_scaled_on_its_foot(names: Names) -> None:
    names.scale("Cube", 2.0)
    assert names.scene.world("cube").scale == 2.0
    assert names.bounds("Cube")[0] == pytest.approx((-1, 0, -1), abs=1e-6)
    with pytest.raises(EditError, match="factor above 0"):
        names.scale("Cube", 0.0)


def test_sides_and_gaps(names: Names) -> None:
    names.align("Cube", "Left", "Over", side="front")
    assert [names.bounds(n)[1][2] for n in ("Cube", "Left", "Over")] == pytest.approx([0.5] * 3)
    names.align("Cube", "Left", side="y")
    assert place(names, "left")[1] == pytest.approx(place(names, "cube")[1])
    names.distribute("Left", "Over", "Cube", along="y")
    low, middle, high = sorted(
        (tuple(names.bounds(n)[i][1] for i in (0, 1)) for n in ("Cube", "Left", "Over")), key=sum
    )
    assert middle[0] - low[1] == pytest.approx(high[0] - middle[1])
    assert names._document.history[-1].label == "Distribute 3 objects"


def test_what_cannot_be_is_refused_in_a_sentence(names: Names) -> None:
    with pytest.raises(EditError, match="no side 'upper'; known: left, right"):
        names.align("Cube", "Left", side="upper")
    with pytest.raises(EditError, match="no axis 'w'"):
        names.distribute("Cube", "Left", along="w")
    names.apply(SetFields("cube", {"locked": True}))
    with pytest.raises(EditError, match="'Cube' cannot be moved: it is locked"):
        names.drop("Cube")
