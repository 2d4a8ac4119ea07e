"""The names that scripts and the console have: a document, what can be done to it, what it is made of."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from studio_core import edits, errors
from studio_core.contract import ImportedModel, Registry, Services
from studio_core.copies import duplicate
from studio_core.document import Document
from studio_core.edits import Add, Assign, Compound, Edit, Move, Remove, SetFields, SetMaterial
from studio_core.errors import EditError, InputError
from studio_core.params import check, param_infos
from studio_core.rooms import new_room
from studio_core.scene import nodes, transform
from studio_core.scene.bounds import scene_bounds
from studio_core.scene.nodes import Camera, Environment, Group, Material, MeshObject, Node, Scene, new_id
from studio_core.scene.room import Room
from studio_core.scene.room_shape import Opening
from studio_core.scene.transform import Transform, axis_angle, vec3
from studio_core.scripting import find as finding
from studio_core.scripting.patterns import Patterns
from studio_core.scripting.placing import Placing
from studio_core.scripting.shelved import Shelved
from studio_core.scripting.shown import help_text, overview
from studio_core.scripting.stroking import Stroking
from studio_core.session import Session, View
from studio_core.shading.artifacts import Picture
from studio_core.shading.job import Job

T = TypeVar("T")
Thing = Node | Material | str
"""A node or material as it was found, or its name, path or id."""
Run = Callable[[str, Callable[[Job], Any]], Any]
GROUPS: dict[str, tuple[str, ...]] = {
    "Look for things": ("find", "find_all", "material", "materials", "select", "selected", "size", "bounds"),
    "Change the scene": (
        *(
            "move",
            "turn",
            "scale",
            "drop",
            "align",
            "distribute",
            "copy",
            "change",
            "assign",
            "replace_material",
            "lay_pattern",
            "grow_pattern",
            "unwrap",
            "remove",
        ),
        *("add_model", "add_material", "keep_material", "light_from", "apply", "undo", "redo"),
    ),
    "Strokes": ("paint", "paint_strokes", "match_strokes", "stylise"),
    "Look and render": ("look_through", "picture", "render"),
    "Files": ("save",),
    "What there is": ("document", "scene", "session", "edits", "nodes", "np", "Path"),
}


class Size(NamedTuple):
    """Width (x), depth (z) and height (y) in metres."""

    width: float
    depth: float
    height: float

    def __repr__(self) -> str:
        return f"width {self.width:.3f} × depth {self.depth:.3f} × height {self.height:.3f} m"


def at_once(label: str, work: Callable[[Job], T]) -> T:
    """Do heavy work here and now."""
    return work(Job(label))


class Names(Placing, Patterns, Shelved, Stroking):
    """Fills `namespace` and keeps its `scene` the current one until `close`.

    `services` is asked for when something is rendered; `run(label, work)` does what takes long and gives
    its result; `save` keeps the project (None: there is none), or a copy of it at a path.
    """

    def __init__(
        self,
        document: Document,
        session: Session,
        registry: Registry,
        services: Callable[[], Services],
        *,
        namespace: dict[str, Any] | None = None,
        run: Run = at_once,
        save: Callable[[Path | None], object] | None = None,
    ) -> None:
        self._document, self._session, self._registry = document, session, registry
        self._services, self._run, self._save = services, run, save
        self.namespace: dict[str, Any] = {} if namespace is None else namespace
        self.reset()
        self.close = document.changed.connect(lambda before, after, _: self._moved_on(after))

    def reset(self) -> None:
        """All names as at the start; what else was defined stays."""
        made: dict[str, Any] = {"np": np, "Path": Path, "Scene": Scene, "edits": edits, "nodes": nodes}
        for module, base in ((edits, object), (nodes, Node), (errors, Exception)):
            made |= _classes(module, base)
        made |= {name: getattr(transform, name) for name in ("Transform", "looking", "axis_angle")}
        made |= {"Material": Material, "new_id": new_id, "duplicate": duplicate, "View": View}
        made |= {"new_room": new_room, "Room": Room, "Opening": Opening}
        for members in GROUPS.values():
            made |= {name: getattr(self, name) for name in members if hasattr(type(self), name)}
        made |= {"document": self._document, "session": self._session, "scene": self._document.scene}
        self.namespace.update(made, help=self.help)

    @property
    def scene(self) -> Scene:
        """The scene as it is now."""
        return self._document.scene

    def _moved_on(self, after: Scene) -> None:
        self.namespace["scene"] = after

    # looking for things

    def find(self, name: Thing) -> Any:
        """The node of that name, path (`Armchair/Frame`) or id, as it is now."""
        if isinstance(name, Node):
            return self.scene[name.id]
        return finding.node_named(self.scene, str(name))

    def find_all(self, pattern: str = "*", kind: type[Node] = Node) -> list[Any]:
        """All nodes with a name such as `Chair*`; with `kind` only those, such as `Camera`."""
        return [node for node in finding.matching(self.scene, pattern) if isinstance(node, kind)]

    def material(self, name: Thing) -> Material:
        """The material of that name or id, as it is now."""
        if isinstance(name, Material):
            return self.scene.material(name.id)
        return finding.material_named(self.scene, str(name))

    def materials(self, pattern: str = "*") -> list[Material]:
        """All materials whose name fits a pattern such as `*oak`."""
        from fnmatch import fnmatch

        every = self.scene.materials.values()
        return [one for one in every if fnmatch(one.name.casefold(), pattern.casefold())]

    def select(self, *things: Thing) -> None:
        """Choose these things, and nothing else."""
        self._session.select([self.find(thing).id for thing in things])

    def selected(self) -> list[Node]:
        """What is chosen."""
        return [self.scene[node] for node in self._session.selection if node in self.scene.nodes]

    def size(self, thing: Thing) -> Size:
        """Width, depth and height in metres of the box around a thing and all under it."""
        low, high = self.bounds(thing)
        width, height, depth = (float(side) for side in high - low)
        return Size(width, depth, height)

    def bounds(self, thing: Thing | None = None) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Lowest and highest corner in the world, metres; without a thing of all that is shown."""
        if thing is None:
            return scene_bounds(self.scene)
        node = self.find(thing)
        under = set(self.scene.subtree(node.id)) | {above.id for above in self.scene.ancestors(node.id)}
        kept = {n: self.scene.nodes[n] for n in self.scene.nodes if n in under}
        part = dataclasses.replace(self.scene, nodes=kept)
        if not any(isinstance(one, MeshObject) and part.shown(one.id) for one in kept.values()):
            here = np.array(self.scene.world(node.id).translation)
            return here, here
        return scene_bounds(part)

    # changing

    def apply(self, *changes: Edit) -> None:
        """Do edits, such as `Move({node.id: Transform((1, 0, 0))})`."""
        for edit in changes:
            self._document.apply(edit)

    def undo(self, steps: int = 1) -> None:
        """Steps back in the history."""
        for _ in range(steps):
            self._document.undo()

    def redo(self, steps: int = 1) -> None:
        """Steps forward again."""
        for _ in range(steps):
            self._document.redo()

    def move(self, thing: Thing, to: npt.ArrayLike | None = None, by: npt.ArrayLike | None = None) -> None:
        """Put a thing at `to`, or move it `by` so much: (x, y, z) in metres, in the world."""
        node = self.find(thing)
        world = self.scene.world(node.id)
        place = np.asarray(world.translation if to is None else to, np.float64)
        place = place + (np.zeros(3) if by is None else np.asarray(by, np.float64))
        self._place(node, dataclasses.replace(world, translation=vec3(place)), "Move")

    def turn(self, thing: Thing, degrees: float) -> None:
        """Turn a thing about the vertical through its middle, counter-clockwise as seen from above."""
        node = self.find(thing)
        low, high = self.bounds(node)
        middle = Transform(vec3((low + high) / 2))
        about = middle @ Transform(rotation=axis_angle((0, 1, 0), degrees)) @ middle.inverse()
        self._place(node, about @ self.scene.world(node.id), "Turn")

    def copy(self, thing: Thing, by: npt.ArrayLike = (0.0, 0.0, 0.0)) -> Any:
        """A copy that shares its meshes, moved `by` so many metres; the new node."""
        node = self.find(thing)
        offset = Transform(vec3(by))
        if node.parent is not None:
            above = self.scene.world(node.parent)
            offset = above.inverse() @ offset @ above
        edit = duplicate(self.scene, (node.id,), offset=offset)
        self._document.apply(dataclasses.replace(edit, label=f"Copy {node.name}"))
        return self.find(edit.nodes[0])

    def change(self, thing: Thing, **values: Any) -> None:
        """Other values for a node (`hidden=True`) or a material (`roughness=0.2`, `model="ggx"`).

        A name means the node of that name, else the material.
        """
        found = self._any(thing)
        if isinstance(found, Node):
            self._document.apply(SetFields(found.id, values, f"Change {found.name}"))
            return
        own = {name: values.pop(name) for name in ("model", "name", "opacity") if name in values}
        checked = self._checked(own.get("model", found.model), values)
        self._document.apply(SetMaterial(found.id, checked, **own, label=f"Change {found.name}"))

    def assign(self, thing: Thing, material: Thing) -> None:
        """Give a thing, and every mesh under it, a material."""
        top, chosen = self.find(thing), self.material(material)
        meshes = [n for n in self.scene.subtree(top.id) if isinstance(self.scene[n], MeshObject)]
        if not meshes:
            raise EditError(f"{top.name!r} has no mesh that could have a material")
        each = tuple(Assign(node, chosen.id) for node in meshes)
        self._document.apply(Compound(f"Assign {chosen.name} to {top.name}", each))

    def replace_material(self, old: Thing, new: Thing) -> int:
        """Give everything that has one material another one; how many objects there were."""
        gone, chosen = self.material(old), self.material(new)
        users = [node for node in self.scene.of(MeshObject) if gone.id in node.materials]
        each = tuple(
            Assign(node.id, chosen.id, slot)
            for node in users
            for slot, used in enumerate(node.materials)
            if used == gone.id
        )
        self._document.apply(Compound(f"Replace {gone.name} by {chosen.name}", each))
        return len(users)

    def remove(self, *things: Thing) -> None:
        """Take things away with all that hangs under them."""
        ids = tuple(self.find(thing).id for thing in things)
        self._document.apply(Remove(ids, f"Delete {self.scene[ids[0]].name}" if len(ids) == 1 else "Delete"))

    def add_model(self, path: str | Path, at: npt.ArrayLike = (0.0, 0.0, 0.0), unit: float = 1.0) -> Any:
        """Add a model from a file, standing `at` a point; `unit` is the file's, in metres. The new node.

        Of a file with a material alone (`.lucmat`, `.binary`, `.astm`, `.csv`), the new material.
        """
        path = Path(path)
        model: ImportedModel = self._run(f"Importing {path.name}", lambda job: self._load(path, unit))
        if model.materials and not model.nodes:
            self._document.apply(Add((), model.materials, f"Import {path.stem}"))
            return self.material(model.materials[0])
        top = Group(id=new_id("group"), name=path.stem)
        held = {node.id for node in model.nodes}
        under = [n if n.parent in held else dataclasses.replace(n, parent=top.id) for n in model.nodes]
        self._document.apply(Add((top, *under), model.materials, f"Import {path.stem}"))
        low, high = self.bounds(top)
        foot = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
        self.move(top, by=np.asarray(at, np.float64) - foot)
        return self.find(top)

    def light_from(self, path: str | Path) -> Any:
        """Light the scene with a picture of light (EXR, HDR).

        An environment that is there keeps its settings.
        """
        from studio_core.imaging.environment import load_environment

        path = Path(path)
        image, _ = self._run(f"Reading {path.name}", lambda job: load_environment(path))
        old = next(self.scene.of(Environment), None)
        label = f"Environment {path.stem}"
        if old is not None:
            values = {"image": image, "name": path.stem, "hidden": False}
            self._document.apply(SetFields(old.id, values, label))
            return self.find(old)
        made = Environment(id=new_id("environment"), name=path.stem, image=image)
        self._document.apply(Add((made,), label=label))
        return made

    # looking

    def look_through(self, camera: Thing) -> None:
        """See what a camera of the scene sees."""
        width, height = self._session.view.width, self._session.view.height
        self._session.look(View.of(self._camera(camera), self.scene, width, height))

    def picture(
        self, size: tuple[int, int] = (960, 540), camera: Thing | None = None, antialias: int = 2
    ) -> npt.NDArray[np.float32]:
        """(height, width, 3) scene-linear radiance, as a camera sees it or as it is looked at now."""
        return self._picture(size, camera, antialias).linear

    def _picture(self, size: tuple[int, int], camera: Thing | None, antialias: int) -> Picture:
        from studio_core.shading import offline

        width, height = size
        if camera is None:
            view = self._session.view.sized(width, height)
        else:
            view = View.of(self._camera(camera), self.scene, width, height)
        view = dataclasses.replace(view, antialias=antialias, fine_edges=antialias > 1)
        scene, session, services = self.scene, self._session, self._services()

        def work(job: Job) -> Picture:
            backend = self._registry.get("backend", session.backend)
            params = offline.backend_params(backend, session.params)
            choice = offline.session_choice(session, self._registry)
            given = (scene, view, backend, params, services, job)
            return offline.picture(*given, indirect=choice, light=session.light)

        made: Picture = self._run("Rendering", work)
        return made

    def render(
        self,
        path: str | Path,
        size: tuple[int, int] = (960, 540),
        camera: Thing | None = None,
        exposure: float | None = None,
        tonemap: str | None = None,
        antialias: int = 2,
    ) -> Path:
        """Write a picture as PNG (with exposure in EV and tone curve) or EXR; where it is now."""
        from studio_core.imaging.picture import write_picture

        path = Path(path)
        if path.suffix.lower() not in (".png", ".exr"):
            raise InputError(f"{path.name}: pictures are written as .png or .exr")
        made = self._picture(size, camera, antialias)
        ev = self._session.exposure if exposure is None else exposure
        ev, shown = made.shown_with(ev, tonemap or self._session.tonemap)
        kind: Any = shown
        write_picture(path, made.linear, exposure=ev, kind=kind)
        return path

    # files and help

    def save(self, path: str | Path | None = None) -> Path | None:
        """Save the project, or with a path a copy of it."""
        if self._save is None:
            raise InputError("there is no project to save; give save() a path, or lucarne script --project")
        self._save(None if path is None else Path(path))
        return None if path is None else Path(path)

    def help(self, thing: Any = None) -> None:
        """What all these names do, or with `help(name)` what one of them does."""
        print(overview(GROUPS, self.namespace) if thing is None else help_text(thing))

    # parts

    def _any(self, thing: Thing) -> Any:
        if isinstance(thing, Material):
            return self.material(thing)
        try:
            return self.find(thing)
        except EditError:
            if isinstance(thing, str):
                try:
                    return self.material(thing)
                except EditError:
                    pass
            raise

    def _camera(self, camera: Thing) -> Camera:
        found = self.find(camera)
        if not isinstance(found, Camera):
            known = ", ".join(repr(node.name) for node in self.scene.of(Camera)) or "none"
            raise EditError(f"{found.name!r} is no camera; known: {known}")
        return found

    def _place(self, node: Node, world: Transform, verb: str) -> None:
        local = world if node.parent is None else self.scene.world(node.parent).inverse() @ world
        self._document.apply(Move({node.id: local}, f"{verb} {node.name}"))

    def _checked(self, model: str, values: Mapping[str, Any]) -> dict[str, Any]:
        infos = param_infos(self._registry.brdf(model).Params)
        for name in values:
            if name not in infos:
                raise EditError(f"{model} has no parameter {name!r}; known: {', '.join(infos) or 'none'}")
        return {name: check(name, infos[name], value) for name, value in values.items()}

    def _load(self, path: Path, unit: float) -> ImportedModel:
        known: list[str] = []
        for name in self._registry.names("importer"):
            importer = self._registry.get("importer", name)
            if path.suffix.lower() in importer.extensions:
                found: ImportedModel = importer.load(path, unit)
                return found
            known += importer.extensions
        raise InputError(f"{path.name} cannot be imported: known kinds are {', '.join(known) or 'none'}")


def _classes(module: Any, base: type) -> dict[str, Any]:
    """The module's own public classes that are a `base`, without protocols."""
    return {
        name: found
        for name, found in vars(module).items()
        if isinstance(found, type)
        and found.__module__ == module.__name__
        and not name.startswith("_")
        and issubclass(found, base)
        and not getattr(found, "_is_protocol", False)
    }
