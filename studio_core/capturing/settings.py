"""Everything that a designer can decide about a capture: frozen values, one class a step of the wizard.

What is None or empty is found by the program. Equal settings of a step give equal results of its stages, so
a change recomputes only what follows. Angles are degrees.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from studio_core.imaging.projection import EQUIDISTANT, MODELS, Circle
from studio_core.params import param

AUTOMATIC = "automatic"
FRONT, BACK = "front", "back"
SIDES = (FRONT, BACK)
TWO_PICTURES, DUAL, SINGLE, EQUIRECTANGULAR = (
    "two lenses, a picture each",
    "two circles in one picture",
    "one lens",
    "equirectangular",
)
LAYOUTS = (AUTOMATIC, TWO_PICTURES, DUAL, SINGLE, EQUIRECTANGULAR)
MULTIBAND, GRADIENT, FEATHER = "multi-band", "gradient", "feather"
NOT_CALIBRATED, LUX, LUMINANCE = "not calibrated", "lux meter", "known luminance"
AS_SHOT, KELVIN, GREY_CARD = "as the camera did", "temperature", "grey card"
OTHER_LENS, RING = "the other lens", "elsewhere on the ring"


@dataclass(frozen=True)
class Shot:
    """One photograph of the bracket, by its digest. `ev`: typed exposure (log2 of light), any origin."""

    photograph: str
    side: str | None = None
    ev: float | None = None
    used: bool = True


@dataclass(frozen=True)
class BracketSettings:
    """Which photographs belong together, and how they were exposed."""

    layout: str = param(AUTOMATIC, "Layout", "What the photographs show", choices=LAYOUTS)
    shots: tuple[Shot, ...] = ()
    step: float = param(
        2.0, "Step", "Between exposures, where photographs do not say", unit="EV", low=0.1, high=6.0
    )


@dataclass(frozen=True)
class RadianceSettings:
    """How exposures become light."""

    align: bool = param(True, "Align", "Undo small movements of the hand between exposures")
    ghosts: bool = param(True, "Leave out what moved", "People, leaves, curtains: one exposure is used there")
    response: str = param(
        "measured",
        "Response curve",
        "How the camera turns light into numbers: measured from the exposures, or assumed",
        choices=("measured", "sRGB", "linear"),
    )
    exposures: str = param(
        "measured",
        "Exposures",
        "Listed ones are what the photographs say, which is often wrong",
        choices=("measured", "listed"),
    )


@dataclass(frozen=True)
class LensSettings:
    """The lens, the same on both sides. Circles are those of the pictures in full size."""

    model: str = param(EQUIDISTANT, "Lens", "How the lens maps angles to distances", choices=MODELS)
    fov: float = param(190.0, "Field of view", "Across the circle", unit="°", low=100.0, high=280.0)
    fit_fov: bool = param(True, "Fit it", "Find the field of view from what both lenses see")
    coefficients: tuple[float, ...] = ()
    affine: tuple[float, float, float] = (1.0, 0.0, 0.0)
    front: Circle | None = None
    back: Circle | None = None
    falloff: float | None = None
    """Light lost at the edge of the circle, 0 … 1; None: found from the overlap."""


@dataclass(frozen=True)
class RegistrationSettings:
    """How the back lens stands to the front lens; half a turn about the vertical when all is 0."""

    automatic: bool = param(True, "Automatic", "From what both lenses see")
    yaw: float = param(0.0, "Turn", unit="°", low=-180.0, high=180.0)
    pitch: float = param(0.0, "Nod", unit="°", low=-180.0, high=180.0)
    roll: float = param(0.0, "Roll", unit="°", low=-180.0, high=180.0)
    exposure: float = param(0.0, "Back brighter by", "When it is not found", unit="EV", low=-10.0, high=10.0)


@dataclass(frozen=True)
class Patch:
    """A rectangle of the ring near the frame: azimuth about the lens' axis × angle from the axis, degrees.

    Azimuth 0 is to the right of the picture, 90 up; `azimuth` … `azimuth` + `width` may go past 360.
    `source`: what replaces it, seamlessly; for RING, `source_azimuth` is where the clean rectangle of the
    same size begins. `found`: by the program, `excess` stops too bright.
    """

    side: str
    azimuth: float
    width: float
    inner: float
    outer: float
    source: str = OTHER_LENS
    source_azimuth: float = 0.0
    found: bool = False
    excess: float = 0.0
    used: bool = True


@dataclass(frozen=True)
class ReflectionSettings:
    """Reflections of the lens' black frame. `patches` None: those that are found; else exactly these."""

    automatic: bool = param(True, "Find them", "Light thrown back by the lens' frame near the circle's edge")
    sensitivity: float = param(
        1.0, "Sensitivity", "More finds weaker ones, and more that are none", low=0.25, high=4.0, scale="log"
    )
    patches: tuple[Patch, ...] | None = None


@dataclass(frozen=True)
class StitchSettings:
    """From two lenses to one picture. Angles turn the finished picture."""

    width: int = param(4096, "Width", "Of the equirectangular picture", unit="px", low=64, high=16384)
    blend: str = param(
        MULTIBAND, "Seam", "How the two lenses are joined", choices=(MULTIBAND, GRADIENT, FEATHER)
    )
    feather: float = param(4.0, "Seam width", unit="°", low=0.1, high=30.0)
    level: bool = param(True, "Level it", "Find the horizon from upright edges")
    pitch: float = param(0.0, "Horizon, nod", unit="°", low=-180.0, high=180.0)
    roll: float = param(0.0, "Horizon, roll", unit="°", low=-180.0, high=180.0)
    north: float = param(0.0, "Turn", "About the vertical", unit="°", low=-360.0, high=360.0)
    face: int = param(0, "Cube faces", "0: a quarter of the width", unit="px", low=0, high=4096)


@dataclass(frozen=True)
class CalibrationSettings:
    """Colour and absolute scale. Places are directions of the finished picture, (u, v) in 0 … 1."""

    white: str = param(AS_SHOT, "White", "What is white", choices=(AS_SHOT, KELVIN, GREY_CARD))
    kelvin: float = param(6500.0, "Temperature", "Of the room's light", unit="K", low=1500.0, high=25000.0)
    card: tuple[float, float] = (0.5, 0.5)
    card_size: float = param(
        2.0, "Card", "How wide the place is that is averaged", unit="°", low=0.1, high=30.0
    )
    scale: str = param(NOT_CALIBRATED, "Scale", choices=(NOT_CALIBRATED, LUX, LUMINANCE))
    lux: float = param(500.0, "Illuminance", "What the meter said", unit="lx", low=0.0, high=2e5, scale="log")
    facing: tuple[float, float, float] = (0.0, 1.0, 0.0)
    """Where the meter faced, in the finished picture's frame."""
    luminance: float = param(100.0, "Luminance", "Of the place", unit="cd/m²", low=0.0, high=1e9, scale="log")
    place: tuple[float, float] = (0.5, 0.5)
    sun: bool = param(
        False, "Recover clipped lamps", "From an illuminance that was measured and what the picture lacks"
    )
    sun_lux: float = param(
        10000.0, "Measured with it", "What the meter said, lamp or sun included", unit="lx", low=0.0, high=2e5
    )
    sun_facing: tuple[float, float, float] | None = None
    """Where the meter faced then. None: as before, and the first reading was of the room without the lamp."""


@dataclass(frozen=True)
class CaptureSettings:
    """All steps, in their order."""

    bracket: BracketSettings = field(default_factory=BracketSettings)
    radiance: RadianceSettings = field(default_factory=RadianceSettings)
    lens: LensSettings = field(default_factory=LensSettings)
    registration: RegistrationSettings = field(default_factory=RegistrationSettings)
    reflections: ReflectionSettings = field(default_factory=ReflectionSettings)
    stitch: StitchSettings = field(default_factory=StitchSettings)
    calibration: CalibrationSettings = field(default_factory=CalibrationSettings)
