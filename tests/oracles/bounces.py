"""Light from surface to surface, slowly: `studio_core.transport.gather` and the final gather."""

from __future__ import annotations

import numpy as np

from studio_core.transport.hits import BLACK


def sent(vertex, cell, light, surface):
    """(3,) radiance of a vertex towards a cell."""
    known = surface.separated
    made = light.matte[vertex].astype(np.float64)
    first = surface.slot[vertex]
    if first >= 0:
        row = surface.row[vertex]
        count, base = known.count[row], known.base[row]
        g = known.outgoing[base + cell * count : base + (cell + 1) * count].astype(np.float64)
        own = light.functions[3 * first : 3 * (first + count)].reshape(3, count)
        made = made + own.astype(np.float64) @ g
    return np.maximum(made, 0)


def received(light, rows, hits, ray_cells, variants, surface):
    """Irradiance (V, 3) and functions (S, 3) over rays that stand for π / N each; variants (R,)."""
    known = surface.separated
    irradiance = np.zeros(light.matte.shape)
    functions = np.zeros((surface.size, 3))
    scale = np.pi / hits.vertex.shape[1]
    for i, receiver in enumerate(rows):
        for j, vertex in enumerate(hits.vertex[i]):
            if vertex >= BLACK:
                continue
            arrives = scale * sent(vertex, hits.cell[i, j], light, surface)
            irradiance[receiver] += arrives
            first = surface.slot[receiver]
            if first >= 0:
                row = surface.row[receiver]
                count, base = known.count[row], known.base[row]
                at = base + ray_cells[variants[i], j] * count
                h = known.incoming[at : at + count].astype(np.float64)
                functions[first : first + count] += h[:, None] * arrives
    return irradiance, functions


def reflected(irradiance, functions, surface):
    """Matte radiance (V, 3) and functions (3 S,) that are sent back."""
    known = surface.separated
    matte, back = np.zeros(irradiance.shape), np.zeros(functions.size)
    for v, row in enumerate(surface.row):
        if row < 0:
            continue
        terms = min(known.matte.shape[1], surface.coefficients.shape[1])
        albedo = (known.matte[row, :terms, None] * surface.coefficients[v, :terms]).sum(axis=0)
        matte[v] = albedo * irradiance[v]
        first = surface.slot[v]
        if first >= 0:
            count = known.count[row]
            term = known.term[known.first[row] : known.first[row] + count]
            own = surface.coefficients[v, term] * functions[first : first + count]
            back[3 * first : 3 * (first + count)] = own.T.ravel()
    return matte, back
