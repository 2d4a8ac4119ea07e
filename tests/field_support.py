"""Bodies to make fields of: one mesh, matte or with a lobe."""

from __future__ import annotations

import numpy as np

from studio_core.contract import Services
from studio_core.scene.shading_mesh import shade_mesh
from studio_core.shading.job import Job
from studio_core.transport.cells import CELLS, cell_directions
from studio_plugins.interreflection.fields.bases import Basis
from studio_plugins.interreflection.fields.body import Body, Reflection
from studio_plugins.interreflection.fields.precompute import precomputed

JOB = Job("test")


def services(workers):
    return Services(workers, None)


def body(geometry, edge, lobes=0, matte=True):
    """A body of which every vertex has so many functions, cosⁿ of both directions."""
    mesh = shade_mesh(geometry, edge)
    z = np.maximum(cell_directions()[:, 2], 0)
    tables = np.array([z ** (k + 1) for k in range(lobes)], np.float32).reshape(1, lobes, CELLS)
    row = np.zeros(len(mesh), np.int64)
    key = f"{geometry.key} {mesh.edge}"
    return Body(key, mesh, np.ones(len(mesh.faces), bool), Reflection(row, matte, tables, tables))


def even(mesh):
    """One function, 1 everywhere."""
    return Basis(np.ones((len(mesh), 1), np.float32), mesh.area.astype(np.float64))


def field(own, lattice, basis, workers, rays=256, bands=4):
    with own.caster() as caster:
        return precomputed(own, caster, lattice, basis, rays, bands, services(workers), JOB)
