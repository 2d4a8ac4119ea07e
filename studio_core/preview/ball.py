"""A ball of a material in a scene's own light, as a scene-linear picture.

The eye is far away, so light and reflectance meet on rings of equal angle to the view: there the model's
kernel is called once a ring, and the light along a fan of directions (`preview.fan`) is looked up once a
light. Their product, a small matrix product, is what another roughness costs; another colour only multiplies
terms with coefficients, pixel by pixel, through the ball's own texture coordinates. Models with a grain are
called at every point, of fewer. Nothing stands around the ball: it casts no shadow on itself and mirrors the
environment alone. Suns are widened to what rings can show, about 2°, and keep their light.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from studio_core.brdfs.calls import evaluate
from studio_core.contract import Brdf, Registry
from studio_core.preview.fan import DIRECTIONS, Fan, fan
from studio_core.preview.leaning import leaning
from studio_core.preview.light import PreviewLight
from studio_core.preview.sphere import Sphere, disc, over_disc, sphere
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import Material
from studio_core.shading.materials import Resolved, linear_rgb, resolve
from studio_core.shading.normal_maps import normal_texture, strength, unit_normals

F32 = npt.NDArray[np.float32]
T = TypeVar("T")

SMALL = 72  # pixels up to which fewer rings do
_TEXELS = 512  # of a texture's longer side
_SPREAD = 1.5  # radius of a sun in steps from ring to ring
_AROUND = 6  # directions around the middle of a widened sun
_LIGHTS, _TERMS, _TEXTURES = 4, 24, 16  # kept
_COARSE = (
    20,
    40,
)  # rings and points on each: for small balls, and where every point needs a kernel of its own
_COARSE_SUNS = (24, 72)


@dataclass(frozen=True, eq=False)
class _Lit:
    """What one light gives to one set of rings.

    sky (R, T·3, J): radiance along each ring's fan, `fans`; sun (R, T, Q, 3) directions in shading frames,
    cosines above the surface included in irradiance (R, T, Q, 3).
    """

    points: Sphere
    fans: tuple[Fan, ...]
    sky: F32
    fine: Sphere
    sun: F32 | None
    irradiance: F32 | None


class Balls:
    """Renders balls, and keeps what light, shapes and textures have in common. For one thread at a time.

    `counts` tells how often light was gathered, kernels were called, and terms were summed.
    """

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._lit: _Kept[_Lit] = _Kept(_LIGHTS)
        self._terms: _Kept[F32] = _Kept(_TERMS)
        self._textures: _Kept[F32] = _Kept(_TEXTURES)
        self.counts = {"gathered": 0, "kernels": 0, "summed": 0}

    def picture(self, material: Material, light: PreviewLight, size: int) -> Image:
        """(size, size, 4) scene-linear at the light's unit gain, alpha is coverage times opacity.

        What is wrong with the material is shown as in a scene: unknown models are matte grey. Pictures of its
        shape, such as of roughness, count as their mean.
        """
        if size < 8:
            raise ValueError(f"a ball of {size} pixels shows nothing")
        resolved = resolve(material, self._registry)
        typical = resolved.typical(lambda image: float(self._small(image)[..., 0].mean()))
        shape = np.atleast_1d(np.asarray(resolved.brdf.shape(typical), np.float32))
        key = (light.key, size, resolved.brdf, shape.tobytes())
        terms = self._terms.get(key, lambda: self._sum(resolved.brdf, shape, light, size))
        at = disc(size, *_COARSE)  # whatever rings there were: pixels and their places are the same
        bumps = normal_texture(material)
        if bumps is not None:
            normals = self._normals(bumps, strength(material), at.uv)
            terms = leaning(terms, size, at, normals, bumps)
        summed = np.einsum("pkc,pkc->pc", terms, self._coefficients(resolved, at.uv), optimize=False)
        colour = np.maximum(summed, 0)  # captured materials have coefficients below 0
        made = np.zeros((size, size, 4), np.float32)
        made[at.rows, at.columns, :3] = np.nan_to_num(colour, nan=0.0, posinf=3e38, neginf=0.0)
        made[at.rows, at.columns, 3] = at.coverage * material.opacity
        return Image(made)

    def _sum(self, brdf: Brdf, shape: F32, light: PreviewLight, size: int) -> F32:
        """(P, terms, 3): light times kernels, over all directions."""
        grained = _has_grain(brdf, shape)
        rings, fine = (_COARSE, _COARSE_SUNS) if grained else (_rings(size), _fine(size))
        lit = self._lit.get((light.key, rings, fine), lambda: self._gather(light, rings, fine))
        self.counts["summed"] += 1
        turns = lit.points.frames.shape[1]
        made = np.empty((len(lit.fans), turns, 3, brdf.terms), np.float32)
        for ring, own in enumerate(lit.fans):
            sky = lit.sky[ring]
            weight = (own.wi[:, 2] * own.solid)[:, None]
            if not grained:
                self.counts["kernels"] += 1
                made[ring] = (sky @ (evaluate(brdf, shape, own.wo, own.wi) * weight)).reshape(turns, 3, -1)
                continue
            for turn, angle in enumerate(lit.points.grain[ring]):
                self.counts["kernels"] += 1
                values = evaluate(brdf, shape, _turned(own.wo, angle), _turned(own.wi, angle))
                made[ring, turn] = sky[3 * turn : 3 * turn + 3] @ (values * weight)
        pixels = over_disc(made, disc(size, *rings))
        if lit.sun is not None and lit.irradiance is not None:
            shone = self._shine(brdf, shape, lit.fine, lit.sun, lit.irradiance, grained)
            pixels = pixels + over_disc(shone, disc(size, *fine))
        return np.ascontiguousarray(pixels.transpose(0, 2, 1))

    def _shine(self, brdf: Brdf, shape: F32, points: Sphere, sun: F32, irradiance: F32, grained: bool) -> F32:
        """(R, T, 3, terms) of the suns."""
        rings, turns, samples = sun.shape[:3]
        made = np.empty((rings, turns, 3, brdf.terms), np.float32)
        for ring, cosine in enumerate(points.cosines):
            wo = np.array([np.sqrt(1 - cosine * cosine), 0, cosine], np.float32)
            if grained:
                values = np.empty((turns, samples, brdf.terms), np.float32)
                for turn, angle in enumerate(points.grain[ring]):
                    wi = _turned(sun[ring, turn], angle)
                    values[turn] = evaluate(brdf, shape, _turned(wo, angle), wi)
            else:
                values = evaluate(brdf, shape, wo, sun[ring].reshape(-1, 3)).reshape(turns, samples, -1)
            made[ring] = irradiance[ring].transpose(0, 2, 1) @ values
        self.counts["kernels"] += rings * (turns if grained else 1)
        return made

    def _gather(self, light: PreviewLight, rings: tuple[int, int], finer: tuple[int, int]) -> _Lit:
        self.counts["gathered"] += 1
        points, fine = sphere(*rings), sphere(*finer)
        fans = tuple(fan(float(cosine)) for cosine in points.cosines)
        turns = points.frames.shape[1]
        sky = np.empty((len(fans), turns * 3, DIRECTIONS), np.float32)
        for ring, own in enumerate(fans):
            toward = own.wi @ points.frames[ring]  # (T, J, 3)
            seen = light.radiance(toward, own.solid)
            sky[ring] = seen.transpose(0, 2, 1).reshape(turns * 3, -1)
        if light.sun is None:
            return _Lit(points, fans, sky, fine, None, None)
        ways, power = _widened(light, _SPREAD * np.pi / 2 / len(fine.cosines))
        local = np.einsum("rtij,qj->rtqi", fine.frames, ways, optimize=True).astype(np.float32)
        irradiance = (np.maximum(local[..., 2:], 0) * power).astype(np.float32)
        return _Lit(points, fans, sky, fine, local, irradiance)

    def _coefficients(self, resolved: Resolved, uv: F32) -> F32:
        """(P or 1, terms, 3)."""
        values: dict[str, Any] = {}
        for name, value in resolved.values.items():
            if isinstance(value, str | bool):
                continue
            number = np.asarray(value, np.float32)
            texture = resolved.textures.get(name)
            if texture is not None:
                texels = self._texels(texture, uv)
                number = number * (texels[:, 0] if number.ndim == 0 else texels)
            values[name] = number
        if resolved.textures:
            for name, number in values.items():
                if name not in resolved.textures:
                    values[name] = np.broadcast_to(number, (len(uv), *number.shape))
            return np.asarray(resolved.brdf.coefficients(values), np.float32)
        return np.asarray(resolved.brdf.coefficients(values), np.float32)[None]

    def _small(self, image: Image) -> F32:
        return self._textures.get(image.key, lambda: _small(image))

    def _texels(self, texture: Texture, uv: F32) -> F32:
        """(P, 3) of the picture made small, between its texels."""
        return _between(self._small(texture.image), texture, uv)

    def _normals(self, texture: Texture, strong: float, uv: F32) -> F32:
        """(P, 3) unit normals in the frame of a normal map made small."""
        image = texture.image
        key = f"normals {image.key}"
        small = self._textures.get(key, lambda: _shrunk(unit_normals(image)))
        made = _between(small, texture, uv) * np.array([strong, strong, 1], np.float32)
        return np.asarray(made / np.linalg.norm(made, axis=1, keepdims=True), np.float32)


def _between(small: F32, texture: Texture, uv: F32) -> F32:
    """(P, 3) between texels (h, w, 3), rows from v = 0 up, of a picture as it lies."""
    height, width = small.shape[:2]
    place = texture.placed(uv)
    x, y = place[:, 0] * width - 0.5, place[:, 1] * height - 0.5
    left, low = np.floor(x), np.floor(y)
    across, up = (x - left)[:, None].astype(np.float32), (y - low)[:, None].astype(np.float32)
    x0, y0 = left.astype(np.int64) % width, low.astype(np.int64) % height
    x1, y1 = (x0 + 1) % width, (y0 + 1) % height
    lower = small[y0, x0] * (1 - across) + small[y0, x1] * across
    upper = small[y1, x0] * (1 - across) + small[y1, x1] * across
    return np.asarray(lower * (1 - up) + upper * up, np.float32)


def ball(
    material: Material, light: PreviewLight, size: int, registry: Registry, balls: Balls | None = None
) -> Image:
    """One picture (size, size, 4) of a ball; see `Balls.picture`. `balls` keeps what several share."""
    return (balls or Balls(registry)).picture(material, light, size)


class _Kept(Generic[T]):
    """The last few results by what they depend on."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._known: OrderedDict[Hashable, T] = OrderedDict()

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        if key in self._known:
            self._known.move_to_end(key)
            return self._known[key]
        made = self._known[key] = make()
        if len(self._known) > self._most:
            self._known.popitem(last=False)
        return made


def _rings(size: int) -> tuple[int, int]:
    """Rings and points on each that the sky is gathered at."""
    return _COARSE if size <= SMALL else (48, 96)


def _fine(size: int) -> tuple[int, int]:
    """The same for suns, whose highlights are smaller."""
    rings = min(max(size // 2, 12), 96)
    return rings, 4 * ((3 * rings + 3) // 4)


def _small(image: Image) -> F32:
    """(h, w, 3) scene-linear, rows from v = 0 up."""
    return _shrunk(linear_rgb(image))


def _shrunk(pixels: F32) -> F32:
    """The same of pixels, rows from the top."""
    height, width = pixels.shape[:2]
    if max(height, width) > _TEXELS:
        from studio_core.imaging.resample import resize_area

        scale = _TEXELS / max(height, width)
        pixels = resize_area(pixels, max(round(height * scale), 1), max(round(width * scale), 1))
    return np.ascontiguousarray(pixels[::-1])


def _turned(directions: F32, angle: float) -> F32:
    """Directions (..., 3) in a frame whose x axis is turned by `angle` about z."""
    cosine, sine = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
    return np.stack([cosine * x + sine * y, cosine * y - sine * x, z], axis=-1)


def _widened(light: PreviewLight, radius: float) -> tuple[F32, F32]:
    """Directions (Q, 3) and irradiance (Q, 3) of suns with every sample spread over a disc, radians."""
    assert light.sun is not None
    middle = light.sun.directions
    other = np.where(np.abs(middle[:, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    across = np.cross(other, middle)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    up = np.cross(middle, across)
    turn = 2 * np.pi * np.arange(_AROUND) / _AROUND
    flat = np.concatenate([[[0.0, 0.0]], 0.8 * radius * np.stack([np.cos(turn), np.sin(turn)], 1)])
    ways = middle[:, None] + flat[:, :1] * across[:, None] + flat[:, 1:] * up[:, None]
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    power = np.repeat(light.sun.irradiance / len(flat), len(flat), axis=0)
    return ways.reshape(-1, 3).astype(np.float32), power.astype(np.float32)


def _has_grain(brdf: Brdf, shape: F32) -> bool:
    """Whether the kernel tells directions around the normal apart."""
    rng = np.random.default_rng(5)
    wi = rng.standard_normal((64, 3)).astype(np.float32)
    wi[:, 2] = np.abs(wi[:, 2])
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    wo = np.array([0.6, 0.0, 0.8], np.float32)
    mirrored = np.array([-0.6, 0.0, 0.8], np.float32)  # and around it, where lobes are
    wi[:32] = mirrored + 0.2 * wi[:32] * np.linspace(0, 1, 32, dtype=np.float32)[:, None]
    wi /= np.linalg.norm(wi, axis=1, keepdims=True)
    straight = evaluate(brdf, shape, wo, wi)
    for angle in (0.7, 1.9):
        turned = evaluate(brdf, shape, _turned(wo, angle), _turned(wi, angle))
        if not np.allclose(turned, straight, rtol=1e-2, atol=1e-3 * float(np.abs(straight).max(initial=0))):
            return True
    return False


__all__ = ["SMALL", "Balls", "ball"]
