"""The inputs of one shader, as the fields of a `Surface`: numbers and colours, and their pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from studio_core.exchange.pictures import Pictures, channel_of, mean_of, opaque
from studio_core.exchange.placing import laid
from studio_core.exchange.surface import NORMAL
from studio_core.params import Colour
from studio_core.scene.geometry import Image, Texture
from studio_core.shading.materials import linear
from studio_plugins.materialx.graph import Found, Graph

_SRGB = ("srgb_texture", "srgb", "srgb_rec709_scene", "gamma22", "g22_rec709")
_LINEAR = ("", "none", "raw", "lin_rec709", "lin_rec709_scene", "linear")


@dataclass
class Slots:
    """One shader node; `textures` by the field of `Surface` that they multiply."""

    node: Any
    graph: Graph
    pictures: Pictures
    name: str
    tell: Callable[[str], object]
    textures: dict[str, Texture] = field(default_factory=dict)

    def say(self, what: str) -> None:
        """A sentence about this material."""
        self.tell(f"{self.name}: {what}.")

    def plain(self, source: str, default: float) -> float:
        """A number; of a picture its mean."""
        found = self.graph.input(self.node, source)
        if found is None:
            return default
        value = found.factor[0]
        if found.file and (image := self._numbers(found)) is not None:
            value *= mean_of(image, found.channel or 0)
            self.say(f"the mean of the picture of its {source.replace('_', ' ')} is used")
        return value

    def plain_colour(self, source: str, default: Colour) -> Colour:
        """A colour; of a picture its factor."""
        found = self.graph.input(self.node, source)
        return default if found is None else _three(found.factor)

    def number(self, target: str, source: str, default: float) -> float:
        """A number in 0…1 that may have a picture."""
        found = self.graph.input(self.node, source)
        if found is None:
            return default
        value = _unit(found.factor[0])
        image = self._numbers(found) if found.file else None
        if image is None:
            return value
        only = channel_of(image, found.channel or 0)
        if only is None:
            return value * mean_of(image, found.channel or 0)
        self._lay(target, only, found)
        return value

    def colour(self, target: str, source: str, default: Colour) -> Colour:
        """A colour in 0…1 that may have a picture."""
        found = self.graph.input(self.node, source)
        if found is None:
            return default
        value = _three(tuple(_unit(v) for v in found.factor))
        image = self._colours(found) if found.file else None
        if image is not None:
            self._lay(target, image, found)
        return value

    def product(self, target: str, weight: str, source: str, default: float, colour: Colour) -> Colour:
        """A weight times a colour; a picture of the weight counts as its mean."""
        share = self.plain(weight, default)
        red, green, blue = (_unit(share * c) for c in self.colour(target, source, colour))
        if share <= 0:
            self.textures.pop(target, None)
        return (red, green, blue)

    def below(self, target: str, value: Colour, weight: float, source: str) -> Colour:
        """A colour below a coat that colours what comes through it; its picture where there is no other."""
        if weight <= 0:
            return value
        own = self.textures.pop(target, None)
        tint = self.colour(target, source, (1.0, 1.0, 1.0))
        if own is not None:
            if target in self.textures:
                self.say("the picture of its clear coat's colour is left out")
            self.textures[target] = own
        red, green, blue = (v * (1 + weight * (t - 1)) for v, t in zip(value, tint, strict=True))
        return (red, green, blue)

    def normal(self, source: str) -> float:
        """Lays a normal map; its strength."""
        found = self.graph.input(self.node, source)
        if found is None or not found.file:
            return 1.0
        image = self.pictures.file(found.file, plain=True)
        if image is None or image.pixels.shape[2] < 3:
            return 1.0
        self._lay(NORMAL, replace(image, pixels=image.pixels[..., :3]), found)
        return 1.0 if found.strength is None else found.strength

    def turned(self, source: str) -> float:
        """Degrees by which a tangent is rotated about the normal."""
        made = self.node.getInput(source)
        name = "" if made is None else made.getAttribute("nodename")
        found = self.node.getParent().getNode(name) if name else None
        if found is None or found.getCategory() != "rotate3d":
            return 0.0
        return self.graph.number(found, "amount", 0.0)

    def left_out(self, source: str, what: str, advice: str = "") -> None:
        """Says that an input which isn't nothing has no place here."""
        if self.plain_colour(source, (0.0, 0.0, 0.0)) != (0.0, 0.0, 0.0):
            self.say(f"{what} is left out{'; ' + advice if advice else ''}")

    def move(self, source: str, target: str) -> None:
        """Gives the picture of one field to another."""
        if source in self.textures:
            self.textures[target] = self.textures.pop(source)

    def _lay(self, target: str, image: Image, found: Found) -> None:
        texture, exact = laid(image, found.affine)
        if not exact:
            self.say("a picture that lies sheared was laid on straight")
        self.textures[target] = texture

    def _numbers(self, found: Found) -> Image | None:
        """As numbers: 8 bits stay 8 bits unless the file says that they are sRGB."""
        if found.space not in _SRGB:
            return self.pictures.file(found.file, plain=True)
        image = self.pictures.file(found.file)
        return None if image is None else Image(linear(image), "data")

    def _colours(self, found: Found) -> Image | None:
        if found.space not in _SRGB + _LINEAR:
            self.say(f"the colour space {found.space[:40]} was taken for linear Rec.709")
        image = self.pictures.file(found.file, plain=found.space not in _SRGB)
        if image is None:
            return None
        if image.encoding == "data":
            scale = np.float32(255 if image.pixels.dtype == np.uint8 else 1)
            image = Image(image.pixels.astype(np.float32) / scale, "linear")
        if found.channel is not None:
            one = min(found.channel, image.pixels.shape[2] - 1)
            image = replace(image, pixels=image.pixels[..., one : one + 1])
        return opaque(image)


def _unit(value: float) -> float:
    return min(max(value, 0.0), 1.0)


def _three(value: tuple[float, ...]) -> Colour:
    wide = value * 3 if len(value) == 1 else (*value, value[-1])
    return (wide[0], wide[1], wide[2])
