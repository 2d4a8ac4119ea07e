"""What is asked for when a picture is exported, and how the command line is told. No Qt here."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from studio_core.arrays import frozen_map
from studio_core.session import ALL, SHARE

MOST_PIXELS = 16384
MM_PER_INCH = 25.4
HERE = ""
"""Stands for what the window shows, in the place of a camera's id."""

QUALITIES = {"screen": "As on the screen", "final": "Final: as true as can be"}
SAMPLES = {
    1: "1 a pixel, edges rough",
    2: "4 a pixel, 16 at edges",
    3: "9 a pixel, 16 at edges",
    4: "16 a pixel",
    6: "36 a pixel",
}
START_SECONDS = 3.0  # until the program that makes pictures is at work
GUIDE_SAMPLES = 1 << 23  # of a picture that light is summed for


@dataclass(frozen=True)
class Size:
    """Pixels, and dots per inch where it is meant for paper (0: it is not)."""

    width: int
    height: int
    dpi: float = 0.0

    @classmethod
    def paper(cls, width: float, height: float, dpi: float) -> Size:
        """A sheet of so many millimetres."""
        return cls(round(width / MM_PER_INCH * dpi), round(height / MM_PER_INCH * dpi), dpi)

    def upright(self) -> Size:
        """The same, turned by a quarter."""
        return Size(self.height, self.width, self.dpi)

    def described(self) -> str:
        """Megapixels, and millimetres on paper."""
        pixels = f"{self.width * self.height / 1e6:.1f} megapixels"
        if not self.dpi:
            return pixels
        width, height = (side / self.dpi * MM_PER_INCH for side in (self.width, self.height))
        return f"{width:.0f} × {height:.0f} mm at {self.dpi:.0f} dpi, {pixels}"


PRESETS: Mapping[str, Size] = {
    "HD  1280 × 720": Size(1280, 720),
    "Full HD  1920 × 1080": Size(1920, 1080),
    "4K  3840 × 2160": Size(3840, 2160),
    "8K  7680 × 4320": Size(7680, 4320),
    "Square  2048 × 2048": Size(2048, 2048),
    "A4, 150 dpi": Size.paper(297, 210, 150),
    "A4, 300 dpi": Size.paper(297, 210, 300),
    "A3, 150 dpi": Size.paper(420, 297, 150),
    "A3, 300 dpi": Size.paper(420, 297, 300),
}


@dataclass(frozen=True)
class Kind:
    """A kind of file: suffix and bits a channel."""

    label: str
    suffix: str
    bits: int


KINDS = (
    Kind("PNG, 8 bits, as shown", ".png", 8),
    Kind("PNG, 16 bits, as shown", ".png", 16),
    Kind("OpenEXR, 16 bits, linear light", ".exr", 16),
    Kind("OpenEXR, 32 bits, linear light", ".exr", 32),
)


@dataclass(frozen=True)
class Look:
    """How a picture is made, whatever it shows."""

    size: Size
    samples: int = 2
    quality: str = "screen"
    kind: Kind = KINDS[0]
    alpha: bool = False
    lights: bool = False
    measure: bool = False
    exposure: float = 0.0
    tonemap: str = "srgb"
    backend: str = "cuts"
    params: Mapping[str, Any] = field(default_factory=frozen_map)
    indirect: str = ""
    indirect_params: Mapping[str, Any] = field(default_factory=frozen_map)
    light: str = ALL

    def arguments(self) -> list[str]:
        """For the command line."""
        made = ["--size", f"{self.size.width}x{self.size.height}", "--antialias", str(self.samples)]
        made += ["--bits", str(self.kind.bits), f"--exposure={self.exposure:g}", "--tonemap", self.tonemap]
        made += ["--dpi", f"{self.size.dpi:g}"] if self.size.dpi else []
        flags = {"--alpha": self.alpha, "--lights": self.lights, "--measure": self.measure}
        if self.light == SHARE and self.indirect:
            flags = {}  # false colours have none of these
        made += [name for name, on in flags.items() if on]
        made += ["--backend", self.backend]
        for name, value in self.params.items():
            made += ["--param", f"{name}={_text(value)}"]
        if self.indirect:
            made += ["--indirect", self.indirect, "--light", self.light]
            for name, value in self.indirect_params.items():
                made += ["--indirect-param", f"{name}={_text(value)}"]
        return made


@dataclass(frozen=True)
class PictureOrder:
    """One picture: of a camera, or of what the window shows (`HERE`), into a file."""

    camera: str
    path: Path
    look: Look

    @property
    def cameras(self) -> tuple[str, ...]:
        """The camera."""
        return (self.camera,)

    def seen_by(self, others: Mapping[str, str]) -> PictureOrder:
        """The same of another camera."""
        return dataclasses.replace(self, camera=others[self.camera])

    def arguments(self, project: Path, preview: Path) -> list[str]:
        """For the command line, of a project that has the camera."""
        made = ["render", str(project), "-o", str(self.path), "--camera", self.camera]
        return [*made, "--preview", str(preview), *self.look.arguments(), *_FOR_PROGRAMS]


@dataclass(frozen=True)
class SeriesOrder:
    """Numbered pictures. `kind` is turntable, relight or path; `cameras` are ids, one or the path's."""

    kind: str
    cameras: tuple[str, ...]
    path: Path
    look: Look
    count: int = 48
    degrees: float = 360.0
    around: tuple[float, float, float] | None = None
    closed: bool = False
    ease: bool = True
    even: bool = True
    resume: bool = False

    def seen_by(self, others: Mapping[str, str]) -> SeriesOrder:
        """The same of other cameras."""
        return dataclasses.replace(self, cameras=tuple(others[camera] for camera in self.cameras))

    def arguments(self, project: Path, preview: Path) -> list[str]:
        """For the command line, of a project that has the cameras."""
        made = ["frames", str(project), "-o", str(self.path), "--sheet", str(preview)]
        if self.kind == "path":
            made += ["--path", ",".join(self.cameras), "--frames", str(self.count)]
            flags = {"--closed": self.closed, "--ease": self.ease, "--uneven": not self.even}
            made += [name for name, on in flags.items() if on]
        else:
            made += [f"--{self.kind}", str(self.count), f"--degrees={self.degrees:g}"]
            made += ["--camera", self.cameras[0]]
            if self.around is not None and self.kind == "turntable":
                made.append("--around=" + ",".join(f"{c:.9g}" for c in self.around))
        made += ["--resume"] if self.resume else []
        return [*made, *self.look.arguments(), *_FOR_PROGRAMS]


_FOR_PROGRAMS = ["--progress", "json", "--json"]
FINAL: Mapping[str, Any] = {"quality": 1.0, "lamp_samples": 256}
"""What "final" asks of a backend that has these parameters. More directions took six times as long in the
sample room and left the measured error where it was."""


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def guessed(look: Look, past: Mapping[str, Any], kind: str = "one") -> float | None:
    """Seconds that a picture will take, by the last one of its quality (`learned`); None: who knows."""
    found = past.get(f"{kind} {look.quality}")
    if not isinstance(found, dict):
        return None
    try:
        samples = _samples(look)
        share = min(samples, GUIDE_SAMPLES) / float(found["guide"])
        shading = float(found["shading"]) * math.sqrt(share)
        return START_SECONDS + shading + float(found["composing"]) * samples / float(found["samples"])
    except (KeyError, TypeError, ValueError, ZeroDivisionError):
        return None


def learned(look: Look, seconds: Mapping[str, float], past: Mapping[str, Any], kind: str = "one") -> Any:
    """What is remembered of a picture, or of one of many: `past` with its seconds for both halves."""
    samples = _samples(look)
    facts = {"samples": samples, "guide": min(samples, GUIDE_SAMPLES)}
    return {**past, f"{kind} {look.quality}": {**seconds, **facts}}


def _samples(look: Look) -> int:
    return look.size.width * look.size.height * look.samples**2


def duration(seconds: float) -> str:
    """In words that fit the length."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 120 else f"{minutes // 60} h {minutes % 60} min"
