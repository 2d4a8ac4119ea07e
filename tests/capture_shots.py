"""A made-up room photographed by a small phone, once for all tests."""

from __future__ import annotations

from functools import cache

import capture_rooms
import numpy as np
import numpy.typing as npt

from studio.bench.phone import Phone, Shots, shoot
from studio_core.imaging.projection import Circle

LITTLE = Phone(size=(400, 300), circle=Circle(199.0, 152.0, 132.0), evs=(-6.0, -4.0, -2.0, 0.0, 2.0))


@cache
def room() -> npt.NDArray[np.float32]:
    """(256, 512, 3) light."""
    made = capture_rooms.room()
    made.flags.writeable = False
    return made


@cache
def shots(phone: Phone = LITTLE, seed: int = 1) -> Shots:
    """The room photographed."""
    return shoot(room(), phone, seed)
