"""Where lights are: from file names, tables of angles, `.lp` files, or a mirror ball in the pictures.

An `.lp` file (as of dome and highlight RTI) has the number of pictures in its first line, then a
picture's name and x, y, z towards its light, x to the right, y up, z to the camera. A table has a name
and one or two angles in a line: azimuth and height in degrees, parted by commas or blanks; azimuth 0 is
the camera, 90 to the right of it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath

import numpy as np
import numpy.typing as npt

from studio_core.errors import InputError
from studio_plugins.residual.samples import F32, F64, Ball, Lights

_LARGEST = 4_000_000  # bytes of a list of lights
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_AZIMUTH = re.compile(r"(?:^|[_\W])(?:az|azimuth|a|phi)[_=]?(m|p)?([-+]?\d+(?:\.\d+)?)", re.IGNORECASE)
_HEIGHT = re.compile(
    r"(?:^|[_\W\d])(?:el|elevation|height|h|e)[_=]?(m|p)?([-+]?\d+(?:\.\d+)?)", re.IGNORECASE
)
_BARE = re.compile(r"^[^\d+-]*([-+]?\d+(?:\.\d+)?)$")


def read_lights(path: str | Path) -> Mapping[str, F64]:
    """Unit directions by file name (without folders), in the file's order, of an `.lp` file or a table.

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
        return _lp(path.name, rows)
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
    if counted is not None and counted != len(made):
        raise InputError(f"{name} cannot be used: it announces {counted} lights and holds {len(made)}")
    return made


def _table(name: str, rows: Sequence[tuple[int, str]]) -> Mapping[str, F64]:
    made: dict[str, F64] = {}
    for line, text in rows:
        found = re.fullmatch(rf"(.+?)[\s,;]+({_NUMBER})(?:[\s,;]+({_NUMBER}))?", text)
        if not found:
            if line == rows[0][0]:
                continue  # a heading
            raise InputError(f"{name} cannot be used: line {line} is no picture and one or two angles")
        azimuth, height = math.radians(float(found[2])), math.radians(float(found[3] or 0))
        flat = math.cos(height)
        _add(
            made, name, line, found[1], [math.sin(azimuth) * flat, math.sin(height), math.cos(azimuth) * flat]
        )
    if not made:
        raise InputError(f"{name} cannot be used: it holds no lights")
    return made


def _add(made: dict[str, F64], name: str, line: int, picture: str, towards: Sequence[float]) -> None:
    key = PurePath(picture.strip().strip('"').replace("\\", "/")).name
    length = math.sqrt(sum(x * x for x in towards))
    if not math.isfinite(length) or length < 1e-9:
        raise InputError(f"{name} cannot be used: line {line} has no direction")
    if key in made:
        raise InputError(f"{name} cannot be used: {key} is in it twice")
    made[key] = np.asarray(towards, np.float64) / length


def angles_of(name: str) -> tuple[float, float] | None:
    """Azimuth and height in degrees that a file's name tells, None when it tells none.

    `az-30.png`, `jade_az+20_el15.exr`, `a-10_h5.tif`, `a_m40.png` (minus), `cloth-60.jpg` (the only number).
    """
    stem = PurePath(name).stem
    azimuth, height = _AZIMUTH.search(stem), _HEIGHT.search(stem)
    if azimuth:
        found = _signed(azimuth), _signed(height) if height else 0.0
    else:
        bare = _BARE.match(stem)
        if not bare:
            return None
        found = float(bare[1]), 0.0
    return found if abs(found[0]) <= 180 and abs(found[1]) <= 90 else None


def _signed(found: re.Match[str]) -> float:
    value = float(found[2])
    return -value if (found[1] or "").lower() == "m" else value


def lights_for(names: Sequence[str], listed: Mapping[str, F64] | None = None) -> Lights:
    """Lights of pictures by their names, from a list or, without one, from the names themselves.

    In a list a picture may have another ending (photographs were converted). InputError naming the first
    picture without a light.
    """
    if listed is None:
        found = [angles_of(name) for name in names]
        for name, one in zip(names, found, strict=True):
            if one is None:
                raise InputError(
                    f"{name} tells no light: its name has no azimuth such as az-30, and no list was given"
                )
        pairs = [one for one in found if one is not None]
        made = Lights.at([a for a, _ in pairs], [h for _, h in pairs])
        return Lights(made.directions, made.strengths, tuple(names), "file names")
    stems = {PurePath(key).stem.lower(): value for key, value in listed.items()}
    towards = []
    for name in names:
        direction = listed.get(name, stems.get(PurePath(name).stem.lower()))
        if direction is None:
            raise InputError(f"{name} has no light: the list does not hold it")
        towards.append(direction)
    return Lights.of(np.array(towards), "list", names)


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
