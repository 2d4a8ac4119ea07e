"""A tabulated model together with its tables: from then on a reflectance model like any other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.contract import TabulatedBrdf
from studio_core.params import Value
from studio_core.scene.geometry import Table


class Bound:
    """Satisfies `studio_core.contract.Brdf`; equal where model and tables are the same objects.

    Shapes name the tables, which live at least as long as this.
    """

    def __init__(self, inner: TabulatedBrdf, tables: Mapping[str, Table]) -> None:
        self.inner, self.tables = inner, frozen_map(tables)
        self.id, self.label, self.Params = inner.id, inner.label, inner.Params
        own = getattr(inner, "terms_of", None)
        self.terms: int = inner.terms if own is None else own(self.tables)
        self.textures = inner.textures
        self.turning = str(getattr(inner, "turning", ""))
        self.shape_textures: tuple[str, ...] = tuple(getattr(inner, "shape_textures", ()))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Bound) and (self.inner, *self._held) == (other.inner, *other._held)

    def __hash__(self) -> int:
        return hash((self.inner, *self._held))

    @property
    def _held(self) -> tuple[tuple[str, Table], ...]:
        return tuple(self.tables.items())

    @property
    def address(self) -> int:
        """Of the model's kernel."""
        return self.inner.address

    @property
    def sampler(self) -> int:
        """As in `SampledBrdf`; 0 where the model draws no directions."""
        return int(getattr(self.inner, "sampler", 0))

    @property
    def density(self) -> int:
        """As in `SampledBrdf`; 0 where the model draws no directions."""
        return int(getattr(self.inner, "density", 0))

    def shape(self, values: Mapping[str, Value]) -> npt.NDArray[np.float32]:
        """(n,) of the model and these tables; InputError when they do not fit."""
        return self.inner.shape_of(values, self.tables)

    def coefficients(self, values: Mapping[str, npt.NDArray[np.floating[Any]]]) -> npt.NDArray[np.float32]:
        """Of the model, as many as it has terms with these tables."""
        return padded(self.inner.coefficients(values), self.terms)[..., : self.terms, :]


def bound(model: TabulatedBrdf, tables: Mapping[str, Table]) -> Bound:
    """The model with what it reads of `tables`; KeyError when one is missing."""
    return Bound(model, {name: tables[name] for name in model.tables})


def padded(made: npt.NDArray[np.float32], width: int) -> npt.NDArray[np.float32]:
    """Coefficients (…, K, 3) with at least `width` terms, zeros behind their own."""
    if made.shape[-2] >= width:
        return made
    wider = np.zeros((*made.shape[:-2], width, 3), np.float32)
    wider[..., : made.shape[-2], :] = made
    return wider
