"""A simulated phone with a clip-on fisheye in a room given by an HDR map: brackets whose truth is known.

`shoot` gives photographs as files would hold them and everything that made them; `lens_light` only the light
that falls on the sensor, which is quicker. `studio.bench.phone_random` draws phones at random.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from studio.bench.phone_optics import Mover, Pose, Rays, Room
from studio.bench.phone_response import Curve
from studio_core.capturing.artifacts import Motion, View
from studio_core.capturing.settings import BACK, FRONT, SIDES
from studio_core.capturing.standing import HALF_TURN, euler
from studio_core.imaging.photograph import Photograph, ShotFacts
from studio_core.imaging.projection import Circle, Lens

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
SLOWEST = 1 / 60  # seconds, of the frame with EV 0


@dataclass(frozen=True)
class Arc:
    """A reflection of the frame: middle `azimuth` (0 right, 90 up), `width`, `depth` from the edge, degrees.

    `stops`: how much brighter it makes the picture, in the median over its core.
    """

    side: str
    azimuth: float
    width: float = 40.0
    depth: float = 6.0
    stops: float = 1.0


@dataclass(frozen=True)
class Phone:
    """All that can go wrong. Angles are degrees, lengths pixels where nothing else is said.

    evs: true exposures; key: EV 0 puts the front view's median light there (0 … 1 of the sensor);
    listed_errors: EV added to what files say, by side; back_ev: the back bracket is exposed by so much more;
    edge: width of the circle's soft border, of its radius; falloff: light lost at the edge, 0 … 1, and how;
    glare: share of all light that is spread over the picture; outside: light on the rim, of the mean;
    ring: of a shiny ring around the circle, of the mean light; tilt: the front shot's yaw, pitch, roll;
    misalignment: the back shot's, against half a turn; back_scale: its circle is so much larger;
    shake: of the hand between frames (standard deviation); parallax: largest between both lenses;
    mover: radius of something that moves, 0 for nothing; white_drift: of red and blue a frame (relative);
    full_well: electrons of a full pixel; read_noise: electrons; jpeg: quality, None for exact numbers.
    """

    size: tuple[int, int] = (640, 480)
    lens: Lens = field(default_factory=Lens)
    circle: Circle = Circle(318.0, 243.0, 210.0)
    evs: tuple[float, ...] = (-2.0, 0.0, 2.0)
    key: float = 0.12
    listed_errors: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    back_ev: float = 0.0
    curve: Curve = Curve()
    bits: int = 8
    full_well: float = 8000.0
    read_noise: float = 4.0
    jpeg: int | None = None
    falloff: float = 0.0
    falloff_family: str = "polynomial"
    edge: float = 0.01
    arcs: tuple[Arc, ...] = ()
    glare: float = 0.0
    outside: float = 0.0
    ring: float = 0.0
    tilt: tuple[float, float, float] = (0.0, 0.0, 0.0)
    misalignment: tuple[float, float, float] = (0.0, 0.0, 0.0)
    back_scale: float = 1.0
    back_shift: tuple[float, float] = (0.0, 0.0)
    shake: float = 0.0
    parallax: float = 0.0
    mover: float = 0.0
    white_drift: float = 0.0
    samples: int = 2

    def falloff_at(self, s: npt.NDArray[Any]) -> F64:
        """Share of the light at θ / θ_max, 1 on the axis."""
        if self.falloff_family == "cosine":
            bend = np.arccos((1 - self.falloff) ** 0.25)
            return np.asarray(np.cos(np.clip(s, 0, 1.2) * bend) ** 4, np.float64)
        return np.asarray(1 - self.falloff * (0.5 * s**2 + 0.5 * s**4), np.float64)

    def circle_of(self, side: str) -> Circle:
        """Where a side's image lies."""
        if side == FRONT:
            return self.circle
        x, y = self.back_shift
        return Circle(self.circle.x + x, self.circle.y + y, self.circle.radius * self.back_scale)


@dataclass(frozen=True, eq=False)
class SideTruth:
    """One lens' truth. `light`: with reflections, glare and falloff; `clean`: the same without reflections.

    `stops`: log2 of both, (H, W). `evs`: of the shots (any origin common to both sides), `listed` what their
    files say. `shakes`: (3, 3) each: a direction d of the reference's lens frame is at shakes[i] @ d in
    shot i; `motions`: the same as axes times degrees. `moved`: where the mover was in any shot.
    """

    circle: Circle
    light: F32
    clean: F32
    stops: F32
    moved: npt.NDArray[np.bool_]
    evs: tuple[float, ...] = ()
    listed: tuple[float, ...] = ()
    shakes: tuple[F64, ...] = ()
    motions: tuple[Motion, ...] = ()


@dataclass(frozen=True, eq=False)
class Truth:
    """`rotation` (3, 3): front lens' frame from the back lens'; `room_from_front`: the map's frame from it.

    `seen`: the rotation that brings what both lenses see together best, which parallax makes another one.
    `reference`: index of the shot that does not shake (the middle one). `clipped`: share of the map's energy
    that is beyond what the darkest shot of both sides resolves. `scale`: exposure of light 1 at EV 0.
    """

    phone: Phone
    rotation: F64
    room_from_front: F64
    front: SideTruth
    back: SideTruth
    seen: F64
    reference: int = 0
    clipped: float = 0.0
    scale: float = 1.0

    def side(self, side: str) -> SideTruth:
        """By its name."""
        return self.front if side == FRONT else self.back

    def view(self, side: str, clean: bool = False) -> View:
        """The lens' exact light as registration and stitching get it."""
        one = self.side(side)
        light = one.clean if clean else one.light
        height, width = light.shape[:2]
        y, x = np.mgrid[0:height, 0:width] + 0.5
        reach = np.hypot(x - one.circle.x, y - one.circle.y) / one.circle.radius
        return View(light, reach < 1 - self.phone.edge, one.circle, self.phone.lens)


@dataclass(frozen=True, eq=False)
class Shots:
    """Photographs of both sides, in the order they were taken, and their truth."""

    front: tuple[Photograph, ...]
    back: tuple[Photograph, ...]
    truth: Truth


def lens_light(environment: F32, phone: Phone, seed: int = 0) -> Truth:
    """The light on the sensor of both lenses, with all that is optical; no shake, no mover, no noise.

    environment (H, 2H, 3): the room, equirectangular, finite and ≥ 0.
    """
    room, poses = _placed(environment, phone, seed)
    sides = {}
    for side in SIDES:
        rays = Rays(phone, side, phone.circle_of(side))
        light, thrown, moved = rays.light(room, poses[side], rays.gains(room, poses[side]))
        clean, with_arcs = _with_glare(phone, rays, light), _with_glare(phone, rays, light + thrown)
        stops = np.log2((with_arcs.sum(2) + 1e-12) / (clean.sum(2) + 1e-12)).astype(np.float32)
        sides[side] = SideTruth(rays.circle, with_arcs, clean, stops, moved > 0)
    front = poses[FRONT].rotation
    rotation = front.T @ poses[BACK].rotation
    return Truth(
        phone, rotation, front, sides[FRONT], sides[BACK], seen_rotation(room, poses, phone.lens.half)
    )


def shoot(environment: F32, phone: Phone, seed: int = 0) -> Shots:
    """Photograph a room: the same seed gives the same pixels."""
    rng = np.random.default_rng(seed)
    truth = lens_light(environment, phone, seed)
    room, poses = _placed(environment, phone, seed)
    reference = len(phone.evs) // 2
    scale = exposure_scale(truth)
    shots: dict[str, tuple[Photograph, ...]] = {}
    sides: dict[str, SideTruth] = {}
    for place, side in enumerate(SIDES):
        one = truth.side(side)
        rays = Rays(phone, side, one.circle)
        gains = rays.gains(room, poses[side])
        shift = phone.back_ev if side == BACK else 0.0
        evs = tuple(ev + shift for ev in phone.evs)
        errors = phone.listed_errors[place] or (0.0,) * len(evs)
        listed = tuple(ev + error for ev, error in zip(evs, errors, strict=True))
        shakes, movers = _hand(phone, rng, reference), _movers(phone, side, room, rng)
        moved, made = np.zeros(one.light.shape[:2], bool), []
        for index, ev in enumerate(evs):
            light = one.light
            if movers or (index != reference and phone.shake):
                pose = Pose(poses[side].rotation @ shakes[index].T, poses[side].offset)
                mover = movers[index] if movers else None
                bare, thrown, where = rays.light(room, pose, gains, mover)
                light = _with_glare(phone, rays, bare + thrown)
                moved |= where > 0
            white = np.exp(rng.normal(0, phone.white_drift, 3) * (1, 0, 1)) if phone.white_drift else 1.0
            pixels = developed(phone, light * (scale * 2.0**ev * white), rng)
            made.append(_photograph(pixels, side, index, listed[index]))
        shots[side] = tuple(made)
        motions = tuple(_motion(shake) for shake in shakes)
        sides[side] = replace(one, moved=moved, evs=evs, listed=listed, shakes=shakes, motions=motions)
    darkest = min(phone.evs) + min(phone.back_ev, 0.0)
    clipped = clipped_share(environment, scale * 2.0**darkest)
    truth = replace(
        truth, front=sides[FRONT], back=sides[BACK], reference=reference, clipped=clipped, scale=scale
    )
    return Shots(shots[FRONT], shots[BACK], truth)


def developed(phone: Phone, exposure: npt.NDArray[Any], rng: np.random.Generator) -> npt.NDArray[Any]:
    """(H, W, 3) numbers of an exposure, 1 being a full pixel: noise, response, quantisation, JPEG."""
    variance = np.maximum(exposure, 0) / phone.full_well + (phone.read_noise / phone.full_well) ** 2
    noisy = exposure + rng.standard_normal(exposure.shape, np.float32) * np.sqrt(variance)
    encoded = np.stack([phone.curve.encode(noisy[:, :, c], c) for c in range(3)], axis=-1)
    top = (1 << phone.bits) - 1
    pixels = np.rint(encoded * top).astype(np.uint8 if phone.bits == 8 else np.uint16)
    if phone.jpeg is None or phone.bits != 8:
        return pixels
    import cv2

    quality = [cv2.IMWRITE_JPEG_QUALITY, phone.jpeg]
    _, data = cv2.imencode(".jpg", np.ascontiguousarray(pixels[:, :, ::-1]), quality)
    decoded = cv2.imdecode(data, cv2.IMREAD_COLOR)
    assert decoded is not None
    return np.ascontiguousarray(decoded[:, :, ::-1])


def _placed(environment: F32, phone: Phone, seed: int) -> tuple[Room, dict[str, Pose]]:
    rng = np.random.default_rng([seed, 1])
    nearness = np.concatenate([rng.normal(0, 1.6, (3, 3)), rng.uniform(0, 6.28, (1, 3))])
    front = HALF_TURN @ euler(*phone.tilt)
    back = front @ HALF_TURN @ euler(*phone.misalignment)
    apart = np.radians(phone.parallax) / 2
    sideways = rng.normal(0, 0.25, 3)
    along = -front[:, 2] + sideways
    along *= apart / np.linalg.norm(along)
    room = Room(np.ascontiguousarray(environment, np.float32), nearness)
    return room, {FRONT: Pose(front, along), BACK: Pose(back, -along)}


def _with_glare(phone: Phone, rays: Rays, light: F32) -> F32:
    """Light spread over the circle, and what is seen of its rim."""
    if not (phone.glare or phone.outside or phone.ring):
        return light
    import cv2

    circle, (height, width) = rays.circle, rays.shape
    y, x = np.mgrid[0:height, 0:width] + 0.5
    reach = np.hypot(x - circle.x, y - circle.y) / circle.radius
    small = cv2.resize(light, (max(width // 8, 8), max(height // 8, 8)), interpolation=cv2.INTER_AREA)
    wide = cv2.GaussianBlur(small, (0, 0), circle.radius / 8 / 3)
    spread = cv2.resize(wide, (width, height), interpolation=cv2.INTER_LINEAR)
    made = light * (1 - phone.glare) + spread * (phone.glare * (reach < 1))[:, :, None].astype(np.float32)
    # beyond the edge the spread light is less than half: there is none behind it
    made += 2 * spread * (phone.outside * np.exp(-np.maximum(reach - 1, 0) * 8) * (reach >= 1))[:, :, None]
    ring = np.exp(-(((reach - 1.045) / 0.008) ** 2)) * phone.ring
    made += 2 * spread * (ring * (reach >= 1))[:, :, None]
    return np.asarray(made, np.float32)


def seen_rotation(room: Room, poses: Mapping[str, Pose], half: float) -> F64:
    """(3, 3) front lens' frame from the back lens', least squares over what both see (Kabsch 1976)."""
    rng = np.random.default_rng(0)
    way = rng.normal(size=(20_000, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    lens_ways = []
    for pose in (poses[FRONT], poses[BACK]):
        lens_way = (way - room.near(way)[:, None] * pose.offset) @ pose.rotation
        lens_ways.append(lens_way / np.linalg.norm(lens_way, axis=1, keepdims=True))
    front, back = lens_ways
    both = (front[:, 2] < -np.cos(half)) & (back[:, 2] < -np.cos(half))
    if both.sum() < 3:
        return np.asarray(poses[FRONT].rotation.T @ poses[BACK].rotation, np.float64)
    u, _, v = np.linalg.svd(front[both].T @ back[both])
    turned = np.diag([1.0, 1.0, float(np.linalg.det(u @ v))])
    return np.asarray(u @ turned @ v, np.float64)


def exposure_scale(truth: Truth) -> float:
    """Exposure of light 1 at EV 0: the front view's median then is the phone's `key`."""
    light = truth.front.light.mean(axis=2)
    return truth.phone.key / max(float(np.median(light[truth.view(FRONT).usable])), 1e-12)


def _hand(phone: Phone, rng: np.random.Generator, reference: int) -> tuple[F64, ...]:
    turns = rng.normal(0, phone.shake, (len(phone.evs), 3))
    turns[reference] = 0
    return tuple(euler(*degrees) for degrees in turns)


def _movers(phone: Phone, side: str, room: Room, rng: np.random.Generator) -> tuple[Mover, ...]:
    """It walks through the front view, three of its radii a shot."""
    if not phone.mover or side != FRONT:
        return ()
    yaw, pitch = rng.uniform(-30, 30), rng.uniform(-20, 20)
    light = np.median(room.light, axis=(0, 1)) * rng.uniform(0.3, 3.0)
    made = []
    for index in range(len(phone.evs)):
        towards = euler(yaw + 3 * phone.mover * index, pitch, 0) @ np.array([0.0, 0.0, -1.0])
        made.append(Mover(towards, phone.mover, light.astype(np.float64)))
    return tuple(made)


def _motion(shake: F64) -> Motion:
    """The turn as axis times degrees (small ones: never half a turn)."""
    axis = np.array([shake[2, 1] - shake[1, 2], shake[0, 2] - shake[2, 0], shake[1, 0] - shake[0, 1]]) / 2
    sine = float(np.linalg.norm(axis))
    if sine == 0:
        return Motion()
    x, y, z = (float(a) for a in axis / sine * np.degrees(np.arcsin(min(sine, 1.0))))
    return Motion(rotation=(x, y, z))


def clipped_share(environment: F32, exposure: float) -> float:
    """Energy of a map, as a share, that `exposure` (of light 1) does not resolve: where it is over 1."""
    from studio_core.imaging.latlong import pixel_solid_angles

    area = pixel_solid_angles(*environment.shape[:2])[:, None, None]
    lost = np.maximum(environment.astype(np.float64) - 1 / exposure, 0)
    return float((lost * area).sum() / max((environment * area).sum(), 1e-12))


def _photograph(pixels: npt.NDArray[Any], side: str, index: int, ev: float) -> Photograph:
    facts = ShotFacts(
        name=f"{side}_{index + 1}.jpg",
        seconds=SLOWEST * 2.0**ev,
        iso=100.0,
        aperture=2.0,
        bias=None,
        taken=0.5 * index + (40.0 if side == BACK else 0.0),
        camera="Simulated Phone",
    )
    return Photograph(pixels, facts, hashlib.sha256(pixels.tobytes()).hexdigest())
