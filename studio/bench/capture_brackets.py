"""Heaps of photographs of simulated phones parted into front and back, whatever their files tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from studio.bench.harness import Report
from studio.bench.phone import Shots, shoot
from studio.bench.phone_random import random_phone
from studio_core.imaging.photograph import Photograph, ShotFacts
from studio_core.imaging.projection import Circle
from studio_core.imaging.resample import resize_area

LADDERS = ((-2.0, 0.0, 2.0), (-4.0, -2.0, 0.0, 2.0, 4.0), (-3.0, 0.0, 3.0), (-1.0, 0.0, 1.0), (0.0,))
TOLD = ("exif", "times", "names", "nothing")
"""What files tell: all; when they were taken; names that are numbered; not even that. Seconds are whole."""


def measure(report: Report, rooms: Mapping[str, npt.NDArray[np.float32]], phones: int) -> None:
    """Rows `brackets`: share of the heaps that were parted rightly, metric `parted_TOLD`, all shots and
    sides right; of one view's heaps those that stayed one, metric `one_TOLD`. Hands shake by up to 1°.
    `layout_dual`: of both brackets as one picture with two circles, `layout_wide`: of the front's in a frame
    twice as wide as high, those that were taken for what they are."""
    right = {f"{kind}_{told}": 0 for kind in ("parted", "one") for told in TOLD}
    right |= {"layout_dual": 0, "layout_wide": 0}
    for room in rooms.values():
        small = room if room.shape[0] <= 256 else resize_area(room, 256, 512)
        for seed in range(phones):
            shots = taken(small, seed)
            for told in TOLD:
                right[f"parted_{told}"] += parted(shots, told, seed)
                right[f"one_{told}"] += stayed_one(shots, told, seed)
            right["layout_dual"] += seen_as_dual(small, seed)
            right["layout_wide"] += seen_as_single(small, seed)
    for metric, count in right.items():
        report.add("brackets", metric, count / max(len(rooms) * phones, 1), "1")


def taken(room: npt.NDArray[np.float32], seed: int, aspect: float | None = None) -> Shots:
    """Both brackets of a random phone of the set that nothing was tuned on; `aspect` of the frame, which the
    circle fills by 85 … 99 %, off its middle."""
    rng = np.random.default_rng([seed, 5])
    phone = random_phone(5000 + seed, False, radius=100.0)
    ladder = LADDERS[seed % len(LADDERS)]
    phone = replace(phone, evs=ladder, shake=float(rng.uniform(0, 1)), samples=1)
    if aspect is not None:
        reach = phone.circle.radius
        height = round(2 * reach / rng.uniform(0.85, 0.99))
        x, y = rng.uniform(-0.02, 0.02, 2) * height
        middle = Circle(aspect * height / 2 + x, height / 2 + y, reach)
        phone = replace(phone, size=(round(aspect * height), height), circle=middle)
    return shoot(room, phone, seed)


def seen_as_dual(room: npt.NDArray[np.float32], seed: int) -> bool:
    """Whether a camera's pictures with both circles, each turned by a quarter or two, are known as that."""
    from studio_core.capturing.settings import DUAL, BracketSettings
    from studio_plugins.capture.bracket import arrange

    shots = taken(room, seed, 1.0)
    made = []
    for front, back in zip(shots.front, shots.back, strict=True):
        halves = [np.rot90(front.pixels, seed % 4), np.rot90(back.pixels, (seed + 2) % 4)]
        made.append(replace(front, pixels=np.ascontiguousarray(np.concatenate(halves, axis=1))))
    return arrange(made, BracketSettings()).layout == DUAL


def seen_as_single(room: npt.NDArray[np.float32], seed: int) -> bool:
    """Whether one circle in the middle of a wide frame is known as one lens."""
    from studio_core.capturing.settings import SINGLE, BracketSettings
    from studio_plugins.capture.bracket import arrange

    return arrange(taken(room, seed, 2.0).front, BracketSettings()).layout == SINGLE


def parted(shots: Shots, told: str, seed: int) -> bool:
    """Whether the heap of both becomes these brackets, the front being the front where that is told."""
    from studio_core.capturing.settings import BACK, FRONT, BracketSettings
    from studio_plugins.capture.bracket import arrange

    made = arrange(_heap(shots.front + shots.back, told, seed), BracketSettings())
    found = {side: {s.digest for s in bracket.shots} for side, bracket in made.sides.items()}
    true = {FRONT: {s.digest for s in shots.front}, BACK: {s.digest for s in shots.back}}
    if told == "nothing":
        return sorted(map(sorted, found.values())) == sorted(map(sorted, true.values()))
    return found == true


def stayed_one(shots: Shots, told: str, seed: int) -> bool:
    """Whether the front's photographs alone are one view."""
    from studio_core.capturing.settings import FRONT, BracketSettings
    from studio_plugins.capture.bracket import arrange

    made = arrange(_heap(shots.front, told, seed), BracketSettings())
    return list(made.sides) == [FRONT] and len(made.sides[FRONT].shots) == len(shots.front)


def _heap(shots: Sequence[Photograph], told: str, seed: int) -> list[Photograph]:
    rng = np.random.default_rng([seed, 6])
    random = rng.permutation(10**6)
    made = []
    for number, shot in enumerate(shots):
        facts = replace(shot.facts, name=f"IMG_{number + 8}.jpg", taken=np.floor(shot.facts.taken or 0.0))
        if told != "exif":
            taken = facts.taken if told == "times" else None
            name = f"{random[number]}.jpg" if told == "nothing" else facts.name
            facts = ShotFacts(name, taken=taken)
        made.append(replace(shot, facts=facts))
    return [made[i] for i in rng.permutation(len(made))]
