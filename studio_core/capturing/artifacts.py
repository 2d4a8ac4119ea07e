"""What the stages of a capture make, in order; the wizard shows each, the report tells it in numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from studio_core.arrays import frozen_map
from studio_core.capturing.settings import Patch
from studio_core.imaging.photograph import Photograph
from studio_core.imaging.projection import Circle, Lens
from studio_core.scene.geometry import Image

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Bracket:
    """Photographs of one view with different exposures, dark to bright, and their listed EV (prior)."""

    shots: tuple[Photograph, ...]
    listed: tuple[float, ...]
    certain: tuple[bool, ...]
    """Whether the EV comes from the photograph or was typed; else it is a guess."""


@dataclass(frozen=True, eq=False)
class Brackets:
    """By side: `front`, and `back` where there is one. `layout` is what was found or chosen."""

    layout: str
    sides: Mapping[str, Bracket]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Motion:
    """How a frame is shifted and turned against its bracket's reference, pixels (y down) and degrees.

    A point p of the reference lies at R(p − c) + c + (dx, dy) in the frame, c the picture's centre, R a
    turn by `degrees` clockwise as seen. Behind a fisheye the lens is turned in space instead, its circle
    staying where it is: a direction d of the reference lies at turn(rotation) · d in the frame, `rotation`
    being an axis in the lens' frame times degrees (`studio_core.imaging.warping` applies both).
    `correlation` of the two after alignment; when it is not `trusted`, the motion is 0.
    """

    dx: float = 0.0
    dy: float = 0.0
    degrees: float = 0.0
    correlation: float = 1.0
    trusted: bool = True
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class Response:
    """How light became numbers: `curve` (3, L) log2 exposure of the L levels of red, green and blue.

    Levels are 0 … L−1 over 0 … `top` of the pixels' numbers (linear in between), strictly rising inside
    `black` … `white`; 0 at the middle level. Exposure is light · 2^EV. `noise`: (3,) variance of a number n
    in 0 … 1 is about noise[0] + s² (noise[1] + noise[2] · E) at the exposure E, s = dn / dE: rounding and
    compression, the sensor's reading, photons. `linear`: numbers are light, whatever lies between levels.
    """

    curve: F64
    top: float
    black: tuple[float, float, float]
    white: tuple[float, float, float]
    noise: tuple[float, float, float]
    measured: bool = True
    rms: float = 0.0
    """Of what the curve leaves unexplained, log2."""
    linear: bool = False
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Exposures:
    """Solved EV of one bracket's shots beside the listed ones (same origin).

    `wrong`: shots that were exposed more than 0.3 EV otherwise than listed, against most of the others.
    `notes` say it in whole sentences. `tints`: how much more red, green and blue each shot is exposed than
    its EV says, EV (a camera's white balance drifts); empty for nothing.
    """

    listed: tuple[float, ...]
    solved: tuple[float, ...]
    wrong: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()
    tints: tuple[tuple[float, float, float], ...] = ()


@dataclass(frozen=True, eq=False)
class LensLight:
    """Merged light of one side in its reference frame: (H, W, 3) linear, one scale for both sides.

    `clipped`: brighter than any exposure resolves (at least the value given); `dark`: darker than any;
    `moved`: an exposure was left out because something moved; `noise` (H, W): relative standard deviation
    of luminance, 1 where nothing resolves it.
    """

    light: F32
    clipped: Mask
    dark: Mask
    moved: Mask
    noise: F32
    motions: tuple[Motion, ...]
    exposures: Exposures
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class FoundCircle:
    """A lens' image, and how sure that is (0 … 1: under 0.5 it should be looked at)."""

    circle: Circle
    confidence: float
    by_hand: bool = False


@dataclass(frozen=True, eq=False)
class View:
    """One lens ready to be looked through: light, what is usable, where directions lie.

    `clipped` and `dark`: as in `LensLight`; None: nothing is.
    """

    light: F32
    usable: Mask
    circle: Circle
    lens: Lens
    clipped: Mask | None = None
    dark: Mask | None = None


@dataclass(frozen=True, eq=False)
class Registration:
    """`rotation` (3, 3): front lens' frame from the back lens' frame. `gain`: front = gain · back (3,).

    `falloff` (3,): light at s = θ / θ_max is 1 + a s² + b s⁴ + c s⁶ of the axis'. `rim`: share of light that
    the lens' frame cuts off beside that, at which s half of it, and how gradually (`light_at` has both).
    `spread`: median angle between what both show after registration, degrees; `matches` were used; `doubt`:
    standard deviation of the rotation about its least certain axis, degrees. `front`, `back`: the circles,
    their centres moved so that both lenses fit together; None: as they were.
    """

    rotation: F64
    lens: Lens
    gain: F64
    falloff: tuple[float, float, float]
    spread: float
    matches: int
    trusted: bool
    notes: tuple[str, ...] = ()
    front: Circle | None = None
    back: Circle | None = None
    doubt: float = 0.0
    rim: tuple[float, float, float] = (0.0, 1.0, 0.02)

    def light_at(self, s: npt.ArrayLike) -> F64:
        """Light at s = θ / θ_max, relative to the axis'; as at 1.1 further out, never below 0.02."""
        return light_at(self.falloff, self.rim, s)

    @property
    def loss(self) -> float:
        """Share of the axis' light that is lost at the edge."""
        return 1.0 - float(self.light_at(1.0))


def light_at(falloff: tuple[float, float, float], rim: tuple[float, float, float], s: npt.ArrayLike) -> F64:
    """What `Registration.light_at` says."""
    s = np.minimum(np.asarray(s, np.float64), 1.1)
    square, (a, b, c), (share, at, width) = s * s, falloff, rim
    light = 1 + square * (a + square * (b + square * c))
    if share > 0:
        light = light * (1 - share / (1 + np.exp(np.clip((at - s) / width, -60, 60))))
    return np.asarray(np.maximum(light, 0.02), np.float64)


@dataclass(frozen=True, eq=False)
class Reflections:
    """Rectangles that are replaced; `lights`: by side, the light after that."""

    patches: tuple[Patch, ...]
    lights: Mapping[str, F32]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Stitched:
    """Equirectangular (H, 2H, 3); `from_front` (H, 2H): the front lens' share, 0 … 1.

    `clipped`: brighter than any exposure resolves; `dark`: darker than any; `unseen`: no lens looked there,
    the light is that of its surroundings. `upright` (3, 3): finished picture's frame from the front lens'
    frame; `levelled`: degrees by which the horizon was found to be off, None where it was not found.
    """

    light: F32
    clipped: Mask
    unseen: Mask
    from_front: F32
    upright: F64
    dark: Mask | None = None
    levelled: float | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Calibration:
    """`white`: RGB factors; `luminance_scale`: cd/m² for one unit of luminance, with its relative
    uncertainty (standard deviation); `sun`: factor by which clipped light was raised, with uncertainty."""

    white: tuple[float, float, float] = (1.0, 1.0, 1.0)
    luminance_scale: float | None = None
    scale_uncertainty: float = 0.0
    sun: float = 1.0
    sun_uncertainty: float = 0.0
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Captured:
    """The end: environment, cube map (6 faces, `studio_core.imaging.cubemap`'s order), and the report.

    `unresolved` (H, 2H): 0 resolved, 1 clipped in every exposure, 2 too dark in every one, 3 never seen.
    """

    environment: Image
    faces: F32
    unresolved: npt.NDArray[np.uint8]
    calibration: Calibration
    report: Mapping[str, Any] = field(default_factory=frozen_map)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class CaptureState:
    """How far a capture has come: what each step made, None or empty where it has not been reached."""

    brackets: Brackets | None = None
    response: Response | None = None
    lights: Mapping[str, LensLight] = field(default_factory=frozen_map)
    circles: Mapping[str, FoundCircle] = field(default_factory=frozen_map)
    registration: Registration | None = None
    reflections: Reflections | None = None
    stitched: Stitched | None = None
    captured: Captured | None = None
    notes: tuple[str, ...] = ()
