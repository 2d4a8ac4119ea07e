"""Brackets out of heaps of photographs: what belongs together, in which order, and what is said about it."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studio.bench.phone import Phone, shoot
from studio_core.capturing.settings import (
    BACK,
    DUAL,
    EQUIRECTANGULAR,
    FRONT,
    SINGLE,
    TWO_PICTURES,
    BracketSettings,
    Shot,
)
from studio_core.errors import Cancelled, InputError
from studio_core.imaging.photograph import Photograph, ShotFacts
from studio_core.shading.job import Job
from studio_plugins.capture.bracket import arrange

SIZE = (96, 72)


def scene(seed: int, width: int = SIZE[0], height: int = SIZE[1]) -> np.ndarray:
    """Linear light (height, width, 3) in a disc: patches of very different brightness."""
    import cv2

    coarse = np.random.default_rng(seed).normal(-3.5, 1.6, (9, 12, 1)).astype(np.float32)
    light = 2.0 ** cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    y, x = np.mgrid[0:height, 0:width] + 0.5
    disc = np.hypot(x - width / 2, y - height / 2) < 0.48 * height
    return np.repeat((light * disc)[:, :, None], 3, axis=2)


def photograph(
    light: np.ndarray,
    ev: float,
    name: str,
    *,
    taken: float | None = None,
    told: bool = True,
    depth: int = 8,
    **facts: object,
) -> Photograph:
    rng = np.random.default_rng(zlib.crc32(f"{name} {ev}".encode()))
    noisy = np.clip(light * 2.0**ev + rng.normal(0, 0.002, light.shape), 0, 1)
    top = (1 << depth) - 1
    pixels = np.rint(noisy ** (1 / 2.2) * top).astype(np.uint8 if depth == 8 else np.uint16)
    said = ShotFacts(name, 2.0**ev / 60 if told else None, 100.0 if told else None, 2.0 if told else None)
    return Photograph(pixels, replace(said, taken=taken, **facts), f"digest of {name}")  # type: ignore[arg-type]


def heap(
    evs: Sequence[float] = (0, -2, 2),
    back_evs: Sequence[float] | None = None,
    *,
    timed: bool = True,
    told: bool = True,
) -> list[Photograph]:
    """Front and back as they come off a camera: IMG_8 … IMG_13."""
    made = []
    for side, ladder in enumerate((evs, evs if back_evs is None else back_evs)):
        for ev in ladder:
            name = f"IMG_{8 + len(made)}.jpg"
            taken = 100.0 + len(made) * 0.4 + 20 * side if timed else None
            made.append(photograph(scene(side), ev, name, taken=taken, told=told))
    return made


def names(brackets: object, side: str) -> list[str]:
    return [shot.facts.name for shot in brackets.sides[side].shots]  # type: ignore[attr-defined]


@given(st.permutations(range(6)), st.booleans(), st.booleans())
@settings(max_examples=12, deadline=None)
def test_the_order_of_dropping_does_not_matter(order: list[int], timed: bool, told: bool) -> None:
    shots = heap(timed=timed, told=told)
    brackets = arrange([shots[i] for i in order], BracketSettings())
    assert brackets.layout == TWO_PICTURES
    assert names(brackets, FRONT) == ["IMG_9.jpg", "IMG_8.jpg", "IMG_10.jpg"]  # dark to bright
    assert names(brackets, BACK) == ["IMG_12.jpg", "IMG_11.jpg", "IMG_13.jpg"]
    for side in (FRONT, BACK):
        np.testing.assert_allclose(brackets.sides[side].listed, [-2, 0, 2], atol=1e-9)
        assert brackets.sides[side].certain == (told,) * 3


def test_simulated_phones_are_parted_without_exif() -> None:
    rng = np.random.default_rng(3)
    room = np.repeat(np.exp(rng.normal(0, 1, (16, 32, 1))), 3, axis=2).astype(np.float32)
    import cv2

    room = cv2.resize(room, (256, 128), interpolation=cv2.INTER_CUBIC).clip(0.01)
    phone = Phone(size=(240, 180), evs=(-2.0, 0.0, 2.0), shake=0.5, samples=1)
    phone = replace(phone, circle=replace(phone.circle, x=120.0, y=90.0, radius=80.0))
    shots = shoot(room, phone, 5)
    bare = [replace(s, facts=ShotFacts(f"{i}.jpg")) for i, s in enumerate(shots.front + shots.back)]
    brackets = arrange(bare[::-1], BracketSettings())
    for side, true in ((FRONT, shots.front), (BACK, shots.back)):
        assert [s.digest for s in brackets.sides[side].shots] == [s.digest for s in true]


def test_the_difference_of_both_sides_exposures_is_kept() -> None:
    brackets = arrange(heap((-2, 0, 2), (-1, 1, 3)), BracketSettings())
    np.testing.assert_allclose(brackets.sides[FRONT].listed, [-2.5, -0.5, 1.5])
    np.testing.assert_allclose(brackets.sides[BACK].listed, [-1.5, 0.5, 2.5])


def test_a_front_without_a_back_is_one_lens_and_says_so() -> None:
    brackets = arrange(heap(back_evs=()), BracketSettings())
    assert brackets.layout == SINGLE
    assert list(brackets.sides) == [FRONT]
    assert brackets.notes == ("There is one view only: what lies behind the lens was not photographed.",)
    chosen = arrange(heap(back_evs=()), BracketSettings(layout=SINGLE))
    assert chosen.notes == ()


def test_the_same_exposures_twice_of_one_view_stay_together() -> None:
    shots = heap((0, -2, 2, 0, -2, 2), ())
    clocks = [100.0 + 0.4 * i + 15 * (i > 2) for i in range(6)]
    later = [replace(s, facts=replace(s.facts, taken=t)) for s, t in zip(shots, clocks, strict=True)]
    for taken in (shots, later):
        brackets = arrange(taken, BracketSettings())
        assert brackets.layout == SINGLE
        np.testing.assert_allclose(brackets.sides[FRONT].listed, [-2, -2, 0, 0, 2, 2])


def test_one_exposure_each_is_enough_for_a_result() -> None:
    brackets = arrange(heap((0,)), BracketSettings())
    assert {side: len(b.shots) for side, b in brackets.sides.items()} == {FRONT: 1, BACK: 1}
    told = "has one exposure only: what is clipped or black in it stays so."
    assert brackets.notes == (f"The front {told}", f"The back {told}")
    alone = arrange(heap((0,), ()), BracketSettings())
    assert alone.layout == SINGLE
    assert alone.sides[FRONT].listed == (0.0,)


def test_uneven_steps_and_different_numbers_of_shots() -> None:
    brackets = arrange(heap((0, -3.3, 1.7), (-4, -0.3, 0, 0.3, 2)), BracketSettings())
    np.testing.assert_allclose(np.diff(brackets.sides[FRONT].listed), [3.3, 1.7])
    np.testing.assert_allclose(np.diff(brackets.sides[BACK].listed), [3.7, 0.3, 0.3, 1.7])


def test_sixteen_scans_of_film_are_put_in_order_by_brightness() -> None:
    light = scene(4, 384, 288)
    order = np.random.default_rng(0).permutation(16)
    scans = [photograph(light, (k - 9) * 1.0, f"scan{n}.png", told=False) for n, k in enumerate(order)]
    brackets = arrange(scans, BracketSettings(step=1.0))
    assert brackets.layout == SINGLE
    assert names(brackets, FRONT) == [f"scan{n}.png" for n in np.argsort(order)]
    np.testing.assert_allclose(np.diff(brackets.sides[FRONT].listed), 1.0)
    assert not any(brackets.sides[FRONT].certain)
    assert "steps of 1 EV are assumed" in brackets.notes[0]


def test_files_named_front_and_back_need_nothing_else() -> None:
    light = scene(1)
    shots = [
        photograph(light, ev, f"{n} {k}.jpg", told=False)
        for n in ("Back", "front")
        for k, ev in enumerate((0, 2))
    ]
    brackets = arrange(shots, BracketSettings())
    assert names(brackets, FRONT) == ["front 0.jpg", "front 1.jpg"]


def test_two_cameras_are_two_sides() -> None:
    light = scene(1)
    shots = [
        photograph(light, ev, f"{lens}{ev}.jpg", taken=10.0 + ev, camera="Cam", lens=lens)
        for ev in (-2, 0, 2)
        for lens in ("A", "B")
    ]
    brackets = arrange(shots, BracketSettings())
    assert [{s.facts.lens for s in b.shots} for b in brackets.sides.values()] == [{"A"}, {"B"}]


def test_copies_are_left_out_and_named() -> None:
    shots = heap()
    again = replace(shots[1], facts=replace(shots[1].facts, name="IMG_9 copy.jpg"), digest="other metadata")
    brackets = arrange([*shots, shots[0], again], BracketSettings())
    assert [len(b.shots) for b in brackets.sides.values()] == [3, 3]
    assert brackets.notes == (
        "IMG_8.jpg is the same photograph as IMG_8.jpg and is left out.",
        "IMG_9 copy.jpg is the same photograph as IMG_9.jpg and is left out.",
    )


def test_sizes_that_differ_leave_the_largest_group() -> None:
    shots = heap((0, -2, 2))
    small = photograph(scene(0, 48, 36), 1, "IMG_10b.jpg", taken=101.5)
    brackets = arrange([*shots[:3], small, *shots[3:]], BracketSettings())
    assert names(brackets, FRONT) == ["IMG_9.jpg", "IMG_8.jpg", "IMG_10.jpg"]
    assert brackets.notes == (
        "IMG_10b.jpg has 48 × 36 pixels while the others of the front have 96 × 72; it is left out.",
    )
    deep = photograph(scene(0), 1, "deep.png", taken=101.5, depth=16)
    brackets = arrange([*shots[:3], deep, *shots[3:]], BracketSettings())
    assert brackets.notes == ("deep.png is of 16 bit while the others are of 8 bit; it is left out.",)


def test_raw_files_are_taken_before_the_jpegs_beside_them() -> None:
    shots = heap((0, -2, 2), ())
    raw = []
    for shot in shots:
        facts = replace(shot.facts, name=shot.facts.name.replace("jpg", "dng"))
        light = (shot.pixels / 255.0).astype(np.float32) ** 2.2
        raw.append(Photograph(light, facts, f"raw {shot.digest}"))
    brackets = arrange([*shots, *raw], BracketSettings(layout=SINGLE))
    assert {s.kind for s in brackets.sides[FRONT].shots} == {"linear"}
    told = "are of 8 bit while the others are linear light; they are left out."
    assert brackets.notes == (f"IMG_8.jpg, IMG_9.jpg and IMG_10.jpg {told}",)


def test_other_primaries_are_left_out_and_named() -> None:
    shots = heap((0, -2, 2), ())
    shots[1] = replace(shots[1], colour=(1.22, -0.22, 0.0, -0.04, 1.04, 0.0, -0.02, -0.08, 1.1))
    brackets = arrange(shots, BracketSettings(layout=SINGLE))
    assert names(brackets, FRONT) == ["IMG_8.jpg", "IMG_10.jpg"]
    assert brackets.notes == ("IMG_9.jpg has another colour space than the others; it is left out.",)


def test_a_photograph_of_something_else_is_left_out() -> None:
    shots = heap()
    stray = photograph(scene(9), 0, "IMG_99.jpg", taken=140.0)
    brackets = arrange([*shots, stray], BracketSettings())
    assert [len(b.shots) for b in brackets.sides.values()] == [3, 3]
    assert brackets.notes == ("IMG_99.jpg shows neither view and is left out.",)


def test_what_a_person_decides_stands_above_what_is_found() -> None:
    shots = heap()
    chosen = (
        Shot(shots[0].digest, side=BACK),
        Shot(shots[3].digest, side=FRONT),
        Shot(shots[1].digest, used=False),
        Shot(shots[4].digest, ev=-1.25),
    )
    brackets = arrange(shots, BracketSettings(shots=chosen))
    assert set(names(brackets, FRONT)) == {shots[2].facts.name, shots[3].facts.name}
    assert set(names(brackets, BACK)) == {shots[k].facts.name for k in (0, 4, 5)}
    side = next(b for b in brackets.sides.values() if any(s is shots[4] for s in b.shots))
    place = next(i for i, s in enumerate(side.shots) if s is shots[4])
    assert side.listed[place] == -1.25
    assert side.certain[place]


def test_all_put_on_one_side_stay_there() -> None:
    shots = heap()
    brackets = arrange(shots, BracketSettings(shots=tuple(Shot(s.digest, side=FRONT) for s in shots)))
    assert len(brackets.sides[FRONT].shots) == 6
    swapped = {s.digest: BACK if i < 3 else FRONT for i, s in enumerate(shots)}
    brackets = arrange(shots, BracketSettings(shots=tuple(Shot(d, side=s) for d, s in swapped.items())))
    assert set(names(brackets, FRONT)) == {s.facts.name for s in shots[3:]}
    brackets = arrange(shots, BracketSettings(shots=(Shot(shots[0].digest, side=BACK),)))
    assert set(names(brackets, FRONT)) == {s.facts.name for s in shots[1:3]}
    brackets = arrange(shots[:3], BracketSettings(shots=tuple(Shot(s.digest, side=BACK) for s in shots)))
    assert list(brackets.sides) == [FRONT]
    assert "stand in for it" in brackets.notes[0]


def test_a_typed_table_is_taken_as_it_is() -> None:
    shots = heap((0, -2, 2), told=False)
    typed = dict(zip([s.digest for s in shots], (0.5, -1.0, 3.0, 0.0, -2.5, 1.0), strict=True))
    brackets = arrange(shots, BracketSettings(shots=tuple(Shot(d, ev=ev) for d, ev in typed.items())))
    for bracket in brackets.sides.values():
        assert [typed[s.digest] for s in bracket.shots] == list(bracket.listed)
        assert all(bracket.certain)
    assert brackets.notes == ()


@pytest.mark.parametrize("offset", [(0.0, 0.0), (6.0, -4.0)])
def test_two_circles_in_one_picture_are_found(offset: tuple[float, float]) -> None:
    height, width = 120, 240
    light = np.concatenate([scene(0, 120, 120), scene(1, 120, 120)], axis=1)
    y, x = np.mgrid[0:height, 0:width] + 0.5
    inside = np.zeros((height, width), bool)
    for centre in (60 + offset[0], 180 + offset[1]):
        inside |= np.hypot(x - centre, y - 60 - offset[1]) < 54
    light = light * inside[:, :, None] + 0.004
    shots = [photograph(light, ev, f"{ev}.jpg") for ev in (-2, 0, 2)]
    brackets = arrange(shots, BracketSettings())
    assert brackets.layout == DUAL
    assert list(brackets.sides) == [FRONT]


def test_pictures_of_all_directions_and_wide_frames_are_told_apart() -> None:
    import cv2

    rng = np.random.default_rng(0)
    coarse = rng.normal(-3, 1, (8, 16)).astype(np.float32)
    coarse = np.concatenate([coarse, coarse, coarse], axis=1)
    around = 2.0 ** cv2.resize(coarse, (720, 120), interpolation=cv2.INTER_CUBIC)[:, 240:480]
    light = np.repeat(around[:, :, None], 3, axis=2)
    shots = [photograph(light, ev, f"{ev}.jpg") for ev in (-2, 0, 2)]
    assert arrange(shots, BracketSettings()).layout == EQUIRECTANGULAR
    wide = [photograph(scene(2, 240, 120), ev, f"{ev}.jpg") for ev in (-2, 0, 2)]
    assert arrange(wide, BracketSettings()).layout == SINGLE
    assert arrange(shots, BracketSettings(layout=SINGLE)).layout == SINGLE


@pytest.mark.parametrize("turned", [3, 6, 8])
def test_a_phone_that_changed_its_mind_about_up_is_undone(turned: int) -> None:
    shots = heap()
    quarters = {3: 2, 6: -1, 8: 1}[turned]
    odd = replace(
        shots[1],
        pixels=np.ascontiguousarray(np.rot90(shots[1].pixels, quarters)),
        facts=replace(shots[1].facts, orientation=turned),
    )
    brackets = arrange([shots[0], odd, *shots[2:]], BracketSettings())
    assert names(brackets, FRONT)[0] == odd.facts.name
    np.testing.assert_array_equal(brackets.sides[FRONT].shots[0].pixels, shots[1].pixels)
    assert brackets.notes == (f"{odd.facts.name} was turned to stand as the others that show the same.",)


def test_a_back_that_was_taken_upright_stays_so() -> None:
    shots = heap()
    for place in (3, 4, 5):
        facts = replace(shots[place].facts, orientation=6)
        pixels = np.ascontiguousarray(np.rot90(shots[place].pixels, 1))
        shots[place] = replace(shots[place], pixels=pixels, facts=facts)
    brackets = arrange(shots, BracketSettings())
    assert {s.size for s in brackets.sides[BACK].shots} == {SIZE[::-1]}
    assert brackets.notes == ()


def test_nothing_to_work_with_is_said_in_a_sentence() -> None:
    with pytest.raises(InputError, match="no photographs"):
        arrange([], BracketSettings())
    shots = heap()
    with pytest.raises(InputError, match="Every photograph is left out"):
        arrange(shots, BracketSettings(shots=tuple(Shot(s.digest, used=False) for s in shots)))
    job = Job("arranging")
    job.cancel()
    with pytest.raises(Cancelled):
        arrange(shots, BracketSettings(), job)


def test_photographs_notes_are_passed_on_with_their_names() -> None:
    shots = [replace(s, notes=("It is in shades of grey.",)) for s in heap((0, 2), ())]
    notes = arrange(shots, BracketSettings(layout=SINGLE)).notes
    assert notes == ("IMG_8.jpg and IMG_9.jpg: It is in shades of grey.",)


def test_linear_photographs_are_looked_at_too() -> None:
    shots = []
    for side in (0, 1):
        for ev in (-2, 0, 2):
            light = np.clip(scene(side) * 2.0**ev, 0, 1).astype(np.float32)
            facts = ShotFacts(f"{side}{ev + 2}.dng", 2.0**ev, 100.0, 2.0)
            shots.append(Photograph(light, facts, f"{side} {ev}"))
    brackets = arrange(shots, BracketSettings())
    assert [len(b.shots) for b in brackets.sides.values()] == [3, 3]
    np.testing.assert_allclose(brackets.sides[FRONT].listed, [-2, 0, 2])
