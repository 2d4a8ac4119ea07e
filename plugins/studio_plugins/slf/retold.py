"""Between a model's own numbers and the paper's three: matte and shiny albedo, and a level of the lobes.

As in `appearance`, lobes stand for a model's terms. A matte part and a gloss are read back by what they come
to; a shine by the albedo that it gives, from a few amounts of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from studio_plugins.slf.appearance import shape_of
from studio_plugins.slf.dressed import Dressed
from studio_plugins.slf.ladder import LEVELS

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

AMOUNTS = np.concatenate([[0.0], np.geomspace(1e-3, 1.0, 40)])
ROUNDS = 4
"""Times that matte part and shine are found again, each beside the other."""


@dataclass(frozen=True, eq=False)
class Numbers:
    """Of E elements, in the model's own terms: matte and shiny part (E, 3), real level of the ladder (E,)."""

    diffuse: F64
    specular: F64
    level: F64


@dataclass(frozen=True, eq=False)
class Albedos:
    """In the paper's terms: reflectance (E, 3, 2), matte and shiny, and a real level of its lobes (E,)."""

    reflectance: F64
    level: F64

    @property
    def nearest(self) -> I64:
        """(E,) whole levels."""
        return np.clip(np.rint(self.level), 0, LEVELS - 1).astype(np.int64)


class Retold:
    """Of one material: what its terms come to at each level of its gloss."""

    def __init__(self, dressed: Dressed) -> None:
        self._dressed = dressed
        brdf = dressed.resolved.brdf
        self._fits = np.stack([shape_of(brdf.address, brdf.terms, shape) for shape in dressed.shapes()])

    def now(self, uvs: F32, changes: Mapping[str, F32]) -> Numbers:
        """At places with texture coordinates (E, 2) and changes of parameters (E, 1 or 3) on them."""
        dressed = self._dressed
        parts = {}
        for role in ("diffuse", "specular"):
            parts[role] = np.zeros((len(uvs), 3))
            if role in dressed.roles:
                name = dressed.roles[role]
                made = np.asarray(dressed.resolved.values[name], np.float64)
                made = made * dressed.texels(dressed.resolved.textures.get(name), uvs)
                made = made + changes.get(name, np.zeros((1, 1), np.float32))
                parts[role] = np.clip(made, dressed.infos[name].low, dressed.infos[name].high)
        return Numbers(parts["diffuse"], parts["specular"], self._levels(uvs, changes))

    def _levels(self, uvs: F32, changes: Mapping[str, F32]) -> F64:
        dressed = self._dressed
        if "gloss" not in dressed.roles:
            return np.zeros(len(uvs))
        name = dressed.roles["gloss"]
        info = dressed.infos[name]
        gloss = float(np.asarray(dressed.resolved.values[name]).ravel()[0])
        made = gloss * dressed.texels(dressed.resolved.shaping.get(name), uvs)[:, 0].astype(np.float64)
        change = changes.get(name, np.zeros((len(uvs), 1), np.float32))[:, 0]
        made = made * np.exp(change) if info.scale == "log" else made + change
        made = np.clip(made, info.low, info.high)
        some, back = np.unique(made, return_inverse=True)
        return np.array([dressed.level_of(float(one)) for one in some])[back]

    def albedos(self, of: Numbers) -> Albedos:
        """What numbers come to; no more light than arrives."""
        fits = self._at(of.level)
        coefficients = self._dressed.coefficients(of.diffuse, of.specular)
        matte, shine, level = _summed(fits, coefficients)
        whole = np.maximum(matte + shine, 1)
        return Albedos(np.stack([matte / whole, shine / whole], axis=2), level)

    def numbers(self, now: Numbers, before: Albedos, then: Albedos, moved: Bools) -> Numbers:
        """Those that come to what `then` says of what `moved` (E, 3): matte part, shine, gloss."""
        steps = np.where(moved[:, 2], then.level - before.nearest, 0)
        level = self._level_of(now, steps)
        fits, diffuse, specular = self._at(level), now.diffuse, now.specular
        for _ in range(ROUNDS):
            shine = self._shine(fits, diffuse, then.reflectance[..., 1])
            specular = np.where(moved[:, 1:2], shine, now.specular)
            matte = self._matte(fits, specular, then.reflectance[..., 0], now.diffuse)
            diffuse = np.where(moved[:, :1], matte, now.diffuse)
        return Numbers(diffuse, specular, level)

    def _shine(self, fits: F64, diffuse: F64, wanted: F64) -> F64:
        """(E, 3) the amount whose shiny albedo, beside that matte part, is what is wanted."""
        grey = np.broadcast_to(AMOUNTS[:, None, None], (len(AMOUNTS), *diffuse.shape))
        beside = np.broadcast_to(diffuse, grey.shape)
        return _crossing(_summed(fits, self._dressed.coefficients(beside, grey))[1], wanted)

    def _matte(self, fits: F64, specular: F64, wanted: F64, else_: F64) -> F64:
        """(E, 3) the matte part whose albedo, beside that shine, is what is wanted; `else_` if none shows."""
        room = self._dressed.room(specular)
        ends = (np.zeros_like(specular), room)
        low, high = (_summed(fits, self._dressed.coefficients(end, specular))[0] for end in ends)
        rise = high - low
        made = room * np.clip((wanted - low) / np.maximum(rise, 1e-9), 0, 1)
        return np.where(rise > 1e-9, made, else_)

    def changes(self, now: Numbers, then: Numbers) -> dict[str, F32]:
        """By parameter what paint adds at elements: (E, 1) or (E, 3); without those that stay everywhere."""
        dressed, made = self._dressed, dict[str, F64]()
        for role in ("diffuse", "specular"):
            if role in dressed.roles:
                delta = getattr(then, role) - getattr(now, role)
                made[dressed.roles[role]] = delta if dressed.coloured(role) else delta.mean(axis=1)[:, None]
        if "gloss" in dressed.roles:
            name = dressed.roles["gloss"]
            before, after = (np.array([dressed.gloss_of(one) for one in of.level]) for of in (now, then))
            if dressed.infos[name].scale == "log":
                before, after = (np.log(np.maximum(one, 1e-12)) for one in (before, after))
            made[name] = np.where(now.level == then.level, 0, after - before)[:, None]
        return {name: delta.astype(np.float32) for name, delta in made.items() if delta.any()}

    def _at(self, level: F64) -> F64:
        """(E, T, 3) what terms come to at real levels of the ladder."""
        low = np.clip(np.floor(level), 0, len(self._fits) - 1).astype(np.int64)
        share = (level - low)[:, None, None]
        high = np.minimum(low + 1, len(self._fits) - 1)
        return np.asarray((1 - share) * self._fits[low] + share * self._fits[high])

    def _level_of(self, now: Numbers, steps: F64) -> F64:
        """(E,) levels of the ladder at which lobes are so many levels sharper than they are now."""
        shine = np.maximum(now.specular, AMOUNTS[1])  # a gloss of none is as it would be
        coefficients = self._dressed.coefficients(now.diffuse.mean(axis=0), shine.mean(axis=0))
        every = _summed(self._fits, np.broadcast_to(coefficients, (len(self._fits), *coefficients.shape)))[2]
        every = np.maximum.accumulate(every + 1e-9 * np.arange(len(every)))
        ladder = np.arange(len(every))
        found = np.interp(np.interp(now.level, ladder, every) + steps, every, ladder)
        return np.where(steps == 0, now.level, found)


def _summed(fits: F64, coefficients: F64) -> tuple[F64, F64, F64]:
    """Of terms (…, T, 3) with coefficients (…, T, 3): matte and shiny albedo (…, 3), the lobes' level (…)."""
    matte, shine = ((fits[..., k, None] * coefficients).sum(axis=-2) for k in (0, 1))
    share = np.abs(fits[..., 1] * coefficients.mean(axis=-1))
    level = (share * fits[..., 2]).sum(axis=-1) / np.maximum(share.sum(axis=-1), 1e-12)
    return np.maximum(matte, 0), np.maximum(shine, 0), level


def _crossing(shines: F64, wanted: F64) -> F64:
    """(E, 3) the amount at which rising shines (K, E, 3) come to what is wanted."""
    shines = np.maximum.accumulate(shines, axis=0)
    upper = np.clip((shines < wanted).sum(axis=0), 1, len(AMOUNTS) - 1)
    low, high = (np.take_along_axis(shines, at[None], axis=0)[0] for at in (upper - 1, upper))
    share = np.clip((wanted - low) / np.maximum(high - low, 1e-12), 0, 1)
    return np.asarray(AMOUNTS[upper - 1] + share * (AMOUNTS[upper] - AMOUNTS[upper - 1]))


__all__ = ["Albedos", "Numbers", "Retold"]
