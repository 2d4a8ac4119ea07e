"""Lights of Lucarne Studio that Mitsuba 3 lacks, as Mitsuba plugins.

Both are sampled only (no ray meets them), like Mitsuba's own point and directional lights. Set a variant,
import this module, call `register()`, load scene.xml.
"""

from __future__ import annotations

import importlib
import math
from typing import Any

dr: Any = importlib.import_module("drjit")
mi: Any = importlib.import_module("mitsuba")


class _Sampled(mi.Emitter):  # type: ignore[misc]
    """What both share: a place in the world and an RGB gain."""

    def __init__(self, props: Any) -> None:
        mi.Emitter.__init__(self, props)
        self.gain = mi.ScalarVector3f(props.get("gain"))
        world = props.get("to_world").matrix
        columns = [[float(world[row, column]) for row in range(3)] for column in range(4)]
        self.right, self.up, self.axis = (mi.ScalarVector3f(*column) for column in columns[:3])
        self.place = mi.ScalarPoint3f(*columns[3])

    def _colour(self, scale: Any) -> Any:
        return mi.Color3f(self.gain.x * scale, self.gain.y * scale, self.gain.z * scale)

    def _towards(self, it: Any, place: Any) -> Any:
        made = mi.DirectionSample3f()
        made.p = mi.Point3f(place)
        offset = made.p - it.p
        made.dist = dr.norm(offset)
        made.d = offset / made.dist
        made.n = -made.d
        made.uv = mi.Point2f(0, 0)
        made.time = it.time
        made.pdf = mi.Float(1)
        made.delta = mi.Bool(True)
        made.emitter = mi.EmitterPtr(self) if dr.is_jit_v(mi.Float) else self
        return made

    def eval(self, si: Any, active: Any = True) -> Any:
        """No ray meets the light."""
        return mi.Color3f(0)

    def pdf_direction(self, it: Any, ds: Any, active: Any = True) -> Any:
        """No ray meets the light."""
        return mi.Float(0)

    def traverse(self, callback: Any) -> None:
        """Nothing to edit."""

    def to_string(self) -> str:
        """The plugin's name."""
        return type(self).__name__


class Spot(_Sampled):
    """A point that shines along +z: smoothstep of the cosine between the half angles `inner` and `cone`."""

    def __init__(self, props: Any) -> None:
        _Sampled.__init__(self, props)
        self.cone = math.cos(math.radians(float(props.get("cone"))))
        self.inner = math.cos(math.radians(float(props.get("inner"))))
        self.m_flags = +mi.EmitterFlags.DeltaPosition

    def sample_direction(self, it: Any, sample: Any, active: Any = True) -> Any:
        """See mitsuba.Emitter."""
        made = self._towards(it, self.place)
        cosine = -dr.dot(made.d, mi.Vector3f(self.axis))
        if self.inner - self.cone < 1e-9:
            falloff = dr.select(cosine >= self.cone, 1.0, 0.0)
        else:
            t = dr.clip((cosine - self.cone) / (self.inner - self.cone), 0, 1)
            falloff = t * t * (3 - 2 * t)
        weight = self._colour(falloff / (made.dist * made.dist))
        return made, dr.select(active, weight, mi.Color3f(0))

    def bbox(self) -> Any:
        """The point."""
        return mi.ScalarBoundingBox3f(self.place, self.place)


class Sun(_Sampled):
    """A far disc of diameter `angle` (degrees) that shines along +z; gain is irradiance facing it."""

    def __init__(self, props: Any) -> None:
        _Sampled.__init__(self, props)
        self.spread = math.tan(math.radians(float(props.get("angle"))) / 2)
        self.distance = float(props.get("distance"))
        self.m_flags = mi.EmitterFlags.DeltaDirection | mi.EmitterFlags.Infinite

    def sample_direction(self, it: Any, sample: Any, active: Any = True) -> Any:
        """See mitsuba.Emitter; every direction of the disc has the same weight."""
        disc = mi.warp.square_to_uniform_disk_concentric(sample) * self.spread
        aim = -mi.Vector3f(self.axis) + disc.x * mi.Vector3f(self.right) + disc.y * mi.Vector3f(self.up)
        made = self._towards(it, it.p + dr.normalize(aim) * self.distance)
        return made, dr.select(active, self._colour(mi.Float(1)), mi.Color3f(0))

    def bbox(self) -> Any:
        """Infinitely far: nothing of the scene."""
        return mi.ScalarBoundingBox3f()


def register() -> None:
    """Make the lights known to the variant that is set."""
    mi.register_emitter("lucarne_spot", Spot)
    mi.register_emitter("lucarne_sun", Sun)
