"""What is painted in each of the paper's figures, and what is claimed of it.

A dragon is a bunny here. Where the paper paints a flat colour on what is matte, strokes keep the picture's
shading, as a designer's brush does who has it checked; highlights are dabs of one colour, as the paper's.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from studio.bench import strokes_figure_scenes as scenes
from studio.bench.strokes_figures import Act, Played, Session

F64 = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
YES = (1.0, 1.0)
ANY = math.inf


def dab(colour: list[float], path: list[list[float]], size: float, **more: Any) -> dict[str, Any]:
    """A stroke of light in a colour."""
    return {"colour": colour, "path": path, "brush": {"size": size}, **more}


def fixate(path: list[list[float]], size: float) -> dict[str, Any]:
    """A stroke on what is to stay."""
    return {"tool": "fixate", "path": path, "brush": {"size": size}}


def shadow(played: Played) -> dict[str, float]:
    """How much more reflectance the same light takes in the shadow."""
    here, there = (played.value(act, "diffuse").mean() / played.wish(act).mean() for act in (0, 1))
    return {
        "right_shadow": played.named(0, "room", "colour"),
        "right_light": played.named(1, "room", "colour"),
        "error_shadow": played.off(0),
        "error_light": played.off(1),
        "discount": float(here / there),
    }


def bounces(played: Played) -> dict[str, float]:
    """What is off after so many rounds."""
    rounds = [act.rounds for act in BOUNCES]
    return {f"error_{n}": played.off(act) for act, n in enumerate(rounds)}


def shine(played: Played) -> dict[str, float]:
    """What of four things changes."""
    tint = played.value(1, "specular")
    return {
        "right_dull": played.named(0, "bunny", "shine"),
        "right_yellow": played.named(1, "red ball", "shine"),
        "right_brighter": played.named(2, "brown ball", "shine"),
        "right_smaller": played.named(3, "brown ball", "gloss"),
        "shine_dull": float(played.value(0, "specular").mean()),
        "tint_yellow": float(tint[2] / tint[0]),
        "shine_brighter": float(played.value(2, "specular").mean()),
        "roughness_smaller": float(played.value(3, "roughness")[0]),
    }


def green(played: Played) -> dict[str, float]:
    """The wall's colour, and what comes of it on the floor."""
    red, middle, blue = played.value(0, "base_color")
    return {
        "right": played.named(0, "left", "colour"),
        "greenness": float(middle / max(red, blue)),
        "followed": played.followed(0),
        "floor_kept": played.bare("floor"),
    }


def orange(played: Played) -> dict[str, float]:
    """The wall's colour, and what shows of it in the floor."""
    red, _, blue = played.value(0, "base_color")
    return {
        "right": played.named(0, "right", "colour"),
        "orangeness": float(red / max(blue, 0.01)),
        "followed": played.followed(0),
        "floor_kept": played.bare("floor"),
    }


def caustic(played: Played) -> dict[str, float]:
    """What the ring becomes; how far the walls' light moves."""
    red, _, blue = played.value(2, "specular")
    return {
        "right": played.named(1, "ring", "shine"),
        "followed": played.followed(1),
        "fixed": played.fixed(1),
        "right_gold": played.named(2, "ring", "shine"),
        "tint_gold": float(blue / red),
        "followed_gold": played.followed(2),
        "table_kept": played.bare("table"),
    }


def highlight(played: Played) -> dict[str, float]:
    """What the pot becomes."""
    return {
        "right": played.named(0, "pot", "shine"),
        "shine": float(played.value(0, "specular").mean()),
        "followed": played.followed(0),
    }


def detail(played: Played) -> dict[str, float]:
    """Whether bumps show in the new shine as in the old, and grain in new colour; what is far away."""
    (before, after), (other, then) = ([one.linear for one in pair] for pair in played.pictures)
    glow, far = _about(played.masks[0], 2.0), _edge(played.masks[0])
    tile = played.masks[1] > 0
    change = np.abs(after - before).mean(axis=2)
    return {
        "right": played.named(0, "ground", "shine"),
        "bumps": _alike(_fine(after - before), _fine(before), glow),
        "far": float(change[far].mean() / change[glow].mean()),
        "right_colour": played.named(1, "ground", "colour"),
        "grain": _alike(_fine(then) / _fine_mean(then), _fine(other) / _fine_mean(other), tile),
    }


def sharpened(played: Played) -> dict[str, float]:
    """How much more light differs from that around it."""
    before, after = (_contrast(one.linear) for one in played.pictures[0])
    return {"contrast": after / before, "painted": played.painted()}


def _fine(light: npt.NDArray[np.float32]) -> F64:
    """(H, W) what varies within a few pixels."""
    grey = light.mean(axis=2, dtype=np.float64)
    return np.asarray(grey - _fine_mean(light))


def _fine_mean(light: npt.NDArray[np.float32]) -> F64:
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(light.mean(axis=2, dtype=np.float64), len(light) / 40, mode="nearest"))


def _contrast(light: npt.NDArray[np.float32]) -> float:
    from scipy.ndimage import gaussian_filter

    grey = light.mean(axis=2, dtype=np.float64)
    return float(np.abs(grey - gaussian_filter(grey, len(light) / 15, mode="nearest")).mean() / grey.mean())


def _alike(first: F64, second: F64, where: Bools) -> float:
    return float(np.corrcoef(first[where], second[where])[0, 1])


def _about(mask: npt.NDArray[np.float32], times: float) -> Bools:
    """The box around a stroke, so many times as large."""
    made = np.zeros(mask.shape, np.bool_)
    part = []
    for axis in (1, 0):
        own = np.flatnonzero((mask > 0).any(axis=axis))
        middle, half = (own[0] + own[-1]) / 2, times * (own[-1] - own[0] + 1) / 2
        part.append(slice(max(round(middle - half), 0), round(middle + half) + 1))
    made[tuple(part)] = True
    return made


def _edge(mask: npt.NDArray[np.float32]) -> Bools:
    """The left eighth of the picture."""
    made = np.zeros(mask.shape, np.bool_)
    made[:, : mask.shape[1] // 8] = True
    return made


PALE = dab([0.15, 0.19, 0.24], [[0.35, 0.3], [0.65, 0.27]], 0.14, shading=True)
BOUNCES = tuple(Act((PALE,), rounds, afresh=True) for rounds in (1, 4))
CAUSTIC = dab([0.5, 0.5, 0.5], [[0.46, 0.55], [0.5, 0.6]], 0.06, indirect=True)
GOLD = dab([0.4, 0.36, 0.25], [[0.46, 0.55], [0.5, 0.6]], 0.06, indirect=True)
HELD = (fixate([[0.35, 0.2], [0.5, 0.22]], 0.12), fixate([[0.12, 0.25], [0.12, 0.4]], 0.12))

FIGURES: Mapping[int, Session] = {
    14: Session(
        "Painting in shadow, under light between surfaces",
        scenes.shadow,
        (
            Act((dab([0.11, 0.12, 0.05], [[0.36, 0.62], [0.42, 0.64]], 0.07, shading=True),), 3),
            Act((dab([0.2, 0.24, 0.4], [[0.62, 0.8], [0.75, 0.84]], 0.1, shading=True),), 3),
        ),
        shadow,
        {
            "right_shadow": YES, "right_light": YES, "error_shadow": (0, 0.03), "error_light": (0, 0.03),
            "discount": (2, ANY),
        },
        bounces=3,
    ),
    15: Session(
        "Solving again over bounces",
        scenes.closed,
        BOUNCES,
        bounces,
        {"error_1": (0.3, ANY), "error_4": (0, 0.04)},
        bounces=8,
    ),
    16: Session(
        "Sketching shine, and the shape of a highlight",
        scenes.still_life,
        (
            Act((dab([0.08, 0.15, 0.12], [[0.222, 0.385], [0.222, 0.4]], 0.06),)),
            Act((dab([0.9, 0.7, 0.1], [[0.522, 0.5]], 0.07),)),
            Act((dab([0.5, 0.5, 0.5], [[0.735, 0.385]], 0.06),)),
            Act((
                {"tool": "sharpen", "radius": 0.02, "amount": 0.8, "path": [[0.735, 0.385]],
                 "brush": {"size": 0.2}},
            )),
        ),
        shine,
        {
            "right_dull": YES, "right_yellow": YES, "right_brighter": YES, "right_smaller": YES,
            "shine_dull": (0, 0.04), "tint_yellow": (0, 0.4), "shine_brighter": (0.15, 0.4),
            "roughness_smaller": (0.25, 0.36),
        },
    ),
    17: Session(
        "Painting with light from a matte wall",
        scenes.corner,
        (Act((dab([0.34, 0.39, 0.30], [[0.2, 0.85], [0.3, 0.8]], 0.15, shading=True, indirect=True),)),),
        green,
        {"right": YES, "greenness": (1.5, ANY), "followed": (0.8, 1.2), "floor_kept": YES},
        bounces=3,
    ),
    18: Session(
        "Painting what shows in a glossy floor",
        scenes.glossy_corner,
        (Act((dab([0.25, 0.14, 0.05], [[0.84, 0.85], [0.9, 0.9]], 0.15, indirect=True),)),),
        orange,
        {"right": YES, "orangeness": (3, ANY), "followed": (0.7, 1.2), "floor_kept": YES},
        bounces=3,
    ),
    19: Session(
        "A caustic, two fixates, and a golden ring",
        scenes.ring,
        (Act((CAUSTIC,)), Act((CAUSTIC, *HELD), afresh=True), Act((GOLD, *HELD))),
        caustic,
        {
            "right": YES, "followed": (0.15, 1.2), "fixed": (0, 0.08),
            "right_gold": YES, "tint_gold": (0, 0.6), "followed_gold": (0.15, 1.2), "table_kept": YES,
        },
        bounces=3,
    ),
    20: Session(
        "A highlight under a captured sky",
        scenes.pot,
        (Act((dab([1.5, 1.5, 1.5], [[0.39, 0.565], [0.42, 0.57]], 0.05),)),),
        highlight,
        {"right": YES, "shine": (0.08, 0.25), "followed": (0.4, 1.2)},
    ),
    21: Session(
        "Changes that keep grain and bumps",
        scenes.bricks,
        (
            Act((dab([2.0, 1.6, 0.4], [[0.53, 0.56]], 0.1, reach={"near": 4}),)),
            Act((dab([0.1, 0.16, 0.25], [[0.2, 0.7]], 0.1, reach={"alike": 10}),)),
        ),
        detail,
        {"right": YES, "bumps": (0.5, 1), "far": (0, 0.03), "right_colour": YES, "grain": (0.95, 1)},
    ),
    22: Session(
        "Unsharp stylisation",
        scenes.furnished,
        (Act(stylise=1.0),),
        sharpened,
        {"contrast": (1.03, 2), "painted": YES},
        bounces=3,
    ),
}  # fmt: skip

__all__ = ["FIGURES"]
