"""Mitsuba 3 as a peer: render an exported folder, and light at single points, with its own errors.

Needs the extra `mitsuba`; it is imported inside the functions. `variant` None takes llvm_ad_rgb.
"""

from __future__ import annotations

import importlib.util
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt

from studio_core.errors import PluginError

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
VARIANT = "llvm_ad_rgb"
REPLICATES = 8
BATCH = 1 << 20  # rays in flight


@dataclass(frozen=True)
class Estimate:
    """Monte Carlo estimate `value` and its standard error, both (V, 3) float64."""

    value: F64
    error: F64

    @property
    def relative_error(self) -> float:
        """RMS standard error over the mean value, as errors are stated elsewhere."""
        return float(np.sqrt((self.error**2).mean()) / max(self.value.mean(), 1e-30))


def mitsuba(variant: str | None = None) -> Any:
    """The module with its variant set and our plugins registered; PluginError where it is missing."""
    try:
        import mitsuba as mi
    except ImportError:
        raise PluginError("Mitsuba 3 is not installed; `pip install lucarne[peers]` brings it") from None
    chosen = variant or VARIANT
    mi.set_variant(chosen)
    for name in ("mitsuba_bsdfs", "mitsuba_emitters"):
        _for_variant(name, chosen).register()
    return mi


def _for_variant(name: str, variant: str) -> ModuleType:
    """The shipped plugin file, executed once a variant: its classes derive from the variant's."""
    key = f"{__package__}._{name}_{variant}"
    if key not in sys.modules:
        spec = importlib.util.spec_from_file_location(key, Path(__file__).with_name(f"{name}.py"))
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[key] = module
        spec.loader.exec_module(module)
    return sys.modules[key]


def load(folder: Path, variant: str | None = None, **values: object) -> Any:
    """Mitsuba's scene of an exported folder; values for $width, $height, $spp, $sampler, $max_depth."""
    mi = mitsuba(variant)
    return mi.load_file(str(Path(folder) / "scene.xml"), **{k: str(v) for k, v in values.items()})


def render(
    folder: Path,
    spp: int,
    size: tuple[int, int],
    variant: str | None = None,
    *,
    max_depth: int | None = None,
    seed: int = 0,
    sensor: int = 0,
) -> F32:
    """(H, W, 3) linear radiance; `size` is (width, height)."""
    values: dict[str, object] = {"width": size[0], "height": size[1], "spp": spp}
    if max_depth is not None:
        values["max_depth"] = max_depth
    scene = load(folder, variant, **values)
    mi = mitsuba(variant)
    return np.array(mi.render(scene, sensor=sensor, seed=seed), np.float32)[..., :3]


class DirectRenderer:
    """An exported folder in Mitsuba's own `direct` integrator, loaded once: to time it at its best.

    `size` is (width, height); `sampler` one of Mitsuba's, such as `multijitter` (best with square numbers
    of samples). With `max_depth` it is its `path` integrator, and lights themselves are not seen.
    """

    def __init__(
        self,
        folder: Path,
        size: tuple[int, int],
        sampler: str = "multijitter",
        variant: str | None = None,
        *,
        max_depth: int | None = None,
    ) -> None:
        self._mi = mitsuba(variant)
        self._scene = load(folder, variant, width=size[0], height=size[1], sampler=sampler)
        hidden = ElementTree.parse(Path(folder) / "scene.xml").find(
            "integrator/boolean[@name='hide_emitters']"
        )
        hide = hidden is not None and hidden.get("value") == "true"
        direct = {"type": "direct", "hide_emitters": hide}
        path = {"type": "path", "hide_emitters": True, "max_depth": max_depth}
        self._integrator = self._mi.load_dict(direct if max_depth is None else path)

    def __call__(self, spp: int, seed: int = 0, sensor: int = 0) -> F32:
        """(H, W, 3) linear radiance."""
        made = self._mi.render(self._scene, sensor=sensor, integrator=self._integrator, seed=seed, spp=spp)
        return np.array(made, np.float32)[..., :3]

    def timed(self, spp: int, seed: int = 0, sensor: int = 0) -> tuple[F32, float]:
        """The same and its seconds, by a second call: the first compiles."""
        self(spp, seed, sensor)
        started = time.perf_counter()
        made = self(spp, seed, sensor)
        return made, time.perf_counter() - started


def vertex_irradiance(
    scene: Any, positions: npt.ArrayLike, normals: npt.ArrayLike, spp: int = 1024, *, offset: float = 1e-4
) -> Estimate:
    """(V, 3) irradiance of points under all lights, with traced visibility.

    See `vertex_radiance`; irradiance is π times the radiance of a white matte point. To compare with a
    tracer, give its own ray origins and offset 0: in creases a millionth of a metre decides.
    """
    white = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 1.0}}
    made = vertex_radiance(scene, positions, normals, normals, white, spp, offset=offset)
    return Estimate(made.value * np.pi, made.error * np.pi)


def vertex_radiance(
    scene: Any,
    positions: npt.ArrayLike,
    normals: npt.ArrayLike,
    wo: npt.ArrayLike,
    bsdf: Mapping[str, Any],
    spp: int = 1024,
    *,
    offset: float = 1e-4,
    seed: int = 1,
) -> Estimate:
    """(V, 3) radiance that points send towards wo (V, 3) under direct light, with its standard error.

    `scene` is an exported folder or a loaded Mitsuba scene (llvm_ad_rgb); `bsdf` a Mitsuba dictionary,
    the same for all points, seen from the side that `normals` (V, 3) point to. Rays start `offset` metres
    above the points. Each light takes `spp` samples a point, and environments and area lights
    as many again by the BSDF (multiple importance sampling, balance heuristic). Samples are an evenly
    spread sequence in `REPLICATES` independent shifts, whose differences give the standard error.
    """
    mi = mitsuba()
    import drjit as dr

    if isinstance(scene, str | Path):
        scene = load(Path(scene))
    model = mi.load_dict(dict(bsdf))
    p, n, out = (np.ascontiguousarray(a, np.float32) for a in (positions, normals, wo))
    each = max(1, -(-spp // REPLICATES))
    total, squares = np.zeros((len(p), 3)), np.zeros((len(p), 3))
    rng = np.random.default_rng(seed)
    for _ in range(REPLICATES):
        shift = rng.random((len(p), 4), np.float32)
        mean = np.zeros((len(p), 3))
        block = max(1, BATCH // each)
        for start in range(0, len(p), block):
            rows = slice(start, start + block)
            mean[rows] = _direct(mi, dr, scene, model, p[rows], n[rows], out[rows], shift[rows], each, offset)
        total += mean
        squares += mean**2
    value = total / REPLICATES
    variance = np.maximum(squares / REPLICATES - value**2, 0) / (REPLICATES - 1)
    return Estimate(value, np.sqrt(variance))


def _direct(
    mi: Any,
    dr: Any,
    scene: Any,
    model: Any,
    p: F32,
    n: F32,
    wo: F32,
    shift: F32,
    each: int,
    offset: float,
) -> F64:
    """(B, 3) mean of `each` samples of every light for a block of points."""
    count = len(p)
    row = np.repeat(np.arange(count), each)
    lattice = _lattice(each)
    u = (lattice[np.tile(np.arange(each), count)] + shift[row]) % 1.0
    u = np.minimum(u, np.float32(1 - 2**-24))
    sample, other = mi.Point2f(*u[:, :2].T), mi.Point2f(*u[:, 2:].T)
    normal = mi.Normal3f(*n[row].T)
    si = dr.zeros(mi.SurfaceInteraction3f, count * each)
    si.p = mi.Point3f(*(p + np.float32(offset) * n)[row].T)
    si.n = normal
    si.sh_frame = mi.Frame3f(normal)
    si.wi = si.to_local(mi.Vector3f(*wo[row].T))
    context = mi.BSDFContext()
    made = mi.Color3f(0)
    for emitter in scene.emitters():
        ds, weight = emitter.sample_direction(si, sample)
        local = si.to_local(ds.d)
        value, by_bsdf = model.eval_pdf(context, si, local)
        active = (ds.pdf > 0) & (local.z > 0)
        ray = mi.Ray3f(si.p, ds.d, dr.select(ds.dist < 1e8, ds.dist * (1 - 1e-4), dr.inf), 0.0, [])
        active &= ~scene.ray_test(ray, active)
        share = dr.select(ds.delta, 1, ds.pdf / (ds.pdf + by_bsdf))
        made += dr.select(active, weight * value * share, 0)
        if not (mi.has_flag(emitter.flags(), mi.EmitterFlags.Surface) or emitter.is_environment()):
            continue
        bs, weight = model.sample(context, si, other.x, mi.Point2f(other.y, sample.x))
        direction = si.to_world(bs.wo)
        hit = scene.ray_intersect(mi.Ray3f(si.p, direction), bs.pdf > 0)
        same = (hit.emitter(scene) == mi.EmitterPtr(emitter)) & (bs.pdf > 0)
        ds = mi.DirectionSample3f(scene, hit, si)
        by_light = emitter.pdf_direction(si, ds, same)
        share = bs.pdf / (bs.pdf + by_light)
        made += dr.select(same, emitter.eval(hit, same) * weight * share, 0)
    values = np.array(made, np.float64).reshape(3, count, each)
    found: F64 = values.mean(axis=2).T
    return found


def _lattice(count: int) -> F32:
    """(count, 4) points of the R4 sequence (Roberts 2018): evenly spread in the unit cube."""
    root = 1.1673039782614187  # of x^5 = x + 1
    steps = root ** -np.arange(1.0, 5.0)
    made: F32 = ((np.arange(count)[:, None] + 0.5) * steps % 1.0).astype(np.float32)
    return made
