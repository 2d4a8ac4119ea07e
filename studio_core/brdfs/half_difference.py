"""Half and difference angles (Rusinkiewicz, "A New Change of Variables for Efficient BRDF Representation",
1998): the coordinates in which measured isotropic reflectance is kept.

h is the half vector of ω_i and ω_o, θ_h its angle with the normal; ω_i seen in the frame whose pole is h has
the polar angle θ_d and the azimuth φ_d, counted from the direction in which θ_h grows. Exchanging ω_i and ω_o
turns φ_d by π, so a table over 0…π is reciprocal by itself.

A *half-difference table* is (H, D, P, 3) float32, linear Rec.709, 1/sr: cell (i, j, k) is the mean over
θ_h = 90° (i, i+1)²/H², θ_d = 90° (j, j+1)/D, φ_d = 180° (k, k+1)/P, and is taken for the value in the middle
of the cell's indices. That is the layout of the MERL database with H = D = 90, P = 180.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

F64 = npt.NDArray[np.float64]


def from_angles(theta_h: F64, theta_d: F64, phi_d: F64) -> tuple[F64, F64]:
    """Unit ω_i and ω_o (..., 3) with h in the xz plane; radians. They may lie below the surface."""
    sine_h, cosine_h = np.sin(theta_h), np.cos(theta_h)
    along, across, up = (
        np.sin(theta_d) * np.cos(phi_d),
        np.sin(theta_d) * np.sin(phi_d),
        np.cos(theta_d),
    )
    shared = np.stack(np.broadcast_arrays(sine_h * up, 0.0 * up, cosine_h * up), axis=-1)
    apart = np.stack(np.broadcast_arrays(cosine_h * along, across, -sine_h * along), axis=-1)
    return shared + apart, shared - apart


def to_angles(wi: F64, wo: F64) -> tuple[F64, F64, F64]:
    """θ_h, θ_d and φ_d in 0…π of unit directions (..., 3); where h is the normal, φ_d is ω_i's azimuth."""
    h, e = wi + wo, wi - wo
    length = np.sqrt((h * h).sum(-1))
    flat = h[..., 0] ** 2 + h[..., 1] ** 2
    theta_h = np.arctan2(np.sqrt(flat), h[..., 2])
    theta_d = np.arctan2(np.sqrt((e * e).sum(-1)), length)
    upright = flat < 1e-14
    across = np.where(upright, e[..., 1], h[..., 0] * e[..., 1] - h[..., 1] * e[..., 0])
    along = np.where(upright, e[..., 0], -e[..., 2] * length)
    phi_d = np.arctan2(across, along)
    return theta_h, theta_d, np.where(phi_d < 0, phi_d + np.pi, phi_d)


def centres(shape: tuple[int, ...]) -> tuple[F64, F64, F64]:
    """Angles of the cells' middles: (H,), (D,), (P,) in radians."""
    h, d, p = (np.arange(n) + 0.5 for n in shape[:3])
    return (
        np.pi / 2 * (h / shape[0]) ** 2,
        np.pi / 2 * d / shape[1],
        np.pi * p / shape[2],
    )


def grid(shape: tuple[int, ...]) -> tuple[F64, F64]:
    """ω_i and ω_o (H, D, P, 3) in the middle of every cell."""
    theta_h, theta_d, phi_d = centres(shape)
    return from_angles(theta_h[:, None, None], theta_d[None, :, None], phi_d[None, None, :])


def filled(table: npt.NDArray[np.floating], known: npt.NDArray[np.bool_]) -> npt.NDArray[np.float32]:
    """The table (H, D, P, 3) with cells that are not known (H, D, P) taken from the nearest known ones.

    First along θ_d, the way to grazing directions, from the next smaller angle; what is left (all of a line)
    from the next smaller θ_h, then from the next larger. ValueError when nothing is known.
    """
    if not known.any():
        raise ValueError("nothing in it is valid")
    made, there = np.where(known[..., None], table, 0).astype(np.float32), known.copy()
    for axis, backwards in ((1, False), (1, True), (0, False), (0, True)):
        if there.all():
            break
        flipped = np.flip(there, axis) if backwards else there
        count = there.shape[axis]
        steps = np.arange(count).reshape([-1 if a == axis else 1 for a in range(3)])
        last = np.maximum.accumulate(np.where(flipped, steps, -1), axis=axis)
        source = np.flip(count - 1 - last, axis) if backwards else last
        found = np.flip(last >= 0, axis) if backwards else last >= 0
        taken = np.take_along_axis(made, np.clip(source, 0, count - 1)[..., None], axis=axis)
        made, there = np.where(found[..., None], taken, made), found
    if not there.all():  # azimuths of which nothing is known
        nearest = np.flatnonzero(there.all(axis=(0, 1)))
        turn = np.abs(
            (np.arange(there.shape[2])[:, None] - nearest + there.shape[2] // 2) % there.shape[2]
            - there.shape[2] // 2
        )
        made = made[:, :, nearest[turn.argmin(axis=1)]]
    return np.ascontiguousarray(made)
