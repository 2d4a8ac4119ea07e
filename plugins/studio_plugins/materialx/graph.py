"""What an input of a shader is: a constant, or a picture with how it lies, found through its nodes.

Followed are the nodes that programs write around pictures: image, tiledimage, the pictures of glTF and USD,
place2d, constants, products with constants, single channels, conversions, normal maps, and the ways into and
out of node graphs. Whatever else computes a value is named, and the value of the shader's input is taken.
Definitions: MaterialX Specification 1.39, "Standard Nodes".
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from studio_core.exchange.placing import Affine, moving, scaling, turning

DEEPEST = 64
_SAME = ("dot", "convert", "texcoord", "geompropvalue", "UsdPrimvarReader", "normalize")
_CHANNELS = {"outr": 0, "outg": 1, "outb": 2, "outa": 3, "outx": 0, "outy": 1, "outz": 2, "outw": 3}
_USD_CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}


@dataclass(frozen=True)
class Found:
    """`factor` (1 or 3 numbers) alone, or times the picture `file`: one of its channels, or its colours.

    `space` is MaterialX's colour space of the picture, `strength` that of a normal map.
    """

    factor: tuple[float, ...]
    file: str = ""
    space: str = ""
    channel: int | None = None
    affine: Affine = field(default_factory=lambda: np.eye(3))
    strength: float | None = None


class Graph:
    """Follows connections of one document; what is not known is said once."""

    def __init__(self, document: Any, say: Callable[[str], object]) -> None:
        self.document, self._say = document, say
        self._known: dict[tuple[str, str], Found | None] = {}  # None while a node is being followed

    def input(self, node: Any, name: str) -> Found | None:
        """What a node's input is, None where the file doesn't tell or it cannot be followed."""
        made = node.getInput(name)
        return None if made is None else self._input(made, node.getParent(), 0)

    def number(self, node: Any, name: str, default: float) -> float:
        """A constant input; a picture counts as its factor."""
        found = self.input(node, name)
        return default if found is None else found.factor[0]

    def text(self, node: Any, name: str) -> str:
        """An input that is a word or a file."""
        made = node.getInput(name)
        if made is None:
            return ""
        if made.getInterfaceName():
            above = node.getParent().getInput(made.getInterfaceName())
            made = made if above is None else above
        return str(made.getValueString())

    def _input(self, made: Any, scope: Any, depth: int) -> Found | None:
        if depth > DEEPEST:
            self._say("A graph of nodes runs in circles or is too deep; its value was left out.")
            return None
        if made.getInterfaceName() and (above := scope.getInput(made.getInterfaceName())) is not None:
            return self._input(above, scope.getParent(), depth + 1)
        if made.getAttribute("nodegraph"):
            graph = self.document.getNodeGraph(made.getAttribute("nodegraph"))
            outputs = [] if graph is None else graph.getOutputs()
            wanted = made.getOutputString()
            output = next((o for o in outputs if not wanted or o.getName() == wanted), None)
            if output is not None:
                return self._connected(output, graph, depth + 1)
            self._say(
                f"The graph {made.getAttribute('nodegraph')[:60]!r} that a value comes from is missing."
            )
            return None
        if made.getAttribute("nodename"):
            return self._connected(made, scope, depth + 1)
        return _constant(made.getValueString())

    def _connected(self, port: Any, scope: Any, depth: int) -> Found | None:
        name = port.getAttribute("nodename")
        node = scope.getNode(name) if name else None
        if node is None:
            self._say(f"The node {name[:60]!r} that a value comes from is missing.")
            return None
        return self._node(node, port.getOutputString(), scope, depth)

    def _node(self, node: Any, output: str, scope: Any, depth: int) -> Found | None:
        """What a node gives; each is followed once, however many lead to it."""
        key = (str(node.getNamePath()), output)
        if key not in self._known:
            self._known[key] = None
            self._known[key] = self._followed(node, output, scope, depth)
        return self._known[key]

    def _followed(self, node: Any, output: str, scope: Any, depth: int) -> Found | None:
        kind = node.getCategory()

        def get(name: str) -> Found | None:
            made = node.getInput(name)
            return None if made is None else self._input(made, scope, depth + 1)

        if kind in ("image", "tiledimage", "gltf_image", "gltf_colorimage", "UsdUVTexture"):
            return self._picture(node, kind, output, scope, get, depth)
        if kind == "constant":
            return get("value")
        if kind == "multiply":
            return self._product(get("in1"), get("in2"))
        if kind in ("extract", "separate2", "separate3", "separate4"):
            found = get("in")
            if found is None:
                return None
            index = _CHANNELS.get(output, 0)
            if kind == "extract" and (asked := get("index")) is not None:
                index = int(min(max(asked.factor[0], 0), 3))
            factor = found.factor[min(index, len(found.factor) - 1)]
            return replace(found, factor=(factor,), channel=index if found.channel is None else found.channel)
        if kind in ("normalmap", "gltf_normalmap"):
            found, scale = get("in"), get("scale")
            if kind == "gltf_normalmap":
                found = self._picture(node, "gltf_image", output, scope, get, depth)
            strength = 1.0 if scale is None else scale.factor[0]
            return None if found is None else replace(found, strength=strength)
        if kind in _SAME:
            return get("in")
        self._say(f"The node {kind[:40]} is not followed; the plain value of what it feeds was taken.")
        return None

    def _product(self, a: Found | None, b: Found | None) -> Found | None:
        if a is None or b is None:
            return b if a is None else a
        if a.file and b.file:
            self._say("Of two pictures that are multiplied the first was taken.")
            return a
        first, second = (a, b) if a.file or not b.file else (b, a)
        wide = max(len(first.factor), len(second.factor))
        spread = [
            np.broadcast_to(f.factor if len(f.factor) > 1 else f.factor * wide, wide) for f in (first, second)
        ]
        return replace(first, factor=tuple((spread[0] * spread[1]).tolist()))

    def _picture(
        self, node: Any, kind: str, output: str, scope: Any, get: Callable[[str], Found | None], depth: int
    ) -> Found | None:
        made = node.getInput("file")
        if made is None:
            return None
        holder = made
        if made.getInterfaceName() and (above := scope.getInput(made.getInterfaceName())) is not None:
            holder = above
        name = f"{holder.getActiveFilePrefix()}{holder.getValueString()}"
        if not holder.getValueString():
            return None
        space = holder.getColorSpace() or node.getColorSpace() or holder.getActiveColorSpace()
        if kind == "UsdUVTexture":
            space = self._usd_space(node, space)
        elif not node.isColorType():  # numbers have no colour space, whatever is around them
            space = ""
        factor: tuple[float, ...] = (1.0,)
        told = get("factor" if kind == "gltf_image" else "color" if kind == "gltf_colorimage" else "scale")
        if told is not None and kind != "image" and kind != "tiledimage":
            factor = told.factor[:3]
        affine = _within(kind, get) @ self._coordinates(node, kind, scope, depth)
        channel = _USD_CHANNELS.get(output) if kind == "UsdUVTexture" else None
        if node.getType() == "float":
            channel = 0
        return Found(factor, name, space, channel, affine)

    def _usd_space(self, node: Any, space: str) -> str:
        told = self.text(node, "sourceColorSpace")
        return {"sRGB": "srgb_texture", "raw": "none"}.get(told, space)

    def _coordinates(self, node: Any, kind: str, scope: Any, depth: int) -> Affine:
        """The map from the mesh's uv to what the picture is looked up with."""
        made = node.getInput("st" if kind == "UsdUVTexture" else "texcoord")
        total = np.eye(3)
        for _ in range(DEEPEST):
            if made is None:
                return total
            if made.getInterfaceName() and (above := scope.getInput(made.getInterfaceName())) is not None:
                made, scope = above, scope.getParent()
                continue
            name = made.getAttribute("nodename")
            found = scope.getNode(name) if name else None
            if found is None:
                return total
            step = self._placed(found, scope, depth)
            if step is None:
                return total
            total = total @ step[0]
            made = found.getInput(step[1])
        return total

    def _placed(self, node: Any, scope: Any, depth: int) -> tuple[Affine, str] | None:
        """The map of one node over texture coordinates, and the input that it takes them from."""
        kind = node.getCategory()

        def pair(name: str, default: float) -> tuple[float, float]:
            made = node.getInput(name)
            found = None if made is None else self._input(made, scope, depth + 1)
            if found is None:
                return default, default
            return found.factor[0], found.factor[min(1, len(found.factor) - 1)]

        if kind == "place2d":
            scale, offset, pivot = pair("scale", 1.0), pair("offset", 0.0), pair("pivot", 0.0)
            return _place(
                scale, pair("rotate", 0.0)[0], offset, pivot, pair("operationorder", 0.0)[0] >= 1
            ), "texcoord"
        if kind == "UsdTransform2d":
            turn = turning(-pair("rotation", 0.0)[0])
            return moving(*pair("translation", 0.0)) @ turn @ scaling(*pair("scale", 1.0)), "in"
        if kind == "multiply":
            return scaling(*pair("in2", 1.0)), "in1"
        if kind == "add":
            return moving(*pair("in2", 0.0)), "in1"
        if kind == "texcoord":
            if pair("index", 0.0)[0] > 0:
                self._say("A picture lies by a second set of texture coordinates; the first was taken.")
            return None
        if kind in _SAME:
            return None
        self._say(f"The node {kind[:40]} in texture coordinates is not followed.")
        return None


def _constant(text: str) -> Found | None:
    """Numbers of a value; None where they are none."""
    if text in ("true", "false"):
        return Found((float(text == "true"),))
    try:
        numbers = tuple(float(part) for part in text[:400].split(",")[:4])
    except ValueError:
        return None
    return Found(numbers[:3]) if np.isfinite(numbers).all() else None


def _place(
    scale: tuple[float, float],
    rotate: float,
    offset: tuple[float, float],
    pivot: tuple[float, float],
    last: bool,
) -> Affine:
    """`place2d`: scale, rotate, translate about the pivot, or the other way round (`last`)."""
    smaller = scaling(*(1 / s if s != 0 else 1.0 for s in scale))
    back = moving(-offset[0], -offset[1])
    inner = smaller @ turning(rotate) @ back if last else back @ turning(rotate) @ smaller
    return moving(*pivot) @ inner @ moving(-pivot[0], -pivot[1])


def _within(kind: str, get: Callable[[str], Found | None]) -> Affine:
    """What a picture's node does itself to the coordinates it is given."""

    def pair(name: str, default: float, second: float | None = None) -> tuple[float, float]:
        found = get(name)
        if found is None:
            return default, default if second is None else second
        return found.factor[0], found.factor[min(1, len(found.factor) - 1)]

    if kind == "tiledimage":
        offset, real, tile = (
            pair("uvoffset", 0.0),
            pair("realworldimagesize", 1.0),
            pair("realworldtilesize", 1.0),
        )
        sized = scaling(*(t / r if r != 0 else 1.0 for t, r in zip(tile, real, strict=True)))
        return sized @ moving(-offset[0], -offset[1]) @ scaling(*pair("uvtiling", 1.0))
    if kind in ("gltf_image", "gltf_colorimage"):
        u, v = pair("scale", 1.0)
        smaller = (1 / u if u else 1.0, 1 / v if v else 1.0)
        x, y = pair("offset", 0.0)
        order = pair("operationorder", 1.0)[0] >= 1
        return _place(smaller, -pair("rotate", 0.0)[0], (-x, y), pair("pivot", 0.0, 1.0), order)
    return np.eye(3)
