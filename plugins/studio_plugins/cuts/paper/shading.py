"""Equation (3): light of the nodes times their visibility, as irradiance or as nodes for BRDF kernels."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from studio_core.jit import kernel
from studio_core.kernels.radiance import LOWEST_VIEW, surface_frame
from studio_plugins.cuts.paper.placement import f32_at, u16_at

I64 = npt.NDArray[np.int64]
F32 = npt.NDArray[np.float32]


@kernel
def irradiance_of(
    start: int,
    stop: int,
    points: I64,
    number_addresses: I64,
    value_addresses: I64,
    sizes: I64,
    node_sum: F32,
    solid_angle: float,
    out: F32,
) -> None:
    """Σ_k l_k v_k of rows start … stop into out (P, 3); all but `node_sum` are per row of `points`."""
    for row in range(start, stop):
        red, green, blue = 0.0, 0.0, 0.0
        numbers = u16_at(number_addresses[row])
        values = f32_at(value_addresses[row])
        for item in range(sizes[row]):
            node = numbers[item]
            value = values[item]
            red += value * node_sum[node, 0]
            green += value * node_sum[node, 1]
            blue += value * node_sum[node, 2]
        out[row, 0], out[row, 1], out[row, 2] = (
            red * solid_angle,
            green * solid_angle,
            blue * solid_angle,
        )


@kernel
def nodes_of(
    start: int,
    stop: int,
    points: I64,
    normals: F32,
    tangents: F32,
    number_addresses: I64,
    value_addresses: I64,
    first: I64,
    node_sum: F32,
    axis: F32,
    solid_angle: float,
    data: F32,
) -> None:
    """Fills data (6 N,) of rows start … stop as `NodeBlock` has it.

    ω_k is the middle of the node's cell; where it lies below the horizon of a node that the horizon
    passes through, it is lifted to it.
    """
    axes = np.empty((3, 3))
    lowest = np.float32(LOWEST_VIEW)
    for row in range(start, stop):
        p = points[row]
        surface_frame(normals[p], tangents[p], axes)
        numbers = u16_at(number_addresses[row])
        values = f32_at(value_addresses[row])
        n = first[row + 1] - first[row]
        at = 6 * first[row]
        for item in range(n):
            node = numbers[item]
            dx, dy, dz = axis[node, 0], axis[node, 1], axis[node, 2]
            x = np.float32(axes[0, 0] * dx + axes[0, 1] * dy + axes[0, 2] * dz)
            y = np.float32(axes[1, 0] * dx + axes[1, 1] * dy + axes[1, 2] * dz)
            z = np.float32(axes[2, 0] * dx + axes[2, 1] * dy + axes[2, 2] * dz)
            if z < lowest:
                z = lowest
                scale = np.float32(1) / np.sqrt(max(x * x + y * y + z * z, np.float32(1e-12)))
                x, y, z = x * scale, y * scale, z * scale
            power = values[item] * np.float32(solid_angle)
            data[at + item], data[at + n + item], data[at + 2 * n + item] = x, y, z
            data[at + 3 * n + item] = power * node_sum[node, 0]
            data[at + 4 * n + item] = power * node_sum[node, 1]
            data[at + 5 * n + item] = power * node_sum[node, 2]
