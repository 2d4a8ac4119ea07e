"""Pictures in made-up light, which take no time to compute, and OpenGL to draw them with."""

from __future__ import annotations

import dataclasses
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from studio_core.contract import Services
from studio_core.raster import PictureStage
from studio_core.scene.diff import Aspect, Changes, everything
from studio_core.scene.nodes import Light, Scene
from studio_core.session import View
from studio_core.shading.artifacts import TERMS, Hits, LayerRadiance, Picture, Radiance, Surfaces
from studio_core.shading.frame import Frame
from studio_core.shading.job import Job
from studio_core.shading.pipeline import Inputs, Pipeline
from studio_core.shading.primary import visible_vertices
from studio_core.shading.stages import SurfaceParams, common_stages

ROOT = Path(__file__).resolve().parent.parent
WAVES = np.random.default_rng(5).normal(size=(TERMS * 3, 3))


class PaintedStage:
    """Light that swings through the room, the first light's; another eye sees another one."""

    needs: tuple[type, ...] = (Surfaces, Hits)
    gives = Radiance
    dirtied_by = ~Aspect.NONE

    def __init__(self) -> None:
        self.phase = 0.0
        self.everywhere = False

    def run(self, frame: Frame, inputs: Inputs, job: Job) -> Radiance:
        surfaces, hits = inputs[Surfaces], inputs[Hits]
        mesh = surfaces.mesh
        swing = np.sin(mesh.positions @ WAVES.T + mesh.side[:, None] + self.phase)
        terms = (0.15 + 0.6 * swing**2).astype(np.float32).reshape(len(mesh), TERMS, 3)
        valid = visible_vertices(surfaces, hits) | self.everywhere
        lights = list(frame.scene.of(Light))[:1]
        irradiance = 4 * terms[:, 0] * valid[:, None]
        tilts = None
        if any("normal" in material.textures for material in frame.scene.materials.values()):
            lean = np.sin(mesh.positions @ WAVES[:9].T - self.phase).reshape(-1, 3, 1, 3)
            tilts = (lean * terms[:, None] * valid[:, None, None, None]).astype(np.float32)
        layer = LayerRadiance(terms * valid[:, None, None], irradiance, tilts)
        return Radiance(surfaces, hits, {light.id: layer for light in lights}, valid, 1024, True)


class Painter:
    """A pipeline in made-up light; `paint` gives the picture of a scene."""

    def __init__(self, services: Services, vertices: int = 3000) -> None:
        self.stage = PaintedStage()
        self.pipeline = Pipeline([*common_stages(services), self.stage, PictureStage(services)])
        self.params = SurfaceParams(vertices=vertices)
        self._revision = 0

    def paint(self, scene: Scene, view: View, changes: Changes | None = None) -> Picture:
        self._revision += 1
        frame = Frame(scene, view, self.params, self._revision)
        made: Picture = self.pipeline.update(frame, changes or everything(scene), Job("Painting"))
        return made


def python(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """A child with this one's paths."""
    values = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **environment}
    return subprocess.run(
        [sys.executable, *arguments],
        env=values,
        cwd=ROOT,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )


def require_offscreen() -> None:
    """Skip without OpenGL that needs no window; a driver that ends the program ends a child."""
    source = (
        "from studio_ui.canvas.gl_context import Offscreen, try_out; Offscreen(); print(try_out() or 'fine')"
    )
    tried = python("-c", source, EGL_PLATFORM="surfaceless", QT_QPA_PLATFORM="offscreen")
    if tried.returncode or tried.stdout.strip() != "fine":
        lines = (tried.stdout + tried.stderr).strip().splitlines()
        pytest.skip(f"no OpenGL without a window here: {lines[-1] if lines else tried.returncode}")


def edges(picture: Picture) -> np.ndarray:
    """(H, W) pixels on either side of a silhouette, and of what transparent surfaces hide."""
    hits = picture.radiance.hits
    assert hits is not None
    mesh = picture.radiance.surfaces.mesh

    def kinds(layer: Hits) -> np.ndarray:
        made = np.full(len(layer.face), -1)
        hit = layer.face >= 0
        made[hit] = mesh.object[mesh.faces[layer.face[hit], 0]]
        for index, rest in layer.behind:
            made[index] = 1000 * made[index] + kinds(rest)
        return made

    n = hits.samples
    seen = kinds(hits).reshape(*picture.node.shape, n * n)
    edge = (seen != seen[..., :1]).any(axis=2)
    first = seen[..., 0]
    for axis in (0, 1):
        step = np.diff(first, axis=axis) != 0
        low: list[Any] = [slice(None)] * 2
        high = list(low)
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        edge[tuple(low)] |= step
        edge[tuple(high)] |= step
    return edge


def agreement(a: np.ndarray, b: np.ndarray, outside: np.ndarray) -> float:
    """Share of the pixels outside a mask that differ by 2 of 255 at most."""
    close = np.abs(a.astype(int) - b).max(axis=2) <= 2
    return float(close[~outside].mean())


def sized(view: View, **fields: Any) -> View:
    """A view with other fields."""
    return dataclasses.replace(view, **fields)
