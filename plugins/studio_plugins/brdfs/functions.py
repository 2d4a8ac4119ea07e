"""A model's compiled functions by their addresses, as kernels call them."""

from __future__ import annotations

from typing import ClassVar

from studio_core.jit import BatchFunction


class Functions:
    """That part of `studio_core.contract.SampledBrdf`; `functions`: evaluate, sample, density."""

    functions: ClassVar[tuple[BatchFunction, BatchFunction, BatchFunction]]

    @property
    def address(self) -> int:
        """Of `evaluate`."""
        return self.functions[0].address

    @property
    def sampler(self) -> int:
        """Of `sample`."""
        return self.functions[1].address

    @property
    def density(self) -> int:
        """Of `density`."""
        return self.functions[2].address
