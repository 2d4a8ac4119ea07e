"""Solved exposures beside listed ones: the scale they share, and which listed ones are wrong."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from studio_core.capturing.artifacts import Exposures

F64 = npt.NDArray[np.float64]
WRONG = 0.3
"""EV between listed and solved steps from which a person is told."""
_SMALL = 0.15  # EV: a step that says nothing about the scale
_ALIKE = 0.12  # EV, or of a step that is longer: between steps that agree about the scale


def shared_scale(
    solved: Sequence[F64],
    listed: Sequence[F64],
    certain: Sequence[npt.NDArray[np.bool_]],
    linked: Sequence[npt.NDArray[np.bool_]],
    usual: float | None = None,
) -> float | None:
    """Factor that brings solved EV steps to the listed ones, as the median step of all brackets has it.

    Steps that agree are averaged; `linked` (F − 1,) are those that were measured. Guessed EV count where no
    others are. Where the middle is between two answers, it is the one nearer to `usual`. None when no step
    says anything.
    """
    for sure_only in (True, False):
        steps, wanted = [], []
        for own, said, sure, seen in zip(solved, listed, certain, linked, strict=True):
            for k in range(len(own) - 1):
                if not seen[k] or (sure_only and not (sure[k] and sure[k + 1])):
                    continue
                if own[k + 1] - own[k] > _SMALL and said[k + 1] - said[k] > _SMALL:
                    steps.append(own[k + 1] - own[k])
                    wanted.append(said[k + 1] - said[k])
        if steps:
            return _agreed(np.array(steps), np.array(wanted), usual)
    return None


def _agreed(steps: F64, wanted: F64, usual: float | None) -> float:
    """The median of the steps' factors, averaged with those that agree with it."""
    ratio = wanted / steps
    order = np.argsort(ratio)
    low, high = order[(len(ratio) - 1) // 2], order[len(ratio) // 2]

    def alike(factor: float) -> npt.NDArray[np.bool_]:
        return np.asarray(np.abs(wanted - factor * steps) < np.maximum(_ALIKE, _ALIKE * wanted), np.bool_)

    answers = [float(ratio[low])]
    if not alike(ratio[low])[high]:  # halves disagree
        answers.append(float(ratio[high]))
        if len(ratio) == 2:  # it is the exposure in the middle that may be wrong
            answers.append(float(wanted.sum() / steps.sum()))
    prefer = float(np.sqrt(ratio[low] * ratio[high])) if usual is None else usual
    best = min(answers, key=lambda factor: abs(np.log(factor / prefer)))
    same = alike(best)
    return float(wanted[same].sum() / steps[same].sum()) if same.any() else best


def compared(
    solved: F64, listed: F64, certain: npt.NDArray[np.bool_], names: Sequence[str]
) -> tuple[Exposures, F64]:
    """One bracket's exposures, dark to bright, shifted to the listed origin; and the same EV as an array."""
    trusted = certain if certain.any() else np.ones(len(listed), np.bool_)
    solved = solved + _origin((listed - solved)[trusted])
    found = [pair for pair in _wrong(solved, listed) if certain[pair[0]]]
    wrong = sorted({i for i, _ in found})
    notes = []
    for i, neighbour in found:
        own, said = (abs(float(e[i] - e[neighbour])) for e in (solved, listed))
        notes.append(
            f"{names[i]} was exposed otherwise than listed: {own:.1f} EV instead of {said:.1f} EV from "
            f"{names[neighbour]}."
        )
    made = Exposures(
        tuple(float(e) for e in listed), tuple(float(e) for e in solved), tuple(wrong), tuple(notes)
    )
    return made, solved


def _origin(gap: F64) -> float:
    """Median of the differences; of an even number the mean of those that most agree with."""
    middle = float(np.median(gap))
    near = [gap[np.abs(gap - g) < WRONG / 2] for g in gap]
    most = max(near, key=lambda part: (len(part), -abs(float(part.mean()) - middle)))
    return float(most.mean())


def _wrong(solved: F64, listed: F64) -> list[tuple[int, int]]:
    """Shots at whose step the two part ways, and the shot across that step.

    A shot that stands alone is named once, else the shot on the side with fewer shots.
    """
    count = len(listed)
    off = np.diff(solved - listed)
    wrong: list[tuple[int, int]] = []
    k = 0
    while k < count - 1:
        if abs(off[k]) > WRONG:
            alone = k + 1 < count - 1 and abs(off[k + 1]) > WRONG and abs(off[k] + off[k + 1]) < WRONG
            if alone:
                wrong.append((k + 1, k))
                k += 1
            else:
                wrong.append((k, k + 1) if k + 1 < count - k - 1 else (k + 1, k))
        k += 1
    return wrong
