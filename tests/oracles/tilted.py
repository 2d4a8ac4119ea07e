"""Light sums at leaning normals, node by node in float64: what tilts of vertices are differences of."""

from __future__ import annotations

import numpy as np
from oracles.radiance import evaluate

LEAST = 1e-3


def leaning_sum(brdf, shape, to_eye, nodes, lean):
    """Terms (K, 3) of nodes (N, 6: direction, light) about a normal `lean` (3,), all in the vertex' frame."""
    normal = np.asarray(lean, np.float64) / np.linalg.norm(lean)
    along = np.array([1.0, 0, 0]) - normal[0] * normal
    along /= np.linalg.norm(along)
    axes = np.stack([along, np.cross(normal, along), normal])
    wo = axes @ to_eye
    if wo[2] < LEAST:
        wo[2] = LEAST
        wo /= np.linalg.norm(wo)
    made = np.zeros((brdf.terms, 3))
    for node in nodes:
        wi = axes @ node[:3]
        if wi[2] > 0:
            light = node[3:] * wi[2] / max(node[2], LEAST)
            wi[2] = max(wi[2], LEAST)
            made += evaluate(brdf, shape, wo, wi)[:, None] * light
    return made


def tilts(at, slope):
    """(3, …): what sums at(normal) change by for x, y and 1 − z: from four that lean and one upright."""
    right, left, up, down = (
        at(np.array(way)) for way in ((slope, 0, 1), (-slope, 0, 1), (0, slope, 1), (0, -slope, 1))
    )
    cosine = np.cos(np.arctan(slope))
    sine = np.sin(np.arctan(slope))
    bend = ((right + left + up + down) / 4 - at(np.array((0, 0, 1)))) / (1 - cosine)
    return np.stack([(right - left) / (2 * sine), (up - down) / (2 * sine), bend])
