"""A fitter that needs no photographs: a matte pattern whose fit is a tenth too dark under lamps held back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from studio_core.contract import API, Plugin
from studio_core.fitting import F32, Figures, FitRequest, Flags, LampError, Quality
from studio_core.scene.nodes import Material
from studio_core.shading.job import Job

AZIMUTHS = (-60.0, -20.0, 20.0, 60.0)
HEIGHTS = (0.0, 40.0)
DARKER = 0.9  # under lamps held back
PLACES = [(azimuth, height) for height in HEIGHTS for azimuth in AZIMUTHS]
plugin = Plugin("fake fitter", API, {"fitter": {"pattern": "fit_support:FITTER"}})


def towards(azimuth: float, height: float) -> np.ndarray:
    a, h = np.radians((azimuth, height))
    return np.array([np.sin(a) * np.cos(h), np.sin(h), np.cos(a) * np.cos(h)])


@dataclass(frozen=True)
class Pattern:
    """Satisfies `studio_core.fitting.Fitted`."""

    request: FitRequest
    notes: tuple[str, ...] = ("Two pictures are left out.",)
    about: str = "Captured by nobody"
    tags: tuple[str, ...] = ("captured",)

    @property
    def material(self) -> Material:
        return Material(
            id="m", name=self.request.folder.name, model="lambert", values={"base_color": (0.4, 0.3, 0.2)}
        )

    @property
    def figures(self) -> Figures:
        unseen = Quality((1 - DARKER) ** 2, 0.009, 0.3)
        return Figures(unseen, Quality(0, 0, 0.3), "matte", "its colour", 4, 3, 6, 6_144, (6, 5))

    @property
    def lamps(self) -> tuple[LampError, ...]:
        made = []
        for i, (azimuth, height) in enumerate(PLACES):
            held = i % 2 == 1
            error = (1 - DARKER) ** 2 if held else 0.0
            made.append(LampError(f"shot{i}.png", azimuth, height, held, error, error, 0.3))
        return tuple(made)

    @property
    def report(self) -> Mapping[str, Any]:
        return {"folder": self.request.folder.name, "lamps": [asdict(lamp) for lamp in self.lamps]}

    def relit(self, azimuth: float, height: float) -> F32:
        albedo = np.linspace(0.2, 0.8, 30).reshape(5, 6, 1) * np.array([1.0, 0.8, 0.6])
        return np.asarray(albedo * towards(azimuth, height)[2], np.float32)

    def photograph(self, lamp: int) -> F32:
        return self.relit(*PLACES[lamp])

    def trusted(self, lamp: int) -> Flags:
        made = np.ones((5, 6), np.bool_)
        made[0, 0] = False
        return made

    def reconstruction(self, lamp: int) -> F32:
        share = DARKER if self.lamps[lamp].held else 1.0
        return np.asarray(self.photograph(lamp) * np.float32(share), np.float32)


class Fitter:
    """Answers at once, or fails as it is told."""

    label = "Patterns"

    def __init__(self) -> None:
        self.requests: list[FitRequest] = []
        self.error: Exception | None = None

    def fit(self, request: FitRequest, job: Job) -> Pattern:
        self.requests.append(request)
        job.checkpoint(1, 2)
        if self.error is not None:
            raise self.error
        return Pattern(request)


FITTER = Fitter()
