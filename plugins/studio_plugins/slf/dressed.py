"""A material as solvers see it: matte and shiny reflectance and a gloss level, whatever its model is.

Which parameters these are, the model says (`studio_core.contract.PaintableBrdf`). Coefficients are the
model's own, so what is solved for is what is shaded.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.contract import Registry
from studio_core.params import ParamInfo, param_infos
from studio_core.scene.geometry import Texture
from studio_core.scene.nodes import Material
from studio_core.shading.materials import Resolved, finite_shape, linear_rgb, resolve, scalar
from studio_core.strokes.paintable import material_roles
from studio_plugins.slf.joint import EVERY, Change
from studio_plugins.slf.ladder import LEVELS, alpha_of_level, level_of_alpha
from studio_plugins.slf.samples import F64, Reflectance

F32 = npt.NDArray[np.float32]
ROLES = {"diffuse": Change.DIFFUSE, "specular": Change.SPECULAR, "gloss": Change.GLOSS}
STRAIGHT = 1e-4  # of a coefficient, by which it may bend
NEUTRAL = 0.5


@dataclass(frozen=True, eq=False)
class Dressed:
    """A material with its model and the parameters that play a part; satisfies `samples.Model`."""

    material: Material
    resolved: Resolved
    roles: Mapping[str, str]
    infos: Mapping[str, ParamInfo]

    @staticmethod
    def of(material: Material, registry: Registry) -> Dressed | None:
        """None where nothing of it can be painted."""
        roles = material_roles(material, registry)
        resolved = resolve(material, registry)
        if not roles or resolved.problem or material.catches:
            return None
        return Dressed(material, resolved, roles, param_infos(resolved.brdf.Params))

    @property
    def can(self) -> Change:
        """What of it can change."""
        made = Change.NONE
        for role, change in ROLES.items():
            made |= change if role in self.roles else Change.NONE
        return made

    @property
    def allowed(self) -> tuple[Change, ...]:
        """Every set of that."""
        return tuple(change for change in EVERY if change & self.can == change)

    @property
    def white(self) -> bool:
        """Whether its shine has no colour of its own to choose."""
        return "specular" in self.roles and not self.coloured("specular")

    # -- coefficients ------------------------------------------------------------------------------

    def coefficients(self, diffuse: F64, specular: F64) -> F64:
        """(…, T, 3); see `samples.Model`."""
        diffuse, specular = np.broadcast_arrays(diffuse, specular)
        values: dict[str, Any] = {**self.resolved.values}
        for role, colour in (("diffuse", diffuse), ("specular", specular)):
            if role in self.roles:
                values[self.roles[role]] = colour if self.coloured(role) else colour.max(axis=-1)
        played = {self.roles[role] for role in ("diffuse", "specular") if role in self.roles}
        count = diffuse.shape[:-1]
        every: dict[str, F32] = {}
        for name, value in values.items():
            if isinstance(value, str | bool):
                continue
            array = np.asarray(value, np.float32)
            every[name] = array if name in played else np.broadcast_to(array, (*count, *array.shape))
        return np.asarray(self.resolved.brdf.coefficients(every), np.float64)

    def room(self, specular: F64) -> F64:
        """(…, 3): 1 where the model itself keeps its matte part below what the shine leaves, else 1 − s."""
        if "diffuse" not in self.roles:
            return np.ones_like(specular)
        return np.ones_like(specular) if self._keeps_energy else np.clip(1 - specular, 0, 1)

    @cached_property
    def _keeps_energy(self) -> bool:
        """Whether coefficients are affine in the matte part beside any shine."""
        shine = np.full(3, NEUTRAL)
        low, middle, high = (self.coefficients(np.full(3, d), shine) for d in (0.0, 0.5, 1.0))
        return bool(np.abs(low + high - 2 * middle).max() <= STRAIGHT * max(float(np.abs(high).max()), 1e-9))

    # -- gloss -------------------------------------------------------------------------------------

    def shapes(self) -> F32:
        """(L, D) the shape at each level; one level where it has no gloss."""
        values = self.resolved.typical()
        brdf = self.resolved.brdf
        if "gloss" not in self.roles:
            return np.stack([finite_shape(brdf, values)])
        name = self.roles["gloss"]
        return np.stack(
            [finite_shape(brdf, {**values, name: self.gloss_of(level)}) for level in range(LEVELS)]
        )

    def own_shape(self, gloss: float | None) -> F32:
        """(D,) as it is now, with that gloss."""
        values = {**self.resolved.typical()}
        if gloss is not None:
            values[self.roles["gloss"]] = gloss
        return finite_shape(self.resolved.brdf, values)

    def gloss_of(self, level: float) -> float:
        """The model's parameter, within its range."""
        info = self.infos[self.roles["gloss"]]
        made = self.resolved.brdf.gloss(float(alpha_of_level(level)))  # type: ignore[attr-defined]
        return float(np.clip(made, info.low, info.high))

    def level_of(self, gloss: float) -> float:
        """The inverse, within the ladder."""
        return float(level_of_alpha(self.resolved.brdf.alpha(gloss)))  # type: ignore[attr-defined]

    # -- as it is ----------------------------------------------------------------------------------

    def now(self, uvs: F32, changes: Mapping[str, F64]) -> tuple[Reflectance, float | None]:
        """In the mean over places with texture coordinates (N, 2), with mean changes of parameters on it.

        And the gloss as the model has it, None where it has none.
        """
        colours = {}
        for role in ("diffuse", "specular"):
            if role not in self.roles:
                colours[role] = np.zeros(3)
                continue
            name = self.roles[role]
            plain = np.broadcast_to(np.asarray(self.resolved.values[name], np.float64), (3,))
            made = plain * self._texel(self.resolved.textures.get(name), uvs)
            made = made + np.asarray(changes.get(name, 0.0), np.float64)
            info = self.infos[name]
            colours[role] = np.clip(made, info.low, info.high)
        gloss: float | None = None
        level = 0.0
        if "gloss" in self.roles:
            name = self.roles["gloss"]
            info = self.infos[name]
            texel = self._texel(self.resolved.shaping.get(name), uvs)
            gloss = scalar(self.resolved.values[name]) * float(texel[0])
            change = float(np.asarray(changes.get(name, 0.0)).ravel()[0])
            gloss = gloss * math.exp(change) if info.scale == "log" else gloss + change
            gloss = float(np.clip(gloss, info.low, info.high))
            level = self.level_of(gloss)
        return Reflectance(colours["diffuse"], colours["specular"], level), gloss

    def _texel(self, texture: Texture | None, uvs: F32) -> F64:
        """(3,) the mean of a picture at places."""
        made: F64 = np.ones(3) if not len(uvs) else self.texels(texture, uvs).mean(axis=0, dtype=np.float64)
        return made

    @staticmethod
    def texels(texture: Texture | None, uvs: F32) -> F32:
        """(N, 3) of a picture at places; 1 without one."""
        if texture is None:
            return np.ones((len(uvs), 3), np.float32)
        pixels = linear_rgb(texture.image)[::-1]
        height, width = pixels.shape[:2]
        at = texture.placed(uvs) % 1.0
        rows = np.minimum((at[:, 1] * height).astype(np.int64), height - 1)
        columns = np.minimum((at[:, 0] * width).astype(np.int64), width - 1)
        made: F32 = pixels[rows, columns]
        return made

    # -- changes -----------------------------------------------------------------------------------

    def changes(
        self, now: Reflectance, gloss: float | None, then: Reflectance, change: Change
    ) -> dict[str, F64]:
        """By parameter what paint adds, (1,) or (3,): `then` instead of `now`, of what changes."""
        made: dict[str, F64] = {}
        pairs = (("diffuse", now.diffuse, then.diffuse), ("specular", now.specular, then.specular))
        for role, before, after in pairs:
            if ROLES[role] in change:
                delta = after - before
                made[self.roles[role]] = delta if self.coloured(role) else delta[:1]
        if Change.GLOSS in change and gloss is not None:
            name, after_ = self.roles["gloss"], self.gloss_of(then.level)
            if self.infos[name].scale == "log":
                made[name] = np.array([math.log(max(after_, 1e-12) / max(gloss, 1e-12))])
            else:
                made[name] = np.array([after_ - gloss])
        return made

    def values(self, then: Reflectance) -> dict[str, float | tuple[float, float, float]]:
        """Parameters that play a part, by name."""
        made: dict[str, float | tuple[float, float, float]] = {}
        for role, colour in (("diffuse", then.diffuse), ("specular", then.specular)):
            if role in self.roles:
                red, green, blue = (float(c) for c in colour)
                made[self.roles[role]] = (red, green, blue) if self.coloured(role) else red
        if "gloss" in self.roles:
            made[self.roles["gloss"]] = self.gloss_of(then.level)
        return made

    def coloured(self, role: str) -> bool:
        """Whether the parameter that plays a part is a colour."""
        return np.ndim(self.resolved.values[self.roles[role]]) == 1


__all__ = ["Dressed"]
