"""What normal maps make of vertices' light, and of single hits; nothing where no material has one."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from studio_core.kernels.compose import face_texels
from studio_core.kernels.relief import BEND, add_relief, add_tilts
from studio_core.parallel import Workers
from studio_core.scene.nodes import Light, Scene
from studio_core.scene.world_mesh import WorldMesh
from studio_core.shading.artifacts import LayerRadiance, Radiance
from studio_core.shading.coefficients import Coefficients
from studio_core.shading.job import Job
from studio_core.shading.kept import Kept

F32 = npt.NDArray[np.float32]
I64 = npt.NDArray[np.int64]

FACES = 1 << 13
VERTICES = 1 << 13


class Relief(NamedTuple):
    """Normal maps, and what vertices make of them; see `kernels.relief.add_relief`."""

    bend: F32
    texels: F32
    first: I64
    size: I64
    levels: I64
    laid: F32
    tightness: F32


class Embosser:
    """Makes `Relief` of radiance. Owned by the compute thread."""

    def __init__(self, workers: Workers) -> None:
        self._workers = workers
        self._tightness: Kept[F32] = Kept()

    def __call__(
        self, scene: Scene, radiance: Radiance, table: Coefficients, job: Job | None
    ) -> Relief | None:
        """For the lights that are on."""
        reliefs, mesh = table.reliefs, radiance.surfaces.mesh
        if reliefs is None or all(layer.tilts is None for _, layer in lit(scene, radiance)):
            return None
        count, width = len(radiance.valid), table.width
        bend = np.zeros((count, BEND), np.float32)
        looks = (table.maps.kind, reliefs.levels > 0, table.plain, table.slope, table.typical, table.painted)
        for gain, layer in lit(scene, radiance):
            sized = layer.of_width(width)
            if sized.tilts is None:
                continue
            terms = np.ascontiguousarray(sized.terms, np.float32).reshape(count, width * 3)
            tilts = np.ascontiguousarray(sized.tilts, np.float32).reshape(count, -1, width * 3)
            given = (terms, tilts, gain, radiance.valid, mesh.material, *looks, bend)
            self._workers.run(count, VERTICES, partial(_add_tilts, given), job)
        layout = (reliefs.levels, reliefs.size, reliefs.laid)
        tightness = self._tightness(lambda: texels_of_faces(mesh, *layout, self._workers), mesh, reliefs)
        return Relief(
            bend, reliefs.texels, reliefs.first, reliefs.size, reliefs.levels, reliefs.laid, tightness
        )


def lit(scene: Scene, radiance: Radiance) -> list[tuple[F32, LayerRadiance]]:
    """The layers of lights that are on and not summed in every pixel, each with its gain (3,).

    So is light that came by way of other surfaces; it has its gains in it.
    """
    apart = radiance.pixel.nodes if radiance.pixel is not None else frozenset()
    made = [] if radiance.indirect is None else [(np.ones(3, np.float32), radiance.indirect)]
    for node, layer in radiance.layers.items():
        light = scene.nodes.get(node)
        if isinstance(light, Light) and scene.shown(node) and node not in apart:
            made.append((np.asarray(light.gain(), np.float32), layer))
    return made


def texels_of_faces(mesh: WorldMesh, textured: I64, size: I64, uv_map: F32, workers: Workers) -> F32:
    """(F,) texels along a metre of each face, of maps of materials that are textured (M,), else 1."""
    out = np.empty(len(mesh.faces), np.float32)
    corners = (mesh.positions, mesh.uvs, mesh.faces, mesh.face_material)

    def look(start: int, stop: int) -> None:
        face_texels(start, stop, *corners, textured, size, uv_map, out)

    workers.run(len(out), FACES, look)
    return out


def embossed(
    look: Callable[[int, int, F32], None], relief: Relief | None, hits: tuple[Any, ...]
) -> Callable[[int, int, F32], None]:
    """`look`, which writes the colours of hits start … stop−1, followed by what normal maps change."""
    if relief is None:
        return look
    given = (*hits, *relief)

    def both(start: int, stop: int, out: F32) -> None:
        look(start, stop, out)
        every: tuple[Any, ...] = (*given, out)
        add_relief(start, stop, *every)

    return both


def _add_tilts(given: tuple[Any, ...], start: int, stop: int) -> None:
    add_tilts(start, stop, *given)
