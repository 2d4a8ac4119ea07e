"""Whether a picture can be made of it: what a backend gives is looked at before kernels index with it."""

from __future__ import annotations

from typing import Any

import numpy as np

from studio_core.kernels.tilted import FIELDS
from studio_core.shading.artifacts import Hits, LayerRadiance, Radiance


class UnsoundError(ValueError):
    """A backend gave arrays that do not fit each other, or numbers that are none."""


class Soundness:
    """Looks at each array once: what came through and comes again is not looked at again."""

    def __init__(self) -> None:
        self._sound: tuple[object, ...] = ()

    def check(self, radiance: Any, hits: Any) -> None:
        """UnsoundError unless shapes, indices and numbers fit; unlit vertices may hold anything.

        Shapes as in `Radiance` and `Hits`. A whole sum tells that all numbers are finite; only where it
        is not they are looked at one by one.
        """
        if not isinstance(radiance, Radiance) or not isinstance(hits, Hits):
            kinds = " and ".join(type(thing).__name__ for thing in (radiance, hits))
            raise UnsoundError(f"it gave {kinds}, not radiance and hits")
        known, mesh = {id(thing) for thing in self._sound}, radiance.surfaces.mesh
        self._sound = ()
        layers = {**radiance.layers, "other surfaces": radiance.indirect}
        given = {node: layer for node, layer in layers.items() if layer is not None}
        count, every = len(mesh.positions), [layer.terms for layer in given.values()]
        width = next((terms.shape[1] for terms in every if getattr(terms, "ndim", 0) == 3), 1)
        _fits("valid", radiance.valid, (count,), np.bool_)
        for node, layer in given.items():
            _fits(f"terms of {node}", layer.terms, (count, width, 3), np.float32)
            _fits(f"irradiance of {node}", layer.irradiance, (count, 3), np.float32)
            if layer.tilts is not None:
                _fits(f"tilts of {node}", layer.tilts, (count, FIELDS, width, 3), np.float32)
            for numbers in _numbers(layer):
                if id(numbers) not in known:
                    _finite(numbers, radiance)
        if not (id(hits) in known and id(mesh) in known):
            _check_hits(hits, len(mesh.faces))
        seen = [part for layer in given.values() for part in _numbers(layer)]
        self._sound = (hits, mesh, *seen)


def _numbers(layer: LayerRadiance) -> tuple[np.ndarray[Any, Any], ...]:
    own = (layer.terms, layer.irradiance)
    return own if layer.tilts is None else (*own, layer.tilts)


def _check_hits(hits: Hits, faces: int) -> None:
    samples = hits.view.width * hits.view.height * hits.samples**2
    for name, kind in (("face", np.int32), ("u", np.float32), ("v", np.float32), ("distance", np.float32)):
        _fits(f"{name} of its hits", getattr(hits, name), (samples,), kind)
    if samples and not -1 <= int(hits.face.min()) <= int(hits.face.max()) < faces:
        raise UnsoundError(f"its hits name faces that there are not; there are {faces}")


def _fits(name: str, array: Any, shape: tuple[int, ...], kind: Any) -> None:
    if not isinstance(array, np.ndarray) or array.shape != shape or array.dtype != kind:
        found = f"{array.dtype} {array.shape}" if isinstance(array, np.ndarray) else type(array).__name__
        raise UnsoundError(f"{name} should be {np.dtype(kind)} {shape}, and is {found}")


def _finite(numbers: np.ndarray[Any, Any], radiance: Radiance) -> None:
    with np.errstate(all="ignore"):
        if np.isfinite(numbers.sum(dtype=np.float64)):
            return
    wrong = radiance.valid & ~np.isfinite(numbers.reshape(len(numbers), -1)).all(axis=1)
    if wrong.any():
        node = radiance.surfaces.nodes[int(radiance.surfaces.mesh.object[np.argmax(wrong)])]
        raise UnsoundError(f"{int(wrong.sum())} vertices have light that is no number, first at {node}")
