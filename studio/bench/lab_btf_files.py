"""BTFs as files: pictures in folders or zip files as Bonn gave them away in 2003, and `.btf` files.

For tests of their readers; the layout of `.btf` files is told in `studio_plugins.residual.btf_factored`.
"""

from __future__ import annotations

import io
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.imaging.encode import encode_exr, encode_png
from studio_core.imaging.transfer import linear_to_srgb
from studio_plugins.residual.btf import Btf
from studio_plugins.residual.samples import F64

YUV = np.array([[1, 0, 1.13983], [1, -0.39465, -0.5806], [1, 2.03211, 0]])
RGB, YUV_MODEL, PCA, RATIOS, LOGARITHMS = 0, 1, 3, 11, 12
NAMES = ("ubo2003", "utia", "numbers", "folders")


def write_pictures(btf: Btf, target: Path, kind: str = "png", names: str = "ubo2003") -> None:
    """All pictures as "png" (8-bit sRGB, clipped at 1), "jpg", or "exr", into a folder or, where `target`
    ends in `.zip`, a zip file; `names` are one of `NAMES`."""
    packed = zipfile.ZipFile(target, "w") if target.suffix == ".zip" else None
    for index in range(len(btf.lights)):
        (block,) = btf.blocks(np.array([index]))
        name = f"{name_of(index, btf, names)}.{kind}"
        data = encoded(block.values[0], kind)
        if packed is not None:
            packed.writestr(name, data)
        else:
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            (target / name).write_bytes(data)
    if packed is not None:
        packed.close()


def encoded(picture: npt.NDArray[np.float32], kind: str) -> bytes:
    """The bytes of a picture file."""
    if kind == "exr":
        return encode_exr(picture)
    numbers = linear_to_srgb(picture)
    if kind == "png":
        return encode_png(numbers)
    from PIL import Image

    made = io.BytesIO()
    Image.fromarray(numbers).save(made, "JPEG", quality=95, subsampling=0)
    return made.getvalue()


def name_of(index: int, btf: Btf, names: str) -> str:
    """A picture's name without ending."""
    (tl, pl), (tv, pv) = (_degrees(part[index]) for part in (btf.lights, btf.views))
    match names:
        case "ubo2003":
            view = f"tv{tv:03}_pv{pv:03}"
            return f"tv/{view}/{index:05} tl{tl:03} pl{pl:03} tv{tv:03} pv{pv:03}"
        case "utia":
            return f"tl{tl:03}_pl{pl:03}_tv{tv:03}_pv{pv:03}"
        case "numbers":
            return f"{tl}_{pl}_{tv}_{pv}"
        case _:
            return f"{tv}_{pv}/{tl}_{pl}"


def _degrees(direction: F64) -> tuple[int, int]:
    x, y, z = direction
    phi = np.degrees(np.arctan2(y, x)) % 360 if np.hypot(x, y) > 1e-6 else 0.0
    return round(float(np.degrees(np.arccos(z)))), round(float(phi)) % 360


def write_factored(
    btf: Btf,
    path: Path,
    *,
    signature: bytes = b"!DFMF08FCR",
    model: int = RGB,
    version: int = 4,
    scalar: int = 2,
    cosine: bool = True,
    swapped: bool = False,
) -> None:
    """A `.btf` file of a BTF whose pictures are all pairs of views and lights, lights fastest.

    signature, model (colours of DFMF), version (of the description): as in the reader; scalar: bytes a
    number; cosine: whether values keep theirs; swapped: texels are the matrix' rows.
    """
    (block,) = btf.blocks(np.arange(len(btf.lights)))
    height, width = btf.size
    values = block.values.reshape(len(btf.lights), -1, 3).astype(np.float64)
    if not cosine:
        values = values / btf.lights[:, 2, None, None]
    logarithm = signature.endswith(b"ER")
    with path.open("wb") as file:
        file.write(signature)
        _description(file, version, cosine)
        _directions(file, btf)
        file.write(struct.pack("<2I", width, height))
        if signature.endswith(b"R"):
            file.write(struct.pack("<I", 0))
        if signature.startswith(b"!DFMF"):
            matrix = np.array([[0.5, 0.5, 0.2], [0.5, -0.5, 0.1], [0.1, 0.2, 0.9]])
            mean = np.array([0.1, 0.2, 0.3])
            stored = _stored(values, model, matrix, mean)
            file.write(struct.pack("<Ii3f9f", 0, model, *mean, *matrix.ravel()))
            for c in range(3):
                file.write(struct.pack("<B", scalar))
                _matrix(file, stored[..., c].T if swapped else stored[..., c], scalar)
        else:
            if logarithm:
                file.write(struct.pack("<BI2I", 2, 1, 2, 2) + bytes(8))
                values = np.log(values + 1e-5)
            rows = np.moveaxis(values, -1, 1).reshape(-1, values.shape[1])
            if swapped:
                rows = np.moveaxis(values, 0, -1).reshape(-1, len(btf.lights))
            file.write(struct.pack("<IB", 0, scalar))
            _matrix(file, rows, scalar)


def _stored(values: F64, model: int, matrix: F64, mean: F64) -> F64:
    match model:
        case 1:
            return values @ np.linalg.inv(YUV.T)
        case 3:
            return (values - mean) @ np.linalg.inv(matrix)
        case 11:
            yuv = values @ np.linalg.inv(YUV.T)
            y = yuv[..., :1] + 1e-5
            return np.concatenate([np.log(np.maximum(y, 1e-9)), yuv[..., 1:] / y], axis=-1)
        case 12:
            return np.log(values + 1e-5)
        case _:
            return values


def _description(file: Any, version: int, cosine: bool) -> None:
    more = b""
    if version > 1:
        more += struct.pack("<I", int(cosine))
    if version > 2:
        more += struct.pack("<I", 5) + b"<xml>"
    if version > 3:
        more += struct.pack("<I", 3) + b"".join(struct.pack("<I", 1) + c for c in (b"R", b"G", b"B"))
    size = 8 + 240 + 16 + len(more)
    file.write(struct.pack("<2I", size, version) + bytes(240) + struct.pack("<4f", 10, 1, 1, 1) + more)


def _directions(file: Any, btf: Btf) -> None:
    def angles(direction: F64) -> tuple[float, float]:
        return float(np.arccos(direction[2])), float(np.arctan2(direction[1], direction[0]))

    views = [i for i in range(len(btf.views)) if i == 0 or (btf.views[i] != btf.views[i - 1]).any()]
    file.write(struct.pack("<I", len(views)))
    for first, last in zip(views, [*views[1:], len(btf.views)], strict=True):
        file.write(struct.pack("<2fI", *angles(btf.views[first]), last - first))
        for i in range(first, last):
            file.write(struct.pack("<2f", *angles(btf.lights[i])))


def _matrix(file: Any, matrix: F64, scalar: int) -> None:
    u, s, vt = np.linalg.svd(matrix, full_matrices=False)
    kind = {2: "<f2", 4: "<f4", 8: "<f8"}[scalar]
    file.write(struct.pack("<3I", len(s), *matrix.shape))
    for part in (s, u, vt.T * s):
        file.write(np.ascontiguousarray(part).astype(kind).tobytes())
