"""Mitsuba 3 as the peer of `lucarne bench cuts`: its seconds to the error that our picture has.

Its `direct` integrator with multijittered samples (llvm) renders the same picture at several numbers of
samples; errors are against converged pictures of the same scene, which are kept by content in the user's
cache folder, in two independent halves so that their own noise drops out (`harness.unbiased_rmse`).
error(t) = a·tᵖ is fitted and solved for the time at our error. An edit costs Mitsuba a new picture, and
next to nothing beyond.
"""

from __future__ import annotations

import hashlib
import importlib.util
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from studio.bench.cuts_cases import State
from studio.bench.harness import PowerLaw, unbiased_rmse
from studio.headless import Headless
from studio_core.folders import user_cache
from studio_core.scene.nodes import Environment, Scene
from studio_core.shading.cache import DiskCache

F32 = npt.NDArray[np.float32]
METHOD = "Mitsuba, converged direct light, 1"
BATCH = 64  # samples a pixel and call


def installed() -> bool:
    """Whether Mitsuba is there."""
    return importlib.util.find_spec("mitsuba") is not None


@dataclass(frozen=True)
class Peer:
    """Seconds and errors of Mitsuba's pictures, and the converged halves (H, W, 3) behind them."""

    seconds: tuple[float, ...]
    errors: tuple[float, ...]
    halves: tuple[F32, F32]

    @property
    def law(self) -> PowerLaw:
        """error(seconds)."""
        return PowerLaw.fit(self.seconds, self.errors)

    def error(self, picture: F32) -> float:
        """Relative RMSE of a picture."""
        return lit_error(picture, *self.halves)

    def ratio(self, error: float, seconds: float) -> float:
        """Mitsuba's seconds to that error over ours."""
        return self.law.where(error) / seconds

    @property
    def noise(self) -> float:
        """Relative standard error of the converged picture."""
        lit = lit_pixels(*self.halves)
        first, second = (half[lit].astype(np.float64) for half in self.halves)
        return float(np.sqrt(np.mean((first - second) ** 2)) / 2 / np.mean((first + second) / 2))


def lit_pixels(first: F32, second: F32) -> npt.NDArray[np.bool_]:
    """(H, W) pixels that show more than darkness: the only ones that errors are of."""
    found: npt.NDArray[np.bool_] = (first + second).sum(axis=2) > 0
    return found


def lit_error(picture: F32, first: F32, second: F32) -> float:
    """`unbiased_rmse` over the lit pixels."""
    lit = lit_pixels(first, second)
    return unbiased_rmse(picture[lit], first[lit], second[lit])


def peer(state: State, program: Headless, samples: Sequence[int], converged: int) -> Peer:
    """Mitsuba at each of `samples` a pixel, against 2 × `converged` samples.

    The state's view must be what its scene's first camera sees.
    """
    from studio_plugins.export.mitsuba_run import DirectRenderer

    size = (state.view.width, state.view.height)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        program.registry.get("exporter", "mitsuba").save(state.scene, folder, program.registry)
        key = (content(state.scene, folder), size, converged)
        renderer = DirectRenderer(folder, size)
        cache = DiskCache(user_cache() / "peers")
        halves = []
        for half in (0, 1):
            kept = cache.get(METHOD, *key, half)
            if kept is None:
                made = converged_half(renderer, converged, half)
                cache.put({"linear": made}, METHOD, *key, half)
            else:
                made = kept["linear"]
            halves.append(made)
        seconds, errors = [], []
        for number, spp in enumerate(samples):
            picture, taken = renderer.timed(spp, seed=1_000_000 + number)
            if number + 1 < len(samples):  # the longest is steady
                _, again = renderer.timed(spp, seed=2_000_000 + number)
                taken = min(taken, again)  # in Mitsuba's favour where others use the machine
            seconds.append(taken)
            errors.append(lit_error(picture, *halves))
    return Peer(tuple(seconds), tuple(errors), (halves[0], halves[1]))


def converged_half(renderer: object, samples: int, half: int) -> F32:
    """(H, W, 3) mean of many pictures, of other random numbers than the other half's."""
    total: npt.NDArray[np.float64] | None = None
    calls = -(-samples // BATCH)
    for call in range(calls):
        made = renderer(min(samples, BATCH), seed=2 * call + half + 1)  # type: ignore[operator]
        total = made.astype(np.float64) if total is None else total + made
    assert total is not None
    return (total / calls).astype(np.float32)


def content(scene: Scene, folder: Path) -> str:
    """Hex digest of a scene and the folder that it was exported to.

    Pictures count by the scene's own hashes and factors: an EXR file also holds when it was written.
    """
    digest = hashlib.blake2b(digest_size=16)
    for path in sorted(path for path in folder.rglob("*") if path.is_file() and path.suffix != ".exr"):
        held = path.read_bytes()
        digest.update(f"{path.relative_to(folder).as_posix()} {len(held)}\n".encode())
        digest.update(held)
    for light in scene.of(Environment):
        digest.update(f"{light.image.key} {light.gain()}\n".encode())
    for material in scene.materials.values():
        keys = [(name, texture.image.key) for name, texture in material.textures.items()]
        digest.update(f"{sorted(material.values.items())} {keys}\n".encode())
    return digest.hexdigest()
