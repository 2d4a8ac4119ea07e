"""What `lucarne bench cuts` looks at: the sample room in chosen materials, under its windows or a sun.

Materials: `own` as they are; `diffuse` all Lambert; `glossy` GGX α 0.25, Blinn–Phong 40 and Phong 20 in turn;
`sharp` GGX α 0.1 and Blinn–Phong 500 in turn. `native-…` hold only what Mitsuba has itself: every matte
material of the room is `diffuse` of its mean colour, every glossy one white metal without light between
facets, Mitsuba's `roughconductor` (the other models, and textures, would be compared with our own translation
of them); the environment gives light but is not seen, since nobody has to compute its pixels and the bright
windows would be most of the picture's mean.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.imaging.latlong import pixel_solid_angles
from studio_core.params import Colour, Value
from studio_core.scene.geometry import Geometry, Image, Texture
from studio_core.scene.nodes import Camera, Environment, Material, MeshObject, Scene
from studio_core.scene.transform import Transform, looking
from studio_core.shading.materials import linear_rgb

F32 = npt.NDArray[np.float32]

ENVIRONMENTS = ("windows", "sun")
GLOSS = {"glossy": 0.25, "sharp": 0.1, "native-glossy": 0.25, "native-sharp": 0.1}
"""GGX's α of each paint."""
NATIVE = {"diffuse": "native-diffuse", "glossy": "native-glossy", "sharp": "native-sharp"}
EXPONENTS = {"glossy": {"blinn-phong": 40.0, "phong": 20.0}, "sharp": {"blinn-phong": 500.0}}
SUN_SHARE = 0.5
SUN_TINT = (1.0, 0.93, 0.82)
BLOCK = 16
OWN = "own"


class Rooms:
    """Rooms by environment and materials; the same call gives the same scene."""

    def __init__(self, base: Scene) -> None:
        sky = next(base.of(Environment))
        sunny = dataclasses.replace(sky, image=with_sun(sky.image))
        self._lit = {"windows": base, "sun": base.with_nodes(sunny)}
        self._made: dict[tuple[str, str], Scene] = {}

    def __call__(self, environment: str, materials: str) -> Scene:
        """`environment` of ENVIRONMENTS; `materials` as the module says."""
        key = (environment, materials)
        if key not in self._made:
            lit = self._lit[environment]
            made = lit if materials == OWN else painted(lit, materials)
            if materials.startswith("native"):
                sky = next(made.of(Environment))
                made = made.with_nodes(dataclasses.replace(sky, background=False))
            self._made[key] = made
        return self._made[key]


def prefix_of(environment: str) -> str:
    """What the names of an environment's cases begin with."""
    return "" if environment == ENVIRONMENTS[0] else f"{environment}/"


def painted(scene: Scene, materials: str) -> Scene:
    """The scene with every material's definition replaced; ids, and so meshes, stay."""
    made = [
        _diffuse(material, materials.startswith("native"))
        if materials.endswith("diffuse") or (materials.startswith("native") and material.model == "lambert")
        else _glossy(material, index, materials)
        for index, material in enumerate(scene.materials.values())
    ]
    return scene.with_materials(*made)


def _diffuse(material: Material, plain: bool) -> Material:
    colour = {"base_color": _colour(material, plain)}
    textures = {} if plain else _base_texture(material)
    return dataclasses.replace(
        material, model="lambert", values=frozen_map(colour), textures=frozen_map(textures)
    )


def _glossy(material: Material, index: int, materials: str) -> Material:
    roughness = GLOSS[materials] ** 0.5
    values: Mapping[str, Value]
    if materials.startswith("native"):
        values = {
            "base_color": (1.0, 1.0, 1.0),
            "metallic": 1.0,
            "roughness": roughness,
            "keep_energy": False,
        }
        return dataclasses.replace(material, model="ggx", values=frozen_map(values), textures=frozen_map())
    textures = _base_texture(material)
    models = ["ggx", *EXPONENTS[materials]]
    model = "ggx" if textures else models[index % len(models)]
    if model == "ggx":
        values = {"base_color": _colour(material, False), "roughness": roughness}
    else:
        exponent = EXPONENTS[materials][model]
        values = {"diffuse": _colour(material, True), "specular": (0.1, 0.1, 0.1), "exponent": exponent}
    return dataclasses.replace(
        material, model=model, values=frozen_map(values), textures=frozen_map(textures)
    )


def _base_texture(material: Material) -> dict[str, Texture]:
    found = material.textures.get("base_color") or material.textures.get("diffuse")
    return {} if found is None else {"base_color": found}


def _colour(material: Material, plain: bool) -> Colour:
    """Of the matte part; with the texture's mean when `plain`."""
    value = material.values.get("base_color", material.values.get("diffuse", (0.6, 0.6, 0.6)))
    colour = np.asarray(value, np.float64)
    for texture in _base_texture(material).values() if plain else ():
        colour = colour * linear_rgb(texture.image).mean(axis=(0, 1), dtype=np.float64)
    red, green, blue = (float(np.clip(c, 0.0, 1.0)) for c in colour)
    return (red, green, blue)


def with_sun(image: Image, share: float = SUN_SHARE) -> Image:
    """The picture with a sun of 2×2 pixels in the middle of its brightest place.

    The sun's light, facing it, is `share` of the light of the whole picture. No leaf of 2^15 directions
    resolves it.
    """
    pixels = np.array(linear_rgb(image), np.float32)
    height, width, _ = pixels.shape
    rows, columns = max(1, height // BLOCK), max(1, width // BLOCK)
    blocks = pixels[: rows * (height // rows), : columns * (width // columns)]
    grey = blocks.reshape(rows, height // rows, columns, width // columns, 3).mean(axis=(1, 3, 4))
    row, column = np.unravel_index(int(grey.argmax()), grey.shape)
    y = int((row + 0.5) * (height // rows))
    x = int((column + 0.5) * (width // columns))
    spot = (slice(y, min(y + 2, height)), slice(x, min(x + 2, width)))
    angles = np.repeat(pixel_solid_angles(height, width)[:, None], width, axis=1)
    light = float((pixels.mean(axis=2, dtype=np.float64) * angles).sum())
    tint = np.array(SUN_TINT)
    pixels[spot] += (share * light / angles[spot].sum() * tint / tint.mean()).astype(np.float32)
    return Image(pixels)


# --- furniture on a floor, for growth -----------------------------------------------------------------


def hall(count: int, image: Image) -> Scene:
    """`count` tables (instances of one mesh) in rows on a floor of 12 m, and a camera that sees them all."""
    side = int(np.ceil(np.sqrt(count)))
    step = 9.0 / side
    legs = Material(id="wood", name="Wood", values=frozen_map({"base_color": (0.45, 0.3, 0.2)}))
    gloss = Material(
        id="floor", name="Floor", model="ggx", values=frozen_map({"base_color": (0.5, 0.5, 0.5)})
    )
    table = _boxes(
        [((-0.6, 0.70, -0.4), (0.6, 0.74, 0.4))]
        + [
            ((x - 0.03, 0.0, z - 0.03), (x + 0.03, 0.70, z + 0.03))
            for x in (-0.52, 0.52)
            for z in (-0.32, 0.32)
        ]
    )
    scale = min(1.0, 0.8 * step / 1.2)
    places = [(i % side, i // side) for i in range(count)]
    tables = [
        MeshObject(
            id=f"table-{i}",
            name=f"Table {i}",
            geometry=table,
            materials=("wood",),
            transform=Transform(((x - (side - 1) / 2) * step, 0.0, (z - (side - 1) / 2) * step), scale=scale),
        )
        for i, (x, z) in enumerate(places)
    ]
    ground = MeshObject(
        id="ground", name="Floor", geometry=_boxes([((-6, -0.1, -6), (6, 0, 6))]), materials=("floor",)
    )
    camera = Camera(id="camera", name="Camera", transform=looking((6.5, 6.0, 8.5), (0, 0, 0)), focus=12.0)
    sky = Environment(id="sky", name="Sky", image=image)
    return Scene().with_materials(legs, gloss).with_nodes(ground, *tables, camera, sky)


def _boxes(boxes: list[tuple[tuple[float, float, float], tuple[float, float, float]]]) -> Geometry:
    """One mesh of boxes between low and high corners, with flat faces."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], np.float64)
    positions, normals = [], []
    faces: list[tuple[int, int, int]] = []
    for low, high in boxes:
        centre, half = (np.add(low, high) / 2, np.subtract(high, low) / 2)
        for axis in range(3):
            for sign in (-1.0, 1.0):
                around = np.zeros((4, 3))
                around[:, axis] = sign
                around[:, (axis + 1) % 3], around[:, (axis + 2) % 3] = corners[:, 0] * sign, corners[:, 1]
                start = 4 * len(faces) // 2
                positions.append(centre + half * around)
                normals.append(np.tile(np.eye(3)[axis] * sign, (4, 1)))
                faces += [(start, start + 1, start + 2), (start, start + 2, start + 3)]
    return Geometry(
        np.concatenate(positions).astype(np.float32),
        np.array(faces, np.uint32),
        np.concatenate(normals).astype(np.float32),
    )
