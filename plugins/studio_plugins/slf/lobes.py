"""The lobes of all gloss levels as operators on an element's cells of directions (`transport.cells`).

The lobe is Neumann's: f = (n + 2) / 2π · cosⁿα / max(cosθ_i, cosθ_o), α between one direction and the other's
mirror image (Neumann, Neumann & Szirmay-Kalos 1999, "Compact Metallic Reflectance Models"). It is reciprocal,
and returns between half and all of the light that arrives. (The paper's cosⁿα alone returns up to 3.7 times
as much near the horizon, and divided by cosθ_i it would return 1 everywhere, but not be reciprocal.)

Over cells, light in and light out are means, and the operator is the lobe's mean over both cells, weighted
with cosines. It knows no azimuth of its own, so that it is one matrix of rings by rings for each frequency
around the normal: nothing of it is cut off, the only error is that of the quadrature.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from studio_core.transport.cells import PARTS, RINGS, cell_projected_angles
from studio_plugins.slf.ladder import LEVELS, alpha_of_level, exponent_of_alpha

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

FREQUENCIES = PARTS // 2 + 1
NODES = 8  # of Gauss's quadrature along a ring's height
AROUND = 512  # azimuths
NOTHING = -46.0  # logarithm of what is nothing beside 1
_STEP = math.pi / 2 / RINGS


def lobe(exponent: npt.ArrayLike, wi: npt.ArrayLike, wo: npt.ArrayLike) -> F64:
    """f of unit directions (…, 3) above the surface, whose normal is z; per steradian, without the cosine."""
    n, i, o = (np.asarray(one, np.float64) for one in (exponent, wi, wo))
    alike = np.maximum(i[..., 2] * o[..., 2] - i[..., 0] * o[..., 0] - i[..., 1] * o[..., 1], 0)
    least = np.maximum(np.maximum(i[..., 2], o[..., 2]), 1e-12)
    return np.asarray((n + 2) / (2 * math.pi) * alike**n / least)


def exponents() -> F64:
    """(LEVELS,) of Phong, rising."""
    return exponent_of_alpha(alpha_of_level(np.arange(LEVELS)))


@functools.cache
def cell_weights() -> F64:
    """(RINGS,) steradians times cosine of one cell; times PARTS and summed they are π."""
    return cell_projected_angles().astype(np.float64).reshape(RINGS, PARTS)[:, 0]


@functools.cache
def spectra(nodes: int = NODES, around: int = AROUND) -> F64:
    """(LEVELS, FREQUENCIES, RINGS out, RINGS in): the operators' kernels, symmetric in the rings.

    With light L (RINGS, PARTS) and its series L̂_m = Σ_k L_k e^(−2πi m k / PARTS), what is sent back is
    Ŝ_m = K_m diag(cell_weights) L̂_m. Level 0 is scaled by 0.9998, so that no lobe returns more than arrives.
    """
    made = np.zeros((LEVELS, RINGS, RINGS, around // 2 + 1))
    turn = np.cos(np.arange(around // 2 + 1) * (2 * math.pi / around))
    for ring in range(RINGS):
        for other in range(ring + 1):
            a, b, weight = _heights(ring, other, nodes)
            s, c = np.sin(a) * np.sin(b), np.cos(a) * np.cos(b)
            alike = c[:, None] - s[:, None] * turn
            with np.errstate(divide="ignore"):
                logarithm = np.where(alike > 0, np.log(np.maximum(alike, 1e-300)), -np.inf)
            weight = weight / np.maximum(np.cos(a), np.cos(b))
            most = logarithm.max()
            for level, n in enumerate(exponents().tolist()):
                if n * most < NOTHING:
                    break
                made[level, ring, other] = (n + 2) / (2 * math.pi) * (weight @ np.exp(n * logarithm))
            made[:, other, ring] = made[:, ring, other]
    series = np.fft.hfft(made, axis=-1)[..., : around // 2 + 1] / around
    kernels = _over_parts(series, around)
    kernels /= np.maximum(albedos(kernels).max(axis=1), 1)[:, None, None, None]
    kernels.setflags(write=False)
    return kernels


def _over_parts(series: F64, around: int) -> F64:
    """From Fourier series over the azimuth to those over parts, each mean over two parts' widths."""
    kept = np.zeros((*series.shape[:3], FREQUENCIES))
    for order in range(-(around // 2) + 1, around // 2):
        within = order % PARTS
        if within < FREQUENCIES:
            kept[..., within] += series[..., abs(order)] * np.sinc(order / PARTS) ** 2
    return np.ascontiguousarray(np.moveaxis(PARTS * kept, 3, 1))


def _heights(ring: int, other: int, nodes: int) -> tuple[F64, F64, F64]:
    """Pairs of angles from the normal in two rings, and weights that sum to 1, by sin θ cos θ of both.

    In one and the same ring both triangles beside the diagonal, on which the lobe has an edge, are alike.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    x, w = (x + 1) / 2, w / 2
    u, v = np.meshgrid(x, x, indexing="ij")
    weight = np.outer(w, w)
    if ring == other:
        u, v, weight = u, u * v, weight * u
    a, b = (ring + u.ravel()) * _STEP, (other + v.ravel()) * _STEP
    weight = weight.ravel() * np.sin(a) * np.cos(a) * np.sin(b) * np.cos(b)
    return a, b, weight / weight.sum()


def albedos(spectra_of: F64) -> F64:
    """(LEVELS, RINGS): how much of the light from a ring is sent back, or of white light towards it."""
    return np.asarray(np.einsum("lij,i->lj", spectra_of[:, 0], cell_weights()))


__all__ = ["FREQUENCIES", "albedos", "cell_weights", "exponents", "lobe", "spectra"]
