"""How the back lens stands to the front lens: rotation, field of view, gain and falloff from the overlap."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from studio_core.capturing.artifacts import F64, Registration, View
from studio_core.capturing.settings import BACK, FRONT, LensSettings, Patch, RegistrationSettings
from studio_core.capturing.standing import rotation_from
from studio_core.imaging.projection import OCAM, ORTHOGRAPHIC, Circle, Lens
from studio_core.shading.job import Job
from studio_plugins.capture.falloff import NO_RIM, Balance, balanced, from_loss, ring_gain
from studio_plugins.capture.guesses import by_features, by_rolling, by_sliding
from studio_plugins.capture.overlap import Stand, Strip, rotation_of, stand_of, unroll
from studio_plugins.capture.refine import BLURS, refined
from studio_plugins.capture.ring import covers
from studio_plugins.capture.solve import Fit, solved

_FINEST = 5.0  # pixels a degree of the strips
_LEAST_OVERLAP = 2.0  # degrees
_NARROW = 187.0  # of what must fit together all around
_NARROWEST = 170.0  # of a guess that may be mended
_FURTHER = math.radians(26)  # how far inside the other's edge a lens' strip begins
_FOVS = np.arange(0.90, 1.151, 0.01)
_UNLIKE = 1.0  # log2
_STEPS = 6
_FEWEST, _SHARE_OF_PIECES, _DEGREES_OF_PIECES = 6, 0.45, 60  # that must slide together


def register(
    front: View,
    back: View,
    settings: RegistrationSettings,
    lens: LensSettings,
    job: Job,
) -> Registration:
    """The stand of the back lens to the front lens from what both see.

    Nothing is assumed of the roll of either shot. `lens.fit_fov`: the field of view is sought too (never for
    calibrated OCamCalib lenses). Where the overlap shows too little, `trusted` is False, a note says why, and
    the result is what the settings say; how much brighter one lens' picture is follows from the whole ring
    that both see then, unless the settings tell it. A registration by hand (`settings.automatic` off) is
    trusted.
    """
    by_hand = stand_of(rotation_from(settings.yaw, settings.pitch, settings.roll), front.lens)
    fit_fov = lens.fit_fov and front.lens.model != OCAM
    widest = front.lens.fov * (float(_FOVS[-1]) if fit_fov and front.lens.model != ORTHOGRAPHIC else 1.0)
    if front.lens.model != back.lens.model or widest < 180 + _LEAST_OVERLAP or front.lens.fov < _NARROWEST:
        why = f"A field of view of {front.lens.fov:.0f}° leaves no overlap to register both lenses by."
        return _as_set(by_hand, front, settings, lens, None, why)
    job.checkpoint(0, _STEPS)
    strips = _strips(front, back)
    job.checkpoint(1, _STEPS)
    if not settings.automatic:
        return _as_set(by_hand, front, settings, lens, balanced(*strips, by_hand, lens.falloff), "")
    fit = _fitted(*strips, by_hand, fit_fov, job)
    why = _doubtful(fit)
    if fit is None or why:
        refused = _as_set(by_hand, front, settings, lens, None, why)
        gain = None if settings.exposure else ring_gain(*strips)
        return refused if gain is None else replace(refused, gain=gain)
    found = balanced(*strips, fit.stand, lens.falloff)
    job.checkpoint(_STEPS, _STEPS)
    return _registration(fit, found, front, back, settings, lens)


def _strips(front: View, back: View) -> tuple[Strip, Strip]:
    half = front.lens.half
    inner = max(math.radians(40), math.pi - half - _FURTHER)
    finest = min(v.circle.radius / math.degrees(v.lens.half) for v in (front, back))
    per_degree = min(_FINEST, max(1.5, finest))
    return unroll(front, False, inner, per_degree), unroll(back, True, inner, per_degree)


def _fitted(front: Strip, back: Strip, by_hand: Stand, fit_fov: bool, job: Job) -> Fit | None:
    """The best fit from features; from the settings and every roll where these don't convince."""
    fov = by_hand.fov
    fovs = np.array([f for f in fov * _FOVS if _possible(front.lens, f)]) if fit_fov else np.array([fov])
    guess = by_features(front, back, fovs)
    job.checkpoint(2, _STEPS)
    best = refined(front, back, guess.stand, fit_fov, BLURS[1:]) if guess is not None else None
    job.checkpoint(3, _STEPS)
    if best is not None and _sure(best):
        return best
    for stand in (by_hand, *by_rolling(front, back, fov)):
        slid = by_sliding(front, back, stand)
        job.checkpoint(3, _STEPS)
        if len(slid.here) < _FEWEST:
            continue
        start = solved(front, back, slid, stand, fit_fov)
        if start.share < _SHARE_OF_PIECES or start.support < _DEGREES_OF_PIECES:
            continue
        for blurs in (BLURS[1:], BLURS):
            fit = refined(front, back, start.stand, fit_fov, blurs)
            job.checkpoint(4, _STEPS)
            if best is None or _worth(fit) > _worth(best):
                best = fit
            if _sure(best):
                return best
    return best


def _sure(fit: Fit) -> bool:
    """Whether nothing better need be looked for."""
    return fit.share > 0.6 and not _doubtful(fit)


def _possible(lens: Lens, fov: float) -> bool:
    if fov < 180 + _LEAST_OVERLAP:
        return False
    try:
        return lens.with_fov(fov).fov == fov
    except ValueError:
        return False


def _worth(fit: Fit) -> float:
    return fit.share * fit.support if len(fit.left) else 0.0


def _doubtful(fit: Fit | None) -> str:
    """Why a fit is not to be believed; "" when it is."""
    if fit is None or len(fit.left) < 8:
        return "Both lenses' edges show too little in common to register them by."
    if fit.share < 0.3 or fit.support < 45:
        return "What both lenses see at their edges does not fit together well enough to register them by."
    if fit.doubt > 1.0 or fit.spread > 0.45:
        return "What both lenses see leaves their rotation uncertain."
    if fit.stand.fov < _NARROW and fit.share < 0.7:
        return f"A field of view of about {fit.stand.fov:.0f}° leaves too little overlap to register by."
    return ""


def _registration(
    fit: Fit,
    found: Balance | None,
    front: View,
    back: View,
    settings: RegistrationSettings,
    lens: LensSettings,
) -> Registration:
    notes = []
    stand = fit.stand
    off = stand.fov / front.lens.fov - 1
    if abs(off) > 0.03:
        notes.append(f"The field of view is {stand.fov:.1f}°, not {front.lens.fov:.0f}°.")
    gain, falloff, rim = _balance(found, settings, lens, notes)
    return Registration(
        rotation=rotation_of(stand),
        lens=front.lens if stand.fov == front.lens.fov else front.lens.with_fov(stand.fov),
        gain=gain,
        falloff=falloff,
        spread=fit.spread,
        matches=len(fit.left),
        trusted=True,
        notes=tuple(notes),
        front=_moved(front.circle, stand.front),
        back=_moved(back.circle, stand.back),
        doubt=fit.doubt,
        rim=rim,
    )


def _moved(circle: Circle, shift: F64) -> Circle:
    return Circle(
        circle.x + float(shift[0]) * circle.radius, circle.y + float(shift[1]) * circle.radius, circle.radius
    )


def _balance(
    found: Balance | None, settings: RegistrationSettings, lens: LensSettings, notes: list[str]
) -> tuple[F64, tuple[float, float, float], tuple[float, float, float]]:
    if found is None or found.off > _UNLIKE:
        if found is not None:
            notes.append("Both lenses differ too much in brightness where they overlap to balance them.")
        return np.full(3, 2.0**-settings.exposure), from_loss(lens.falloff or 0.0), NO_RIM
    if found.loss > 0 and found.doubt > max(0.1, 0.7 * found.loss):
        notes.append(f"The light lost at the lens' edge is uncertain: {found.loss:.0%} ± {found.doubt:.0%}.")
    return found.gain, found.falloff, found.rim


def _as_set(
    stand: Stand,
    front: View,
    settings: RegistrationSettings,
    lens: LensSettings,
    found: Balance | None,
    why: str,
) -> Registration:
    """What the settings say, with what could be found beside."""
    notes = [why] if why else []
    gain, falloff, rim = _balance(found, settings, lens, notes)
    trusted = not settings.automatic
    return Registration(rotation_of(stand), front.lens, gain, falloff, 0.0, 0, trusted, tuple(notes), rim=rim)


def rebalanced(
    found: Registration, views: Mapping[str, View], patches: Sequence[Patch], lens: LensSettings
) -> Registration:
    """The registration with gain and falloff of what no reflection of the frame covers.

    views: with the registration's lens and circles. Where too little is left of what both lenses see, and
    without a registration to trust, it stays as it is.
    """
    used = [patch for patch in patches if patch.used]
    if not used or not found.trusted or len(views) < 2:
        return found
    strips = _strips(views[FRONT], views[BACK])
    free = [
        _without(strip, [patch for patch in used if patch.side == side])
        for strip, side in zip(strips, (FRONT, BACK), strict=True)
    ]
    made = balanced(free[0], free[1], stand_of(found.rotation, found.lens), lens.falloff)
    if made is None or made.off > _UNLIKE:
        return found
    return replace(found, gain=made.gain, falloff=made.falloff, rim=made.rim)


def _without(strip: Strip, patches: Sequence[Patch]) -> Strip:
    """A strip in which rectangles tell nothing of how bright it is."""
    azimuth, theta = np.moveaxis(strip.grid(), -1, 0)
    if strip.turned:
        azimuth, theta = math.pi - azimuth, math.pi - theta
    free = strip.resolved.copy()
    for patch in patches:
        free &= ~covers(patch, azimuth, theta)
    return replace(strip, resolved=free)


def alone(view: View, lens: LensSettings) -> Registration:
    """What a single lens counts for: nothing is found, its falloff is what the settings say."""
    return Registration(
        rotation_from(0, 0, 0), view.lens, np.ones(3), from_loss(lens.falloff or 0.0), 0.0, 0, False
    )
