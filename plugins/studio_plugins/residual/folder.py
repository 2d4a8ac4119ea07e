"""What lies in a folder of photographs: which pictures belong to one lamp, and what else there is.

Folders may be nested (one a lamp, or one an exposure). Beside the lamps' pictures there may be a list of the
lamps (`*.lp`, `lights.csv`), a mask of the sample (`mask.png`, white where it is), and pictures without any
lamp (`dark.jpg`, `ambient/…`) whose light is taken off.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studio_core.errors import InputError
from studio_core.imaging.photograph_decode import RAW
from studio_core.imaging.photograph_read import PHOTOGRAPHS
from studio_plugins.residual.lights import LightList, key_of, lights_for, read_list
from studio_plugins.residual.names import Told, structure, told_by
from studio_plugins.residual.samples import F64

_DEEPEST = 3
_MOST = 20_000  # pictures
_MOST_STRAYS = 2 / 3  # of all names are alike at least
_MASKS = ("mask", "matte")
_DARKS = ("dark", "ambient", "black", "off", "nolight", "no_light", "no-light", "background")
_LISTS = ("lights.csv", "lights.txt", "lights.tsv", "angles.csv", "angles.txt")
_BEST = ((".exr", ".hdr", ".pfm"), RAW, (".tif", ".tiff"), (".png",))


@dataclass(frozen=True, eq=False)
class Group:
    """The pictures of one lamp: `name` in reports, unit `direction` (None: not told), and of each picture
    what its name or the list says of its exposure."""

    name: str
    paths: tuple[Path, ...]
    direction: F64 | None
    told: tuple[Told, ...]


@dataclass(frozen=True, eq=False)
class Folder:
    """Lamps in the order of their names; the pictures without a lamp; the mask; sentences; where directions
    come from."""

    groups: tuple[Group, ...]
    dark: Group | None
    mask: Path | None
    notes: tuple[str, ...]
    source: str


def look_through(
    folder: str | Path, listed: LightList | Mapping[str, F64] | None = None, directions: bool = True
) -> Folder:
    """The folder's pictures by lamp: by a list, else by names, else by a list that lies in the folder.

    `directions`: False where they are found out in another way (a mirror ball): pictures then belong together
    when they lie in one of several folders or differ in their exposure alone. InputError in one sentence.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise InputError(f"{folder} cannot be read: there is no such folder")
    names, notes = _pictures(folder)
    mask = next((name for name in names if _called(name, _MASKS)), None)
    dark = [name for name in names if name != mask and _called(name, _DARKS)]
    rest = [name for name in names if name != mask and name not in dark]
    if listed is not None and not isinstance(listed, LightList):
        listed = LightList(listed, {})
    if listed is None and directions and any(one.azimuth is None for one in told_by(rest)):
        rest, more = _without_strays(rest)
        notes += more
        found = None if more else _list_in(folder)
        if found is not None:
            listed = read_list(found)
            notes.append(f"Lights are those of {found.name}, which lies among the pictures.")
    told = told_by(rest)
    if listed is not None:
        rest, told, listed, more = _in_list(rest, told, listed)
        notes += more
    if not rest:
        raise InputError(f"{folder} cannot be used: it holds no photographs with a light")
    source = "list" if listed is not None else "file names"
    places: Sequence[F64 | None] = [None] * len(rest)
    if directions:
        lights = lights_for(rest, listed.directions if listed is not None else None)
        places = list(lights.directions)
    groups = _grouped(folder, rest, told, places)
    off = Group("dark", tuple(folder / n for n in dark), None, tuple(told_by(dark))) if dark else None
    return Folder(groups, off, folder / mask if mask else None, tuple(notes), source)


def _pictures(folder: Path) -> tuple[list[str], list[str]]:
    """Names within the folder, `/` between, sorted; of one picture in several formats the best."""
    found: list[str] = []
    for path in sorted(folder.rglob("*")):
        within = path.relative_to(folder)
        if len(within.parts) > _DEEPEST or any(p.startswith((".", "__MACOSX")) for p in within.parts):
            continue
        if path.suffix.lower() in PHOTOGRAPHS and path.is_file():
            found.append(within.as_posix())
        if len(found) > _MOST:
            raise InputError(f"{folder} cannot be used: it holds more than {_MOST} pictures")
    by_stem: dict[str, list[str]] = {}
    for name in found:
        by_stem.setdefault(str(Path(name).with_suffix("")), []).append(name)
    made = [min(same, key=_rank) for same in by_stem.values()]
    if len(made) == len(found):
        return made, []
    return made, [
        f"{len(found) - len(made)} pictures are left out: another file has the same in a better format"
    ]


def _rank(name: str) -> int:
    suffix = Path(name).suffix.lower()
    if suffix in RAW and importlib.util.find_spec("rawpy") is None:
        return len(_BEST) + 1
    return next((i for i, some in enumerate(_BEST) if suffix in some), len(_BEST))


def _called(name: str, words: Sequence[str]) -> bool:
    """Whether the picture, or the folder it lies in, is called so."""
    path = Path(name)
    parts = [path.stem.lower(), *(part.lower() for part in path.parts[:-1])]
    return any(part == word or part.startswith((f"{word}_", f"{word}-")) for part in parts for word in words)


def _without_strays(names: list[str]) -> tuple[list[str], list[str]]:
    """Without a few that are called otherwise, if the others then tell their lights; a sentence."""
    kinds = [structure(name) for name in names]
    usual = max(dict.fromkeys(kinds), key=kinds.count, default=frozenset())
    some = [name for name, kind in zip(names, kinds, strict=True) if kind == usual]
    strays = [name for name in names if name not in some]
    if len(some) < max(3, _MOST_STRAYS * len(names)) or any(t.azimuth is None for t in told_by(some)):
        return names, []
    return some, [f"{', '.join(strays)}: left out, for the name tells no light"]


def _list_in(folder: Path) -> Path | None:
    some = sorted(p for p in folder.iterdir() if p.suffix.lower() == ".lp" or p.name.lower() in _LISTS)
    return some[0] if len(some) == 1 else None


def _in_list(
    names: list[str], told: list[Told], listed: LightList
) -> tuple[list[str], list[Told], LightList, list[str]]:
    """Pictures that the list holds, with the exposures it tells, and the list by names that they have."""
    keys = [key_of(name, listed.directions) for name in names]
    notes = []
    if not any(keys) and len(names) == len(listed.directions):
        old = list(listed.directions)
        notes.append(
            "No picture is called as in the list of lights: they are taken in the order of their names."
        )
        directions = dict(zip(names, listed.directions.values(), strict=True))
        seconds = {n: listed.seconds[k] for n, k in zip(names, old, strict=True) if k in listed.seconds}
        listed, keys = LightList(directions, seconds), list(names)
    rest = [i for i, key in enumerate(keys) if key is not None]
    if len(rest) < len(names):
        notes.append(f"{len(names) - len(rest)} pictures are left out: the list of lights does not hold them")
    made = []
    for i in rest:
        time = listed.seconds.get(keys[i] or "")
        made.append(told[i] if time is None else Told(seconds=time))
    return [names[i] for i in rest], made, listed, notes


def _grouped(
    folder: Path, names: Sequence[str], told: Sequence[Told], places: Sequence[F64 | None]
) -> tuple[Group, ...]:
    folders = {str(Path(name).parent) for name in names}
    groups: dict[object, list[int]] = {}
    for i, name in enumerate(names):
        place = places[i]
        key: object = name
        if place is not None:
            key = tuple(np.round(place, 6))
        elif len(folders) > 1:
            key = str(Path(name).parent)
        elif told[i].azimuth is not None:
            key = (told[i].azimuth, told[i].height)
        groups.setdefault(key, []).append(i)
    made = []
    for some in groups.values():
        parents = {Path(names[i]).parent for i in some}
        (first, *_) = parents
        alone = len(parents) == 1 and first != Path() and len(some) > 1
        alone = alone and sum(Path(n).parent == first for n in names) == len(some)
        name = first.as_posix() if alone else names[some[0]]
        made.append(
            Group(name, tuple(folder / names[i] for i in some), places[some[0]], tuple(told[i] for i in some))
        )
    return tuple(made)
