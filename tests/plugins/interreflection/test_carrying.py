"""What rest has found goes on in hand: near what was there, never where it does not belong."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from gathered_rooms import Room
from path_rooms import furnished

from studio_core.contract import Services
from studio_core.errors import Cancelled
from studio_core.scene.nodes import AreaLamp, Material, MeshObject, PointLamp, Scene
from studio_core.scene.transform import Transform, looking
from studio_plugins.interreflection.gather.carrying import Carry
from studio_plugins.interreflection.gather.final_stage import FinalStage
from studio_plugins.interreflection.gather.tiers import tiers

LAMP = AreaLamp(
    id="lamp", intensity=6.0, width=1.0, height=0.6, transform=looking((0.8, 2.4, 0.9), (-0.5, 0, -0.5))
)
OTHER = PointLamp(id="other", intensity=3.0, transform=Transform((-1.0, 2.0, 1.0)))
GLOSSY = Material(id="paint", name="Paint", model="phong", values={"exponent": 12.0})


@pytest.fixture
def services(workers: Any, host: Any) -> Services:
    return Services(workers, host)


def carry_of(room: Room) -> Carry:
    stage = next(stage for stage in room.inner.stages if isinstance(stage, FinalStage))
    return stage._carry


def brighter(room: Room, lamp: Any, share: float) -> Scene:
    return room.scene.with_nodes(dataclasses.replace(lamp, intensity=lamp.intensity * share))


def nudged(room: Room, metres: float) -> Scene:
    box = room.scene["box"]
    assert isinstance(box, MeshObject)
    x, y, z = box.transform.translation
    place = dataclasses.replace(box.transform, translation=(x + metres, y, z))
    return room.scene.with_nodes(dataclasses.replace(box, transform=place))


def apart(made: Any, other: Any) -> float:
    """Root mean square difference of irradiance, of the mean."""
    difference = (made.layer.irradiance - other.layer.irradiance).astype(np.float64)
    return float(np.sqrt((difference**2).mean()) / other.layer.irradiance.mean())


def same(made: Any, other: Any) -> None:
    np.testing.assert_allclose(made.layer.irradiance, other.layer.irradiance, rtol=1e-4, atol=1e-5)
    np.testing.assert_allclose(made.layer.terms, other.layer.terms, rtol=1e-4, atol=1e-5)


def test_a_dimmed_lamp_dims_what_rest_has_found(services: Services) -> None:
    room = Room(furnished((LAMP,), GLOSSY), services)
    rest = room.light(moving=False)
    dimmed = room.light(brighter(room, LAMP, 0.5))
    fresh = Room(room.scene, services).light()
    half = dataclasses.replace(
        rest, layer=dataclasses.replace(rest.layer, irradiance=rest.layer.irradiance / 2)
    )
    assert not dimmed.final
    assert apart(dimmed, half) < 0.2 * apart(fresh, half)
    assert apart(fresh, half) > 0.01
    glossy = rest.layer.terms[:, 1:].astype(np.float64)
    off = [np.abs(one.layer.terms[:, 1:] - glossy / 2).mean() for one in (dimmed, fresh)]
    assert off[0] < 0.2 * off[1]


def test_a_nudge_does_not_flicker(services: Services) -> None:
    room = Room(furnished((LAMP,), GLOSSY), services)
    rest = room.light(moving=False)
    near = room.light(nudged(room, 0.001))
    fresh = Room(room.scene, services).light()
    assert apart(near, rest) < 0.3 * apart(fresh, rest)
    assert apart(room.light(moving=False), rest) < 0.02


def test_it_is_no_further_from_rest_after_any_edit(services: Services) -> None:
    room = Room(furnished((LAMP, OTHER), GLOSSY), services)
    dark = Material(id="paint", name="Paint", model="phong", values={"exponent": 40.0, "diffuse": (0, 0, 0)})
    edits = (
        lambda: nudged(room, 0.1),
        lambda: brighter(room, LAMP, 0.0),
        lambda: room.scene.with_materials(dark),
        lambda: brighter(room, OTHER, 4.0),
    )
    room.light(moving=False)
    for edit in edits:
        made = room.light(edit())
        fresh, rest = Room(room.scene, services).light(), room.light(moving=False)
        assert apart(made, rest) < 1.05 * apart(fresh, rest)
        assert np.isfinite(made.layer.terms).all()
        assert (made.layer.irradiance >= 0).all()


def test_another_lamp_leaves_little_of_it(services: Services) -> None:
    both = furnished((LAMP, dataclasses.replace(OTHER, intensity=0.0)))
    room = Room(both, services)
    room.light(moving=False)
    swapped = brighter(room, LAMP, 0.0).with_nodes(OTHER)
    made, fresh = room.light(swapped), Room(swapped, services).light()
    rest = room.light(moving=False)
    assert apart(made, rest) < 1.05 * apart(fresh, rest)


def test_no_tier_is_worse_than_the_hand_that_let_go(services: Services) -> None:
    room = Room(furnished((LAMP,), GLOSSY), services)
    room.light(moving=False)
    room.light(nudged(room, 0.002))
    made: list[Any] = []
    stage = next(stage for stage in room.inner.stages if isinstance(stage, FinalStage))
    run = stage.run

    def noted(*given: Any) -> Any:
        made.append(run(*given))
        return made[-1]

    stage.run = noted  # type: ignore[method-assign]
    rest = room.light(moving=False)
    assert len(made) == len(tiers(3.0))
    off = [apart(one, rest) for one in made]
    assert max(off[1:]) < 1.1 * off[0]
    assert off[-1] == 0


def test_rest_does_not_know_of_it(services: Services) -> None:
    room = Room(furnished((LAMP,), GLOSSY), services)
    room.light(moving=False)
    room.light(brighter(room, LAMP, 2.0))
    after = room.light(moving=False)
    same(after, Room(room.scene, services).light(moving=False))


def test_nothing_is_carried_where_a_first_tier_is_enough(services: Services) -> None:
    room = Room(furnished((LAMP,)), services, tolerance=10.0)
    room.light(moving=False)
    made = room.light(brighter(room, LAMP, 0.5))
    assert carry_of(room).nbytes == 0
    same(made, Room(room.scene, services, tolerance=10.0).light())


def test_other_parameters_and_other_objects_begin_anew(services: Services) -> None:
    room = Room(furnished((LAMP,)), services, 800)
    room.light(moving=False)
    same(room.light(bounces=2), Room(room.scene, services, 800, bounces=2).light())
    room.light(moving=False)
    box = room.scene["box"]
    assert isinstance(box, MeshObject)
    second = dataclasses.replace(box, id="second", transform=Transform((1.0, 0.5, -1.0)))
    room._receivers = None  # all are to be seen, of which there are more now
    assert carry_of(room)._found is not None
    room.light(room.scene.with_nodes(second))
    assert carry_of(room)._found is None


def test_a_rest_that_was_cancelled_leaves_what_was_there(services: Services, monkeypatch: Any) -> None:
    room = Room(furnished((LAMP, OTHER)), services, 800)
    room.light(moving=False)
    kept = carry_of(room)._found
    assert kept is not None

    def stop(*_: Any, **__: Any) -> None:
        raise Cancelled

    room.light(nudged(room, 0.3))
    with monkeypatch.context() as patched:
        patched.setattr(Carry, "finer", stop)
        with pytest.raises(Cancelled):
            room.light(moving=False)
    assert carry_of(room)._found is kept
    made, fresh = room.light(brighter(room, OTHER, 3.0)), Room(room.scene, services, 800)
    in_hand = fresh.light()
    rest = room.light(moving=False)
    assert apart(made, rest) < 1.05 * apart(in_hand, rest)
    assert apart(rest, fresh.light(moving=False)) < 1e-3


def test_a_finished_rest_replaces_what_was_there_and_drops_its_beginning(services: Services) -> None:
    room = Room(furnished((LAMP,)), services, 800)
    room.light(moving=False)
    first, held = carry_of(room)._found, carry_of(room).nbytes
    room.light(nudged(room, 0.3))
    assert carry_of(room)._found is first
    room.light(moving=False)
    assert carry_of(room)._found is not first
    assert carry_of(room)._begun is None
    assert carry_of(room).nbytes == held
