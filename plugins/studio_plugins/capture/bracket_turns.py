"""Photographs that a phone took for turned although it was held as before.

Held flat, a phone guesses which way is up, and may change its mind within a bracket. Its pictures then stand
in different ways although the lens never moved.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from studio_core.imaging.photograph import Photograph
from studio_plugins.capture.bracket_looks import Look, alike, look_at

_QUARTERS = {1: 0, 3: 2, 6: -1, 8: 1}  # counter-clockwise, that Exif's orientation asked for
_ALIKE, _BETTER = 0.65, 0.2


def turned_back(shots: Sequence[tuple[Photograph, Look]]) -> list[tuple[Photograph, Look, bool]]:
    """The photographs and their looks, and whether each was turned to stand as those that show the same.

    Only where orientations differ, and only where the picture is clearly alike to others when it is turned
    and not as it is. The less frequent orientation follows the more frequent one.
    """
    facts = [photograph.facts.orientation for photograph, _ in shots]
    kinds = sorted(set(facts), key=lambda o: (-facts.count(o), facts.index(o)))
    made = [(photograph, look, False) for photograph, look in shots]
    for rank, orientation in enumerate(kinds):
        for other in kinds[rank + 1 :]:
            for place, (photograph, look, turned) in enumerate(made):
                if turned or facts[place] != other or not {orientation, other} <= set(_QUARTERS):
                    continue
                quarters = (_QUARTERS[orientation] - _QUARTERS[other]) % 4
                pixels = np.ascontiguousarray(np.rot90(photograph.pixels, quarters))
                pixels.flags.writeable = False
                stands = replace(photograph, pixels=pixels)
                then = look_at(stands)
                there = [one for k, (_, one, _) in enumerate(made) if facts[k] == orientation]
                others = [one for k, (_, one, _) in enumerate(made) if k != place]
                if _best(then, there) > max(_ALIKE, _best(look, others) + _BETTER):
                    made[place] = (stands, then, True)
    return made


def _best(look: Look, others: Sequence[Look]) -> float:
    found = [low for low, _ in (alike(look, other) for other in others) if np.isfinite(low)]
    return max(found, default=-1.0)
