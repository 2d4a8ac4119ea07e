"""Part of `lucarne bench cuts`: edits of a picture that has settled, against Mitsuba at equal picture error.

Somebody who designs sees a picture that has come to rest, refined and smoothed, and edits it. So every path
first comes to rest in a state that is not compared, goes on by edits, and ends where Mitsuba's converged
picture was taken: what is compared is what is then on the screen, on meshes that were refined for another
state, and the edit's time counts until it is there. Each case is measured at several operating points. Cases
of more than materials have pipelines of their own, which know no light of the state that is compared.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from studio.bench.cuts_cases import Case, State
from studio.bench.cuts_measure import Editor
from studio.bench.cuts_peers import Peer
from studio.bench.cuts_scenes import ENVIRONMENTS, NATIVE
from studio.bench.harness import Timing

if TYPE_CHECKING:
    from studio.bench.cuts import Suite

F32 = npt.NDArray[np.float32]


@dataclass(frozen=True)
class Point:
    """How an edit is shown: while a hand moves something, or at rest until the first exact picture.

    `antialias` by itself samples a pixel, and 16 with `edges` where something ends; `refined` meshes are
    those that the picture before came to rest on.
    """

    name: str
    moving: bool
    antialias: int
    refined: bool = True
    edges: bool = False


PLAIN = Point("plain", True, 1, refined=False)
MOVING = Point("moving", True, 1)
EDGES = Point("edges", True, 1, edges=True)
SMOOTH = Point("smooth", True, 2, edges=True)
REST = Point("rest", False, 2, edges=True)
ROUGH = Point("rough", False, 1, refined=False)


def points(case: Case, environment: str) -> tuple[Point, ...]:
    """Where a case is measured, first as it is against brute force; under the sun, fewer.

    A moved object at rest is a case of its own.
    """
    everything = environment == ENVIRONMENTS[0]
    if not case.moving:
        return (ROUGH, REST) if everything else (ROUGH,)
    if case.name == "camera" or case.name.startswith("move"):
        rest = () if case.name.startswith("move") else (REST,)
        return (PLAIN, MOVING, EDGES, *rest) if everything else (PLAIN, EDGES)
    return (PLAIN, MOVING, EDGES, SMOOTH, REST) if everything else (PLAIN, SMOOTH)


def against_peer(suite: Suite, name: str, case: Case, environment: str) -> None:
    """Rows `peer_…` of a case; nothing where Mitsuba has none of its materials or is not installed."""
    materials = NATIVE[case.materials]
    peer = suite.peer(environment, materials)
    if peer is None:
        return
    best: tuple[float, float, Point] | None = None
    for point in points(case, environment):
        editor = suite.settled_editor(environment, case, point.refined)
        linear, timing = edited(suite, editor, case, environment, point)
        error = peer.error(linear)
        suite.report.add(name, f"peer_{point.name}_ms", 1000 * timing.median, "ms", 1000 * timing.spread)
        suite.report.add(name, f"peer_{point.name}_rel_rmse", error, "1", peer.noise)
        if not told(peer, error):
            continue
        ratio = peer.ratio(error, timing.median)
        suite.report.add(name, f"peer_{point.name}_ratio", ratio, "1")
        if best is None or ratio > best[0]:
            best = (ratio, error, point)
    if best is not None:
        suite.report.add(name, "peer_picture_rel_rmse", best[1], "1", peer.noise)
        suite.report.add(name, "peer_ratio", best[0], "1")
        suite.detail(name, peer_point=best[2].name)


def told(peer: Peer, error: float) -> bool:
    """Whether there is a ratio: too few samples may leave no error, or no law."""
    return error > 0 and peer.law.exponent < 0


def edited(suite: Suite, editor: Editor, case: Case, environment: str, point: Point) -> tuple[F32, Timing]:
    """The picture after the last edit, and the seconds of all but the first (it warms up)."""
    base = suite.base(environment, NATIVE[case.materials])
    edits = suite.setup.peer_edits if case.moving else suite.setup.peer_exact
    path = case.path(base, edits + 1, NATIVE[case.materials])
    params = suite.params(refine=point.refined, everywhere=case.everywhere)
    before = REST if point.refined else PLAIN
    if point.moving and not case.name.startswith(("move", "camera")):
        before = dataclasses.replace(before, antialias=point.antialias, edges=point.edges)  # rays are kept
    settled = sampled(path[0], before)
    _, picture = editor.go(settled, params, moving=False)
    taken = []
    for state in path[1:]:
        wanted = sampled(state, point)
        if point.moving:
            step, picture = editor.go(wanted, params, moving=True)
            taken.append(step.seconds)
        else:
            seconds, picture = editor.first_exact(wanted, params)
            taken.append(seconds)
    return picture.linear, Timing.of(taken[1:])


def sampled(state: State, point: Point) -> State:
    """The state with a point's samples."""
    view = dataclasses.replace(state.view, antialias=point.antialias, fine_edges=point.edges)
    return dataclasses.replace(state, view=view)
