"""What photographs of a ball say about lights that were told: sides, a turned frame, how far the camera is.

A ball is brighter where its lamp is: where that is the other side throughout, angles were counted the other
way round. The spot that a shiny ball shows lies where its normal halves light and view (as on a mirror
ball). Over all lamps that tells a rotation that they have in common, for nobody sets a camera up to the
degree, and how far the camera is, in whose perspective all spots lie further in. Single lamps are left to
`refine`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from studio_core.colour import LUMINANCE
from studio_plugins.residual.samples import F32, F64, Ball, Flags, Lights

_LUMINANCE = np.array(LUMINANCE, np.float32)
_APART = 0.15  # spread of a light's coordinate from which sides can be told
_OPPOSITE, _UNLIKE = -0.7, 0.3  # correlations: the other way round; nothing in common
_FEWEST = 6  # spots
_SPOT, _WIDEST = 2.0, 0.1  # times as bright as the rest; radii of the ball
_NEAREST, _FARTHEST = 3.0, 60.0  # radii
_SCATTER = np.radians(1.2)  # of spots about where they should be
_BETTER = 0.5  # of the squared angles that must go
_NOTICED = np.radians(0.3)


@dataclass(frozen=True, eq=False)
class Checked:
    """Lights and ball as pictures bear them out, and sentences on what was changed."""

    lights: Lights
    ball: Ball
    notes: tuple[str, ...] = ()


def checked(pictures: F32, clipped: Flags, ball: Ball, lights: Lights) -> Checked:
    """Of pictures (n, H, W, 3) of a ball. A `ball` with a finite distance keeps it."""
    light = np.einsum("nhwc,c->nhw", pictures, _LUMINANCE)
    towards, notes = _sides(light, ball, lights.directions.copy())
    which, spots = _spots(light, clipped, ball)
    if len(which) >= _FEWEST:
        turn, near = _fitted(spots, ball, towards[which])
        if turn is not None:
            towards = towards @ _rotation(turn).T
            degrees = float(np.degrees(np.linalg.norm(turn)))
            notes.append(f"Highlights say that all lights are turned by {degrees:.1f}° against the camera.")
        if near > 0:
            ball = replace(ball, distance=1 / near)
            notes.append(f"Highlights say that the camera was {1 / near:.1f} radii of the ball away.")
    same = not notes or bool((towards == lights.directions).all())
    told = lights if same else Lights(towards, lights.strengths, lights.names, lights.source)
    return Checked(told, ball, tuple(notes))


def _sides(light: F32, ball: Ball, towards: F64) -> tuple[F64, list[str]]:
    """Directions, mirrored where all pictures are brighter on the other side."""
    height, width = light.shape[1:]
    x, y = np.meshgrid(np.arange(width) + 0.5 - ball.x, ball.y - (np.arange(height) + 0.5))
    inside = np.hypot(x, y) < 0.95 * ball.radius
    weight = np.minimum(light[:, inside], np.quantile(light[:, inside], 0.9, axis=1)[:, None]) + np.float32(
        1e-9
    )
    notes = []
    for axis, place, words in ((0, x[inside], "left and right"), (1, y[inside], "above and below")):
        middle = (weight * place).sum(axis=1) / weight.sum(axis=1)
        told = towards[:, axis]
        if len(told) < 3 or np.ptp(told) < _APART or np.std(middle) < 1e-3 * ball.radius:
            continue
        alike = float(np.corrcoef(middle, told)[0, 1])
        if alike < _OPPOSITE:
            towards[:, axis] *= -1
            notes.append(f"The pictures show the lights the other way round, {words}: they are mirrored.")
        elif alike < _UNLIKE:
            notes.append(f"The pictures hardly agree with the lights that were told ({words}).")
    return towards, notes


def _spots(light: F32, clipped: Flags, ball: Ball) -> tuple[F64, F64]:
    """Pictures with one bright spot on the ball, and where its middle is (k, 2), pixels."""
    height, width = light.shape[1:]
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    inside = np.hypot(x - ball.x, y - ball.y) < 0.97 * ball.radius
    which, places = [], []
    for i, one in enumerate(light):
        shown = np.where(inside, one, 0)
        top = float(shown.max())
        rest = float(np.quantile(one[inside], 0.97))
        bright = (shown > 0.5 * top) | (clipped[i] & inside)
        if top < _SPOT * rest or not bright.any():
            continue
        weight = np.where(bright, np.maximum(shown - 0.5 * top, 0.05 * top), 0).astype(np.float64)
        middle = np.array([(weight * x).sum(), (weight * y).sum()]) / weight.sum()
        far = np.hypot(x[bright] - middle[0], y[bright] - middle[1])
        if np.quantile(far, 0.9) < _WIDEST * ball.radius:
            which.append(i)
            places.append(middle)
    return np.array(which, np.intp), np.array(places).reshape(-1, 2)


def _fitted(spots: F64, ball: Ball, towards: F64) -> tuple[F64 | None, float]:
    """A rotation of all lights (axis times radians), and one over the camera's distance; None and 0 where
    there is nothing to be gained by them."""
    from scipy.optimize import least_squares

    given = np.isfinite(ball.distance)

    def misfit(x: F64) -> F64:
        near = 1 / ball.distance if given else float(x[3])
        seen = replace(ball, distance=1 / near if near > 1e-4 else float("inf"))
        n, v, _ = seen.normals(spots[:, 0], spots[:, 1])
        mirrored = 2 * (n * v).sum(axis=-1, keepdims=True) * n - v
        return np.asarray((mirrored - towards @ _rotation(x[:3]).T).ravel(), np.float64)

    def cost(x: F64) -> float:
        off = np.sort((misfit(x).reshape(-1, 3) ** 2).sum(axis=1))
        return float(off[: max(round(0.8 * len(off)), 4)].sum())  # lamps that are wrong alone say nothing

    def solved(free: list[int]) -> F64:
        """Of the unknowns turn (0 … 2) and one over the distance (3), those that are free."""

        def filled(y: F64) -> F64:
            x = np.zeros(4)
            x[free] = y
            return x

        low, high, start = (
            np.array([v] * 3 + [k])[free] for v, k in ((-0.5, 0), (0.5, 1 / _NEAREST), (0, 0.05))
        )
        made = least_squares(
            lambda y: misfit(filled(y)), start, bounds=(low, high), loss="soft_l1", f_scale=0.01
        )
        return filled(made.x)

    best = np.zeros(4)
    least = cost(best)
    for free in ([0, 1, 2],) if given else ([3], [0, 1, 2], [0, 1, 2, 3]):
        found = solved(free)
        now = cost(found)
        if now < (1 - _BETTER) * least - _NOTICED**2 * len(spots) / 4:
            best, least = found, now
    if np.sqrt(least / len(spots)) > _SCATTER:
        return None, 0.0  # spots that do not agree tell nothing
    turned = float(np.linalg.norm(best[:3])) > _NOTICED
    return (best[:3] if turned else None), float(best[3]) if best[3] > 1 / _FARTHEST else 0.0


def _rotation(turn: F64) -> F64:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(turn).as_matrix(), np.float64)
