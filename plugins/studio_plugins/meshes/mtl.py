"""Wavefront MTL: materials of OBJ files, and how they become ours.

Without specular colour, or with `illum` 0 and 1, a material is Lambert's; with one it is Blinn-Phong's
(the format defines its highlight by (h·n)^Ns); with `Pr` or `Pm` (the PBR extension) it is GGX.
Coloured pictures under `norm`, `map_Bump` or `bump` are normal maps, as programs write them; grey ones are
heights, of which the format says no size: white is `-bm` hundredths of the picture's width above black.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from studio_core.exchange.pictures import Pictures, channel_of, mean_of, opaque
from studio_core.params import Value
from studio_core.scene.geometry import Texture
from studio_core.scene.nodes import Material, new_id
from studio_core.shading.normal_maps import NORMAL, of_heights
from studio_plugins.meshes.common import PLAIN_GREY, Notes, colour, share

_UNUSED = {
    "map_bump": "",
    "bump": "",
    "norm": "",
    "disp": "displacement",
    "map_ks": "specular",
    "map_ns": "sharpness",
    "map_ke": "emission",
    "map_ka": "ambient",
    "refl": "reflection",
    "decal": "decal",
}
_BUMPS = ("norm", "map_bump", "bump")
HIGH = 0.01  # of the picture's width: how high white is
GREY = 0.02  # difference of channels up to which a picture is grey
_ARGUMENTS = {
    "-blendu": 1,
    "-blendv": 1,
    "-cc": 1,
    "-clamp": 1,
    "-imfchan": 1,
    "-texres": 1,
    "-type": 1,
    "-bm": 1,
    "-boost": 1,
    "-colorspace": 1,
    "-mm": 2,
}
_VECTORS = ("-o", "-s", "-t")


@dataclass(frozen=True)
class Map:
    """A texture statement: file name, and uv ↦ uv · scale + offset."""

    name: str
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    clamped: bool = False
    strength: float = 1.0


@dataclass
class Entry:
    """One `newmtl`: numbers and texture statements by lower-case keyword."""

    name: str
    numbers: dict[str, tuple[float, ...]] = field(default_factory=dict)
    maps: dict[str, Map] = field(default_factory=dict)

    def colour(self, key: str, default: float) -> tuple[float, ...]:
        """Three numbers; one stands for all."""
        given = self.numbers.get(key, (default,))
        return given[:3] if len(given) >= 3 else (given[0],) * 3

    def number(self, key: str, default: float) -> float:
        """The first number."""
        return self.numbers.get(key, (default,))[0]


def parse_mtl(text: str, notes: Notes) -> list[Entry]:
    """The entries of a file; statements that make no sense are counted and passed over."""
    entries: list[Entry] = []
    for line in text.splitlines():
        keyword, _, rest = line.strip().partition("#" if line.lstrip().startswith("#") else " ")
        if "\t" in keyword:
            keyword, _, more = keyword.partition("\t")
            rest = f"{more} {rest}"
        key, rest = keyword.lower(), rest.strip()
        if not key:
            continue
        if key == "newmtl":
            entries.append(Entry(rest))
        elif not entries:
            continue
        elif key.startswith("map_") or key in _UNUSED:
            entries[-1].maps[key] = parse_map(rest)
        else:
            numbers = _numbers(rest.split())
            if numbers:
                entries[-1].numbers[key] = numbers
            elif key in ("kd", "ks", "ns", "d", "tr", "pr", "pm") and "spectral" not in rest:
                notes.count("Statements of material files that could not be read", 1)
    return entries


def parse_map(rest: str) -> Map:
    """A texture statement's options and file name; the name may hold blanks."""
    words = rest.split(" ")
    scale, offset, clamped, strength = (1.0, 1.0), (0.0, 0.0), False, 1.0
    at = 0
    while at < len(words):
        option = words[at].lower()
        if option == "":
            at += 1
        elif option in _VECTORS:
            values = _numbers(words[at + 1 : at + 4])
            at += 1 + max(len(values), 1)
            if option == "-s" and values:
                scale = (values[0], values[1] if len(values) > 1 else values[0])
            elif option == "-o" and values:
                offset = (values[0], values[1] if len(values) > 1 else 0.0)
        elif option in _ARGUMENTS:
            clamped |= option == "-clamp" and words[at + 1 : at + 2] == ["on"]
            if option == "-bm":
                strength = next(iter(_numbers(words[at + 1 : at + 2])), 1.0)
            at += 1 + _ARGUMENTS[option]
        else:
            break
    return Map(" ".join(words[at:]).strip(), scale, offset, clamped, strength)


def _numbers(words: Sequence[str]) -> tuple[float, ...]:
    """The finite numbers at the start."""
    made: list[float] = []
    for word in words:
        try:
            value = float(word)
        except ValueError:
            break
        if not np.isfinite(value):
            break
        made.append(value)
    return tuple(made)


def material_of(entry: Entry, pictures: Pictures, notes: Notes) -> Material:
    """Our material of an MTL entry."""
    texture = _texture(entry, pictures, notes)
    base = colour(entry.colour("kd", PLAIN_GREY if texture is None else 1.0))
    if texture is not None and max(base) == 0:
        base = (1.0, 1.0, 1.0)  # exporters that put the whole colour into the picture
    shine = colour(entry.colour("ks", 0.0))
    values: dict[str, Value]
    target = "base_color"
    shaped: dict[str, Texture] = {}
    if any(key in entry.numbers for key in ("pr", "pm")) or {"map_pr", "map_pm"} & entry.maps.keys():
        model = "ggx"
        metallic, metal = _share(entry, "pm", 0.0, pictures, notes)
        roughness, rough = _share(entry, "pr", 0.5, pictures, notes)
        values = {"base_color": base, "metallic": metallic, "roughness": roughness, "specular": 0.5}
        shaped = {
            name: map_ for name, map_ in (("metallic", metal), ("roughness", rough)) if map_ is not None
        }
    elif max(shine) > 0 and entry.number("illum", 2) >= 2:
        model, target = "blinn-phong", "diffuse"
        base, shine = share(base, shine)
        exponent = min(max(entry.number("ns", 10.0), 1.0), 1e5)
        values = {"diffuse": base, "specular": shine, "exponent": exponent}
    else:
        model, values = "lambert", {"base_color": base}
    bumps = _bumps(entry, pictures)
    if bumps is not None:
        shaped[NORMAL], values[NORMAL] = bumps
    unused = sorted({_UNUSED[key] for key in entry.maps if _UNUSED.get(key)})
    for kind in unused:
        notes.say(f"The {kind} map of {entry.name!r} is not used.")
    if max(entry.colour("ke", 0.0)) > 0:
        notes.say(f"The material {entry.name!r} shines by itself; add a lamp for its light.")
    return Material(
        id=new_id("material"),
        name=entry.name or "Material",
        model=model,
        values=values,
        textures={**({} if texture is None else {target: texture}), **shaped},
        opacity=_opacity(entry, pictures, notes),
    )


def _texture(entry: Entry, pictures: Pictures, notes: Notes) -> Texture | None:
    statement = entry.maps.get("map_kd")
    if statement is None or not statement.name:
        return None
    image = pictures.file(statement.name)
    if image is None:
        return None
    if statement.clamped:
        notes.say(f"The picture {statement.name!r} is repeated, though the file asks to clamp it.")
    return Texture(opaque(image), statement.scale, statement.offset)


def _share(
    entry: Entry, key: str, default: float, pictures: Pictures, notes: Notes
) -> tuple[float, Texture | None]:
    """A number in 0…1, and its map, which stands in its place; the map's mean where it is one colour."""
    statement = entry.maps.get(f"map_{key}")
    if statement is None or (image := pictures.file(statement.name, plain=True)) is None:
        return min(max(entry.number(key, default), 0.0), 1.0), None
    if statement.clamped:
        notes.say(f"The picture {statement.name!r} is repeated, though the file asks to clamp it.")
    channel = channel_of(image, 0)
    if channel is None:
        return mean_of(image, 0), None
    return 1.0, Texture(channel, statement.scale, statement.offset)


def _bumps(entry: Entry, pictures: Pictures) -> tuple[Texture, float] | None:
    """A normal map and its strength."""
    statement = next((entry.maps[key] for key in _BUMPS if key in entry.maps), None)
    if statement is None or (image := pictures.file(statement.name, plain=True)) is None:
        return None
    channels = image.pixels[..., :3].astype(np.float32) / (255 if image.pixels.dtype == np.uint8 else 1)
    if float((channels.max(axis=2) - channels.min(axis=2)).mean()) < GREY:
        return Texture(of_heights(image, HIGH), statement.scale, statement.offset), statement.strength
    return Texture(opaque(image), statement.scale, statement.offset), statement.strength


def _opacity(entry: Entry, pictures: Pictures, notes: Notes) -> float:
    """From d (which wins) or Tr = 1 − d, and the mean of map_d."""
    opacity = entry.number("d", 1.0 - entry.number("tr", 0.0))
    statement = entry.maps.get("map_d")
    if statement is not None and (image := pictures.file(statement.name, plain=True)) is not None:
        notes.say(f"The mean of {statement.name!r} is the opacity of all of {entry.name!r}.")
        opacity *= mean_of(image, 3)
    return min(max(opacity, 0.0), 1.0)
