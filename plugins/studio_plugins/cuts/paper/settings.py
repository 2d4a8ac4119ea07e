"""What may be chosen of the paper's method, and what is counted of it."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from studio_plugins.cuts.paper import placement
from studio_plugins.cuts.paper.height_cuts import HIGHEST_K
from studio_plugins.cuts.paper.records import CutSizes


@dataclass(frozen=True)
class PaperParams:
    """What the paper leaves to choose.

    k: 2^k directions, at most 15. threshold: error of self-visibility cuts; 0.002 gives about the paper's
    428 nodes a cut in the sample room, and under a few strong lamps irradiance wrong by up to 4 %; with
    0.0005, and a merge half as large, by nothing to speak of beside the fields. shells and cells: n spheres
    of 6·m² samples (the paper: 32 and 32). operations: "intervals" or "counters" (V.A.3), with the same
    result. merge: error, measured like `threshold`, to which siblings of the product are merged again; the
    paper sums over all nodes at the minimum heights, as 0 does: four times as many in the sample room for a
    difference of 0.3 %. horizon: leave out objects under the horizon (V.B). hidden: leave out objects that
    only cover what the receiver's own object covers (ours).
    """

    k: int = HIGHEST_K
    threshold: float = 0.002
    shells: int = 32
    cells: int = 32
    operations: str = "intervals"
    merge: float = 0.001
    horizon: bool = True
    hidden: bool = True


@dataclass(frozen=True)
class PaperCounts:
    """What is kept, and what was done since the path was made.

    vcf_possible: samples that all fields together have. pairs_…: of receivers with objects, per product.
    """

    svc: CutSizes = CutSizes()
    vcf: CutSizes = CutSizes()
    fields: int = 0
    vcf_possible: int = 0
    kept_bytes: int = 0
    product_nodes: int = 0
    rays: int = 0
    products: int = 0
    pairs_used: int = 0
    pairs_under_horizon: int = 0
    pairs_hidden: int = 0
    pairs_inside: int = 0
    pairs_beyond: int = 0
    seconds: dict[str, float] = field(default_factory=dict)

    def with_product(self, counts: npt.NDArray[np.int64], products: int) -> PaperCounts:
        """After a run of the product kernels, with their counts (`placement.COUNTS`,)."""
        return dataclasses.replace(
            self,
            products=self.products + products,
            pairs_used=self.pairs_used + int(counts[placement.USED]),
            pairs_under_horizon=self.pairs_under_horizon + int(counts[placement.HORIZON]),
            pairs_hidden=self.pairs_hidden + int(counts[placement.HIDDEN]),
            pairs_inside=self.pairs_inside + int(counts[placement.NEAR]),
            pairs_beyond=self.pairs_beyond + int(counts[placement.FAR]),
        )
