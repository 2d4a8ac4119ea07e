"""Brackets of several lamps become light, as a capture's do: one response curve, true exposures, one merge.

The camera stays as it is from lamp to lamp, so that the curve and the true exposures are solved on a few of
the brackets (`studio_core.imaging.response`), and every lamp's pictures are merged by them
(`studio_core.imaging.merging`). Exposures are told by names or lists, else by Exif, else guessed from the
brightness. Light is 1 where the camera clips at one second (exposures told in seconds), else at the middle
exposure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from studio_core.capturing.artifacts import Bracket, Exposures, Motion, Response
from studio_core.errors import InputError
from studio_core.imaging.listed_exposures import Exposed, Listed, listed_exposures
from studio_core.imaging.merging import merge
from studio_core.imaging.photograph import Photograph, in_rec709
from studio_core.imaging.response import LINEAR, MEASURED, SRGB, solve_response
from studio_core.imaging.transfer import srgb_to_linear
from studio_core.shading.job import Job
from studio_plugins.residual.folder import Group
from studio_plugins.residual.names import Told
from studio_plugins.residual.samples import F32, Flags

AUTOMATIC = "automatic"
RESPONSES = (AUTOMATIC, MEASURED, SRGB, LINEAR)
"""How numbers become light: measured on brackets and sRGB without, or as said."""
_CLIPPED = 0.99
_STEP = 2.0  # EV between exposures of which nothing is told
_SOLVED_ON = 400_000_000  # bytes of photographs
_MOST_SOLVED = 4  # lamps
_SAME = 0.05  # EV
_UNEQUAL = 0.05  # EV

Read = Callable[[Group], list[Photograph]]
"""A lamp's pictures that can be read, with the exposures that names or lists tell (`with_told`)."""


@dataclass(frozen=True, eq=False)
class Light:
    """Linear light (H, W, 3), and where every exposure clips (H, W)."""

    pixels: F32
    clipped: Flags


class Developer:
    """Turns the pictures of lamps into light that is comparable from lamp to lamp.

    `notes` grow with what is found out.
    """

    def __init__(self, groups: Sequence[Group], read: Read, response: str = AUTOMATIC) -> None:
        if response not in RESPONSES:
            raise InputError(f"there is no response {response!r}; known: {', '.join(RESPONSES)}")
        self.notes: list[str] = []
        self._read = read
        self._kind = response
        self._response: Response | None = None
        self._shifts: list[tuple[float, float]] = []  # listed EV, what was solved beyond it
        self._origin: float | None = None
        if any(len(group.paths) > 1 for group in groups):
            self._solve([group for group in groups if len(group.paths) > 1])

    def light(self, group: Group, job: Job | None = None) -> Light | None:
        """Of one lamp, None if none of its pictures can be read. InputError naming a picture that does not
        belong to the others."""
        shots = self._read(group)
        if not shots:
            return None
        if self._response is None:
            return self._alone(shots[0])
        bracket = self._bracket(shots, group)
        solved = tuple(self._true(ev) for ev in bracket.listed)
        motions = [Motion() for _ in shots]
        made = merge(bracket, motions, self._response, Exposures(bracket.listed, solved), job, ghosts=False)
        return Light(made.light * np.float32(_full(self._response)), made.clipped)

    def _alone(self, shot: Photograph) -> Light:
        """A lamp's only picture: as it is, unless exposures differ from lamp to lamp."""
        light, full = linear(shot, self._kind)
        ev = shot.facts.ev
        if ev is not None:
            if self._origin is None:
                self._origin = ev
            if abs(ev - self._origin) > _UNEQUAL:
                light = light * np.float32(2.0 ** (self._origin - ev))
                self._say("Lamps were photographed with different exposures; these are made up for.")
        return Light(light, full)

    def _solve(self, groups: Sequence[Group]) -> None:
        """One curve, and how far exposures are from what is listed, on a few brackets."""
        chosen: dict[str, Bracket] = {}
        size = 0
        few = np.unique(np.linspace(0, len(groups) - 1, _MOST_SOLVED).round().astype(int))
        for group in (groups[i] for i in few):
            shots = self._read(group)
            if not shots:
                continue
            bracket = self._bracket(shots, group, self._say)
            size += sum(shot.pixels.nbytes for shot in bracket.shots)
            if chosen and size > _SOLVED_ON:
                break
            chosen[group.name] = bracket
        if not chosen:
            return
        kind = MEASURED if self._kind == AUTOMATIC else self._kind
        self._response, found = solve_response(chosen, response=kind)
        for note in self._response.notes:
            self._say(note)
        for name, exposures in found.items():
            for note in exposures.notes:
                self._say(note)
            self._shifts += [
                (listed, solved - listed)
                for listed, solved in zip(chosen[name].listed, exposures.solved, strict=True)
            ]

    def _true(self, listed: float) -> float:
        """What an exposure that is listed so was in fact: as where it was solved, else as its neighbours."""
        same = [shift for ev, shift in self._shifts if abs(ev - listed) < _SAME]
        if same:
            return listed + float(np.median(same))
        at = sorted(self._shifts)
        return listed + float(np.interp(listed, [ev for ev, _ in at], [shift for _, shift in at]))

    def _bracket(
        self, shots: Sequence[Photograph], group: Group, say: Callable[[str], None] | None = None
    ) -> Bracket:
        for shot in shots:
            if shot.pixels.shape != shots[0].pixels.shape:
                raise InputError(
                    f"{shot.facts.name} cannot be merged: it has another size than {shots[0].facts.name}"
                )
        bright = [_brightness(shot) for shot in shots]
        exposed = [Exposed(shot.facts, b) for shot, b in zip(shots, bright, strict=True)]
        listed = listed_exposures({"lamp": exposed}, _STEP)["lamp"]
        evs = self._with_origin(listed, shots, group.told)
        if say is not None:
            for note in listed.notes:
                say(note)
        order = sorted(range(len(shots)), key=lambda i: (evs[i], bright[i], i))
        return Bracket(
            tuple(shots[i] for i in order),
            tuple(evs[i] for i in order),
            tuple(listed.certain[i] for i in order),
        )

    def _with_origin(self, listed: Listed, shots: Sequence[Photograph], told: Sequence[Told]) -> list[float]:
        """Exposures with one origin for all lamps: one second, or the middle of the first lamp's."""
        known = [shot.facts.ev for shot in shots]
        evs = [ev for ev in known if ev is not None]
        if len(evs) < len(known) or not all(listed.certain):
            return list(listed.evs)
        middle = float(np.median(evs))
        if self._origin is None:
            self._origin = 0.0 if all(one.seconds is not None for one in told) else middle
        return [ev + middle - self._origin for ev in listed.evs]

    def _say(self, note: str) -> None:
        if note not in self.notes:
            self.notes.append(note)


def with_told(shot: Photograph, told: Told) -> Photograph:
    """What a name or a list says of the exposure goes before Exif."""
    seconds = told.seconds if told.seconds is not None else None if told.ev is None else 2.0**told.ev
    if seconds is None:
        return shot
    return replace(shot, facts=replace(shot.facts, seconds=seconds, iso=1.0, aperture=1.0))


def _brightness(shot: Photograph) -> float:
    """log2 of the mean light, as far as numbers tell without a curve."""
    step = max(int(np.sqrt(shot.pixels.shape[0] * shot.pixels.shape[1] / 40_000)), 1)
    some = shot.pixels[::step, ::step]
    if some.dtype != np.float32:
        some = srgb_to_linear(some if some.dtype == np.uint8 else some.astype(np.float32) / np.float32(65535))
    return float(np.log2(max(float(some.mean()), 1e-9)))


def _full(response: Response) -> float:
    """What brings the merge's unit, the middle number, to the number at which a camera ends."""
    if response.linear:
        black = float(np.mean(response.black)) / response.top
        return 0.5 - black
    level = np.linspace(0, response.top, response.curve.shape[1])
    # beyond white a curve only goes on so that it rises
    end = [
        np.interp(white, level, curve) for white, curve in zip(response.white, response.curve, strict=True)
    ]
    return float(2.0 ** -np.mean(end))


def linear(shot: Photograph, response: str = AUTOMATIC, grow: bool = True) -> tuple[F32, Flags]:
    """Light (H, W, 3) of a photograph alone, and where it is clipped (H, W).

    `grow`: in 8 bits neighbours of what is clipped count as clipped, for compression mixes them.
    """
    pixels = shot.pixels
    if pixels.dtype == np.float32:
        # a value that many pixels share exactly at the top is where the sensor ended
        full: Flags = np.asarray((pixels >= max(float(pixels.max(initial=0.0)), 1e-9)).any(axis=-1), np.bool_)
        return in_rec709(pixels, shot.colour), full & (np.count_nonzero(full) > 8)
    top = float(np.iinfo(pixels.dtype).max)
    full = np.asarray((pixels >= _CLIPPED * top).any(axis=-1), np.bool_)
    if grow and pixels.dtype == np.uint8 and full.any():
        import cv2

        full = cv2.dilate(full.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    scaled = pixels.astype(np.float32) / np.float32(top)
    if response == LINEAR:
        return in_rec709(scaled, shot.colour), full
    encoded = pixels if pixels.dtype == np.uint8 else scaled
    return in_rec709(srgb_to_linear(encoded), shot.colour), full
