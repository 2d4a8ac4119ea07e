"""What is on the person's shelf of materials, as panels see it: read and written beside the window."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from PySide6.QtCore import QFile

from studio_core.errors import InputError
from studio_core.folders import user_materials
from studio_core.library.lucmat import SUFFIX, Kept
from studio_core.library.shelf import Entry, Shelf, file_stem
from studio_core.scene.nodes import Material
from studio_core.shading.job import Job
from studio_core.signal import Signal
from studio_ui.ask import Ask, Filter
from studio_ui.context import Context

FILES = Filter("Materials", (SUFFIX,))


class MaterialLibrary:
    """`changed()` when other entries are there; `came(paths)` when materials were put on the shelf,
    `opened()` when the person wants to see it.

    Nothing is read before somebody asks. Files that other programs put there are seen at the next `read`.
    """

    def __init__(self, context: Context, ask: Ask, shelf: Shelf | None = None) -> None:
        if shelf is None:
            from studio_core.library.presets import PRESETS

            shelf = Shelf(user_materials(), PRESETS)
        self.shelf = shelf
        self.changed: Signal[[]] = Signal()
        self.came: Signal[[tuple[Path, ...]]] = Signal()
        self.opened: Signal[[]] = Signal()
        self.trash: Callable[[Path], bool] = lambda path: bool(QFile.moveToTrash(str(path)))
        """Whether a file is in the trash now."""
        self._context, self._ask = context, ask
        self._own: tuple[Entry, ...] = ()
        self._reading = self._again = False

    @property
    def entries(self) -> tuple[Entry, ...]:
        """What is built in, then what was there when it was last read."""
        return (*self.shelf.built_in, *self._own)

    def entry(self, key: str) -> Entry | None:
        """By its key."""
        return next((entry for entry in self.entries if entry.key == key), None)

    def read(self) -> None:
        """Look what is on the shelf now."""
        if self._reading:
            self._again = True
            return
        self._reading = True

        def look(job: Job) -> tuple[Entry, ...]:
            return self.shelf.entries()

        def done(entries: tuple[Entry, ...]) -> None:
            own = tuple(entry for entry in entries if entry.path is not None)
            if own != self._own:
                self._own = own
                self.changed.emit()
            ended(None)

        def ended(error: Exception | None) -> None:
            self._reading = False
            if self._again:
                self._again = False
                self.read()

        self._context.tasks.run("Looking for materials", look, done, ended, quiet=True)

    def fetch(self, entries: Sequence[Entry], done: Callable[[list[Kept]], object]) -> None:
        """Whole materials: at once where they are in memory, else when their files have been read."""
        if all(entry.kept is not None and entry.whole for entry in entries):
            done([entry.kept for entry in entries if entry.kept is not None])
            return

        def look(job: Job) -> list[Kept]:
            return [self.shelf.fetch(entry) for entry in entries]

        self._context.tasks.run(f"Reading {_names(entries)}", look, done)

    # what is kept

    def keep(self, materials: Sequence[Material], tags: Iterable[str] = ()) -> None:
        """Put materials on the shelf, for all projects."""
        words = tuple(tags)
        self.keep_kept([Kept(material, words) for material in materials])

    def keep_kept(self, found: Sequence[Kept]) -> None:
        """The same with what they are found by."""

        def put(job: Job) -> list[Path]:
            return [self.shelf.put(kept) for kept in found]

        def done(paths: list[Path]) -> None:
            names = ", ".join(path.stem for path in paths)
            self._context.journal.write(f"Kept for all projects: {names}.")
            self._put(paths)

        if found:
            what = found[0].name if len(found) == 1 else f"{len(found)} materials"
            self._context.tasks.run(f"Keeping {what}", put, done, lambda error: self.read())

    def copy(self, entries: Sequence[Entry]) -> None:
        """Copies of entries among one's own, to be changed."""

        def put(job: Job) -> list[Path]:
            found = [self.shelf.fetch(entry) for entry in entries]
            return [self.shelf.add(kept.material, kept.tags, kept.about) for kept in found]

        self._context.tasks.run(f"Copying {_names(entries)}", put, self._put)

    def rename(self, entry: Entry, name: str) -> None:
        """Another name, for the material and its file."""
        if name and name != entry.name:
            self._change([entry], lambda entry: self.shelf.change(entry, name=name))

    def tag(self, tags: Mapping[str, Sequence[str]]) -> None:
        """Other tags for entries, by their keys."""
        changed = [entry for entry in self._own if entry.tags != tuple(tags.get(entry.key, entry.tags))]
        self._change(changed, lambda entry: self.shelf.change(entry, tags=tags[entry.key]))

    def ask_tags(self, entries: Sequence[Entry]) -> None:
        """Ask for the tags of one's own entry; for several, which ones to add."""
        own = [entry for entry in entries if entry.path is not None and entry.kept is not None]
        if not own:
            return
        title = f"Tags of {own[0].name}" if len(own) == 1 else f"More tags for {len(own)} materials"
        text = self._ask.text(title, "Words with commas between", ", ".join(own[0].tags * (len(own) == 1)))
        if text is None:
            return
        words = tuple(word.strip() for word in text.split(",") if word.strip())
        together = {entry.key: tuple(dict.fromkeys((*entry.tags, *words))) for entry in own}
        self.tag({own[0].key: words} if len(own) == 1 else together)

    def remove(self, entries: Sequence[Entry]) -> None:
        """To the trash; where there is none they are deleted after asking."""
        own = [entry for entry in entries if entry.path is not None]
        left = [entry for entry in own if entry.path is not None and not self.trash(entry.path)]
        gone = [entry for entry in own if entry not in left]
        if gone:
            self._context.journal.write(f"{_names(gone)} {'is' if len(gone) == 1 else 'are'} in the trash.")
        if left and self._ask.delete(_names(left)):
            for entry in left:
                try:
                    self.shelf.remove(entry)
                except InputError as error:
                    self._context.journal.write(str(error), "problem")
        self.read()

    # files

    def ask_import(self) -> None:
        """Ask for files, and put their materials on the shelf."""
        self.import_files(self._ask.open_files("Import materials", self._filters(), many=True))

    def import_files(self, paths: Sequence[Path]) -> None:
        """Put the materials of files on the shelf: own ones, measured ones, those of models."""
        host = self._context.host
        for path in paths:

            def put(job: Job, path: Path = path) -> tuple[list[Path], tuple[str, ...]]:
                from studio_core.exchange.files import materials_of

                found, notes = materials_of(path, host)
                job.checkpoint()
                return [self.shelf.put(kept) for kept in found], notes

            def done(found: tuple[list[Path], tuple[str, ...]], path: Path = path) -> None:
                for note in found[1]:
                    self._context.journal.write(f"{path.name}: {note}", "warning")
                self._put(found[0])

            self._context.tasks.run(f"Importing {path.name}", put, done, lambda error: self.read())

    def open(self, path: Path) -> None:
        """Keep the material of a file, if it is not kept already, and show it."""
        self.opened.emit()
        if path.resolve().parent == self.shelf.folder.resolve():
            self._put([path])
        else:
            self.import_files([path])

    def export(self, entries: Sequence[Entry]) -> None:
        """Ask where to, and write entries there as files of their own."""
        found = [entry for entry in entries if entry.kept is not None]
        if found:
            self.fetch(found, self.export_kept)

    def export_kept(self, found: Sequence[Kept]) -> None:
        """The same for whole materials: one as a file, several into a folder."""
        if len(found) == 1:
            suggested = Path.home() / f"{file_stem(found[0].name)}{SUFFIX}"
            path = self._ask.save_file(f"Export {found[0].name}", suggested, self._written())
            known = {ending for one in self._written() for ending in one.extensions}
            if path is not None and path.suffix.lower() not in known:
                path = path.with_name(path.name + SUFFIX)
            targets = [path] if path is not None else []
        else:
            folder = self._ask.folder(f"Export {len(found)} materials")
            targets = _targets(folder, found) if folder is not None else []
        if not targets:
            return
        host = self._context.host

        def put(job: Job) -> list[str]:
            from studio_core.exchange.files import write_materials

            notes: list[str] = []
            for path, kept in zip(targets, found, strict=True):
                notes += write_materials(path, [kept], host)
            return notes

        def done(notes: list[str]) -> None:
            for note in notes:
                self._context.journal.write(note, "warning")
            where = (
                targets[0].name if len(targets) == 1 else f"{len(targets)} files in {targets[0].parent.name}"
            )
            self._context.journal.write(f"Exported {where}.")
            self.read()  # it may have been the shelf's own folder

        self._context.tasks.run(f"Exporting {found[0].name}", put, done)

    def _filters(self) -> list[Filter]:
        if not self._context.warm:
            return [FILES]
        found = self._context.host.available("importer").values()
        others = [Filter(importer.label, tuple(importer.extensions)) for importer in found]
        others = [one for one in others if SUFFIX not in one.extensions]
        every = tuple(dict.fromkeys((SUFFIX, *(e for one in others for e in one.extensions))))
        return [Filter("All that holds materials", every), FILES, *others]

    def _written(self) -> list[Filter]:
        """Kinds that a material can be written as."""
        if not self._context.warm:
            return [FILES]
        from studio_core.exchange.files import kinds

        return [FILES, *(Filter(label, endings) for label, endings in kinds(self._context.host)[1:])]

    def _change(self, entries: Sequence[Entry], work: Callable[[Entry], Path]) -> None:
        def put(job: Job) -> list[Path]:
            return [work(entry) for entry in entries]

        if entries:
            self._context.tasks.run(f"Changing {_names(entries)}", put, self._put, lambda error: self.read())

    def _put(self, paths: Sequence[Path]) -> None:
        self.read()
        self.came.emit(tuple(paths))


def _names(entries: Sequence[Entry]) -> str:
    return entries[0].name if len(entries) == 1 else f"{len(entries)} materials"


def _targets(folder: Path, found: Sequence[Kept]) -> list[Path]:
    """Where each goes in a folder, over nothing that is there."""
    made: list[Path] = []
    for kept in found:
        stem, number = file_stem(kept.name), 2
        path = folder / f"{stem}{SUFFIX}"
        while path.exists() or path in made:
            path = folder / f"{stem} {number}{SUFFIX}"
            number += 1
        made.append(path)
    return made


def with_key(entry: Entry) -> Material | None:
    """An entry's material under its key, for pictures of it."""
    return dataclasses.replace(entry.kept.material, id=entry.key) if entry.kept is not None else None


__all__ = ["FILES", "MaterialLibrary", "with_key"]
