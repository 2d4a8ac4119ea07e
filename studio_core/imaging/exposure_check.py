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
_ALIKE = 0.12  # of steps that agree about the scale


def shared_scale(
    solved: Sequence[F64],
    listed: Sequence[F64],
    certain: Sequence[npt.NDArray[np.bool_]],
    linked: Sequence[npt.NDArray[np.bool_]],
) -> float | None:
    """Factor that brings solved EV steps to the listed ones in the (weighted) median over all brackets.

    Steps that agree with the median are averaged; `linked` (F − 1,) are those that were measured. Guessed
    EV count where no others are. None when no step says anything.
    """
    for sure_only in (True, False):
        ratio, weight = [], []
        for own, said, sure, seen in zip(solved, listed, certain, linked, strict=True):
            for k in range(len(own) - 1):
                if not seen[k] or (sure_only and not (sure[k] and sure[k + 1])):
                    continue
                step, wanted = own[k + 1] - own[k], said[k + 1] - said[k]
                if step > _SMALL and wanted > _SMALL:
                    ratio.append(wanted / step)
                    weight.append(step)
        if ratio:
            return _agreed(np.array(ratio), np.array(weight))
    return None


def _agreed(ratio: F64, weight: F64) -> float:
    order = np.argsort(ratio)
    ratio, weight = ratio[order], weight[order]
    # the middle of the weighted distribution, between the two nearest where it falls between them
    middle = float(np.interp(0.5, (np.cumsum(weight) - weight / 2) / weight.sum(), ratio))
    alike = np.abs(ratio / middle - 1) < _ALIKE
    return float(np.average(ratio[alike], weights=weight[alike])) if alike.any() else middle


def compared(
    solved: F64, listed: F64, certain: npt.NDArray[np.bool_], names: Sequence[str]
) -> tuple[Exposures, F64]:
    """One bracket's exposures, dark to bright, shifted to the listed origin; and the same EV as an array."""
    trusted = certain if certain.any() else np.ones(len(listed), np.bool_)
    solved = solved + _origin((listed - solved)[trusted])
    wrong = [i for i in _wrong(solved, listed) if certain[i]]
    notes = []
    for i in wrong:
        off = float(solved[i] - listed[i])
        neighbour = i - 1 if i else i + 1
        own, said = (abs(float(e[i] - e[neighbour])) for e in (solved, listed))
        notes.append(
            f"{names[i]} was exposed otherwise than listed: {own:.1f} EV instead of {said:.1f} EV from "
            f"{names[neighbour]} ({off:+.1f} EV)."
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


def _wrong(solved: F64, listed: F64) -> list[int]:
    """Shots at whose step the two part ways: a shot that stands alone, else the one on the smaller side."""
    count = len(listed)
    off = np.diff(solved - listed)
    wrong: list[int] = []
    k = 0
    while k < count - 1:
        if abs(off[k]) > WRONG:
            alone = k + 1 < count - 1 and abs(off[k + 1]) > WRONG and abs(off[k] + off[k + 1]) < WRONG
            if alone:
                wrong.append(k + 1)
                k += 1
            else:
                wrong.append(k if k + 1 < count - k - 1 else k + 1)
        k += 1
    return sorted(set(wrong))
