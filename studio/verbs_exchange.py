"""`lucarne materials`: the materials of any file, listed, kept for all projects, or written anew."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studio_core.errors import InputError

if TYPE_CHECKING:
    from studio.headless import Headless
    from studio_core.library.lucmat import Kept
    from studio_core.params import Value

_PROJECT = ".lucarne"


def add_options(verb: argparse.ArgumentParser) -> None:
    """The options of `materials`."""
    verb.add_argument("file", type=Path, metavar="FILE", help="a project, a material, or a model with some")
    verb.add_argument(
        "--only", action="append", default=[], metavar="NAME", help="this one; may be repeated (default: all)"
    )
    verb.add_argument(
        "-o",
        "--out",
        type=Path,
        metavar="OUT",
        help="a file (.lucmat, .glb, .mtlx), or a folder: each as its own .lucmat",
    )
    verb.add_argument("--keep", action="store_true", help="put them under My materials, for all projects")


def materials(options: argparse.Namespace, program: Headless) -> None:
    """`lucarne materials`."""
    from studio.verbs import result

    found, notes = _found(options.file, program)
    chosen = _chosen(found, options.only, options.file)
    written: list[Path] = []
    if options.out is not None:
        written, lost = _write(options.out, chosen, program)
        notes = (*notes, *lost)
    if options.keep:
        from studio_core.folders import user_materials
        from studio_core.library.shelf import Shelf

        shelf = Shelf(user_materials())
        written += [shelf.put(kept) for kept in chosen]
    for note in notes:
        program.say(note)
    values = {
        "file": str(options.file),
        "materials": [_plain(kept) for kept in chosen],
        "written": [str(path) for path in written],
        "notes": list(notes),
    }
    lines = [str(path) for path in written] or [_line(kept) for kept in chosen]
    result(options, program, values, "\n".join(lines))


def _found(path: Path, program: Headless) -> tuple[tuple[Kept, ...], tuple[str, ...]]:
    from studio_core.exchange.files import materials_of
    from studio_core.library.lucmat import Kept

    if path.suffix.lower() != _PROJECT:
        return materials_of(path, program.registry)
    from studio.verbs import open_scene

    found = tuple(Kept(material) for material in open_scene(path).materials.values())
    if not found:
        raise InputError(f"{path} holds no material")
    return found, ()


def _chosen(found: tuple[Kept, ...], names: list[str], path: Path) -> tuple[Kept, ...]:
    known = {kept.name for kept in found}
    for name in names:
        if name not in known:
            raise InputError(f"--only {name!r}: {path} has {', '.join(sorted(known))}")
    return tuple(kept for kept in found if not names or kept.name in names)


def _write(out: Path, chosen: tuple[Kept, ...], program: Headless) -> tuple[list[Path], tuple[str, ...]]:
    from studio.verbs import check_target
    from studio_core.exchange.files import kinds, write_materials
    from studio_core.library.shelf import Shelf

    if out.is_dir():
        shelf = Shelf(out)
        return [shelf.put(kept) for kept in chosen], ()
    check_target(out, [ending for _, endings in kinds(program.registry) for ending in endings], "materials")
    return [out], write_materials(out, chosen, program.registry)


def _plain(kept: Kept) -> dict[str, Any]:
    material = kept.material

    def plain(value: Value) -> Any:
        return list(value) if isinstance(value, tuple) else value

    return {
        "name": kept.name,
        "model": material.model,
        "values": {name: plain(value) for name, value in material.values.items()},
        "pictures": sorted(material.textures),
        "tables": sorted(material.tables),
        "opacity": material.opacity,
        "tags": list(kept.tags),
    }


def _line(kept: Kept) -> str:
    def text(value: Value) -> str:
        if isinstance(value, tuple):
            return "/".join(f"{number:.3g}" for number in value)
        return f"{value:.4g}" if isinstance(value, float) else str(value)

    values = ",".join(f"{name}={text(value)}" for name, value in kept.material.values.items())
    pictures = f"  pictures: {', '.join(sorted(kept.material.textures))}" if kept.material.textures else ""
    return f"{kept.name}  {kept.material.model}:{values}{pictures}"
