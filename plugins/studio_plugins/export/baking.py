"""Painted objects as files of other programs can have them: paint becomes pictures.

Each painted material of an object gets an atlas of its own (`scene.atlas`): the coordinates that its faces
have, where these show every spot once, else new charts. In each texel the paint is evaluated itself, not what
vertices have of it, over the pictures that were there; these are laid anew, and normal maps turned, where
charts are new. Texels are a quarter as long as paint's points are apart, or as the pictures' texels; 2048
along a side at most. Objects without paint, and parts of an object that have none, stay as they are.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from studio_core.contract import Registry
from studio_core.params import param_infos
from studio_core.scene.atlas import MOST, Atlas, Texels, atlas_of, filled, texels_of
from studio_core.scene.geometry import Geometry, Texture
from studio_core.scene.nodes import Material, MaterialId, MeshObject, Scene
from studio_core.scene.paint import Paint
from studio_core.shading.looks import PictureLooks
from studio_core.shading.materials import Resolved, resolve
from studio_core.shading.normal_maps import NORMAL, normal_texture, normals_at, strength
from studio_plugins.export.baked_looks import Look, is_constant, look_of, material_of, picture
from studio_plugins.export.shaded import shaded_parts
from studio_plugins.export.texel_values import Spots, values_at

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]
COARSER = 1.5
"""Times a picture's own texel, from which on it is said that there are fewer."""
FINER = 4
"""Texels between two points of paint."""
FEWEST = 8
"""Texels along an object at least, where points of paint lie far apart."""


def baked(scene: Scene, registry: Registry, most: int = MOST) -> tuple[Scene, list[str]]:
    """The scene with pictures in place of paint, and in sentences what these do not show."""
    notes: list[str] = []
    for node in list(scene.of(MeshObject)):
        if node.paint is not None and scene.shown(node.id):
            scene = _Object(scene, node, node.paint, registry, most, notes).baked()
    return scene, notes


@dataclass
class _Object:
    """One painted object under way."""

    scene: Scene
    node: MeshObject
    paint: Paint
    registry: Registry
    most: int
    notes: list[str]
    parts: list[Geometry] = field(default_factory=list)

    def baked(self) -> Scene:
        whole = _with_normals(self.node.geometry)
        materials = list(self.node.materials)
        if whole is None or not materials:
            return self.scene.with_nodes(dataclasses.replace(self.node, paint=None))
        assert whole.slots is not None
        slots = np.minimum(whole.slots, len(materials) - 1)
        whole = dataclasses.replace(whole, slots=slots)
        for slot in np.unique(slots).tolist():
            part = _only(whole, slots == slot)
            material = self.scene.material(materials[slot])
            made = self._part(part, slot, material)
            if made is None:
                self.parts.append(part)
                continue
            geometry, look = made
            self.parts.append(geometry)
            self.scene = self.scene.with_materials(look)
            materials[slot] = look.id
        plain = dataclasses.replace(
            self.node, geometry=_joined(self.parts), materials=tuple(materials), paint=None
        )
        return self.scene.with_nodes(plain)

    def _part(self, part: Geometry, slot: int, material: Material) -> tuple[Geometry, Material] | None:
        """Faces and material of a slot with pictures; None where its paint changes nothing."""
        resolved = resolve(material, self.registry)
        points = self.paint.places[self.paint.slots == slot]
        changed = [name for name in self.paint.changes if name in resolved.values]
        if not len(points) or not changed or material.catches:
            return None
        infos = param_infos(resolved.brdf.Params)
        if any(name not in infos for name in resolved.textures):
            self._tell(f"its paint was left out; the pictures of {material.name} belong together.")
            return None
        before = _texel_of_pictures(part, resolved)
        atlas = atlas_of(part, min(_apart(points, part) / FINER, before), self.most)
        if atlas.texel > COARSER * before:
            scale = 1000 * self.scene.world(self.node.id).scale
            told = f"texels of {scale * atlas.texel:.1f} mm instead of {scale * before:.1f} mm"
            self._tell(f"the pictures of {material.name} have {told} where it is painted.")
        texels = texels_of(atlas)
        if not len(texels.row):
            self._tell(f"its paint was left out; {material.name} lies on slivers alone.")
            return None
        spots = self._with_looks(_spots(part, atlas, texels, slot))
        look, lost = look_of(resolved, values_at(resolved, self.paint, spots))
        for name in lost:
            told = f"the {infos[name].label.lower()} of {material.name}"
            self._tell(f"what was painted of {told} was left out.")
        if look.stands_for:
            label = self.registry.brdf(look.model).label
            self._tell(f"{material.name} is {look.stands_for}; painted, it goes as {label}.")
        textures = {
            name: Texture(picture(filled(texels, atlas.size, values.reshape(len(values), -1))))
            for name, values in look.varying.items()
            if not is_constant(values)
        }
        look = self._bumps(material, part, atlas, texels, spots, textures, look)
        key = _new_id(self.scene, f"{material.id}-on-{self.node.id}")
        name = f"{material.name} on {self.node.name}"
        return atlas.geometry, material_of(look, material, textures, key, name, self.registry)

    def _with_looks(self, spots: Spots) -> Spots:
        if self.paint.looks is None or spots.slot >= len(self.node.materials):
            return spots
        looks = PictureLooks(self.registry)
        slots = np.full(len(spots.places), spots.slot)
        made = looks.at(looks.pictures(self.scene, self.node), spots.uvs, slots, spots.area)
        return dataclasses.replace(spots, looks=made)

    def _tell(self, what: str) -> None:
        self.notes.append(f"{self.node.name}: {what}")

    def _bumps(
        self,
        material: Material,
        part: Geometry,
        atlas: Atlas,
        texels: Texels,
        spots: Spots,
        textures: dict[str, Texture],
        look: Look,
    ) -> Look:
        """The normal map goes along, laid anew where the coordinates are new."""
        bumps = normal_texture(material)
        if bumps is None or part.uvs is None:
            return look
        if not atlas.made:
            textures[NORMAL] = bumps
            return look
        own = normals_at(bumps, strength(material), spots.uvs).astype(np.float64)
        right, up = _frames(part, texels, spots.normals)
        places = np.stack([right, up, spots.normals], axis=1)
        there = np.einsum("nk,nkc->nc", own, places)
        frames = np.stack([*_frames(atlas.geometry, texels, spots.normals), spots.normals], axis=1)
        turned = np.einsum("nc,nkc->nk", there, frames)
        textures[NORMAL] = Texture(picture(filled(texels, atlas.size, (turned + 1) / 2)))
        return dataclasses.replace(look, values={**look.values, NORMAL: 1.0})


def _with_normals(geometry: Geometry) -> Geometry | None:
    """As it is shaded; None without an area."""
    if geometry.normals is not None:
        return geometry if len(geometry.faces) else None
    parts = [
        Geometry(one.positions, one.faces, one.normals, one.uvs, np.full(len(one.faces), one.slot, np.uint16))
        for one in shaded_parts(geometry)
    ]
    return _joined(parts) if parts else None


def _only(geometry: Geometry, faces: npt.NDArray[np.bool_]) -> Geometry:
    """Some of a mesh' faces, with the corners that they use."""
    used, index = np.unique(geometry.faces[faces], return_inverse=True)
    assert geometry.slots is not None
    assert geometry.normals is not None
    return Geometry(
        geometry.positions[used],
        index.reshape(-1, 3).astype(np.uint32),
        geometry.normals[used],
        None if geometry.uvs is None else geometry.uvs[used],
        geometry.slots[faces],
    )


def _joined(parts: list[Geometry]) -> Geometry:
    """One mesh; coordinates of 0 where a part has none."""
    first = np.cumsum([0, *(len(part.positions) for part in parts)])
    some = any(part.uvs is not None for part in parts)
    uvs = [np.zeros((len(p.positions), 2), np.float32) if p.uvs is None else p.uvs for p in parts]
    return Geometry(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.faces + np.uint32(n) for part, n in zip(parts, first, strict=False)]),
        np.concatenate([part.normals for part in parts if part.normals is not None]),
        np.concatenate(uvs) if some else None,
        np.concatenate([part.slots for part in parts if part.slots is not None]),
    )


def _apart(points: F32, part: Geometry) -> float:
    """How far points of paint are from the next, in the middle; no more than a share of the object."""
    from scipy.spatial import cKDTree  # heavy: only exports come here

    whole = float(np.linalg.norm(np.ptp(part.positions, axis=0))) / FEWEST
    if len(points) < 2:
        return whole
    apart = float(np.median(cKDTree(points).query(points, k=2)[0][:, 1]))
    return min(max(apart, whole * 1e-4), whole)


def _density(part: Geometry) -> float:
    """How long a unit of the coordinates is on the surface, in the mean."""
    if part.uvs is None:
        return np.inf
    place, uv = part.positions[part.faces].astype(np.float64), part.uvs[part.faces].astype(np.float64)
    size = np.linalg.norm(np.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]), axis=1).sum()
    one, other = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    in_map = np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]).sum()
    return float(np.sqrt(size / in_map)) if in_map > 0 else np.inf


def _texel_of_pictures(part: Geometry, resolved: Resolved) -> float:
    """The length of the shortest texel of a material's pictures; infinite without any."""
    long, found = _density(part), np.inf
    for texture in (*resolved.textures.values(), *resolved.shaping.values()):
        texels = texture.image.pixels.shape[0] * texture.image.pixels.shape[1] * texture.area
        found = min(found, long / max(texels, 1e-12) ** 0.5)
    return float(found)


def _spots(part: Geometry, atlas: Atlas, texels: Texels, slot: int) -> Spots:
    """Where the texels are, with the coordinates that the part had; its faces are those of the atlas."""
    assert part.normals is not None
    normals = texels.of(part, part.normals)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    uvs = np.zeros((len(texels.face), 2), np.float32)
    area = np.zeros(len(texels.face), np.float32)
    if part.uvs is not None:
        uvs = texels.of(part, part.uvs).astype(np.float32)
        area[:] = (atlas.texel / _density(part)) ** 2
    return Spots(texels.of(part, part.positions), normals, slot, uvs, area)


def _frames(geometry: Geometry, texels: Texels, normals: F64) -> tuple[F64, F64]:
    """(N, 3) tangents along u, and with v, at right angles to normals; of each texel's face."""
    assert geometry.uvs is not None
    faces = geometry.faces
    place, uv = geometry.positions[faces].astype(np.float64), geometry.uvs[faces].astype(np.float64)
    p, q = place[:, 1] - place[:, 0], place[:, 2] - place[:, 0]
    (a, b), (c, d) = (uv[:, 1] - uv[:, 0]).T, (uv[:, 2] - uv[:, 0]).T
    sign = np.where(a * d - b * c < 0, -1.0, 1.0)[:, None]
    along = (sign * (d[:, None] * p - b[:, None] * q))[texels.face]
    against = (sign * (a[:, None] * q - c[:, None] * p))[texels.face]
    right = along - (along * normals).sum(axis=1, keepdims=True) * normals
    right /= np.maximum(np.linalg.norm(right, axis=1, keepdims=True), 1e-30)
    up = np.cross(normals, right)
    return right, up * np.where((up * against).sum(axis=1) < 0, -1.0, 1.0)[:, None]


def _new_id(scene: Scene, wanted: MaterialId) -> MaterialId:
    made, number = wanted, 2
    while made in scene.materials:
        made, number = f"{wanted}-{number}", number + 1
    return made


__all__ = ["baked"]
