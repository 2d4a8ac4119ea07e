"""The room as a scene: a window to the left, a low sun, and what the light falls on."""

from __future__ import annotations

import numpy as np

from studio_core.colour import LUMINANCE
from studio_core.scene.nodes import Environment, Material, PointLamp, Scene
from studio_core.scene.room import Room
from studio_core.scene.room_shape import Opening
from studio_core.scene.transform import Transform

from ..living_room import decor, materials, seating, tables
from ..modelling import equirect
from ..modelling.equirect import stored
from ..modelling.landscape import Landscape
from ..modelling.mesh import Array
from ..modelling.parts import Stage, material, placed
from ..modelling.sky import SUN_RADIUS, Sky, sun_at
from .cabinet import HEIGHT as HIGH
from .cabinet import cabinet

WIDTH, DEPTH, HEIGHT = 4.0, 3.6, 2.6
LEFT = 3  # which wall has the window
SKY = Sky(turbidity=2.6, sun=sun_at(21.0, 284.0))
FACING_IRRADIANCE = 19.0  # what faces the sun gets, in units of radiance · sr
CABINET = placed(1.2, -0.78, -90.0)


def build(light_height: int = 192) -> Scene:
    """The whole scene; the light's picture is 2·light_height × light_height."""
    stage = Stage(palette())
    furnish(stage)
    stage.camera("By the window", (-1.28, 1.42, 1.62), (0.72, 0.86, -1.25), 45.0)
    stage.camera("Wall and cabinet", (-0.6, 1.25, 0.5), (0.95, 0.9, -1.75), 40.0)
    picture, scale = low_sun(light_height)
    light = Environment(
        id="light-sky", name="Evening sky with sun", image=stored(picture), luminance_scale=scale
    )
    return stage.scene(light)


def furnish(stage: Stage) -> None:
    """Puts everything but cameras and the sky on the stage."""
    names = ("pale floor", "white wall", "white ceiling", "white wood", "white wood")
    window = Opening(kind="window", wall=LEFT, along=0.15, sill=0.55, width=1.7, height=1.7)
    stage.nodes.append(
        Room(
            id="mesh-room",
            name="Room",
            locked=True,
            width=WIDTH,
            depth=DEPTH,
            height=HEIGHT,
            openings=(window,),
            materials=tuple(stage.materials[name].id for name in names),
        )
    )
    red = stage.group("Red cabinet", CABINET)
    stage.put(cabinet(), red)
    stage.put(tables.vase(), red, placed(-0.3, 0.02, 30.0, HIGH))
    stage.put(tables.books(), red, placed(0.22, 0.0, -12.0, HIGH))
    stage.put(seating.armchair(), stage.group("Armchair", placed(-0.62, -1.05, 32.0)))
    lamp = stage.group("Floor lamp", placed(-1.45, -1.35, 20.0))
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


def palette() -> dict[str, Material]:
    """The living room's furniture in a room of white plaster, where every tint shows."""
    made = materials.palette()
    made |= {
        "pale floor": material("Limed boards", "lambert", base_color=(0.58, 0.54, 0.48)),
        "white wall": material("White plaster", "lambert", base_color=(0.82, 0.81, 0.79)),
        "white ceiling": material("White ceiling", "lambert", base_color=(0.85, 0.85, 0.84)),
        "white wood": material("White woodwork", "lambert", base_color=(0.80, 0.80, 0.79)),
        "red lacquer": material(
            "Red lacquer",
            "blinn-phong",
            diffuse=(0.60, 0.045, 0.03),
            specular=(0.05, 0.05, 0.05),
            exponent=40.0,
        ),
        "leather": material("White bouclé", "lambert", base_color=(0.68, 0.66, 0.62)),
    }
    return made


def low_sun(height: int) -> tuple[Array, float]:
    """The picture (height, 2·height, 3), white-balanced and exposed, and cd/m² for a unit of luminance."""
    picture = equirect.painted(Landscape(SKY).painter(), height)
    picture = equirect.add_disc(picture, np.array(SKY.sun), SUN_RADIUS, SKY.sun_radiance())
    light = equirect.irradiance(picture, np.array(SKY.sun))
    scale = FACING_IRRADIANCE / float(light @ np.array(LUMINANCE))
    return picture * equirect.balance(light, 0.8) * scale, 1000.0 / scale
