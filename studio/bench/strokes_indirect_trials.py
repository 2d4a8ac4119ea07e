"""Trials of strokes in indirect mode: places whose light a change of another object's material changes.

The truth are paths at the vertices under the stroke (`shading.path_tracing`), with the same random numbers
before and after: nothing of it comes from the rays and columns of a solver. Scenes are the interreflection
benchmark's `room`, and shared furniture in a room where the shared test data is there, every slot of every
object in a material of its own.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from studio.bench.interreflection_scenes import Setting, furniture, room
from studio.bench.interreflection_truth import scene_key
from studio.headless import Headless
from studio_core.arrays import frozen_map
from studio_core.contract import PaintableBrdf, Registry
from studio_core.folders import user_cache
from studio_core.params import Value, defaults
from studio_core.scene.nodes import Material, MeshObject, NodeId, Scene
from studio_core.shading.artifacts import Picture
from studio_core.shading.cache import DiskCache
from studio_core.shading.job import Job
from studio_core.shading.offline import backend_params, indirect_choice, scene_view
from studio_core.shading.path_tracing import PathSettings, chosen_points, indirect_layer
from studio_core.shading.path_world import PathWorlds
from studio_core.shading.primary import visible_vertices
from studio_core.shading.vertex_radiance import vertex_radiance, vertex_weights
from studio_core.strokes.marks import Marks
from studio_core.strokes.paintable import material_roles, paintable
from studio_core.strokes.session import Easel
from studio_core.strokes.solution import Lit

F64 = npt.NDArray[np.float64]
I64 = npt.NDArray[np.int64]

METHOD = "changed light at vertices, 1"
CHANGES = ("diffuse", "specular", "gloss")
WIDTH, HEIGHT = 240, 160
PLACES, FEWEST = 120, 60
"""Vertices of a stroke."""
ALIKE = 0.8
"""Cosine of the angle between normals of a stroke's places and of its middle."""
LEAST = 0.003
"""Change of the light under a stroke, relative and RMS, that makes a trial."""
OFF = 0.25
"""Of the light by way of others: where picture and paths differ by more, parts overlap, and nobody paints."""
DIM = 0.3
"""Of the mean light: darker places are not painted on."""
SCREENED, FEW = 128, 4
"""Paths a vertex, of every fourth, of each of two batches that tell whether a change makes a trial."""
PATHS, BATCHES, QUIET = 1024, 6, 0.1
"""Of what is painted: paths a vertex of a batch, and so many batches until its noise is that small."""
KNOWN = 0.3
"""Noise of the truth, of the change, above which it is none."""
SHOWN_BOUNCES = 3
NEAR = 0.6
"""Metres from a surface within which its gloss is seen."""
TRIES = 300
LEVELS_APART = 0.12
"""Of roughness α: glosses that are nearer are not told apart by eye."""


@dataclass(frozen=True, eq=False)
class Change:
    """What becomes of one slot of an object: its material's new values, and which role of it that is."""

    node: NodeId
    slot: int
    role: str
    material: Material


@dataclass(frozen=True, eq=False)
class IndirectTrial:
    """Vertices (N,) of one object with their light before, shown (N, 3), and after, wanted (N, 3).

    noise: of wanted − shown, by the paths of the truth itself, relative and RMS.
    """

    scene: Scene
    lit: Lit
    node: NodeId
    marks: Marks
    change: Change
    noise: float


class Stage:
    """A scene with its light as a solver gets it, and true light at some of its vertices."""

    def __init__(self, one: Setting, program: Headless) -> None:
        self.scene, self._program = apart(one.scene), program
        registry, services = program.registry, program.services
        backend = registry.get("backend", "reference")
        quality = {"directions": "1024", "lamp_samples": 8, "vertices": one.budget}
        gather = indirect_choice(registry, "gather", {"bounces": SHOWN_BOUNCES})
        easel = Easel(backend, backend_params(backend, quality), services, gather)
        view = scene_view(self.scene, None, WIDTH, HEIGHT)
        self.picture: Picture = easel.picture(self.scene, view, Job("Trial"))
        self.lit = easel.lit()
        self.eye = np.asarray(view.transform.translation, np.float64)
        made = self.picture.radiance
        self.surfaces = made.surfaces.unrefined
        count = len(self.surfaces.mesh)
        straight = dataclasses.replace(made, indirect=None)
        self.straight = vertex_radiance(self.scene, straight, registry)[:count].astype(np.float64)
        self.weights = vertex_weights(self.scene, self.surfaces, made.width, registry)
        assert made.hits is not None
        self.seen = np.flatnonzero(visible_vertices(made.surfaces, made.hits)[:count])
        self._worlds = PathWorlds(registry)
        self._key = scene_key(self.scene)
        self._cache = DiskCache(user_cache() / "truths")

    def _moved(self, change: Change, some: I64, paths: int, seed: int) -> tuple[F64, F64]:
        """(N, 3) light that came by way of other surfaces, and how a change changes it: by the same paths.

        At the changed surface paths go on by the cosine, before and after: so they part nowhere.
        """
        before, after = (self._light(scene, change, some, paths, seed) for scene in self._both(change))
        return before, after - before

    def _both(self, change: Change) -> tuple[Scene, Scene]:
        return self.scene, self.scene.with_materials(change.material)

    def _light(self, scene: Scene, change: Change, some: I64, paths: int, seed: int) -> F64:
        lit, mesh = self.lit, self.surfaces.mesh
        world = self._worlds(scene, self.surfaces, lit.casters, lit.lighting)
        number = self.surfaces.materials.index(change.material.id)
        sampler, density = world.models.sampler.copy(), world.models.density.copy()
        sampler[number] = density[number] = 0
        models = world.models._replace(sampler=sampler, density=density)
        shapes = dataclasses.replace(lit.shapes.of_points(some), tilt=None)
        settings = PathSettings(SHOWN_BOUNCES, paths, seed)
        layer = indirect_layer(
            chosen_points(mesh, some), shapes, self.eye, dataclasses.replace(world, models=models), settings,
            self._program.services.workers, Job("Truth"),
        )  # fmt: skip
        weights = self.weights[some][:, : layer.terms.shape[1]]
        return np.asarray((layer.terms[:, : weights.shape[1]] * weights).sum(axis=1), np.float64)

    def patch(self, middle: int) -> I64:
        """Seen vertices about one, of its slot, that face as it does."""
        mesh = self.surfaces.mesh
        own = self.seen[(mesh.object[self.seen] == mesh.object[middle])]
        own = own[mesh.material[own] == mesh.material[middle]]
        own = own[mesh.normals[own] @ mesh.normals[middle] > ALIKE]
        away = np.linalg.norm(mesh.positions[own] - mesh.positions[middle], axis=1)
        return np.asarray(own[np.argsort(away, kind="stable")[:PLACES]])

    def _near(self, node: NodeId, slot: int) -> I64:
        """Seen vertices near one slot's: how sharply it shines is seen nowhere else."""
        mesh = self.surfaces.mesh
        own = mesh.material == self.surfaces.materials.index(self._slot_material(node, slot))
        away = cKDTree(mesh.positions[own]).query(mesh.positions[self.seen], distance_upper_bound=NEAR)[0]
        near = self.seen[np.isfinite(away)]
        return near if len(near) else self.seen

    def trial(self, role: str, rng: np.random.Generator) -> IndirectTrial | None:
        """One that is drawn; None where none is found."""
        bright = DIM * float(self.straight[self.seen].mean())
        slots = slots_of(self.scene)
        for _ in range(TRIES):
            middle = int(rng.choice(self.seen))
            node, slot = slots[int(rng.integers(len(slots)))]
            if role == "gloss":
                middle = int(rng.choice(self._near(node, slot)))
            some = self.patch(middle)
            seed = int(rng.integers(1 << 20))
            own = self.surfaces.mesh.material[some[0]]
            name = self._slot_material(node, slot)
            if len(some) < FEWEST or self.surfaces.materials[own] == name:
                continue
            material = other(self.scene.material(name), role, rng, self._program.registry)
            if material is None:
                continue
            change = Change(node, slot, role, material)
            if self.straight[some].mean() < bright:
                continue
            made = self._truth(change, some, seed)
            if made is None:
                continue
            light, moved, noise = made
            own = np.flatnonzero(self._as_shown(some, light))
            if len(own) >= FEWEST:
                shown = (light + self.straight[some])[own]
                return self._painted(some[own], shown, moved[own], noise, change)
        return None

    def _as_shown(self, some: I64, light: F64) -> npt.NDArray[np.bool_]:
        """Where the picture shows about this light: not what lies inside of other parts."""
        assert self.lit.indirect is not None
        terms = self.lit.indirect.layer.terms[some]
        width = min(terms.shape[1], self.weights.shape[1])
        shown = (terms[:, :width] * self.weights[some][:, :width]).sum(axis=(1, 2))
        true = light.sum(axis=1)
        return np.asarray(np.abs(shown - true) < OFF * np.maximum(true, 0))

    def _truth(self, change: Change, some: I64, seed: int) -> tuple[F64, F64, float] | None:
        """Light before, how it changes, and that change's noise; None where that is too little or too noisy.

        Kept in the user's cache folder by all that it depends on.
        """
        how = (METHOD, self._key, _told(change), some.tobytes().hex(), seed)
        kept = self._cache.get(*how)
        if kept is None:
            made = self._traced(change, some, seed)
            arrays = (np.zeros((0, 3)),) * 3 if made is None else (made[0], made[1], np.full((1, 3), made[2]))
            kept = dict(zip(("light", "moved", "noise"), arrays, strict=True))
            self._cache.put(kept, *how)
        if not len(kept["noise"]):
            return None
        return kept["light"], kept["moved"], float(kept["noise"][0, 0])

    def _traced(self, change: Change, some: I64, seed: int) -> tuple[F64, F64, float] | None:
        light = moved = np.zeros((0, 0, 3))
        noise = 0.0
        for own, paths, most in ((some[::FEW], SCREENED, 2), (some, PATHS, BATCHES)):
            light, moved = np.zeros((2, 0, len(own), 3))
            while len(moved) < most:
                one, other = self._moved(change, own, paths, BATCHES * seed + len(moved))
                light, moved = np.concatenate([light, one[None]]), np.concatenate([moved, other[None]])
                if len(moved) == 1:
                    continue
                size, noise = size_and_noise(moved)
                if size < LEAST * (light.mean() + self.straight[own].mean()):
                    return None
                if noise * np.sqrt(paths * len(moved) / (PATHS * BATCHES)) > KNOWN:
                    return None
                if noise < QUIET:
                    break
        return light.mean(axis=0), moved.mean(axis=0), noise

    def _painted(self, some: I64, shown: F64, moved: F64, off: float, change: Change) -> IndirectTrial:
        mesh, count = self.surfaces.mesh, len(some)
        number = int(mesh.object[some[0]])
        placed = mesh.objects[number]
        local = some - mesh.vertex_offsets[number]
        marks = Marks(
            np.zeros(count, np.int64), placed.mesh.positions[local], placed.mesh.normals[local],
            placed.mesh.slot[local].astype(np.int64), np.tile(self.eye, (count, 1)).astype(np.float32),
            shown.astype(np.float32), (shown + moved).astype(np.float32), np.ones(count, np.float32),
            np.full((count, 3), np.nan, np.float32),
        )  # fmt: skip
        return IndirectTrial(self.scene, self.lit, placed.node, marks, change, off)

    def _slot_material(self, node: NodeId, slot: int) -> str:
        thing = self.scene[node]
        assert isinstance(thing, MeshObject)
        return thing.materials[slot]


def size_and_noise(batches: F64) -> tuple[float, float]:
    """RMS of what batches (B, N, 3) have in common, and how far off their mean is, relative to that."""
    count = len(batches)
    total = (batches.sum(axis=0) ** 2).mean()
    each = (batches**2).sum(axis=0).mean()
    square = (total - each) / (count * (count - 1))
    size = float(np.sqrt(max(square, 0.0)))
    off = float(np.sqrt(max(total / count**2 - square, 0.0)))
    return size, off / max(size, 1e-30)


def stages(program: Headless) -> list[Stage]:
    """The scenes that there are."""
    settings = (room(), furniture(program))
    return [Stage(one, program) for one in settings if one is not None]


def trials(
    count: int, program: Headless, roles: Sequence[str] = CHANGES, seed: int = 0
) -> Iterator[Mapping[str, IndirectTrial]]:
    """So many, each with a trial for every one of the roles that was found; the same ones each time."""
    made = stages(program)
    for number in range(count):
        found = {}
        for role in roles:
            # no gloss of the first scene is seen in 0.3 % of the light
            stage = made[-1 if role == "gloss" else number % len(made)]
            one = stage.trial(role, np.random.default_rng((seed, number, CHANGES.index(role))))
            if one is not None:
                found[role] = one
        yield found


def apart(scene: Scene) -> Scene:
    """Every slot of every object in a material of its own."""
    for node in list(scene.of(MeshObject)):
        own = [
            dataclasses.replace(scene.material(name), id=f"{node.id} {slot}")
            for slot, name in enumerate(node.materials)
        ]
        names = tuple(material.id for material in own)
        scene = scene.with_materials(*own).with_nodes(dataclasses.replace(node, materials=names))
    return scene


def _told(change: Change) -> str:
    material = change.material
    return f"{change.node} {change.slot} {material.model} {sorted(material.values.items())}"


def slots_of(scene: Scene) -> list[tuple[NodeId, int]]:
    """All objects' slots that have faces."""
    return [
        (node.id, int(slot))
        for node in scene.of(MeshObject)
        if scene.shown(node.id)
        for slot in np.unique(node.geometry.slots if node.geometry.slots is not None else 0)
        if slot < len(node.materials)
    ]


def other(material: Material, role: str, rng: np.random.Generator, registry: Registry) -> Material | None:
    """With another colour, shine or gloss; None where it has none. What cannot shine becomes what can."""
    roles = material_roles(material, registry)
    if role == "diffuse":
        return (
            None
            if role not in roles
            else _with(material, roles[role], _colour(material, roles, rng, registry))
        )
    full = paintable(material, registry)
    roles = material_roles(full, registry)
    if not {"specular", "gloss"} <= roles.keys():
        return None
    shine = np.asarray(_value(full, roles["specular"], registry), np.float64)
    if role == "specular":
        if shine.max() > 0:
            more = np.clip(shine * rng.choice([0.2, 0.4, 1.8, 2.5]), 0, 0.95)
            return _with(full, roles["specular"], _plain(more))
        made = _with(full, roles["specular"], _plain(np.full(shine.shape, rng.uniform(0.3, 0.9))))
        model = cast(PaintableBrdf, registry.brdf(full.model))
        return _with(made, roles["gloss"], float(model.gloss(float(rng.uniform(0.15, 0.45)))))
    if shine.max() <= 0:
        return None
    model = cast(PaintableBrdf, registry.brdf(full.model))
    alpha = float(model.alpha(float(np.asarray(_value(full, roles["gloss"], registry)))))
    while True:
        new = float(rng.uniform(0.1, 0.7))
        if abs(new - alpha) > LEVELS_APART:
            return _with(full, roles["gloss"], float(model.gloss(new)))


def _colour(
    material: Material, roles: Mapping[str, str], rng: np.random.Generator, registry: Registry
) -> Value:
    old = np.asarray(_value(material, roles["diffuse"], registry), np.float64)
    while True:
        new = rng.uniform(0.05, 0.9, 3)
        if np.abs(new - old).max() > 0.2:
            return _plain(new)


def _value(material: Material, name: str, registry: Registry) -> Value:
    return material.values.get(name, defaults(registry.brdf(material.model).Params)[name])


def _with(material: Material, name: str, value: Value) -> Material:
    return dataclasses.replace(material, values=frozen_map({**material.values, name: value}))


def _plain(value: F64) -> Value:
    if value.ndim == 0:
        return float(value)
    red, green, blue = (float(c) for c in value)
    return (red, green, blue)
