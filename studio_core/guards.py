"""Importers and exporters of other people's plugins: mistakes are named, and leave nothing half done."""

from __future__ import annotations

import secrets
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from studio_core.contract import Exporter, ImportedModel, Importer, Registry
from studio_core.edits import Add
from studio_core.errors import Cancelled, InputError, LucarneError, PluginError
from studio_core.scene.nodes import Scene

Report = Callable[[str, BaseException], object]
_Format = TypeVar("_Format", Importer, Exporter)


@dataclass(frozen=True)
class _Guarded(Generic[_Format]):
    inner: _Format
    plugin: str
    report: Report

    @property
    def label(self) -> str:
        """As the plugin says."""
        return str(self.inner.label)

    @property
    def extensions(self) -> tuple[str, ...]:
        """As the plugin says."""
        return tuple(self.inner.extensions)


@dataclass(frozen=True)
class GuardedImporter(_Guarded[Importer]):
    """An importer whose models are looked at before anybody uses them."""

    def load(self, path: Path, unit: float = 1.0) -> ImportedModel:
        """See `Importer`; PluginError when it fails otherwise than it should, or gives what is no model."""
        try:
            model = self.inner.load(path, unit)
            _check(model)
        except (InputError, Cancelled):
            raise
        except (Exception, SystemExit) as error:
            self.report(f"reading {path.name}", error)
            raise PluginError(f"{path.name} could not be read: {_why(self.plugin, error)}") from error
        return model


@dataclass(frozen=True)
class GuardedExporter(_Guarded[Exporter]):
    """An exporter that writes beside its target first: what was there stays when it fails."""

    def save(self, scene: Scene, path: Path, registry: Registry) -> tuple[str, ...]:
        """See `Exporter`; PluginError when it fails, and then nothing was written."""
        beside = path.parent / f".{path.name[:40]}-{secrets.token_hex(6)}"
        try:
            beside.mkdir()
        except OSError as error:
            raise InputError(f"{path.name} cannot be written: {error.strerror or error}") from None
        try:
            notes = tuple(str(note) for note in self.inner.save(scene, beside / path.name, registry) or ())
            made = sorted(beside.iterdir())
            if not (beside / path.name).exists():
                raise FileNotFoundError(f"it wrote no {path.name}")
            for part in made:
                _put(part, path.parent / part.name)
        except (InputError, Cancelled):
            raise
        except (Exception, SystemExit) as error:
            self.report(f"writing {path.name}", error)
            raise PluginError(f"{path.name} was not written: {_why(self.plugin, error)}") from error
        finally:
            shutil.rmtree(beside, ignore_errors=True)
        return notes


def guarded(kind: str, thing: Any, plugin: str, report: Report) -> Any:
    """What a third-party plugin provides, with a guard around it where its kind has one."""
    if kind == "importer":
        return GuardedImporter(thing, plugin, report)
    return GuardedExporter(thing, plugin, report) if kind == "exporter" else thing


def _put(part: Path, target: Path) -> None:
    """A file replaces a file; a folder's files go into the folder that is there."""
    if part.is_dir():
        target.mkdir(exist_ok=True)
        for inside in part.iterdir():
            _put(inside, target / inside.name)
    else:
        part.replace(target)


def _check(model: object) -> None:
    if not isinstance(model, ImportedModel):
        raise TypeError(f"it gave a {type(model).__name__}, which is no model")
    Add(tuple(model.nodes), tuple(model.materials))(Scene())


def _why(plugin: str, error: BaseException) -> str:
    cause = str(error) if isinstance(error, LucarneError) else f"{type(error).__name__}: {error}"
    return f"a mistake in the plugin {plugin} ({cause})"
