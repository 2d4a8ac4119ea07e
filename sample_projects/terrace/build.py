"""The terrace as a scene: a table for two under a parasol, an armchair, pots, and the afternoon sun."""

from __future__ import annotations

from dataclasses import replace

from studio_core.scene.geometry import Texture
from studio_core.scene.nodes import Environment, Material, Scene

from ..living_room import decor, materials, seating, tables
from ..modelling import textures
from ..modelling.equirect import stored
from ..modelling.parts import Stage, material, placed
from . import garden
from .open_sky import sunny_sky

WIDTH, DEPTH, TILE = 5.4, 4.2, 2.4


def build(light_height: int = 512) -> Scene:
    """The whole scene; the light's picture is 2·light_height × light_height."""
    stage = Stage(palette())
    furnish(stage)
    stage.camera("Terrace", (2.9, 1.62, 3.5), (-0.32, 0.92, -0.35), 36.0)
    stage.camera("Under the parasol", (1.5, 1.35, 1.9), (-0.55, 0.72, -0.4), 34.0)
    picture, scale = sunny_sky(light_height)
    light = Environment(
        id="light-sky", name="Clear sky with sun", image=stored(picture), luminance_scale=scale
    )
    return stage.scene(light)


def furnish(stage: Stage) -> None:
    """Puts everything but cameras and the sky on the stage."""
    stage.put([garden.paving(WIDTH, DEPTH, TILE)])
    dining = stage.group("Table for two", placed(-0.7, -0.45))
    stage.put([replace(p, name=f"Table {p.name.lower()}") for p in tables.round_table()], dining)
    stage.put([tables.bowl(), tables.fruit()], dining, placed(-0.12, 0.12, 0.0, 0.735))
    chair = replace(seating.chair(), materials=("teak", "blue canvas"))
    geometry = chair.geometry()
    stage.shape("Chair at the right", geometry, chair.materials, dining, placed(0.72, 0.2, -105.0), "dining-")
    stage.shape("Chair at the left", geometry, chair.materials, dining, placed(-0.62, 0.5, 128.0), "dining-")
    stage.put(tables.vase(), stage.group("Vase", placed(-0.54, -0.56, 0.0, 0.735)))
    stage.put(garden.parasol(), stage.group("Parasol", placed(-0.95, -1.0, 12.0)))
    stage.put(seating.armchair(), stage.group("Armchair", placed(1.25, -0.55, -22.0)))
    stage.put(garden.planter(), stage.group("Planter", placed(0.75, -1.78, 0.0)))
    stage.put(decor.plant(seed=12), stage.group("Rubber fig", placed(-2.2, -1.2, 80.0)))


def palette() -> dict[str, Material]:
    """The living room's materials, weathered for outdoors where it matters."""
    made = materials.palette()
    made |= {
        "canvas": material("Natural canvas", "lambert", base_color=(0.70, 0.62, 0.50)),
        "blue canvas": material("Blue canvas", "lambert", base_color=(0.10, 0.17, 0.27)),
        "teak": material(
            "Oiled teak",
            "blinn-phong",
            diffuse=(0.30, 0.165, 0.085),
            specular=(0.045, 0.045, 0.045),
            exponent=30.0,
        ),
        "granite": material(
            "Granite", "phong", diffuse=(0.19, 0.19, 0.19), specular=(0.04, 0.04, 0.04), exponent=25.0
        ),
        "grass": material("Feather grass", "lambert", base_color=(0.17, 0.22, 0.07)),
        "paving": material(
            "Limestone paving",
            "lambert",
            {"base_color": Texture(textures.slabs())},
            base_color=(1.0, 1.0, 1.0),
        ),
        "leather": material("Terracotta canvas", "lambert", base_color=(0.50, 0.19, 0.10)),
    }
    return made
