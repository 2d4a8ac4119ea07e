"""`gather` in small rooms: against path tracing, and against itself after edits."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from captured_fits import made_up
from gathered_rooms import Room
from path_rooms import box_room, furnished
from scenes import sky

from studio.bench.harness import unbiased_rmse
from studio_core.contract import Services
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import AreaLamp, Environment, Light, Material, MeshObject, PointLamp, Scene
from studio_core.scene.transform import Transform, axis_angle, looking
from studio_core.shading.artifacts import Surfaces
from studio_core.shading.cache import DiskCache
from studio_plugins.residual.material import scene_material

LAMP = AreaLamp(
    id="lamp", intensity=6.0, width=1.0, height=0.6, transform=looking((0.8, 2.4, 0.9), (-0.5, 0, -0.5))
)
FINE = 6000  # vertices: what stands on the floor is then resolved
SKY = Environment(id="sky", image=sky(32), intensity=1.0)
GLOSSY = Material(id="paint", name="Paint", model="phong", values={"exponent": 12.0})
METAL = Material(id="paint", name="Paint", model="ggx", values={"roughness": 0.5, "metallic": 1.0})


@pytest.fixture
def services(workers: Any, host: Any) -> Services:
    return Services(workers, host)


def error(room: Room, made: Any, bounces: int = 3, count: int = 400) -> float:
    """Relative RMSE of radiance towards the eye, over some vertices."""
    total = len(made.valid)
    some = np.sort(np.random.default_rng(1).choice(total, min(count, total), replace=False))
    a, b = (room.radiance(half.terms, some) for half in room.truth(some, bounces=bounces))
    return unbiased_rmse(room.radiance(made.layer.terms[some], some), a, b)


@pytest.mark.parametrize(
    ("lights", "material"),
    [((LAMP,), GLOSSY), ((LAMP,), METAL), ((SKY,), GLOSSY)],
    ids=["lamp on paint", "lamp on metal", "sky on paint"],
)
def test_it_is_near_the_truth_and_nearer_at_rest(services: Services, lights: Any, material: Material) -> None:
    room = Room(furnished(lights, material), services, FINE)
    hand, rest = room.light(), room.light(moving=False)
    in_hand, at_rest = error(room, hand), error(room, rest)
    assert not hand.final
    assert rest.final
    assert in_hand < 0.12
    assert at_rest < 0.07
    assert at_rest < in_hand
    assert (rest.layer.irradiance >= 0).all()


def test_a_captured_material_sends_and_receives(services: Services) -> None:
    material = dataclasses.replace(scene_material(made_up("blinn", "half"), "Cloth").material, id="paint")
    room = Room(furnished((LAMP,), material), services, FINE)
    assert error(room, room.light(moving=False)) < 0.06


@pytest.mark.parametrize("bounces", [1, 2, 5])
def test_light_goes_on_as_often_as_asked(services: Services, bounces: int) -> None:
    room = Room(furnished((LAMP,)), services, FINE, bounces=bounces)
    assert error(room, room.light(moving=False), bounces) < 0.06


def test_dimming_a_lamp_dims_what_came_from_it(services: Services) -> None:
    """Gains are linear, colour by colour; no ray is traced for them."""
    other = PointLamp(id="other", intensity=3.0, transform=Transform((-1.0, 2.0, 1.0)))
    room = Room(furnished((LAMP, other)), services)
    both = room.light()

    def dimmed(node: Light, intensity: float) -> Scene:
        return room.scene.with_nodes(dataclasses.replace(node, intensity=intensity))

    off = room.light(dimmed(LAMP, 0.0))
    assert sum(off.counts[name] for name in off.counts if name.startswith("rays")) == 0
    room.light(dimmed(LAMP, LAMP.intensity))
    own = room.light(dimmed(other, 0.0))
    np.testing.assert_allclose(
        own.layer.irradiance + off.layer.irradiance, both.layer.irradiance, rtol=1e-4, atol=1e-5
    )
    doubled = room.light(dimmed(LAMP, 2 * LAMP.intensity))
    np.testing.assert_allclose(doubled.layer.terms, 2 * own.layer.terms, rtol=1e-4, atol=1e-6)
    dark = room.light(dimmed(LAMP, 0.0))
    assert not dark.layer.terms.any()


def test_moves_in_hand_give_what_a_fresh_start_gives(services: Services) -> None:
    rng = np.random.default_rng(5)
    room = Room(furnished((LAMP,), GLOSSY), services)
    room.light()
    scene = room.scene
    for _ in range(12):
        box = scene["box"]
        assert isinstance(box, MeshObject)
        turn = axis_angle((0, 1, 0), float(rng.uniform(0, 360)))
        place = (float(rng.uniform(-1.2, 1.2)), 0.5, float(rng.uniform(-1.2, 1.2)))
        scene = scene.with_nodes(dataclasses.replace(box, transform=Transform(place, turn)))
        made = room.light(scene)
    fresh = Room(scene, services).light()
    scale = fresh.layer.irradiance.mean()
    difference = (made.layer.irradiance - fresh.layer.irradiance).astype(np.float64)
    assert np.sqrt((difference**2).mean()) < 1e-3 * scale
    assert made.counts["rays_between_vertices"] < fresh.counts["rays_between_vertices"]


def test_a_white_box_settles_at_its_limit(services: Services) -> None:
    """Of the lamp's light Φ all surfaces together receive Φ ρ / (1 − ρ) by way of others."""
    white = Material(id="wall", name="Wall", values={"base_color": (0.8, 0.8, 0.8)})
    lamp = PointLamp(id="lamp", intensity=1.0)
    box = MeshObject(id="room", name="Room", geometry=box_room(), materials=("wall",))
    scene = Scene().with_materials(white).with_nodes(box, lamp)
    room = Room(scene, services, FINE, settle=True)
    made = room.light(moving=False)
    surfaces = room.handed()[Surfaces]
    area = surfaces.mesh.area.astype(np.float64)
    mean = (made.layer.irradiance[:, 0] * area).sum() / area.sum()
    straight = 4 * np.pi / area.sum()  # all light of a lamp of 1 W/sr
    assert mean == pytest.approx(straight * 0.8 / 0.2, rel=0.01)
    assert made.facts["rounds"] < 12


def test_normal_maps_get_tilts(services: Services) -> None:
    bumps = np.zeros((8, 8, 3), np.float32) + 0.5
    bumps[:, :4, 0], bumps[..., 2] = 0.7, 0.95
    mapped = dataclasses.replace(GLOSSY, textures={"normal": Texture(Image(bumps, "linear"))})
    room = Room(furnished((LAMP,), mapped), services)
    made = room.light()
    assert made.layer.tilts is not None
    surfaces = room.handed()[Surfaces]
    painted = surfaces.mesh.material == surfaces.materials.index("paint")
    assert np.isfinite(made.layer.tilts).all()
    assert made.layer.tilts[painted].any()
    assert not made.layer.tilts[~painted].any()


def test_without_lights_it_is_dark_and_without_objects_nothing_fails(services: Services) -> None:
    assert not Room(furnished(()), services).light(moving=False).layer.terms.any()


def test_less_is_asked_for_with_a_larger_tolerance(services: Services) -> None:
    room = Room(furnished((LAMP,)), services, vertices=800)
    made = [room.light(moving=False, tolerance=t) for t in (10.0, 3.0, 1.5)]
    counts = [one.facts["rays"] + one.facts["lobe_rays"] for one in made]
    assert counts[0] < counts[1] < counts[2]


def test_rays_of_all_vertices_are_found_again_on_disk(services: Services, tmp_path: Path) -> None:
    kept = dataclasses.replace(services, cache=DiskCache(tmp_path))
    scene = furnished((LAMP,), GLOSSY)
    first = Room(scene, kept)
    made = first.light()
    first.complete()
    again = Room(scene, kept).light()
    assert made.counts["rays_between_vertices"] > 0
    assert again.counts["rays_between_vertices"] == 0
    np.testing.assert_array_equal(again.layer.irradiance, made.layer.irradiance)
    box = scene["box"]
    assert isinstance(box, MeshObject)
    elsewhere = dataclasses.replace(box, transform=Transform((0.5, 0.5, 0.5)))
    moved = Room(scene.with_nodes(elsewhere), kept).light()
    assert moved.counts["rays_between_vertices"] > 0
