"""From a heap of photographs to brackets: what belongs together, which side it shows, how it was exposed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from studio_core.arrays import frozen_map
from studio_core.capturing.artifacts import Bracket, Brackets
from studio_core.capturing.settings import (
    AUTOMATIC,
    BACK,
    DUAL,
    EQUIRECTANGULAR,
    FRONT,
    SIDES,
    SINGLE,
    TWO_PICTURES,
    BracketSettings,
    Shot,
)
from studio_core.errors import InputError
from studio_core.imaging.listed_exposures import Exposed, completed, joined, listed_exposures
from studio_core.imaging.photograph import Photograph
from studio_core.shading.job import Job
from studio_plugins.capture.bracket_looks import Look, dark_ends, goes_round, look_at, two_discs, well_exposed
from studio_plugins.capture.bracket_sides import Member, in_order, part
from studio_plugins.capture.bracket_turns import turned_back

_BEST = ("8 bit", "16 bit", "linear")
_WIDE = (1.6, 2.4)  # aspects in which two circles may lie side by side
_TWICE_AS_WIDE = (1.98, 2.02)


@dataclass(frozen=True, eq=False)
class _Taken:
    photograph: Photograph
    look: Look
    shot: Shot
    name: str


def arrange(photographs: Sequence[Photograph], settings: BracketSettings, job: Job | None = None) -> Brackets:
    """Brackets of what was photographed, each dark to bright, with listed exposures.

    `settings.shots` overrule what is found: side, exposure, use. A dual or equirectangular picture has the
    side `front` alone, the whole picture. `notes` are sentences on what was left out, guessed or is missing.
    Raises InputError when nothing can be used.
    """
    notes: list[str] = []
    taken = _usable(photographs, settings, notes, job)
    layout = settings.layout if settings.layout != AUTOMATIC else _layout(taken)
    groups = _sides(taken, layout, settings.layout != AUTOMATIC, notes)
    if layout in (SINGLE, TWO_PICTURES):
        layout = TWO_PICTURES if len(groups) == 2 else SINGLE
    groups = _consistent(groups, notes)
    exposed = {
        side: [Exposed(t.photograph.facts, t.look.brightness, t.shot.ev) for t in group]
        for side, group in groups.items()
    }
    listed = listed_exposures(exposed, settings.step)
    made = {}
    for side, group in groups.items():
        own = listed[side]
        order = sorted(range(len(group)), key=lambda i: (own.evs[i], group[i].look.brightness, i))
        shots = tuple(group[i].photograph for i in order)
        made[side] = Bracket(shots, tuple(own.evs[i] for i in order), tuple(own.certain[i] for i in order))
        notes += own.notes
        if len(group) == 1:
            notes.append(f"The {side} has one exposure only: what is clipped or black in it stays so.")
    if settings.layout in (AUTOMATIC, TWO_PICTURES) and layout == SINGLE:
        notes.append("There is one view only: what lies behind the lens was not photographed.")
    told = [(note, t.name) for group in groups.values() for t in group for note in t.photograph.notes]
    for note in dict.fromkeys(note for note, _ in told):
        notes.append(f"{joined([name for said, name in told if said == note])}: {note}")
    return Brackets(layout, frozen_map(made), tuple(notes))


def _usable(
    photographs: Sequence[Photograph], settings: BracketSettings, notes: list[str], job: Job | None
) -> list[_Taken]:
    """Those that are to be used, none twice."""
    if not photographs:
        raise InputError("There are no photographs to work with.")
    wanted = {shot.photograph: shot for shot in settings.shots}
    taken: list[_Taken] = []
    for done, photograph in enumerate(photographs):
        if job is not None:
            job.checkpoint(done, len(photographs))
        shot = wanted.get(photograph.digest, Shot(photograph.digest))
        if not shot.used:
            continue
        name = photograph.facts.name or f"photograph {done + 1}"
        same = next((t for t in taken if t.photograph.digest == photograph.digest), None)
        if same is None:
            look = look_at(photograph)
            same = next((t for t in taken if _equal(t, photograph, look)), None)
            if same is None:
                taken.append(_Taken(photograph, look, shot, name))
                continue
        notes.append(f"{name} is the same photograph as {same.name} and is left out.")
    looked = turned_back([(t.photograph, t.look) for t in taken])
    for place, (photograph, look, turned) in enumerate(looked):
        if turned:
            taken[place] = replace(taken[place], photograph=photograph, look=look)
            notes.append(f"{taken[place].name} was turned to stand as the others that show the same.")
    if not taken:
        raise InputError("Every photograph is left out: at least one is needed.")
    return taken


def _equal(taken: _Taken, photograph: Photograph, look: Look) -> bool:
    return np.array_equal(taken.look.numbers, look.numbers) and np.array_equal(
        taken.photograph.pixels, photograph.pixels
    )


def _layout(taken: Sequence[_Taken]) -> str:
    """What the photographs show, by those of the most frequent size."""
    sizes = [t.photograph.size for t in taken]
    size = max(dict.fromkeys(sizes), key=sizes.count)
    looks = [t.look for t in taken if t.photograph.size == size]
    look = well_exposed(looks)
    aspect = size[0] / size[1]
    if _WIDE[0] <= aspect <= _WIDE[1] and any(two_discs(one) for one in looks):
        return DUAL
    round_about = _TWICE_AS_WIDE[0] <= aspect <= _TWICE_AS_WIDE[1] and goes_round(look)
    return EQUIRECTANGULAR if round_about and not dark_ends(look) else TWO_PICTURES


def _sides(taken: Sequence[_Taken], layout: str, chosen: bool, notes: list[str]) -> dict[str, list[_Taken]]:
    """The photographs of each side, in the order they were taken."""
    if layout not in (SINGLE, TWO_PICTURES) or (layout == SINGLE and chosen):
        if layout == SINGLE:
            taken = [t for t in taken if t.shot.side != BACK] or taken
        return {FRONT: [taken[i] for i in in_order([t.photograph.facts for t in taken])]}
    facts = completed([t.photograph.facts for t in taken])
    members = [
        Member(t.photograph.facts, t.look, f.ev, t.shot.side if t.shot.side in SIDES else None)
        for t, f in zip(taken, facts, strict=True)
    ]
    parted = part(members, may_be_one=not chosen)
    groups = {FRONT: [taken[i] for i in parted.front], BACK: [taken[i] for i in parted.back]}
    groups = {side: group for side, group in groups.items() if group}
    for stray in parted.strays:
        notes.append(f"{taken[stray].name} shows neither view and is left out.")
    if not groups:
        raise InputError("The photographs show nothing in common.")
    if set(groups) == {BACK}:
        groups = {FRONT: groups[BACK]}
        notes.append("There are no photographs of the front; those of the back stand in for it.")
    if not parted.sure and len(taken) > 1:
        how = "showing front and back" if len(groups) == 2 else "showing one view"
        notes.append(f"It is not certain which photograph shows which side; they were taken as {how}.")
    return groups


def _consistent(groups: dict[str, list[_Taken]], notes: list[str]) -> dict[str, list[_Taken]]:
    """Of each side the largest group of one size; all of one kind of numbers and of one colour space.

    Of equally many the linear ones are taken: cameras write raw files beside their JPEGs.
    """
    everything = [t for group in groups.values() for t in group]
    kinds = [t.photograph.kind for t in everything]
    kind = max(dict.fromkeys(kinds), key=lambda k: (kinds.count(k), _BEST.index(k)))
    others = [t for t in everything if t.photograph.kind != kind]
    for other in dict.fromkeys(t.photograph.kind for t in others):
        odd = [t for t in others if t.photograph.kind == other]
        notes.append(_left_out(odd, f"{_are(odd)} {_numbers(other)} while the others are {_numbers(kind)}"))
    colours = [_colour(t) for t in everything if t.photograph.kind == kind]
    colour = max(dict.fromkeys(colours), key=colours.count)
    odd = [t for t in everything if t.photograph.kind == kind and _colour(t) != colour]
    if odd:
        notes.append(_left_out(odd, f"{_have(odd)} another colour space than the others"))
    made: dict[str, list[_Taken]] = {}
    for side, group in groups.items():
        alike = [t for t in group if t.photograph.kind == kind and _colour(t) == colour]
        sizes = [t.photograph.size for t in alike]
        if not sizes:
            continue
        size = max(dict.fromkeys(sizes), key=lambda s: (sizes.count(s), s[0] * s[1]))
        for other_size in dict.fromkeys(s for s in sizes if s != size):
            odd = [t for t in alike if t.photograph.size == other_size]
            (w, h), (width, height) = other_size, size
            than = f"while the others of the {side} have {width} × {height}"
            notes.append(_left_out(odd, f"{_have(odd)} {w} × {h} pixels {than}"))
        made[side] = [t for t in alike if t.photograph.size == size]
    return made if FRONT in made else {FRONT: made[BACK]}


def _colour(taken: _Taken) -> tuple[float, ...]:
    return tuple(round(v, 2) for v in taken.photograph.colour)


def _numbers(kind: str) -> str:
    return "linear light" if kind == "linear" else f"of {kind}"


def _left_out(odd: Sequence[_Taken], why: str) -> str:
    return f"{joined([t.name for t in odd])} {why}; {'it is' if len(odd) == 1 else 'they are'} left out."


def _are(odd: Sequence[_Taken]) -> str:
    return "is" if len(odd) == 1 else "are"


def _have(odd: Sequence[_Taken]) -> str:
    return "has" if len(odd) == 1 else "have"
