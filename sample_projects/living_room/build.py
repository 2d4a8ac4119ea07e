"""The living room as a scene: everything in its place, two cameras, the light of the day."""

from __future__ import annotations

from dataclasses import replace

from studio_core.scene.nodes import Environment, PointLamp, Scene
from studio_core.scene.transform import Transform

from ..modelling.equirect import stored
from ..modelling.parts import Part, Stage, placed
from . import decor, seating, tables
from .materials import palette as palette
from .window_room import HIGH, LOW, day_room

TILE = 2.4


def build(light_height: int = 512) -> Scene:
    """The whole scene; the light's picture is 2·light_height × light_height."""
    stage = Stage(palette())
    furnish(stage)
    stage.camera("Living room", (2.62, 1.42, 2.18), (-0.66, 0.60, -0.80), 34.0)
    stage.camera("Reading corner", (-0.72, 1.3, 2.15), (0.28, 0.66, -1.7), 34.0)
    stage.camera("Vase and books", (0.75, 1.1, 0.75), (-0.72, 0.42, -0.95), 34.0)
    picture, scale = day_room(light_height)
    light = Environment(
        id="light-day", name="Daylight through two windows", image=stored(picture), luminance_scale=scale
    )
    return stage.scene(light)


def furnish(stage: Stage) -> None:
    """Puts everything but cameras and the light of the day on the stage."""
    width, depth = HIGH[0] - LOW[0], HIGH[2] - LOW[2]
    room = stage.group("Room", locked=True)
    rug_size, rug_place = (2.5, 1.75), placed(-0.72, -0.72, 4.0)
    stage.put([decor.floor(width, depth, TILE, rug_place, rug_size)], room)
    board = Part("Skirting board", decor.skirting(width), ("painted wood",))
    stage.put([board], room, placed(0.0, LOW[2]))
    stage.put([decor.rug(*rug_size)], None, rug_place)
    stage.put(seating.sofa(), stage.group("Sofa", placed(-0.85, -1.85)))
    stage.put(seating.armchair(), stage.group("Armchair", placed(0.86, -1.3, -38.0)))
    coffee = stage.group("Coffee table", placed(-0.72, -0.72, 3.0))
    stage.put(tables.coffee_table(), coffee)
    stage.put(tables.vase(), coffee, placed(0.16, -0.06, 0.0, 0.4))
    stage.put(tables.books(), coffee, placed(-0.26, 0.05, 12.0, 0.4))
    dining = stage.group("Dining corner", placed(-2.12, 0.2))
    stage.put([replace(p, name=f"Table {p.name.lower()}") for p in tables.round_table()], dining)
    stage.put([tables.bowl(), tables.fruit()], dining, placed(0.05, 0.02, 0.0, 0.735))
    chair = seating.chair()
    geometry = chair.geometry()
    stage.shape("Chair at the front", geometry, chair.materials, None, placed(-1.5, 0.48, -112.0))
    stage.shape("Chair at the back", geometry, chair.materials, None, placed(-2.1, -0.48, 8.0))
    lamp = stage.group("Floor lamp", placed(0.42, -2.12, 20.0))
    stage.put(decor.floor_lamp(), lamp)
    stage.nodes.append(
        PointLamp(
            id="lamp-floor-lamp",
            name="Floor lamp bulb",
            parent=lamp,
            transform=Transform((0.0, decor.SHADE_HEIGHT + 0.1, 0.0)),
            intensity=1.2,
            temperature=2700.0,
            hidden=True,
        )
    )
    stage.put(decor.plant(), stage.group("Rubber fig", placed(-2.55, -1.95, 40.0)))
    stage.put(decor.picture(1.05, 0.84), stage.group("Picture", Transform((-0.85, 1.2, LOW[2] + 0.005))))
