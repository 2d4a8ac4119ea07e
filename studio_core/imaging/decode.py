"""Decoding one picture file with OpenImageIO; runs in the decoder child (`decode_child`).

Only `ImageInput` is used, every result is checked for None and every read for a pending error: an
`ImageBuf` of a file that did not open can end the process, and a damaged Radiance file gives black
pixels with nothing but a pending error.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from studio_core.imaging.radiance import HEADER, RadianceHeader, parse_header
from studio_core.imaging.transfer import REC709, icc_to_rec709, rgb_to_xyz, srgb_to_linear, to_rec709

Pixels = npt.NDArray[Any]
_HARMLESS = re.compile(
    "extraneous bytes before marker|Invalid SOS parameters"
    "|unknown JFIF revision|Unknown Adobe color transform"
)
PARTS = 64
"""Parts of a multi-part file that are looked at."""


class Unreadable(Exception):  # noqa: N818 - becomes an InputError once the file's name is known
    """Why a picture cannot be read, as the end of a sentence."""


@dataclass(frozen=True)
class Limits:
    """The largest picture that is decoded: `pixels` in all, `megabytes` of samples."""

    pixels: int = 1 << 27
    megabytes: int = 2048


@dataclass(frozen=True)
class Facts:
    """What a file says about its picture beyond the pixels.

    `envmap` is OpenEXR's environment layout; `edge_aligned` tells that the outermost samples lie on
    the edges of a face; radiance is pixel / `exposure` (Radiance); `notes` are sentences on what was
    converted or left out. `colour`: see `Photograph.colour`. `exif`: the file's Exif block, base64, where the
    decoder is the one who finds it; `told`: exposure as a camera's own format tells it.
    """

    format: str = ""
    encoding: Literal["linear", "srgb"] = "linear"
    envmap: Literal["", "latlong", "cube"] = ""
    edge_aligned: bool = False
    exposure: float = 1.0
    notes: list[str] = field(default_factory=list)
    colour: list[float] = field(default_factory=list)
    exif: str = ""
    told: dict[str, Any] = field(default_factory=dict)


def decode_file(
    path: str, limits: Limits, *, encoded: bool = False, plain: bool = False
) -> tuple[Pixels, Facts]:
    """Pixels (H, W, 1, 3 or 4) of uint8 (sRGB) or float32 (linear Rec.709), and the facts.

    Alpha is kept as the fourth channel as the file has it (associated in OpenEXR, straight elsewhere).
    `encoded`: whole numbers stay as they are, of uint8 or uint16, and small faults in how a camera wrote its
    JPEG, which change no pixel, are passed over. `plain`: numbers that are no colours, such as roughness or
    normals: no transfer curve and no primaries are undone; 16 bits become 0…1. Raises Unreadable.
    """
    import OpenImageIO as oiio  # noqa: N813 - its customary name

    oiio.attribute("limits:imagesize_MB", limits.megabytes)
    oiio.attribute("limits:channels", 256)
    config = oiio.ImageSpec()
    config.attribute("oiio:UnassociatedAlpha", 1)
    source = oiio.ImageInput.open(path, config)
    if source is None:
        raise Unreadable(_failure(oiio) or "it is no picture of a known format")
    try:
        return _decode(oiio, source, path, limits, encoded, plain)
    finally:
        source.close()


def _decode(
    oiio: Any, source: Any, path: str, limits: Limits, encoded: bool, plain: bool
) -> tuple[Pixels, Facts]:
    notes: list[str] = []
    part, spec, chosen = _part(source, notes)
    _check(spec, limits)
    first, last = min(chosen), max(chosen) + 1
    kind = str(spec.format)
    whole = kind == "uint8" or (encoded and kind == "uint16")
    wanted = oiio.FLOAT if not whole else oiio.UINT8 if kind == "uint8" else oiio.UINT16
    pixels = source.read_image(part, 0, first, last, wanted)
    error = _failure(source, _HARMLESS if encoded else None)
    if error or pixels is None:
        raise Unreadable(error or "its pixels cannot be decoded")
    pixels = np.asarray(pixels).reshape(spec.height, spec.width, last - first)
    if chosen != list(range(first, last)):
        pixels = np.ascontiguousarray(pixels[:, :, [c - first for c in chosen]])
    if pixels.shape[2] == 2:  # grey and alpha
        pixels = pixels[:, :, [0, 0, 0, 1]]

    form = str(source.format_name())
    layout = str(_attribute(spec, "textureformat", ""))
    envmap: Literal["", "latlong", "cube"] = ""
    if layout.startswith("LatLong"):
        envmap = "latlong"
    elif layout.startswith("CubeFace"):
        envmap = "cube"
    if form == "openexr":
        if envmap != "cube":
            pixels = _display(pixels, spec, limits, notes)
        if not plain:
            given = _attribute(spec, "chromaticities", None)
            pixels = _primaries(pixels, given, _attribute(spec, "adoptedNeutral", None), notes)
    exposure = 1.0
    if form == "hdr":
        with Path(path).open("rb") as file:
            header = parse_header(file.read(HEADER))
        exposure = header.exposure
        pixels = _radiance(pixels, header, notes)
    encoding: Literal["linear", "srgb"] = "srgb" if whole else "linear"
    linear = kind in ("half", "float", "double") or _says_linear(_attribute(spec, "oiio:ColorSpace", ""))
    if plain:
        encoding = "linear"
    elif whole and linear and not encoded:
        pixels, encoding = pixels.astype(np.float32) / 255, "linear"
    elif not whole and not linear:
        pixels = pixels.astype(np.float32)
        pixels[:, :, :3] = srgb_to_linear(pixels[:, :, :3])
    pixels = _upright(pixels, _attribute(spec, "Orientation", 1))
    edges = bool(_attribute(spec, "oiio:sampleborder", 0))
    colour = icc_to_rec709(_bytes(_attribute(spec, "ICCProfile", None))) if whole else []
    return np.ascontiguousarray(pixels), Facts(form, encoding, envmap, edges, exposure, notes, colour)


def _part(source: Any, notes: list[str]) -> tuple[int, Any, list[int]]:
    """The first part that has colour, or else the first with any channel, and its channels."""
    found: tuple[int, Any, list[int]] | None = None
    for index in range(PARTS):
        if not source.seek_subimage(index, 0):
            _failure(source)  # there is no such part: nothing to report
            break
        spec = source.spec()
        if spec.deep or spec.nchannels < 1:
            continue
        chosen, whole = _channels([str(name) for name in spec.channelnames], spec.alpha_channel)
        if whole:
            if index:
                notes.append(f"Part {index + 1} of the file is used: the first that has red, green and blue.")
            return index, spec, chosen
        found = found or (index, spec, chosen)
    if found is None:
        raise Unreadable("it holds deep data or no picture at all")
    return found


def _channels(names: list[str], alpha: int) -> tuple[list[int], bool]:
    """Channels to read, red first, and whether they are a colour."""
    place = {name.lower(): index for index, name in reversed(list(enumerate(names)))}
    for prefix in dict.fromkeys(["", *(n.rpartition(".")[0] + "." for n in place if "." in n)]):
        colour = [place.get(prefix + letter) for letter in "rgb"]
        if all(c is not None for c in colour):
            also = place.get(prefix + "a")
            return [c for c in (*colour, also) if c is not None], True
    grey = next((place[n] for n in ("y", "l", "i") if n in place), 0)
    if len(names) == 2 and alpha >= 0:
        return [1 - alpha, alpha], False
    if len(names) >= 3 and "y" not in place:
        return [0, 1, 2], False
    return [grey], False


def _check(spec: Any, limits: Limits) -> None:
    """Refuse sizes before anything is allocated."""
    if spec.width < 1 or spec.height < 1 or spec.depth > 1:
        raise Unreadable(f"its size of {spec.width} × {spec.height} × {spec.depth} is no picture's")
    check_size(spec.width, spec.height, spec.nchannels, limits)


def check_size(width: int, height: int, channels: int, limits: Limits) -> None:
    """Refuse what is larger than accepted: Unreadable."""
    megabytes = width * height * min(channels, 4) * 4 >> 20
    if width * height > limits.pixels or megabytes > limits.megabytes:
        raise Unreadable(
            f"{width} × {height} pixels are more than the {limits.pixels / 1e6:.0f} million"
            f" or {limits.megabytes} MB that are accepted"
        )


def _display(pixels: Pixels, spec: Any, limits: Limits, notes: list[str]) -> Pixels:
    """What is inside the display window; the window's uncovered part is black and transparent."""
    data = (spec.x, spec.y, spec.width, spec.height)
    window = (spec.full_x, spec.full_y, spec.full_width, spec.full_height)
    if data == window or spec.full_width < 1 or spec.full_height < 1:
        return pixels
    check_size(spec.full_width, spec.full_height, pixels.shape[2], limits)
    left, top = spec.x - spec.full_x, spec.y - spec.full_y
    x0, x1 = max(left, 0), min(left + spec.width, spec.full_width)
    y0, y1 = max(top, 0), min(top + spec.height, spec.full_height)
    if x0 >= x1 or y0 >= y1:
        raise Unreadable("all its pixels lie outside its display window")
    made = np.zeros((spec.full_height, spec.full_width, pixels.shape[2]), pixels.dtype)
    made[y0:y1, x0:x1] = pixels[y0 - top : y1 - top, x0 - left : x1 - left]
    notes.append(
        f"The data window of {spec.width} × {spec.height} was fitted into"
        f" the display window of {spec.full_width} × {spec.full_height}."
    )
    return made


def _primaries(
    pixels: Pixels, given: Sequence[float] | None, neutral: Sequence[float] | None, notes: list[str]
) -> Pixels:
    """Rec.709 from the primaries that the file names."""
    if given is None or len(given) != 8 or pixels.shape[2] < 3:
        return pixels
    try:
        matrix = to_rec709([float(v) for v in given], neutral)
    except (ValueError, TypeError, np.linalg.LinAlgError):
        notes.append("The chromaticities of the file make no sense and were ignored.")
        return pixels
    if np.allclose(matrix, np.eye(3), atol=2e-3):
        return pixels
    notes.append("The colours were converted to Rec.709 from the file's own primaries.")
    return _through(pixels, matrix)


def _radiance(pixels: Pixels, header: RadianceHeader, notes: list[str]) -> Pixels:
    if "xyze" in header.format:
        notes.append("The colours were converted to Rec.709 from CIE XYZ.")
        return _through(pixels, np.linalg.inv(rgb_to_xyz(REC709)))
    return _primaries(pixels, header.primaries, None, notes)


def _through(pixels: Pixels, matrix: npt.NDArray[np.floating[Any]]) -> Pixels:
    made = pixels.astype(np.float32)
    with np.errstate(all="ignore"):
        made[:, :, :3] = made[:, :, :3] @ matrix.T.astype(np.float32)
    return made


def _upright(pixels: Pixels, orientation: object) -> Pixels:
    """The picture as it is to be seen, from Exif's orientation 1…8."""
    turn = orientation if isinstance(orientation, int) and 1 <= orientation <= 8 else 1
    if turn >= 5:
        pixels = pixels.transpose(1, 0, 2)
    if turn in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    if turn in (3, 4, 7, 8):
        pixels = pixels[::-1]
    return pixels


def _attribute(spec: Any, name: str, default: Any) -> Any:
    """An attribute; text that is no UTF-8 counts as absent."""
    try:
        value = spec.getattribute(name)
    except (UnicodeDecodeError, ValueError):
        return default
    return default if value is None else value


def _bytes(value: object) -> bytes:
    return bytes(value) if isinstance(value, np.ndarray) and value.dtype == np.uint8 else b""


def _says_linear(space: object) -> bool:
    return str(space).lower().startswith(("lin", "scene-linear", "scene_linear"))


def _failure(library: Any, harmless: re.Pattern[str] | None = None) -> str:
    """The pending error of the library or of an open file, as the end of a sentence; "" for harmless ones."""
    try:
        text = str(library.geterror())
    except UnicodeDecodeError:  # the message quotes the damaged header
        return "its header is damaged"
    if "ubsampled channels" in text:
        return "it holds luminance and subsampled chroma; save it again as RGB"
    if "limits:" in text:
        return "its size is more than what is accepted, or it is damaged"
    lines = re.sub(r"EXR Error \(.*?\):\s*(EXR_ERR_\w+)?", "", text).strip().splitlines()
    first = next((line for line in lines if not (harmless and harmless.search(line))), "")
    if jpeg := re.match(r"JPEG error: (.*?)( \(\".*\"\))?$", first):
        return f"it is damaged or incomplete ({jpeg[1]})"
    return first.strip().rstrip(".")[:200]
