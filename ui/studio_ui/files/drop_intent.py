"""What dropping something would do, told before it is let go: a sentence, and whether it can be done."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import chain, islice
from pathlib import Path

from PySide6.QtCore import QMimeData, QSize
from PySide6.QtGui import QImageReader

from studio_core.library.lucmat import SUFFIX as MATERIAL
from studio_ui.files.project_files import SUFFIX
from studio_ui.objects.material_drag import LIBRARY_MIME, MIME

HDR = (".exr", ".hdr", ".tif", ".tiff")
CAMERAS = (
    *(".heic", ".heif", ".hif"),
    *(".dng", ".nef", ".nrw", ".cr2", ".cr3", ".arw", ".raf", ".rw2", ".orf", ".pef", ".srw"),
)
"""Files of cameras that are photographs of a room and nothing else."""
PHOTOGRAPHS = (".png", ".jpg", ".jpeg", ".webp", ".bmp")
_PICTURES = frozenset((*HDR, *CAMERAS, *PHOTOGRAPHS))
_LOOKED_AT, _FOLDERS = 200, 3  # of a folder's entries, and of folders in it
_SMALL, _BLACK = (64, 32), 48  # size that is looked at, and what is dark of 255
_TWICE = 0.02  # how far from 2:1 the sides of an equirectangular picture may be


@dataclass(frozen=True)
class Intent:
    """What happens; `problem` says why nothing does. `photograph` and `capture` are asked about first."""

    project: Path | None = None
    models: tuple[Path, ...] = ()
    light: Path | None = None
    photograph: bool = False
    material: bool = False
    materials: tuple[Path, ...] = ()
    capture: tuple[Path, ...] = ()
    samples: Path | None = None  # a folder of photographs of a material
    problem: str = ""

    def __bool__(self) -> bool:
        return not self.problem and (
            self.project is not None
            or bool(self.models)
            or self.light is not None
            or self.material
            or bool(self.materials)
            or bool(self.capture)
            or self.samples is not None
        )

    def told(self, *, here: bool, options: bool, whom: str = "") -> str:
        """What will happen; `here` where a model has a place to stand on, `options` while Shift is held,
        `whom` a file of one material is held over.
        """
        if self.problem:
            return self.problem
        if self.project is not None:
            return f"Open {self.project.stem}"
        if self.samples is not None:
            return f"Make a material of the photographs in {self.samples.name}"
        if self.capture:
            count = len(self.capture)
            return f"Capture the room's light from {count} photograph{'s' * (count > 1)}"
        parts = []
        if self.materials and whom:
            return f"Give {whom} {self.materials[0].stem}"
        if self.materials:
            count = len(self.materials)
            parts.append(
                f"Add the material {self.materials[0].stem}" if count == 1 else f"Add {count} materials"
            )
        if self.models:
            what = self.models[0].stem if len(self.models) == 1 else f"{len(self.models)} models"
            where = "here" if here else "to the scene"
            parts.append(f"{'add' if parts else 'Add'} {what} {where}{' with options' * options}")
        if self.light is not None:
            parts.append(f"{'light' if parts else 'Light'} the room with {self.light.stem}")
        if self.material:
            parts.append("Give the object this material")
        return " and ".join(parts)


def dropped_paths(data: QMimeData) -> list[Path] | None:
    """The files that a drag carries; None when some are not on this computer."""
    urls = data.urls()
    if any(not url.isLocalFile() for url in urls):
        return None
    return [Path(url.toLocalFile()) for url in urls]


def intent(data: QMimeData, known: Collection[str]) -> Intent | None:
    """What a drag means; None when it is nothing for this program. `known` are endings of models."""
    if data.hasFormat(MIME) or data.hasFormat(LIBRARY_MIME):
        return Intent(material=True)
    if not data.hasUrls():
        return None
    paths = dropped_paths(data)
    if paths is None:
        return Intent(problem="Only files on this computer can be dropped: save it there first.")
    return intent_of(paths, known)


def intent_of(paths: Sequence[Path], known: Collection[str]) -> Intent:
    """What dropping files would do. With `known` empty everything unknown may be a model."""
    if len(paths) == 1 and holds_photographs(paths[0]):
        return Intent(samples=paths[0])
    models: list[Path] = []
    lights: list[Path] = []
    materials: list[Path] = []
    for path in paths:
        problem = _unusable(path)
        if problem:
            return Intent(problem=problem)
        ending = path.suffix.lower()
        if ending == SUFFIX:
            if len(paths) > 1:
                return Intent(problem="A project is dropped by itself.")
            return Intent(project=path)
        if ending == MATERIAL:
            materials.append(path)
        elif ending in HDR or ending in PHOTOGRAPHS or ending in CAMERAS:
            lights.append(path)
        elif not known or ending in known:
            models.append(path)
        else:
            return Intent(
                problem=f"{path.name} is no model, material, picture of light or project that can be read."
            )
    if materials:
        if lights:
            return Intent(problem="Materials and pictures of light are dropped one after the other.")
        return Intent(models=tuple(models), materials=tuple(materials))
    if lights and not models and _photographs(lights):
        return Intent(capture=tuple(lights))
    if len(lights) == 1 and not models and _two_circles(lights[0]):
        return Intent(capture=tuple(lights))
    if len(lights) > 1:
        return Intent(problem="One picture of light is dropped at a time.")
    if lights and lights[0].suffix.lower() in PHOTOGRAPHS:
        problem = _no_environment(lights[0])
        if problem:
            return Intent(problem=problem)
        return Intent(models=tuple(models), light=lights[0], photograph=True)
    return Intent(models=tuple(models), light=lights[0] if lights else None)


def holds_photographs(folder: Path) -> bool:
    """Whether pictures lie in a folder or in a folder in it, as far as a short look tells."""
    try:
        if not folder.is_dir():
            return False
        some = list(islice(folder.iterdir(), _LOOKED_AT))
        inner = (path for path in some if path.is_dir())
        more = (islice(path.iterdir(), _LOOKED_AT) for path in islice(inner, _FOLDERS))
        return any(path.suffix.lower() in _PICTURES for path in chain(some, *more))
    except OSError:
        return False


def _two_circles(path: Path) -> bool:
    """Whether a picture twice as wide as high shows two round ones: dark in its corners and between them."""
    if path.suffix.lower() not in PHOTOGRAPHS:
        return False
    reader = QImageReader(str(path))
    size = reader.size()
    if not size.isValid() or abs(size.width() - 2 * size.height()) > _TWICE * size.width():
        return False
    reader.setScaledSize(QSize(*_SMALL))
    image = reader.read()
    if image.isNull():
        return False
    wide, high = _SMALL
    places = [(x, y) for y in (1, high - 2) for x in (1, wide // 2 - 1, wide // 2, wide - 2)]
    return all(max(image.pixelColor(*place).getRgb()[:3]) < _BLACK for place in places)


def _photographs(paths: Sequence[Path]) -> bool:
    """Whether files are a series of photographs rather than one picture of light."""
    endings = {path.suffix.lower() for path in paths}
    if endings & set(CAMERAS):
        return True
    return len(paths) > 1 and endings <= {*PHOTOGRAPHS, ".tif", ".tiff"}


def _unusable(path: Path) -> str:
    try:
        if path.is_dir():
            return f"{path.name} is a folder: drop the files in it."
        if not path.is_file():
            return f"{path.name} is not there any more."
    except OSError as error:
        return f"{path.name} cannot be read: {(error.strerror or 'the disk reports an error').lower()}."
    if path.suffix.lower() in (".py", ".pyw"):
        return f"{path.name} is a script: dropping runs nothing. Open it in the console."
    return ""


def _no_environment(path: Path) -> str:
    """Why a photograph cannot light a room."""
    size = QImageReader(str(path)).size()
    if not size.isValid():
        return f"{path.name} is no picture that can be read."
    if abs(size.width() - 2 * size.height()) > _TWICE * size.width():
        return (
            f"{path.name} is an ordinary photograph of {size.width()} × {size.height()}: "
            "light needs a picture all around, twice as wide as high, or several exposures of a room."
        )
    return ""
