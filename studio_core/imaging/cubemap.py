"""Cube maps: their layouts, and their conversion to equirectangular pictures.

Faces are kept in OpenEXR's way (ImfEnvmap.h): order +x −x +y −y +z −z, and in picture coordinates
(a to the right, b down, both −1…1) the directions (1, −b, a), (−1, −b, −a), (a, 1, −b), (a, −1, b),
(−a, −b, 1), (a, −b, −1). All are seen upright and unmirrored from the inside.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.imaging.latlong import equirect_direction
from studio_core.imaging.sphere import even_rows, lookup, with_border

Faces = npt.NDArray[np.float32]
Vectors = npt.NDArray[np.floating[Any]]

_CROSSES = {  # face of OpenGL's order: row, column, of a horizontal and a vertical cross
    (3, 4): ((1, 2), (1, 0), (0, 1), (2, 1), (1, 1), (1, 3)),
    (4, 3): ((1, 2), (1, 0), (0, 1), (2, 1), (1, 1), (3, 1)),
}


def face_directions(n: int, edge_aligned: bool = False, border: int = 0) -> npt.NDArray[np.float64]:
    """(6, n + 2 border, n + 2 border, 3): directions, not of unit length, of the samples of all faces."""
    steps = np.arange(-border, n + border)
    if edge_aligned:
        t = 2 * steps / max(n - 1, 1) - 1.0 if n > 1 else np.zeros(len(steps))
    else:
        t = (2 * steps + 1) / n - 1.0
    b, a = np.meshgrid(t, t, indexing="ij")
    one = np.ones_like(a)
    faces = [(one, -b, a), (-one, -b, -a), (a, one, -b), (a, -one, b), (-a, -b, one), (a, -b, -one)]
    return np.stack([np.stack(face, axis=-1) for face in faces])


def face_of(
    directions: Vectors,
) -> tuple[npt.NDArray[np.intp], Vectors, Vectors]:
    """Face, a and b (shape (...)) that the directions (..., 3) meet."""
    x, y, z = (directions[..., i] for i in range(3))
    ax, ay, az = np.abs(x), np.abs(y), np.abs(z)
    on_x = (ax >= ay) & (ax >= az)
    on_y = ~on_x & (ay >= az)
    major = np.where(on_x, x, np.where(on_y, y, z))
    sign = np.where(major < 0, -1.0, 1.0).astype(directions.dtype)
    size = np.abs(major)
    size = np.where(size == 0, 1, size)
    face = np.where(on_x, 0, np.where(on_y, 2, 4)) + (major < 0)
    a = np.where(on_x, sign * z, np.where(on_y, x, -sign * x)) / size
    b = np.where(on_y, -sign * z, -y) / size
    return face, a, b


def from_opengl(faces: Faces) -> Faces:
    """OpenGL's faces (right, left, top, bottom, front, back) in our order; the front looks along +z."""
    right, left, top, bottom, front, back = faces
    return np.stack([left, right, top[::-1, ::-1], bottom[::-1, ::-1], front, back])


def to_opengl(faces: Faces) -> Faces:
    """Our faces in OpenGL's order and turns; `from_opengl`'s way back."""
    left, right, top, bottom, front, back = faces
    return np.stack([right, left, top[::-1, ::-1], bottom[::-1, ::-1], front, back])


def joined(faces: Faces, layout: str) -> Faces:
    """OpenGL's faces (6, n, n, C) as one picture: a "strip" (n, 6n), "cross" (3n, 4n) or "vertical cross".

    `split` takes it apart. The corners of crosses are black; the back of a vertical one hangs upside down.
    """
    if layout == "strip":
        return np.concatenate(list(faces), axis=1)
    rows, columns = {"cross": (3, 4), "vertical cross": (4, 3)}[layout]
    n = faces.shape[1]
    made = np.zeros((rows * n, columns * n, faces.shape[3]), faces.dtype)
    for index, (row, column) in enumerate(_CROSSES[rows, columns]):
        face = faces[index][::-1, ::-1] if rows == 4 and index == 5 else faces[index]
        made[row * n : (row + 1) * n, column * n : (column + 1) * n] = face
    return made


def split(pixels: npt.NDArray[np.float32]) -> Faces | None:
    """OpenGL faces (6, n, n, C) of a strip (6×1, 1×6) or a cross (4×3, 3×4); None when it is neither.

    A cross must have empty corners (each of one colour): else it is an ordinary picture.
    """
    height, width = pixels.shape[:2]
    if height == 6 * width:
        return pixels.reshape(6, width, width, -1)
    if width == 6 * height:
        return np.ascontiguousarray(pixels.reshape(height, 6, height, -1).swapaxes(0, 1))
    for (rows, columns), places in _CROSSES.items():
        if height * columns != width * rows or height % rows:
            continue
        n = height // rows
        cells = pixels.reshape(rows, n, columns, n, -1).swapaxes(1, 2)
        unused = [(r, c) for r in range(rows) for c in range(columns) if (r, c) not in places]
        if any(not _plain(cells[place]) for place in unused):
            return None
        faces = np.stack([cells[place] for place in places])
        if rows == 4:  # the back hangs upside down below the bottom
            faces[5] = faces[5][::-1, ::-1]
        return faces
    return None


def _plain(cell: npt.NDArray[np.float32]) -> bool:
    """Whether a cell has one colour, but for what compression adds."""
    low, high = np.nanpercentile(cell, [1, 99], axis=(0, 1))
    return bool(np.all(high - low <= 0.02))


def equirect_from_cube(faces: Faces, edge_aligned: bool = False, samples: int = 2) -> Faces:
    """(2n, 4n, C) picture of (6, n, n, C) faces in our order; the mean of samples² bilinear lookups a pixel.

    `edge_aligned`: the outermost samples lie on the edges of a face, as OpenEXR writes them.
    """
    n = faces.shape[1]
    padded = faces if edge_aligned and n > 1 else _with_border(faces)
    height, width = 2 * n, 4 * n
    made = np.empty((height, width, faces.shape[3]), np.float32)
    rows = max(1, (1 << 18) // width)
    for start in range(0, height, rows):
        stop = min(start + rows, height)
        total = np.zeros((stop - start, width, faces.shape[3]), np.float32)
        for i in range(samples * samples):
            du, dv = (i % samples + 0.5) / samples, (i // samples + 0.5) / samples
            u = (np.arange(width) + du) / width
            v = (np.arange(start, stop) + dv) / height
            total += _bilinear(padded, n, edge_aligned, _directions(u, v))
        made[start:stop] = total / samples**2
    return made


def faces_from_equirect(pixels: Faces, n: int, samples: int = 0, edge_aligned: bool = False) -> Faces:
    """(6, n, n, C) faces in our order of an equirectangular picture (H, 2H, C).

    A face's pixel is the mean of samples² bilinear lookups over its area (0: as many as the picture's
    pixels ask for), in rows that were averaged where they are denser than those lookups. `edge_aligned`:
    the outermost samples lie on the edges of a face, as OpenEXR wants them.
    """
    width = pixels.shape[1]
    spacing = 2 / max(n - 1, 1) if edge_aligned else 2 / n  # at a face's centre, radians
    count = samples or max(2, round(np.ceil(spacing * width / (2 * np.pi))))
    ready = with_border(even_rows(np.asarray(pixels, np.float32), spacing / count), 1)
    made = np.empty((6, n, n, pixels.shape[2]), np.float32)
    rows = max(1, (1 << 19) // (n * count * count))
    a = _steps(np.arange(n * count), n, count, edge_aligned).astype(np.float32)[None, :]
    away = np.hypot(a, np.float32(1))
    side_u = 0.5 - np.arctan2(a, np.float32(-1)) / np.float32(2 * np.pi)  # what −z sees, and others turned
    for start in range(0, n, rows):
        stop = min(start + rows, n)
        lines = np.arange(start * count, stop * count)
        b = _steps(lines, n, count, edge_aligned).astype(np.float32)[:, None]
        side_v = np.arctan2(away, -b) / np.float32(np.pi)
        up_u = 0.5 - np.arctan2(a, -b) / np.float32(2 * np.pi)
        up_v = np.arctan2(np.hypot(a, b), np.float32(1)) / np.float32(np.pi)
        for face in range(6):
            if face in (2, 3):
                u, v = (up_u, up_v) if face == 2 else (np.mod(0.5 - up_u, 1.0), 1 - up_v)
            else:
                turn = np.float32({0: 0.25, 1: 0.75, 4: 0.5, 5: 0.0}[face])
                u, v = np.broadcast_to(np.mod(side_u + turn, 1.0), side_v.shape), side_v
            seen = lookup(ready, 1, u, v).reshape(stop - start, count, n, count, -1)
            made[face, start:stop] = seen.mean(axis=(1, 3), dtype=np.float32)
    return made


def edge_samples(faces: Faces) -> Faces:
    """The same cube with samples on the edges of its faces, as OpenEXR keeps it: equal where faces meet."""
    n = faces.shape[1]
    if n == 1:
        return faces
    wide = face_directions(n, edge_aligned=True)
    return _bilinear(_with_border(faces), n, False, wide)


def _steps(index: npt.NDArray[np.intp], n: int, count: int, edge_aligned: bool) -> npt.NDArray[np.float64]:
    """Where the `count` lookups a sample lie across a face, −1 … 1 (a bit beyond when edge-aligned)."""
    at = (index + 0.5) / count
    if edge_aligned:
        made: npt.NDArray[np.float64] = 2 * (at - 0.5) / max(n - 1, 1) - 1.0 if n > 1 else (at - 0.5) * 2
        return made
    return np.asarray(2 * at / n - 1.0, np.float64)


def _directions(u: npt.NDArray[np.float64], v: npt.NDArray[np.float64]) -> Vectors:
    return equirect_direction(u[None, :], v[:, None]).astype(np.float32)


def _bilinear(padded: Faces, n: int, edge_aligned: bool, directions: Vectors) -> Faces:
    face, a, b = face_of(directions)
    if edge_aligned and n > 1:
        x, y = (a + 1) * ((n - 1) / 2), (b + 1) * ((n - 1) / 2)
    else:
        x, y = (a + 1) * (n / 2) + 0.5, (b + 1) * (n / 2) + 0.5
    side = padded.shape[1]
    x0 = np.clip(x.astype(np.intp), 0, side - 2)
    y0 = np.clip(y.astype(np.intp), 0, side - 2)
    fx = np.clip(x - x0, 0, 1).astype(np.float32)[..., None]
    fy = np.clip(y - y0, 0, 1).astype(np.float32)[..., None]
    flat = padded.reshape(-1, padded.shape[3])
    corner = (face * side + y0) * side + x0
    top = flat.take(corner, axis=0)
    top += (flat.take(corner + 1, axis=0) - top) * fx
    bottom = flat.take(corner + side, axis=0)
    bottom += (flat.take(corner + side + 1, axis=0) - bottom) * fx
    bottom -= top
    bottom *= fy
    made: Faces = top + bottom
    return made


def _with_border(faces: Faces) -> Faces:
    """Faces with one more sample all around, taken from their neighbours."""
    n = faces.shape[1]
    face, a, b = face_of(face_directions(n, border=1))
    x = np.clip(((a + 1) / 2 * n).astype(np.intp), 0, n - 1)
    y = np.clip(((b + 1) / 2 * n).astype(np.intp), 0, n - 1)
    made: Faces = faces[face, y, x]
    made[:, 1:-1, 1:-1] = faces
    return made
