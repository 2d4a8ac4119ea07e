"""Environments at hand: what the person has used, the folders they added, the samples; each with a thumbnail.

Thumbnails are made on the files' thread, one after the other so that a save never waits long, and kept in
the user's cache by path, time and size.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from PySide6.QtGui import QImage

from studio_core.edits import Add, Edit, SetFields
from studio_core.errors import InputError, LucarneError
from studio_core.folders import user_cache
from studio_core.kernels.tonemap import tonemap
from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.geometry import Image
from studio_core.scene.nodes import Environment, Scene, new_id
from studio_core.shading.job import Job
from studio_core.signal import Signal
from studio_ui.context import Context, Subscriptions
from studio_ui.settings import Settings

SIZE = (256, 128)  # pixels of a thumbnail
EXTENSIONS = (".exr", ".hdr")
RECENT, FOLDERS = "environments", "environment_folders"
_RECENT_KEPT, _LISTED, _KEPT = 24, 200, 1000
_VERSION = 1  # of what is kept
IN_SCENE = ""


@dataclass(frozen=True)
class Entry:
    """One environment: a file of its own, or that of a project (`sample`), or the scene's (no path)."""

    name: str
    path: Path | None = None
    sample: bool = False

    @property
    def id(self) -> str:
        """The same for the same file."""
        return str(self.path) if self.path is not None else IN_SCENE


@dataclass(frozen=True)
class Thumbnail:
    """A picture of it, its content's key, and how many pixels it has."""

    image: QImage
    key: str
    size: str


class EnvironmentShelf:
    """`changed()` when entries or thumbnails did, or another environment lights the scene."""

    def __init__(
        self,
        context: Context,
        settings: Settings,
        samples: Mapping[str, Path],
        load: Callable[[Path], object],
    ) -> None:
        """`load` lights the scene with a file; `samples` are projects by name."""
        self.changed: Signal[[]] = Signal()
        self.current = ""  # key of what lights the scene
        self.thumbnails: dict[str, Thumbnail] = {}
        self._context, self._settings, self._samples, self._load = context, settings, samples, load
        self._found: dict[str, list[Path]] = {}  # files by folder
        self._wanted: deque[Entry] = deque()
        self._busy = self._open = False
        self._useless: set[str] = set()  # files that are no environment
        self._image: Image | None = None
        self._subscriptions = Subscriptions()
        self._subscriptions.add(context.document.changed.connect(self._edited))

    def close(self) -> None:
        """Ask for nothing more."""
        self._wanted.clear()
        self._open = False
        self._subscriptions.close()

    def start(self) -> None:
        """Look into the folders and make thumbnails, once somebody looks at them."""
        if not self._open:
            self._open = True
            self._scan()
            self._follow()

    @property
    def entries(self) -> tuple[Entry, ...]:
        """What lights the scene if it is no file, what was used lately, what is in folders, the samples."""
        found = [Entry(path.stem, path) for path in self._paths(RECENT)]
        for paths in self._found.values():
            found += [Entry(path.stem, path) for path in paths]
        found += [Entry(name, path, sample=True) for name, path in self._samples.items()]
        made = {entry.id: entry for entry in reversed(found) if entry.id not in self._useless}
        ordered = [made[i] for i in dict.fromkeys(entry.id for entry in found) if i in made]
        known = {t.key for i, t in self.thumbnails.items() if i != IN_SCENE and i in made}
        environment = next(self._context.document.scene.of(Environment), None)
        if environment is not None and self.current and self.current not in known:
            ordered.insert(0, Entry(environment.name))
        return tuple(ordered)

    def is_current(self, entry: Entry) -> bool:
        """Whether this one lights the scene."""
        thumbnail = self.thumbnails.get(entry.id)
        return thumbnail is not None and bool(self.current) and thumbnail.key == self.current

    def light(self, entry: Entry) -> None:
        """Light the scene with it."""
        if entry.path is None:
            return
        if not entry.sample:
            self._load(entry.path)
            return
        path = entry.path

        def read(job: Job) -> Environment:
            return _of_project(path)

        def done(found: Environment) -> None:
            scene = self._context.document.scene
            self._context.editing.apply(set_environment(scene, found.image, found.name))

        self._context.tasks.run(f"Reading {path.name}", read, done)

    # what is remembered

    @property
    def folders(self) -> tuple[Path, ...]:
        """The folders that the person added."""
        return tuple(self._paths(FOLDERS))

    def used(self, path: Path) -> None:
        """Put a file first among those used lately."""
        self._remember(RECENT, [path, *self._paths(RECENT)], _RECENT_KEPT)

    def add_folder(self, folder: Path) -> None:
        """List what is in a folder."""
        self._remember(FOLDERS, [*self._paths(FOLDERS), folder], _LISTED)
        self._scan()

    def forget(self, entry: Entry) -> None:
        """Take a file off the list; one of a folder goes with its folder."""
        self._remember(RECENT, [p for p in self._paths(RECENT) if p != entry.path], _RECENT_KEPT)
        gone = [folder for folder, paths in self._found.items() if entry.path in paths]
        for folder in gone:
            del self._found[folder]
        kept = [p for p in self._paths(FOLDERS) if str(p) not in gone]
        self._remember(FOLDERS, kept, _LISTED)

    def _paths(self, name: str) -> list[Path]:
        return [Path(text) for text in self._settings.get(name, []) if isinstance(text, str)]

    def _remember(self, name: str, paths: list[Path], most: int) -> None:
        self._settings.set(name, list(dict.fromkeys(str(p.absolute()) for p in paths))[:most])
        self._want()

    # folders, thumbnails, what is current

    def _scan(self) -> None:
        folders = self.folders

        def look(job: Job) -> dict[str, list[Path]]:
            return {str(folder): _pictures_in(folder) for folder in folders}

        def done(found: dict[str, list[Path]]) -> None:
            self._found = found
            self._want()

        self._context.tasks.run("Looking for environments", look, done, quiet=True)

    def _want(self) -> None:
        self.changed.emit()
        if not self._open:
            return
        asked = {entry.id for entry in self._wanted}
        self._wanted += [
            entry
            for entry in self.entries
            if entry.path is not None and entry.id not in self.thumbnails and entry.id not in asked
        ]
        self._next()

    def _next(self) -> None:
        if self._busy or not self._wanted:
            return
        self._busy = True
        entry = self._wanted.popleft()

        def make(job: Job) -> Thumbnail | None:
            return kept_thumbnail(entry)

        def done(made: Thumbnail | None) -> None:
            self._busy = False
            if made is None:
                self._useless.add(entry.id)
            else:
                self.thumbnails[entry.id] = made
            self.changed.emit()
            if self._open:
                self._next()

        self._context.tasks.run(f"Thumbnail of {entry.name}", make, done, lambda _: done(None), quiet=True)

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if self._open and changes.aspects & (Aspect.LIGHT | Aspect.NAME):
            self._follow()

    def _follow(self) -> None:
        """The key of what lights the scene, which takes reading all of it, and its thumbnail."""
        environment = next(self._context.document.scene.of(Environment), None)
        image = environment.image if environment is not None else None
        if image is self._image:
            return
        self._image = image
        if image is None:
            self.current = ""
            self.changed.emit()
            return

        def look(job: Job) -> Thumbnail:
            return thumbnail_of(image)

        def done(made: Thumbnail) -> None:
            if image is self._image:
                self.thumbnails[IN_SCENE] = made
                self.current = made.key
                self.changed.emit()

        self._context.tasks.run("Thumbnail of the environment", look, done, quiet=True)


def set_environment(scene: Scene, image: Image, name: str) -> Edit:
    """The edit that lights the scene with a picture; an environment that is there keeps its settings."""
    old = next(scene.of(Environment), None)
    if old is not None:
        fields = {"image": image, "name": name, "hidden": False}
        return SetFields(old.id, fields, f"Environment {name}")
    made = Environment(id=new_id("environment"), name=name, image=image)
    return Add((made,), label=f"Environment {name}")


def small_picture(image: Image, width: int, height: int) -> npt.NDArray[np.float32]:
    """(h, w, 3) linear, at most that large, scaled so that its mean is a middle grey."""
    pixels = image.pixels[..., :3]
    step = max(1, -(-pixels.shape[1] // width), -(-pixels.shape[0] // height))
    skip = max(1, step // 3)  # three samples across are enough for a thumbnail
    pixels, step = pixels[::skip, ::skip], step // skip
    rows, columns = pixels.shape[0] // step, pixels.shape[1] // step
    blocks = pixels[: rows * step, : columns * step].reshape(rows, step, columns, step, -1)
    small = blocks.mean(axis=(1, 3))
    clipped = np.minimum(small, np.percentile(small, 95))
    made: npt.NDArray[np.float32] = np.asarray(small * (0.25 / max(float(clipped.mean()), 1e-12)), np.float32)
    return made


def thumbnail_of(image: Image) -> Thumbnail:
    """Made from the picture itself."""
    pixels = np.ascontiguousarray(tonemap(small_picture(image, *SIZE)))
    height, width = pixels.shape[:2]
    picture = QImage(pixels.tobytes(), width, height, 3 * width, QImage.Format.Format_RGB888).copy()
    size = f"{image.pixels.shape[1]} × {image.pixels.shape[0]}"
    return Thumbnail(picture, image.key, size)


def kept_thumbnail(entry: Entry) -> Thumbnail | None:
    """From the cache, or made and put there; None when the file is no environment.

    May take seconds: not for the window's thread.
    """
    assert entry.path is not None
    try:
        stat = entry.path.stat()
    except OSError:
        return None
    name = f"{entry.path.absolute()}|{stat.st_mtime_ns}|{stat.st_size}|{_VERSION}"
    file = _folder() / f"{hashlib.sha256(name.encode()).hexdigest()[:40]}.png"
    kept = QImage(str(file)) if file.is_file() else QImage()
    if not kept.isNull():
        return Thumbnail(kept, kept.text("key"), kept.text("size"))
    if file.is_file():
        return None  # an empty file: looked at before, no environment
    made: Thumbnail | None = None
    try:
        if entry.sample:
            image = _of_project(entry.path).image
        else:
            from studio_core.imaging.environment import load_environment

            image, _ = load_environment(entry.path)
        made = thumbnail_of(image)
    except (LucarneError, OSError, ValueError):
        made = None
    _keep(file, made)
    return made


def _keep(file: Path, made: Thumbnail | None) -> None:
    """Write it where it is found again, and let the oldest of too many go."""
    with contextlib.suppress(OSError):
        file.parent.mkdir(parents=True, exist_ok=True)
        if made is None:
            file.touch()
            return
        picture = made.image.copy()
        picture.setText("key", made.key)
        picture.setText("size", made.size)
        fresh = file.with_suffix(".new")
        if picture.save(str(fresh), "PNG"):
            fresh.replace(file)
        old = sorted(file.parent.glob("*.png"), key=lambda path: path.stat().st_mtime)
        for path in old[:-_KEPT]:
            path.unlink()


def _folder() -> Path:
    return user_cache() / "environments"


def _pictures_in(folder: Path) -> list[Path]:
    with contextlib.suppress(OSError):
        found = sorted(path for path in folder.iterdir() if path.suffix.lower() in EXTENSIONS)
        return found[:_LISTED]
    return []


def _of_project(path: Path) -> Environment:
    """The environment of a project; InputError when it has none."""
    from studio_core.project.store import load

    found = next(load(path).scene.of(Environment), None)
    if found is None:
        raise InputError(f"{path.name} has no environment")
    return found
