"""Writes materials as `.mtlx` with OpenPBR's surface shader, and their pictures beside it.

OpenPBR has what our models have and glTF lacks: rough matte parts by the very formula of `oren-nayar`, and
metals' rims by that of `ggx-conductor`. Pictures go to a folder `NAME_textures`, 8 bits as PNG and others
as EXR.
"""

from __future__ import annotations

import math
import secrets
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from studio_core.contract import Registry
from studio_core.errors import InputError
from studio_core.exchange.outgoing import surface_of
from studio_core.exchange.placing import of, scaling, turning
from studio_core.exchange.surface import NORMAL, WHITE, Surface
from studio_core.imaging.encode import write_exr, write_png
from studio_core.library.shelf import file_stem
from studio_core.scene.geometry import Image, Texture
from studio_core.scene.nodes import MeshObject, Scene
from studio_core.shading.materials import first_channel
from studio_plugins.materialx.library import library


@dataclass(frozen=True)
class MaterialXExporter:
    """Satisfies `studio_core.contract.Exporter`: materials alone, those that objects have or else all."""

    label: str = "MaterialX"
    extensions: tuple[str, ...] = (".mtlx",)

    def save(self, scene: Scene, path: Path, registry: Registry) -> tuple[str, ...]:
        """Write the file; what could not be expressed. InputError when it cannot be written."""
        mx, path = library(), Path(path)
        used = {m for node in scene.of(MeshObject) for m in node.materials if not scene.material(m).catches}
        writer = _Writer(mx, path)
        for key, material in scene.materials.items():
            if key in used or not used:
                made = surface_of(material, registry)
                writer.notes += made.told(made.surface, "OpenPBR")
                writer.material(made.surface)
        text = mx.writeToXmlString(writer.document)
        beside = path.with_name(f".{path.stem[:40]}-{secrets.token_hex(6)}.mtlx")
        try:
            beside.write_text(text, encoding="utf-8")
            beside.replace(path)
        except OSError as error:
            raise InputError(f"{path} cannot be written: {error.strerror or error}") from None
        finally:
            beside.unlink(missing_ok=True)
        if any(not isinstance(node, MeshObject) for node in scene.nodes.values()):
            writer.notes.append("MaterialX holds materials alone; objects, lights and cameras were left out.")
        return tuple(writer.notes)


@dataclass
class _Writer:
    """One file under way."""

    mx: Any
    path: Path
    notes: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.document = self.mx.createDocument()
        self._files: dict[tuple[str, str], tuple[str, str]] = {}

    def material(self, s: Surface) -> None:
        """A surfacematerial with its shader; only what differs from the shader's defaults."""
        name = self.document.createValidChildName(self.mx.createValidName(s.name or "Material"))
        shader = self.document.addNode("open_pbr_surface", f"{name}_shader", "surfaceshader")
        node = self.document.addNode("surfacematerial", name, "material")
        node.setAttribute("uiname", s.name)
        node.addInput("surfaceshader", "surfaceshader").setAttribute("nodename", shader.getName())
        tint = tuple(s.specular * c for c in s.specular_color)
        metal = s.metallic >= 1 and "metallic" not in s.textures
        self._colour(shader, "base_color", s.base_color, s.textures.get("base_color"))
        self._number(shader, "base_diffuse_roughness", s.diffuse_roughness)
        self._number(shader, "base_metalness", s.metallic, s.textures.get("metallic"))
        self._number(shader, "specular_roughness", *self._anisotropy(shader, s))
        self._number(shader, "specular_ior", s.ior)
        if s.specular <= 0 and not metal:
            self._number(shader, "specular_weight", 0.0)
        elif metal:
            self._colour(shader, "specular_color", s.edge_tint, s.textures.get("edge_tint"))
        elif "specular" in s.textures and "specular_color" not in s.textures:
            self._weighted(shader, tint, s.textures["specular"])
        elif tint != WHITE or "specular_color" in s.textures:
            self._colour(shader, "specular_color", tint, s.textures.get("specular_color"))
        strongest = max(s.sheen_color)
        if strongest > 0:
            self._number(shader, "fuzz_weight", strongest)
            self._colour(
                shader,
                "fuzz_color",
                tuple(c / strongest for c in s.sheen_color),
                s.textures.get("sheen_color"),
            )
            self._number(shader, "fuzz_roughness", s.sheen_roughness, s.textures.get("sheen_roughness"))
        if s.clearcoat > 0:
            self._number(shader, "coat_weight", s.clearcoat, s.textures.get("clearcoat"))
            self._number(
                shader, "coat_roughness", s.clearcoat_roughness, s.textures.get("clearcoat_roughness")
            )
            self._number(shader, "coat_ior", 1.5)
        if s.opacity < 1:
            self._number(shader, "geometry_opacity", s.opacity)
        if NORMAL in s.textures:
            self._normal(shader, s)

    def _anisotropy(self, shader: Any, s: Surface) -> tuple[float, Texture | None]:
        """Writes grain and tangent; the roughness that belongs to them."""
        if s.anisotropy <= 0:
            return s.roughness, s.textures.get("roughness")
        along, across = s.alphas
        narrow = across / max(along, 1e-9)
        self._number(shader, "specular_roughness_anisotropy", 1 - narrow)
        tangent = self.document.addNode("tangent", self._free(f"{shader.getName()}_u"), "vector3")
        normal = self.document.addNode("normal", self._free(f"{shader.getName()}_n"), "vector3")
        turned = self.document.addNode("rotate3d", self._free(f"{shader.getName()}_grain"), "vector3")
        turned.addInput("in", "vector3").setAttribute("nodename", tangent.getName())
        turned.addInput("amount", "float").setValueString(_text(s.anisotropy_rotation))
        turned.addInput("axis", "vector3").setAttribute("nodename", normal.getName())
        shader.addInput("geometry_tangent", "vector3").setAttribute("nodename", turned.getName())
        return math.sqrt(along / math.sqrt(2 / (1 + narrow * narrow))), s.textures.get("roughness")

    def _number(self, shader: Any, name: str, value: float, texture: Texture | None = None) -> None:
        made = shader.addInput(name, "float")
        if texture is None:
            made.setValueString(_text(value))
            return
        image = self._image(shader, name, "float", texture)
        made.setAttribute("nodename", self._times(image, "float", _text(value), value == 1).getName())

    def _colour(self, shader: Any, name: str, value: tuple[float, ...], texture: Texture | None) -> None:
        made, text = shader.addInput(name, "color3"), ", ".join(map(_text, value))
        if texture is None:
            made.setValueString(text)
            return
        image = self._image(shader, name, "color3", texture)
        made.setAttribute("nodename", self._times(image, "color3", text, value == WHITE).getName())

    def _weighted(self, shader: Any, tint: tuple[float, ...], texture: Texture) -> None:
        """A picture of numbers times a colour."""
        grey = np.repeat(first_channel(texture.image)[..., None], 3, axis=2)
        self._colour(shader, "specular_color", tint, Texture(Image(grey), *_lying(texture)))

    def _times(self, image: Any, kind: str, text: str, one: bool) -> Any:
        if one:
            return image
        made = self.document.addNode("multiply", self._free(f"{image.getName()}_times"), kind)
        made.addInput("in1", kind).setAttribute("nodename", image.getName())
        made.addInput("in2", kind).setValueString(text)
        return made

    def _normal(self, shader: Any, s: Surface) -> None:
        image = self._image(shader, NORMAL, "vector3", s.textures[NORMAL])
        made = self.document.addNode("normalmap", self._free(f"{shader.getName()}_bumps"), "vector3")
        made.addInput("in", "vector3").setAttribute("nodename", image.getName())
        made.addInput("scale", "float").setValueString(_text(s.normal_strength))
        shader.addInput("geometry_normal", "vector3").setAttribute("nodename", made.getName())

    def _image(self, shader: Any, name: str, kind: str, texture: Texture) -> Any:
        """A picture's node, laid as the texture is."""
        file, space = self._file(texture.image, kind, f"{shader.getName().removesuffix('_shader')}_{name}")
        made = self.document.addNode("image", self._free(f"{shader.getName()}_{name}"), kind)
        held = made.addInput("file", "filename")
        held.setValueString(file)
        if space:
            held.setColorSpace(space)
        placed = self._placed(made.getName(), texture)
        if placed:
            made.addInput("texcoord", "vector2").setAttribute("nodename", placed)
        return made

    def _placed(self, name: str, texture: Texture) -> str:
        """Nodes that lay it: stretch, then turn and stretch (the order TRS of `place2d`); "" for none."""
        affine = of(texture)
        if np.array_equal(affine, np.eye(3)):
            return ""
        at = self.document.addNode("texcoord", self._free(f"{name}_uv"), "vector2").getName()
        if texture.aspect != 1:
            at = self._place2d(name, at, scale=(1.0, 1 / texture.aspect))
        wide, high = (s if s != 0 else 1e-9 for s in texture.scale)
        inner = scaling(wide, high) @ turning(texture.rotation)
        moved = -np.linalg.solve(inner[:2, :2], np.array(texture.offset))
        return self._place2d(
            name, at, scale=(1 / wide, 1 / high), rotate=texture.rotation, offset=(moved[0], moved[1])
        )

    def _place2d(
        self,
        name: str,
        source: str,
        scale: tuple[float, float],
        rotate: float = 0.0,
        offset: tuple[float, float] = (0.0, 0.0),
    ) -> str:
        made = self.document.addNode("place2d", self._free(f"{name}_place"), "vector2")
        made.addInput("texcoord", "vector2").setAttribute("nodename", source)
        for key, pair in (("scale", scale), ("offset", offset)):
            made.addInput(key, "vector2").setValueString(", ".join(_text(float(v)) for v in pair))
        made.addInput("rotate", "float").setValueString(_text(rotate))
        made.addInput("operationorder", "integer").setValueString("1")
        return str(made.getName())

    def _free(self, name: str) -> str:
        return str(self.document.createValidChildName(name))

    def _file(self, image: Image, kind: str, name: str) -> tuple[str, str]:
        """The file's name for the document, and its colour space; each picture is written once."""
        key = (image.key, kind)
        if key not in self._files:
            folder = self.path.with_name(f"{file_stem(self.path.stem)}_textures")
            pixels, space = image.pixels, ""
            if kind == "float":
                pixels = pixels[..., :1]
                space = "srgb_texture" if image.encoding == "srgb" else ""
            elif pixels.shape[2] != 3:
                pixels = np.repeat(pixels, 3, axis=2) if pixels.shape[2] == 1 else pixels[..., :3]
            if kind == "color3":
                space = "srgb_texture" if image.encoding == "srgb" else "lin_rec709"
            suffix = "png" if pixels.dtype == np.uint8 else "exr"
            target = folder / f"{file_stem(name)}.{suffix}"
            try:
                folder.mkdir(exist_ok=True)
            except OSError as error:
                raise InputError(f"{folder} cannot be written: {error.strerror or error}") from None
            (write_png if suffix == "png" else write_exr)(target, np.ascontiguousarray(pixels))
            self._files[key] = f"{folder.name}/{target.name}", space
        return self._files[key]


def _lying(texture: Texture) -> Any:
    return texture.scale, texture.offset, texture.rotation, texture.aspect


def _text(value: float) -> str:
    """A number without noise, exact to seven digits."""
    return f"{value:.9g}"


EXPORTER = MaterialXExporter()
