"""Figures 8 and 10 of the interreflection paper, as numbers, cases `figure-8/…` and `figure-10/…`.

Figure 8: how well N functions make the light on an object, of a floor and of a compact one, for lights that
nobody learnt from: between those of the training, and anywhere within four radii (`off`: off the sphere, or
off the grid over the floor). All functions are fitted by least squares, by area, so that each kind is as good
as it can be. Fourier cosine series, lowest frequencies first, and Haar wavelets, coarsest first, lie over the
unit square: the floor's own, or the compact object's octahedral map, as it is star-shaped. Harmonics are of
the direction from the object's middle; the floor's square is wound around the sphere, evenly by area.

Figure 10: what a Phong lobe of exponent n loses as K products, by the truncated singular value decomposition
of the paper, and by the products of `transport.separable` that keep the energy.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report
from studio.bench.interreflection_meshes import bunny, slab, star
from studio.bench.plot import Chart
from studio.headless import Headless
from studio_core.arrays import frozen_map
from studio_core.contract import Services
from studio_core.scene.geometry import Geometry
from studio_core.scene.nodes import Material, Scene
from studio_core.scene.shading_mesh import shade_mesh
from studio_core.shading.job import Job
from studio_core.shading.varying import ShapeTable
from studio_core.transport.cells import CELLS
from studio_core.transport.separable import Separator

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]

COUNTS = (1, 2, 4, 8, 16, 32, 64)
EXPONENTS = (4, 8, 16, 32, 64, 128, 256)
PRODUCTS = (1, 2, 4, 8, 16, 32, 64)
SHOWN = (4, 8, 16, 32)
LEARNT, TRIED = 256, 64
PRINCIPAL = "principal components"
OBJECTS: Mapping[str, tuple[Geometry, float]] = {
    "floor": (slab(2.0, 2.0, 0.02, (40, 40)), 0.06),
    "bunny": (star(47, 64, bunny), 0.06),
}


def run(report: Report, program: Headless, setup: Any) -> None:
    """All rows that are wanted."""
    for name in OBJECTS:
        case = f"figure-8/{name}"
        if report.wants(case):
            for held, curves in bases(name, program.services).items():
                for kind, errors in curves.items():
                    for count, error in zip(COUNTS, errors, strict=True):
                        report.add(case, f"{kind.replace(' ', '_')}_{count}_{held}", error, "1")
    if any(report.wants(f"figure-10/phong-{n}") for n in EXPONENTS):
        for n, kinds in products(program).items():
            for kind, errors in kinds.items():
                for count, error in zip(PRODUCTS, errors, strict=True):
                    if report.wants(f"figure-10/phong-{n}"):
                        report.add(f"figure-10/phong-{n}", f"{kind}_{count}", error, "1")


def bases(name: str, services: Services) -> dict[str, dict[str, list[float]]]:
    """Relative RMSE of light on an object by number of functions: by lights (`between`, `off`), by kind."""
    from studio_plugins.interreflection.fields.bases import principal_components
    from studio_plugins.interreflection.fields.body import Body, Reflection
    from studio_plugins.interreflection.fields.lattice import lattice_of
    from studio_plugins.interreflection.fields.training import columns, light_places, lit

    geometry, edge = OBJECTS[name]
    mesh, job = shade_mesh(geometry, edge), Job("Figure 8")
    some = np.flatnonzero(mesh.normals[:, 1] > 0.5) if name == "floor" else np.arange(len(mesh))
    nothing = np.zeros((1, 0, CELLS), np.float32)
    reflection = Reflection(np.zeros(len(mesh), np.int64), True, nothing, nothing)
    own = Body(name, mesh, np.ones(len(mesh.faces), np.bool_), reflection, some.astype(np.int64))
    lattice = lattice_of(mesh, 16, 20, own.some)
    area = mesh.area[own.vertices].astype(np.float64)
    area /= area.sum()
    training = light_places(lattice, LEARNT)
    tried = _held_out(training, lattice.centre, lattice.radius, name == "floor")
    with own.caster() as caster:
        learnt = columns(own, *lit(own, caster, training, services, job))
        light = {held: lit(own, caster, places, services, job)[0] for held, places in tried.items()}
    around = mesh.positions[own.vertices].astype(np.float64) - lattice.centre
    square = _square(around, name == "floor")
    most = max(COUNTS)
    kinds = {
        "cosine series": cosines(square, most),
        "harmonics": _harmonics(square, around, name == "floor", most),
        "wavelets": wavelets(square, most),
        PRINCIPAL: principal_components(learnt, area, most).functions.astype(np.float64),
    }
    return {
        held: {kind: _errors(functions, area, values) for kind, functions in kinds.items()}
        for held, values in light.items()
    }


def _held_out(training: F64, centre: F64, radius: float, flat: bool) -> dict[str, F64]:
    """(TRIED, 3) lights as far as those of the training, elsewhere; and others anywhere about the object."""
    rng = np.random.default_rng(8)
    if flat:
        low, high = training.min(axis=0), training.max(axis=0)
        between = rng.uniform(low, high, (TRIED, 3))
        off = centre + rng.uniform((-2, 0.15, -2), (2, 3, 2), (TRIED, 3)) * radius
        return {"between": between, "off": off}
    towards = rng.normal(size=(2 * TRIED, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    reach = np.linalg.norm(training - centre, axis=1).mean()
    far = radius * rng.uniform(1.1, 4.0, (TRIED, 1))
    return {"between": centre + reach * towards[:TRIED], "off": centre + far * towards[TRIED:]}


def _errors(functions: F64, area: F64, values: F32) -> list[float]:
    """Relative RMSE of lights (V, M) by the first N of functions (V, most), for all of `COUNTS`."""
    root = np.sqrt(area)[:, None]
    light = values.astype(np.float64)
    light = light[:, light.any(axis=0)]
    light /= area @ light  # each light's mean is 1
    scaled, made = root * light, []
    for count in COUNTS:
        own = functions[:, :count]
        basis, sizes, _ = np.linalg.svd(root * own, full_matrices=False)
        basis = basis[:, sizes > 1e-9 * sizes[0]]
        rest = scaled - basis @ (basis.T @ scaled)
        made.append(float(np.sqrt((rest**2).sum(axis=0)).mean()))
    return made


def _square(around: F64, flat: bool) -> F64:
    """(V, 2) in the unit square."""
    if flat:
        along = around[:, [0, 2]]
        low, high = along.min(axis=0), along.max(axis=0)
        return np.asarray((along - low) / (high - low))
    x, y, z = (around / np.abs(around).sum(axis=1, keepdims=True)).T
    s = np.where(z < 0, (1 - np.abs(y)) * np.where(x < 0, -1.0, 1.0), x)
    t = np.where(z < 0, (1 - np.abs(x)) * np.where(y < 0, -1.0, 1.0), y)
    return np.stack([s + 1, t + 1], axis=1) / 2


def cosines(square: F64, count: int) -> F64:
    """(V, count) cos(iπu) cos(jπv), lowest frequencies first."""
    pairs = sorted(
        ((i, j) for i in range(count) for j in range(count)), key=lambda p: (p[0] ** 2 + p[1] ** 2, p)
    )
    u, v = math.pi * square.T
    return np.stack([np.cos(i * u) * np.cos(j * v) for i, j in pairs[:count]], axis=1)


def _harmonics(square: F64, around: F64, flat: bool, count: int) -> F64:
    from studio_plugins.interreflection.fields.harmonics import harmonics_of

    towards = around / np.maximum(np.linalg.norm(around, axis=1, keepdims=True), 1e-12)
    if flat:
        z, turn = 1 - 2 * square[:, 1], 2 * math.pi * square[:, 0]
        ring = np.sqrt(np.maximum(1 - z * z, 0.0))
        towards = np.stack([ring * np.cos(turn), ring * np.sin(turn), z], axis=1)
    return harmonics_of(towards, math.isqrt(count - 1) + 1)[:, :count]


def wavelets(square: F64, count: int) -> F64:
    """(V, count) Haar's functions over the square, the mean first, then coarsest first."""
    u, v = np.minimum(square, 1 - 1e-9).T
    made = [np.ones(len(u))]
    level = 0
    while len(made) < count:
        cells = 2**level
        column, row = (u * cells).astype(int), (v * cells).astype(int)
        left = np.where(u * cells - column < 0.5, 1.0, -1.0)
        upper = np.where(v * cells - row < 0.5, 1.0, -1.0)
        for j in range(cells):
            for i in range(cells):
                inside = (column == i) & (row == j)
                made += [np.where(inside, shape, 0.0) for shape in (left, upper, left * upper)]
        level += 1
    return np.stack(made[:count], axis=1)


def products(program: Headless) -> dict[int, dict[str, list[float]]]:
    """By exponent: cosine-weighted errors of K = `PRODUCTS`, cut off (`plain`) and with the energy kept."""
    names = [f"n{n}" for n in EXPONENTS]
    materials = [
        Material(
            id=name,
            name=name,
            model="phong",
            values=frozen_map(
                {"diffuse": (0.0, 0.0, 0.0), "specular": (1.0, 1.0, 1.0), "exponent": float(n)}
            ),
        )
        for name, n in zip(names, EXPONENTS, strict=True)
    ]
    scene = Scene().with_materials(*materials)
    nothing = np.zeros(0, np.int32), np.zeros((0, 2), np.float32)
    shapes = ShapeTable(program.registry).at(scene, tuple(names), *nothing)
    plain, kept = Separator(), Separator()
    by_count = {count: (plain.fixed(shapes, count), kept(shapes, 0.0, count)) for count in PRODUCTS}
    return {
        n: {
            "plain": [float(by_count[count][0].error[row]) for count in PRODUCTS],
            "energy_kept": [float(by_count[count][1].error[row]) for count in PRODUCTS],
        }
        for row, n in enumerate(EXPONENTS)
    }


def figure_8(services: Services) -> list[Chart]:
    """Two charts of each object: lights between those of the training, and off them."""
    words = {"between": "lights between the learnt", "off": "lights elsewhere"}
    made = []
    for name in OBJECTS:
        for held, curves in bases(name, services).items():
            short = {_SHORT.get(kind, kind): errors for kind, errors in curves.items()}
            title = f"{name}, {words[held]}"
            made.append(Chart(title, "functions N", "relative RMSE", COUNTS, short, 100.0, " %"))
    return made


_SHORT = {PRINCIPAL: "principal comp."}


def figure_10(program: Headless) -> list[Chart]:
    """Error by K for each exponent, and by exponent for some K."""
    found = products(program)
    by_exponent = {f"n = {n}": kinds["plain"] for n, kinds in found.items()}
    places = [PRODUCTS.index(count) for count in SHOWN]
    by_count = {
        f"K = {count}": [found[n]["plain"][place] for n in EXPONENTS]
        for count, place in zip(SHOWN, places, strict=True)
    }
    up = "relative error"
    return [
        Chart("A Phong lobe as K products", "products K", up, PRODUCTS, by_exponent, 100.0, " %"),
        Chart("by its exponent", "exponent n", up, EXPONENTS, by_count, 100.0, " %"),
    ]


__all__ = ["bases", "cosines", "figure_8", "figure_10", "products", "run", "wavelets"]
