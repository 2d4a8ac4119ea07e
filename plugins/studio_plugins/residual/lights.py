"""Where lights are: from file names, tables of angles, `.lp` files, or a mirror ball in the pictures.

An `.lp` file (as of dome and highlight RTI) has the number of pictures in its first line, then a
picture's name and x, y, z towards its light, x to the right, y up, z to the camera. A table has a name
and one or two angles in a line: azimuth and height in degrees, parted by commas or blanks; azimuth 0 is
the camera, 90 to the right of it. With a heading (`picture,azimuth,height,seconds`; also `x,y,z`, `ev`)
columns may stand in any order.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_plugins.residual.names import told_by
from studio_plugins.residual.samples import F32, F64, Ball, Lights

_LARGEST = 4_000_000  # bytes of a list of lights
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_HEADINGS = {
    "name": ("picture", "name", "file", "image", "photo", "light", "filename"),
    "azimuth": ("azimuth", "az", "phi", "azimuth_deg"),
    "height": ("height", "elevation", "el", "altitude"),
    "x": ("x",),
    "y": ("y",),
    "z": ("z",),
    "seconds": ("seconds", "exposure", "time", "shutter", "t"),
    "ev": ("ev",),
}
"""What columns of a table are called."""


@dataclass(frozen=True, eq=False)
class LightList:
    """What a list tells by file name: unit `directions`, and `seconds` of exposure where it does."""

    directions: Mapping[str, F64]
    seconds: Mapping[str, float]


def read_lights(path: str | Path) -> Mapping[str, F64]:
    """Unit directions by file name, in the file's order, of an `.lp` file or a table."""
    return read_list(path).directions


def read_list(path: str | Path) -> LightList:
    """An `.lp` file, or a table. Names are without folders, unless only these tell them apart.

    InputError in one sentence with the line that cannot be used.
    """
    path = Path(path)
    try:
        if path.stat().st_size > _LARGEST:
            raise InputError(f"{path.name} cannot be read: it is too large for a list of lights")
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError as error:
        raise InputError(f"{path.name} cannot be read: {error.strerror or error}") from None
    rows = [
        (i + 1, line.strip())
        for i, line in enumerate(lines)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not rows:
        raise InputError(f"{path.name} cannot be used: it holds no lights")
    if path.suffix.lower() == ".lp":
        return LightList(_lp(path.name, rows), {})
    return _table(path.name, rows)


def _lp(name: str, rows: Sequence[tuple[int, str]]) -> Mapping[str, F64]:
    made: dict[str, F64] = {}
    counted: int | None = None
    for line, text in rows:
        if line == rows[0][0] and re.fullmatch(r"\d+", text):
            counted = int(text)
            continue
        found = re.fullmatch(rf"(.+?)[\s,;]+({_NUMBER})[\s,;]+({_NUMBER})[\s,;]+({_NUMBER})", text)
        if not found:
            raise InputError(f"{name} cannot be used: line {line} is no picture and three numbers")
        _add(made, name, line, found[1], [float(found[k]) for k in (2, 3, 4)])
    made = _short(made)
    if counted is not None and counted != len(made):
        raise InputError(f"{name} cannot be used: it announces {counted} lights and holds {len(made)}")
    return made


def _table(name: str, rows: Sequence[tuple[int, str]]) -> LightList:
    made: dict[str, F64] = {}
    seconds: dict[str, float] = {}
    columns = _headings(rows[0][1])
    for line, text in rows[1:] if columns else rows:
        cells = _cells(text, len(columns) if columns else 0)
        numbers = [float(cell) if re.fullmatch(_NUMBER, cell) else None for cell in cells]
        if columns is None:
            if line == rows[0][0] and (len(cells) < 2 or numbers[1] is None):
                continue  # a heading of other words
            told = _known(("name", "azimuth", "height"), numbers)
            short = len(cells) not in (2, 3) or len(told) != len(cells) - 1
        else:
            told = _known(columns, numbers)
            short = len(cells) < len(columns)
        if short or not ("azimuth" in told or {"x", "y", "z"} <= told.keys()):
            raise InputError(f"{name} cannot be used: line {line} is no picture and one or two angles")
        picture = cells[columns.index("name") if columns else 0]
        _add(made, name, line, picture, _towards(told))
        if "seconds" in told or "ev" in told:
            seconds[_plain(picture)] = told["seconds"] if "seconds" in told else 2.0 ** told["ev"]
    if not made:
        raise InputError(f"{name} cannot be used: it holds no lights")
    short_names = dict(zip(made, _short(made), strict=True))
    return LightList(_short(made), {short_names[key]: value for key, value in seconds.items()})


def _known(columns: Sequence[str], numbers: Sequence[float | None]) -> dict[str, float]:
    pairs = zip(columns, numbers, strict=False)
    return {key: value for key, value in pairs if value is not None and key not in ("", "name")}


def _headings(text: str) -> list[str] | None:
    """What each column is, if the line names a picture's and a light's; "" for what is not known."""
    cells = [re.sub(r"\W+.*$", "", cell.lower()) for cell in _cells(text, 0)]
    made = [next((key for key, words in _HEADINGS.items() if cell in words), "") for cell in cells]
    if "name" in made and ("azimuth" in made or {"x", "y", "z"} <= set(made)):
        return made
    return None


def _cells(text: str, count: int) -> list[str]:
    """Parted by commas, semicolons or tabs, else by blanks (a name's own blanks stay, if numbers follow)."""
    for mark in (";", "\t", ","):
        if mark in text:
            return [cell.strip().strip('"') for cell in text.split(mark)]
    found = re.fullmatch(rf"(.+?)((?:\s+{_NUMBER})+)", text)
    if found and count != 1:
        words = found[2].split()
        extra = len(words) - max(count - 1, 1) if count else max(len(words) - 2, 0)
        name = " ".join([found[1], *words[: max(extra, 0)]])
        return [name.strip('"'), *words[max(extra, 0) :]]
    return text.split()


def _towards(told: Mapping[str, float]) -> list[float]:
    if "azimuth" not in told:
        return [told["x"], told["y"], told["z"]]
    azimuth, height = math.radians(told["azimuth"]), math.radians(told.get("height", 0.0))
    flat = math.cos(height)
    return [math.sin(azimuth) * flat, math.sin(height), math.cos(azimuth) * flat]


def _plain(picture: str) -> str:
    return picture.strip().strip('"').replace("\\", "/").removeprefix("./")


def _add(made: dict[str, F64], name: str, line: int, picture: str, towards: Sequence[float]) -> None:
    key = _plain(picture)
    length = math.sqrt(sum(x * x for x in towards))
    if not math.isfinite(length) or length < 1e-9:
        raise InputError(f"{name} cannot be used: line {line} has no direction")
    if key in made:
        raise InputError(f"{name} cannot be used: {PurePosixPath(key).name} is in it twice")
    made[key] = np.asarray(towards, np.float64) / length


def _short(made: Mapping[str, F64]) -> dict[str, F64]:
    """By names without folders, where these differ."""
    names = [PurePosixPath(key).name for key in made]
    return dict(zip(names, made.values(), strict=True)) if len(set(names)) == len(names) else dict(made)


def lights_for(names: Sequence[str], listed: Mapping[str, F64] | None = None) -> Lights:
    """Lights of pictures by their names (with folders, `/` between), from a list or from the names.

    In a list a picture may have another ending (photographs were converted), or its folder's name.
    InputError naming the first picture without a light.
    """
    if listed is None:
        found = told_by(names)
        for name, one in zip(names, found, strict=True):
            if one.azimuth is None:
                raise InputError(
                    f"{name} tells no light: its name has no azimuth such as az-30, and no list was given"
                )
        made = Lights.at([one.azimuth or 0.0 for one in found], [one.height for one in found])
        return Lights(made.directions, made.strengths, tuple(names), "file names")
    keys = [key_of(name, listed) for name in names]
    for name, key in zip(names, keys, strict=True):
        if key is None:
            raise InputError(f"{name} has no light: the list does not hold it")
    towards = np.array([listed[key] for key in keys if key is not None])
    return Lights.of(towards, "list", names)


def key_of(name: str, listed: Mapping[str, F64]) -> str | None:
    """Under which of a list's names a picture stands: its own, without folders, ending or case, or that of
    a folder that it lies in."""
    known = _stems(tuple(listed))
    path = PurePosixPath(name)
    parts = [path.with_suffix("").as_posix(), *(p.as_posix() for p in path.parents)]
    for part in parts:
        whole = PurePosixPath(part)
        for tail in range(len(whole.parts)):
            key = known.get("/".join(whole.parts[tail:]).lower())
            if key is not None:
                return key
    return None


@lru_cache(maxsize=4)
def _stems(names: tuple[str, ...]) -> dict[str, str]:
    return {PurePosixPath(key).with_suffix("").as_posix().lower(): key for key in names}


def from_mirror_ball(pictures: F32, ball: Ball, names: Sequence[str] = ()) -> Lights:
    """Directions from the highlight on a mirror ball in pictures (n, H, W, 3): l = 2 (n·v) n − v.

    The highlight's middle is the mean of what is at least half as bright as the brightest within the ball.
    InputError naming the picture whose highlight is not one spot.
    """
    height, width = pictures.shape[1:3]
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    _, _, inside = ball.normals(x, y)
    towards = []
    for i, picture in enumerate(pictures):
        light = np.where(inside, picture.mean(axis=-1), 0)
        top = float(light.max())
        bright = light > 0.5 * top
        called = names[i] if names else f"picture {i + 1}"
        weight = np.where(bright, light, 0).astype(np.float64)
        at_x, at_y = (float((weight * at).sum() / max(weight.sum(), 1e-30)) for at in (x, y))
        far = np.hypot(x - at_x, y - at_y)[bright]
        if top <= 0 or np.quantile(far, 0.9) > 0.15 * ball.radius:
            raise InputError(
                f"{called} shows no highlight on the mirror ball: what is bright is not one spot"
            )
        n, v, _ = ball.normals(at_x, at_y)
        towards.append(2 * float(n @ v) * n - v)
    return Lights.of(np.array(towards), "mirror ball", names)


def write_lp(path: str | Path, lights: Lights) -> None:
    """An `.lp` file of lights by their names."""
    rows = [
        f"{n} {d[0]:.9f} {d[1]:.9f} {d[2]:.9f}" for n, d in zip(lights.names, lights.directions, strict=True)
    ]
    Path(path).write_text("\n".join([str(len(rows)), *rows]) + "\n", encoding="utf-8")


def write_table(path: str | Path, lights: Lights) -> None:
    """A table of azimuths and heights in degrees."""
    angles: npt.NDArray[np.float64] = lights.angles()
    rows = [f"{n},{a:.6f},{h:.6f}" for n, (a, h) in zip(lights.names, angles.tolist(), strict=True)]
    Path(path).write_text("\n".join(["picture,azimuth,height", *rows]) + "\n", encoding="utf-8")
