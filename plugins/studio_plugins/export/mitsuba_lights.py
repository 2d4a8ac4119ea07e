"""Lights and cameras for Mitsuba 3.

================  ==================================================================================
light             Mitsuba
================  ==================================================================================
environment       `envmap` of env.exr with the gain multiplied in
point             `point`
spot              `lucarne_spot` (emitters.py): the studio's falloff; native `spot`'s is another
directional       `directional` where its angle is 0, else `lucarne_sun` (emitters.py), a disc
area              `rectangle` with an `area` emitter and a black back
================  ==================================================================================
"""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from studio_core.imaging.encode import write_exr
from studio_core.scene.bounds import scene_bounds
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import (
    AreaLamp,
    Camera,
    DirectionalLamp,
    Environment,
    Light,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.session import View, framing
from studio_core.shading.materials import linear_rgb
from studio_plugins.export.mitsuba_xml import matrix, prop, put, rgb, vector

F64 = npt.NDArray[np.float64]
TURN = np.diag([-1.0, 1.0, -1.0, 1.0])  # Mitsuba looks and shines along +z, with +x on the left


def resampled(image: Image) -> npt.NDArray[np.float32]:
    """(2H + 1, W, 3) radiance such that Mitsuba interpolates it as the studio does.

    Mitsuba's first and last row lie on the poles, ours half a pixel away. With rows at the centres and the
    borders of ours, linear interpolation gives the same everywhere (poles: the nearest row).
    """
    pixels = linear_rgb(image)
    height, width, _ = pixels.shape
    made = np.empty((2 * height + 1, width, 3), np.float32)
    made[1::2] = pixels
    made[2:-1:2] = 0.5 * (pixels[:-1] + pixels[1:])
    made[0], made[-1] = pixels[0], pixels[-1]
    return made


def add_lights(root: Element, scene: Scene, folder: Path) -> tuple[list[str], bool]:
    """Write every shown light; notes, and whether the environment is to be seen."""
    notes, visible = [], True
    shown = [light for light in scene.of(Light) if scene.shown(light.id)]
    environments = [light for light in shown if isinstance(light, Environment)]
    for extra in environments[1:]:
        notes.append(f"{extra.name}: Mitsuba takes one environment; this one was left out.")
    for environment in environments[:1]:
        _environment(root, environment, folder)
        visible = environment.background
    low, high = scene_bounds(scene)
    reach = max(float(np.linalg.norm(high - low)), 1.0)
    for light in shown:
        world = _rigid(scene.world(light.id).matrix())
        if isinstance(light, AreaLamp):
            _area(root, light, scene.world(light.id).matrix())
            notes.append(f"{light.name}: in Mitsuba the lamp can be seen and stands in the light's way.")
        elif isinstance(light, PointLamp):
            made = put(root, "emitter", "point")
            rgb(made, "intensity", light.gain())
            held = put(made, "point", name="position")
            held.attrib.update({a: repr(float(v)) for a, v in zip("xyz", world[:3, 3], strict=True)})
        elif isinstance(light, SpotLamp):
            made = put(root, "emitter", "lucarne_spot")
            vector(made, "gain", light.gain())
            prop(made, "float", "cone", float(light.cone))
            prop(made, "float", "inner", float(min(light.inner, light.cone)))
            matrix(made, "to_world", world @ TURN)
        elif isinstance(light, DirectionalLamp) and light.angle <= 0:
            made = put(root, "emitter", "directional")
            rgb(made, "irradiance", light.gain())
            vector(made, "direction", -world[:3, 2])
        elif isinstance(light, DirectionalLamp):
            made = put(root, "emitter", "lucarne_sun")
            vector(made, "gain", light.gain())
            prop(made, "float", "angle", float(light.angle))
            prop(made, "float", "distance", 4 * reach)
            matrix(made, "to_world", world @ TURN)
    return notes, visible


def _rigid(world: F64) -> F64:
    made = world.copy()
    made[:3, :3] /= np.linalg.norm(made[:3, 0])
    return made


def _environment(root: Element, light: Environment, folder: Path) -> None:
    gain = np.asarray(light.gain(), np.float32)
    write_exr(folder / "env.exr", resampled(light.image) * gain)
    made = put(root, "emitter", "envmap", key="environment")
    prop(made, "string", "filename", "env.exr")
    matrix(made, "to_world", light.rotation().matrix())


def _area(root: Element, light: AreaLamp, world: F64) -> None:
    made = put(root, "shape", "rectangle")  # spans −1…1 and shines along +z
    matrix(made, "to_world", world @ TURN @ np.diag([light.width / 2, light.height / 2, 1.0, 1.0]))
    rgb(put(made, "emitter", "area"), "radiance", light.gain())
    rgb(put(made, "bsdf", "diffuse"), "reflectance", (0, 0, 0))


def add_cameras(root: Element, scene: Scene, camera: str | None, size: tuple[int, int]) -> list[str]:
    """Write the cameras, the chosen one (by name or id) first; where there is none, the studio's view."""
    cameras = list(scene.of(Camera))
    cameras.sort(key=lambda c: camera not in (c.name, c.id))
    for found in cameras:
        _camera(root, scene.world(found.id).matrix(), found.fov)
    if cameras:
        return []
    view = framing(*scene_bounds(scene), View(width=size[0], height=size[1]))
    _camera(root, view.transform.matrix(), view.fov)
    return ["The scene has no camera; one that sees everything was added."]


def _camera(root: Element, world: F64, fov: float) -> None:
    made = put(root, "sensor", "perspective")
    matrix(made, "to_world", _rigid(world) @ TURN)
    prop(made, "string", "fov_axis", "y")
    prop(made, "float", "fov", float(fov))
    prop(made, "float", "near_clip", 1e-3)
    prop(made, "float", "far_clip", 1e5)
    film = put(made, "film", "hdrfilm")
    prop(film, "integer", "width", "$width")
    prop(film, "integer", "height", "$height")
    prop(film, "string", "pixel_format", "rgb")
    prop(film, "string", "component_format", "float32")
    put(film, "rfilter", "box")
    prop(put(made, "sampler", "$sampler"), "integer", "sample_count", "$spp")
