"""A picture sample by sample: light sums interpolated, coefficients read from their own maps, float64."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from oracles.radiance import bilinear_repeat, lat_long

from studio_core.scene.nodes import ON_THE_GROUND, Light
from studio_core.shading.lamps import shown_environment
from studio_core.shading.materials import coefficients, linear_rgb, resolve
from studio_core.shading.open_light import OpenLight

Array = npt.NDArray[np.float64]
NO_BACK = 0xFFFFFFFF


def halved(level: Array) -> Array:
    """Boxes of two by two, or what is left of them at the edges."""
    height, width = max(level.shape[0] // 2, 1), max(level.shape[1] // 2, 1)
    y, x = level.shape[0] // height, level.shape[1] // width
    cut = level[: height * y, : width * x].reshape(height, y, width, x, *level.shape[2:])
    return np.asarray(cut.mean(axis=(1, 3)))


class Painter:
    """Colours of single samples."""

    def __init__(self, scene, radiance, hits, registry):
        lights = {light.id: light for light in scene.of(Light) if scene.shown(light.id)}
        self.mesh, self.view, self.surfaces = radiance.surfaces.mesh, hits.view, radiance.surfaces
        self.terms = radiance.combined(lights).astype(np.float64)
        self.maps, self.uv, self.own_map = [], [], []
        for name in radiance.surfaces.materials:
            resolved = resolve(scene.material(name), registry)
            base = coefficients(resolved, radiance.width).astype(np.float64)[None, None]
            if resolved.textures:
                base = coefficients(resolved, radiance.width).astype(np.float64)
            levels = [base]
            while max(levels[-1].shape[:2]) > 1 and len(levels) < 12:
                levels.append(halved(levels[-1]))
            self.maps.append(levels)
            self.own_map.append(len(resolved.textures) > 1 or resolved.brdf.id == "phong")
            texture = next(iter(resolved.textures.values()), None)
            self.uv.append(place_in_picture(texture) if texture else np.eye(3))
        self.tilts, self.bumps = None, []
        if all(layer.tilts is not None for layer in radiance.layers.values()):
            self.tilts = sum(
                layer.tilts.astype(np.float64) * np.array(lights[node].gain())
                for node, layer in radiance.layers.items()
                if node in lights
            )
        for name in radiance.surfaces.materials:
            material = scene.material(name)
            texture = None if material.catches else material.textures.get("normal")
            self.bumps.append(texture and bumps(texture, material.values.get("normal", 1.0)))
        sky = shown_environment(scene)
        self.sky = sky if sky is not None and sky.background else None
        self.sky_pixels = linear_rgb(self.sky.image).astype(np.float64) if self.sky else None
        self.lit = np.zeros((len(self.terms), 3))
        if self.sky is not None:
            normals = self.mesh.normals @ self.sky.rotation().matrix()[:3, :3]
            self.lit = radiance.irradiance(lights) / OpenLight(linear_rgb(self.sky.image)).irradiance(normals)
            self.lit[~radiance.valid] = self.sky.gain()

    def photograph(self, along, met=None):
        """Of the environment, seen along a ray, or at a point that it meets; without gain."""
        sky, eye = self.sky, np.array(self.view.transform.translation)
        if sky.projection == ON_THE_GROUND:
            foot = np.array(sky.transform.translation)
            if met is None and eye[1] > foot[1]:
                radius = max(sky.ground_radius, 1.25 * np.linalg.norm(eye - foot))
                met = on_dome(eye - foot, along, radius) + foot
            if met is not None:
                along = met - foot - (0, sky.ground_height, 0)
        back = sky.background_rotation().matrix()[:3, :3].T
        return lat_long(self.sky_pixels, back @ (along / np.linalg.norm(along)))

    def direction(self, sample):
        view, n = self.view, self.view.antialias
        pixel, inner = divmod(sample, n * n)
        x, y = (pixel % view.width) * n + inner % n, (pixel // view.width) * n + inner // n
        up = np.tan(np.radians(view.fov) / 2)
        a = ((x + 0.5) / (view.width * n) * 2 - 1) * up * view.width / view.height
        b = (1 - (y + 0.5) / (view.height * n) * 2) * up
        along = view.transform.matrix()[:3, :3] @ (a, b, -1)
        return along / np.linalg.norm(along)

    def sample(self, hits, index, sample):
        """Radiance of one sample, and the footprint in texels where a map was read."""
        along, face = self.direction(sample), hits.face[index]
        if face < 0:
            if self.sky is None:
                return np.zeros(3), None
            return self.photograph(along) * self.sky.gain(), None
        mesh = self.mesh
        corners = mesh.faces[face]
        a, b, c = mesh.positions[corners].astype(np.float64)
        normal = np.cross(b - a, c - a)
        size = np.linalg.norm(normal)
        away = normal @ along / size if size > 0 else 0.0
        weights = np.array([1 - float(hits.u[index]) - hits.v[index], hits.u[index], hits.v[index]])
        m = mesh.material[corners[0]]
        if self.surfaces.catches[m]:
            if self.sky is None:
                return np.zeros(3), None
            if away > 0 and mesh.back_faces[face, 0] != NO_BACK:
                corners = mesh.back_faces[face]
            met = np.array(self.view.transform.translation) + float(hits.distance[index]) * along
            return self.photograph(along, met) * (weights @ self.lit[corners]), None
        footprint = None

        def read(levels, place):
            uv = (place @ (*(weights @ mesh.uvs[corners].astype(np.float64)), 1))[:2]
            e, f = mesh.uvs[corners[1:]].astype(np.float64) - mesh.uvs[corners[0]]
            laid = abs(np.linalg.det(place[:2, :2]))
            texels = abs(e[0] * f[1] - e[1] * f[0]) * laid * np.prod(levels[0].shape[:2])
            angle = 2 * np.tan(np.radians(self.view.fov) / 2) / (self.view.height * self.view.antialias)
            covered = hits.distance[index] * angle * np.sqrt(texels / size) / np.sqrt(max(abs(away), 0.05))
            level = int(np.clip(np.floor(np.log2(covered) + 0.5), 0, len(levels) - 1))
            return bilinear_repeat(levels[level], *(uv - np.floor(uv))), covered

        look = self.maps[m][0][0, 0]
        if len(self.maps[m]) > 1:
            look, footprint = read(self.maps[m], self.uv[m])
        normal = None
        if self.tilts is not None and self.bumps[m] is not None:
            levels, place, strong, turn = self.bumps[m]
            normal, covered = read(levels, place)
            normal = leaning(normal, strong, turn)
            footprint = covered if footprint is None else (footprint, covered)
        if away > 0 and mesh.back_faces[face, 0] != NO_BACK:
            corners = mesh.back_faces[face]
        colour = (look * np.einsum("k,ktc->tc", weights, self.terms[corners])).sum(axis=0)
        if normal is not None:
            turned = np.tensordot(normal, np.einsum("k,kftc->ftc", weights, self.tilts[corners]), 1)
            if self.own_map[m]:
                usual = self.maps[m][-1].mean(axis=(0, 1))
                light = np.einsum("k,ktc->tc", weights, self.terms[corners])
                colour = colour * (1 + (usual * turned).sum(axis=0) / (usual * light).sum(axis=0))
            else:
                colour = colour + (look * turned).sum(axis=0)
            colour = np.maximum(colour, 0)
        for inside, rest in hits.behind:
            for at in np.flatnonzero(inside == index):
                alpha = float(self.surfaces.opacity[mesh.face_material[face]])
                under, _ = self.sample(rest, at, sample)
                colour = alpha * colour + (1 - alpha) * under
        return colour, footprint


def place_in_picture(texture):
    """(3, 3) from (u, v, 1): a stretched plane, turned back under the picture, in units of the picture."""
    turn = np.exp(-1j * np.radians(texture.rotation))
    back = np.array([[turn.real, -turn.imag, 0], [turn.imag, turn.real, 0], [0, 0, 1]])
    (wide, high), (right, up) = texture.scale, texture.offset
    size = np.array([[wide, 0, right], [0, high, up], [0, 0, 1]])
    return size @ back @ np.diag([1, texture.aspect, 1])


def bumps(texture, strength):
    """Levels of (x, y, 1 − z) in the picture, the place in it, the strength, and how it lies turned."""
    n = texture.image.pixels.astype(np.float64)[::-1] / 127.5 - 1
    n[..., 2] = np.maximum(n[..., 2], 0.05)
    n /= np.linalg.norm(n, axis=2, keepdims=True)
    levels = [np.stack([n[..., 0], n[..., 1], 1 - n[..., 2]], axis=2)]
    while max(levels[-1].shape[:2]) > 1 and len(levels) < 12:
        levels.append(halved(levels[-1]))
    turn = np.sign(texture.scale), np.exp(1j * np.radians(texture.rotation))
    return levels, place_in_picture(texture), strength, turn


def leaning(found, strength, turn):
    """What a mean of (x, y, 1 − z) is on the surface, stronger."""
    mean = np.array([found[0], found[1], 1 - found[2]])
    short = 1 - np.linalg.norm(mean)
    mean[:2] *= strength
    mean *= (1 - strength**2 * short) / np.linalg.norm(mean)
    (right, up), around = turn
    lies = (right * mean[0] + 1j * up * mean[1]) * around
    return np.array([lies.real, lies.imag, 1 - mean[2]])


def on_dome(eye, along, radius):
    """Where a ray from inside a dome about the origin meets its floor or the dome itself, by bisection."""

    def inside(reach):
        point = eye + reach * along
        return point[1] > 0 and np.linalg.norm(point) < radius

    low, high = 0.0, 4.0 * radius
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if inside(middle) else (low, middle)
    return eye + low * along


def doubtful(footprint):
    """Whether rounding may decide between two levels of a map; footprints of none, one or two maps."""
    steps = [np.log2(max(f, 1e-9)) + 0.5 for f in np.atleast_1d([] if footprint is None else footprint)]
    return any(abs(step - np.round(step)) < 1e-4 for step in steps)


def picture(scene, radiance, hits, registry) -> tuple[Array, npt.NDArray[np.bool_]]:
    """(H, W, 3), and the pixels (H, W) where rounding may decide between two levels of a map."""
    painter, n2 = Painter(scene, radiance, hits, registry), hits.samples**2
    view = hits.view
    out, unsure = np.zeros((view.height * view.width, 3)), np.zeros(view.height * view.width, np.bool_)
    for sample in range(len(hits.face)):
        colour, footprint = painter.sample(hits, sample, sample)
        out[sample // n2] += colour / n2
        unsure[sample // n2] |= doubtful(footprint)
    if hits.edges is not None:
        finer, fine = Painter(scene, radiance, hits.edges.hits, registry), hits.edges.hits
        count = len(fine.face) // max(len(hits.edges.pixels), 1)
        for row, pixel in enumerate(hits.edges.pixels):
            colours = [finer.sample(fine, row * count + k, pixel * count + k) for k in range(count)]
            out[pixel] = np.mean([colour for colour, _ in colours], axis=0)
            unsure[pixel] = any(doubtful(footprint) for _, footprint in colours)
    return out.reshape(view.height, view.width, 3), unsure.reshape(view.height, view.width)
