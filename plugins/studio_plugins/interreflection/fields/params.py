"""What can be chosen of the paper's method: its N, K, number of spheres, and how its parts are made."""

from __future__ import annotations

from dataclasses import dataclass

from studio_core.params import param


@dataclass(frozen=True)
class Params:
    """Parameters of the radiance fields; the first four are the paper's."""

    bounces: int = param(3, "Bounces", "How often light goes on from surface to surface", low=1, high=16)
    components: int = param(
        16, "Functions of an object", "N: principal components of its radiance", low=1, high=64
    )
    functions: int = param(
        4, "Products of a reflectance", "K: each a function of light and one of the view", low=1, high=36
    )
    shells: int = param(
        16, "Shells", "Spheres about an object on which its light is known", low=4, high=64, advanced=True
    )
    cells: int = param(
        20, "Places across a shell", "20 are as many places as 6 · 8²", low=4, high=64, advanced=True
    )
    bands: int = param(
        4,
        "Bands of harmonics",
        "Directions of light at a place: 4 bands are 16 numbers",
        low=1,
        high=6,
        advanced=True,
    )
    lights: int = param(
        128, "Lights to learn from", "Point lights about an object", low=8, high=1024, advanced=True
    )
    rays: int = param(
        256, "Rays of a place", "From each place to the object", low=16, high=4096, advanced=True
    )
    megabytes: int = param(
        512, "Megabytes", "Small objects get coarser fields so that all fit", low=16, high=8192, advanced=True
    )


__all__ = ["Params"]
