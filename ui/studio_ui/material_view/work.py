"""Previews are made beside the window's thread: one at a time, the newest wish of each kind alone."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, Material
from studio_core.shading.job import Job
from studio_ui.context import Context

if TYPE_CHECKING:
    from studio_core.preview.ball import Balls
    from studio_core.preview.light import PreviewLight

F64 = npt.NDArray[np.float64]
Linear = npt.NDArray[np.float32]
ALBEDO_ANGLES = np.concatenate([np.arange(0, 75, 5.0), np.arange(75, 90, 2.5), [89.5]])


@dataclass(frozen=True)
class Wish:
    """What is to be seen: a material, perhaps another to compare it with, at sizes and an angle.

    `light` is `light_of(environment)`. `quick` while a hand drags. A size of 0 leaves the ball out.
    """

    material: Material
    other: Material | None
    light: Hashable
    size: int
    incidence: float
    cosine: bool
    lobe: bool
    albedo: bool
    quick: bool = False
    environment: Environment | None = field(default=None, compare=False)


def light_of(environment: Environment | None) -> Hashable:
    """What balls at unit gain depend on; the picture by identity, for hashing its pixels would take long."""
    if environment is None:
        return None
    return weakref.ref(environment.image), environment.azimuth, environment.tilt


@dataclass(frozen=True, eq=False)
class Sight:
    """One material: ball (S, S, 4) scene-linear at the light's unit gain, curves as in `preview.curves`."""

    ball: Linear | None
    lobe: tuple[F64, F64] | None
    albedo: F64 | None


@dataclass(frozen=True, eq=False)
class Seen:
    """What was made of a wish; `other` where there was one. `neutral`: not the scene's own light."""

    wish: Wish
    own: Sight
    other: Sight | None
    neutral: bool


class PreviewWork:
    """Wishes by name: a newer one takes the place of one that waits. `urgent` ones go first.

    What fails is answered with None: the scene's own picture, made of the same models, tells why.
    """

    def __init__(self, context: Context) -> None:
        self._context = context
        self._bench = _Bench(context)
        self._waiting: dict[str, tuple[Callable[[_Bench], Any], Callable[[Any], object]]] = {}
        self._busy = self._closed = False
        self.made = 0  # wishes answered

    @property
    def busy(self) -> bool:
        """Whether something is made or waits."""
        return self._busy or bool(self._waiting)

    def close(self) -> None:
        """Answer nobody any more."""
        self._closed = True
        self._waiting.clear()

    def see(self, wish: Wish, done: Callable[[Seen | None], object]) -> None:
        """Make what a wish asks for, before all thumbnails."""
        self._ask("", lambda bench: bench.see(wish), done, urgent=True)

    def thumbnail(
        self,
        material: Material,
        environment: Environment | None,
        size: int,
        done: Callable[[tuple[Linear, bool] | None], object],
        whole: Callable[[], Material] | None = None,
    ) -> None:
        """A ball of so many pixels, and whether in neutral light. `whole` reads what `material` lacks."""

        def make(bench: _Bench) -> tuple[Linear, bool]:
            return bench.thumbnail(material if whole is None else whole(), environment, size)

        self._ask(material.id, make, done)

    def forget(self, material: str) -> bool:
        """Make no thumbnail of it after all; False where none waits."""
        return bool(material) and self._waiting.pop(material, None) is not None

    def _ask(
        self, name: str, work: Callable[[_Bench], Any], done: Callable[[Any], object], urgent: bool = False
    ) -> None:
        if self._closed:
            return
        self._waiting.pop(name, None)
        if urgent:
            self._waiting = {name: (work, done), **self._waiting}
        else:
            self._waiting[name] = (work, done)
        self._next()

    def _next(self) -> None:
        if self._busy or self._closed or not self._waiting or not self._context.warm:
            return
        self._busy = True
        work, done = self._waiting.pop(next(iter(self._waiting)))

        def attempt(job: Job) -> Any:
            try:
                return work(self._bench)
            except Exception:  # a model's own fault; shading meets it too, and says so
                return None

        def ended(result: Any) -> None:
            self._busy = False
            self.made += 1
            if not self._closed:
                done(result)
            self._next()

        def failed(error: Exception) -> None:
            ended(None)

        self._context.tasks.run("Preview", attempt, ended, failed, quiet=True, executor=self._context.aside)

    def warmed(self) -> None:
        """Models are there now."""
        self._next()


class _Bench:
    """What lives on the other thread: light and balls, kept from wish to wish."""

    def __init__(self, context: Context) -> None:
        self._registry = context.host
        self._balls: Balls | None = None
        self._light: PreviewLight | None = None
        self._wanted: tuple[object, ...] = ()
        self._means: weakref.WeakKeyDictionary[Image, F64] = weakref.WeakKeyDictionary()

    def see(self, wish: Wish) -> Seen:
        own = self._sight(wish, wish.material)
        other = self._sight(wish, wish.other) if wish.other is not None else None
        return Seen(wish, own, other, self._lit(wish.environment).key == ("neutral",))

    def thumbnail(
        self, material: Material, environment: Environment | None, size: int
    ) -> tuple[Linear, bool]:
        light = self._lit(environment)
        return self._ball(material, light, size), light.key == ("neutral",)

    def _sight(self, wish: Wish, material: Material) -> Sight:
        from studio_core.preview.curves import albedo, averaged, lobe
        from studio_core.shading.materials import resolve

        resolved = averaged(resolve(material, self._registry), self._mean)
        picture = self._ball(material, self._lit(wish.environment), wish.size) if wish.size else None
        around = lobe(resolved, wish.incidence, cosine=wish.cosine) if wish.lobe else None
        share = albedo(resolved, ALBEDO_ANGLES, quick=wish.quick) if wish.albedo else None
        return Sight(picture, around, share)

    def _ball(self, material: Material, light: PreviewLight, size: int) -> Linear:
        if self._balls is None:
            from studio_core.preview.ball import Balls

            self._balls = Balls(self._registry)
        return self._balls.picture(material, light, size).pixels

    def _mean(self, image: Image) -> F64:
        from studio_core.shading.materials import linear_rgb

        if image not in self._means:
            self._means[image] = linear_rgb(image).mean(axis=(0, 1), dtype=np.float64)
        return self._means[image]

    def _lit(self, environment: Environment | None) -> PreviewLight:
        from studio_core.preview.light import environment_key, environment_light

        if environment is None:
            return environment_light(None)
        key = environment_key(environment)
        if self._light is None or self._wanted != key:
            try:
                self._light = environment_light(environment)
            except InputError:
                self._light = environment_light(None)
            self._wanted = key
        return self._light


__all__ = ["ALBEDO_ANGLES", "PreviewWork", "Seen", "Sight", "Wish", "light_of"]
