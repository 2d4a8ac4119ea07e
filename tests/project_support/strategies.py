"""Random scenes for the project's tests."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from hypothesis import strategies as st

from studio_core.arrays import frozen_map
from studio_core.scene.geometry import Geometry, Image, Table, Texture
from studio_core.scene.nodes import (
    AreaLamp,
    Camera,
    DirectionalLamp,
    Environment,
    Group,
    Material,
    MeshObject,
    Node,
    PointLamp,
    Scene,
    SpotLamp,
)
from studio_core.scene.room import Room
from studio_core.scene.room_shape import Opening
from studio_core.scene.transform import Transform

FLOATS = st.floats(allow_nan=False, allow_infinity=False)
TEXTS = st.text(max_size=12)
TRIPLES = st.tuples(FLOATS, FLOATS, FLOATS)
VALUES = st.one_of(FLOATS, st.booleans(), st.integers(-(2**63) + 1, 2**63 - 1), TEXTS, TRIPLES)


@st.composite
def transforms(draw: st.DrawFn) -> Transform:
    raw = draw(st.tuples(*[st.floats(-1, 1) for _ in range(4)]))
    length = math.hypot(*raw)
    unit = tuple(c / length for c in raw) if length > 1e-3 else (1.0, 0.0, 0.0, 0.0)
    return Transform(draw(TRIPLES), unit, draw(st.floats(1e-300, 1e300)))  # type: ignore[arg-type]


@st.composite
def geometries(draw: st.DrawFn) -> Geometry:
    seed = np.random.default_rng(draw(st.integers(0, 2**32)))
    points, faces = draw(st.integers(0, 40)), draw(st.integers(0, 60))
    faces = faces if points else 0
    size = np.float32(10.0 ** draw(st.integers(-30, 30)))
    full = (seed.random((points, 3)) - 0.5).astype(np.float32) * size
    return Geometry(
        full,
        seed.integers(0, max(points, 1), (faces, 3), dtype=np.uint32),
        seed.random((points, 3), dtype=np.float32) if draw(st.booleans()) else None,
        seed.random((points, 2), dtype=np.float32) if draw(st.booleans()) else None,
        seed.integers(0, 3, faces, dtype=np.uint16) if draw(st.booleans()) else None,
    )


@st.composite
def images(draw: st.DrawFn) -> Image:
    seed = np.random.default_rng(draw(st.integers(0, 2**32)))
    shape = (draw(st.integers(1, 9)), draw(st.integers(1, 9)), draw(st.sampled_from([1, 3, 4])))
    encoding = draw(st.sampled_from(["linear", "srgb", "data"]))
    if draw(st.booleans()):
        return Image(seed.integers(0, 256, shape, dtype=np.uint8), encoding)
    if draw(st.booleans()):
        return Image(np.full(shape, draw(st.floats(-1e30, 1e30)), np.float32), encoding)
    return Image((seed.standard_normal(shape) * 1e6).astype(np.float32), encoding)


@st.composite
def tables(draw: st.DrawFn) -> Table:
    seed = np.random.default_rng(draw(st.integers(0, 2**32)))
    shape = tuple(draw(st.integers(1, 5)) for _ in range(4))
    return Table((seed.standard_normal(shape) * 1e3).astype(np.float32), draw(TEXTS))


@st.composite
def materials(draw: st.DrawFn, ident: str, pictures: Sequence[Image]) -> Material:
    laid = st.builds(Texture, st.sampled_from(pictures), st.tuples(FLOATS, FLOATS), st.tuples(FLOATS, FLOATS))
    return Material(
        id=ident,
        name=draw(TEXTS),
        model=draw(st.sampled_from(["lambert", "ggx", "never-heard-of"])),
        values=frozen_map(draw(st.dictionaries(TEXTS, VALUES, max_size=4))),
        textures=frozen_map(draw(st.dictionaries(TEXTS, laid, max_size=2))),
        tables=frozen_map(draw(st.dictionaries(TEXTS, tables(), max_size=2))),
        opacity=draw(st.floats(0, 1)),
    )


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    meshes = draw(st.lists(geometries(), min_size=1, max_size=3))
    pictures = draw(st.lists(images(), min_size=1, max_size=3))
    paints = [draw(materials(f"material-{k}", pictures)) for k in range(draw(st.integers(3, 5)))]
    order = draw(st.permutations(range(draw(st.integers(0, 8)))))
    made: list[Node] = []
    for place in order:
        parent = draw(st.sampled_from([None, *(n.id for n in made)]))
        base = {
            "id": f"node-{place}",
            "name": draw(TEXTS),
            "parent": parent,
            "transform": draw(transforms()),
            "hidden": draw(st.booleans()),
            "locked": draw(st.booleans()),
        }
        lit = {
            "intensity": draw(st.floats(0, 1e9)),
            "tint": draw(st.tuples(*[st.floats(0, 1e3)] * 3)),
            "temperature": draw(st.floats(0, 25000)),
        }
        made.append(
            draw(
                st.sampled_from(
                    [
                        Group(**base),
                        MeshObject(
                            **base,
                            geometry=draw(st.sampled_from(meshes)),
                            materials=tuple(draw(st.permutations([p.id for p in paints]))[:3]),
                        ),
                        Camera(**base, fov=draw(st.floats(1, 170))),
                        Environment(
                            **base,
                            **lit,
                            image=draw(st.sampled_from(pictures)),
                            luminance_scale=draw(st.none() | FLOATS),
                        ),
                        PointLamp(**base, **lit),
                        SpotLamp(**base, **lit),
                        DirectionalLamp(**base, **lit),
                        AreaLamp(**base, **lit, width=draw(st.floats(1e-3, 1e3))),
                        Room(
                            **base,
                            materials=("material-1", "material-0", "material-2", "material-0", "material-1"),
                            width=draw(st.floats(2, 20)),
                            ceiling=draw(st.booleans()),
                            without=draw(st.sampled_from([(), (2,), (0, 1)])),
                            openings=draw(st.sampled_from([(), (Opening(along=0.5), Opening(wall=1))])),
                        ),
                    ]
                )
            )
        )
    shuffled = draw(st.permutations(made))
    return Scene(frozen_map({n.id: n for n in shuffled}), frozen_map({m.id: m for m in paints}))
