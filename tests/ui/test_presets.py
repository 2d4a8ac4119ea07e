"""Habits of navigating: every chord means one thing, Help tells what the mouse does, choices are kept."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from ui_support import Driver, Make

from studio_ui.canvas.presets import BLENDER, CAD, LUCARNE, PRESETS, TOUCHPAD, WORDS, Preset, chord
from studio_ui.canvas.viewport import Pointer

KEYS = ("Shift", "Ctrl", "Alt")


@pytest.mark.parametrize("preset", PRESETS.values(), ids=lambda p: p.id)
def test_chords_are_written_as_a_press_is(preset: Preset) -> None:
    for text, gesture in preset.drags.items():
        *keys, button = text.split("+")
        press = Pointer("press", 0, 0, button, **{k.lower(): k in keys for k in KEYS})  # type: ignore[arg-type]
        assert chord(press) == text
        assert preset.gesture(press) == gesture
    for keys_held, gesture in preset.fingers.items():
        slid = Pointer("move", 0, 0, **{k.lower(): k in keys_held for k in KEYS})  # type: ignore[arg-type]
        assert preset.slid(slid) == gesture


@pytest.mark.parametrize("preset", PRESETS.values(), ids=lambda p: p.id)
def test_everything_can_be_done_and_is_told(preset: Preset) -> None:
    can = {*preset.drags.values(), *preset.fingers.values()}
    assert can == set(WORDS)
    told = dict(preset.table())
    assert set(told) == set(WORDS.values())
    for text, gesture in preset.drags.items():
        if text != "left":
            assert f"{text[0].upper()}{text[1:]} drag" in told[WORDS[gesture]].split("; ")
    assert "Wheel" in told["Nearer and further"]


def test_the_middle_button_is_what_people_are_used_to() -> None:
    middle = Pointer("press", 0, 0, "middle")
    shifted = Pointer("press", 0, 0, "middle", shift=True)
    assert (BLENDER.gesture(middle), BLENDER.gesture(shifted)) == ("orbit", "pan")
    assert (CAD.gesture(middle), CAD.gesture(shifted)) == ("pan", "orbit")
    left = Pointer("press", 0, 0, "left")
    assert (LUCARNE.gesture(left), TOUCHPAD.gesture(left)) == ("orbit", "orbit")
    assert (BLENDER.gesture(left), CAD.gesture(left)) == (None, None), "there it chooses by a box"


def test_the_habit_is_remembered(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "mine"
    driver = make(state=state)
    looking = driver.window.tools.looking
    assert looking.preset is LUCARNE
    assert not looking.inverted
    driver.do("view.navigation_cad")
    driver.do("view.invert_wheel")
    driver.do("view.animate")
    driver.close()
    driver = make(state=state)
    looking = driver.window.tools.looking
    assert looking.preset is CAD
    assert looking.inverted
    driver.until(lambda: not driver.window.following.pending)
    assert driver.window.actions_["view.navigation_cad"].isChecked()
    assert driver.window.actions_["view.invert_wheel"].isChecked()


def test_an_unknown_habit_is_the_first_one(make: Make, tmp_path: Path) -> None:
    state = tmp_path / "mine"
    state.mkdir()
    (state / "window.json").write_text('{"navigation": "maya"}')
    assert make(state=state).window.tools.looking.preset is LUCARNE


def test_help_tells_of_the_habit_in_use(driver: Driver) -> None:
    assert ("Slide the view", "Middle drag") not in driver.window.viewing.mouse()
    driver.do("view.navigation_cad")
    assert ("Slide the view", "Middle drag") in driver.window.viewing.mouse()


def test_the_page_about_looking_tells_every_way() -> None:
    page = (Path(__file__).resolve().parents[2] / "docs" / "looking.md").read_text("utf-8")
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if "|" in line
    ]
    told = {row[0]: dict(zip(rows[0][1:], row[1:], strict=True)) for row in rows[2:]}
    assert set(rows[0][1:]) == {preset.label for preset in PRESETS.values()}
    for gesture, name in (("orbit", "Look around"), ("pan", "Slide"), ("zoom", "Nearer")):
        for preset in PRESETS.values():
            ways = re.split(
                r", | or ", told[name][preset.label].replace(" drag", "").replace(" on nothing", "")
            )
            known = [text for text, found in preset.drags.items() if found == gesture]
            fingers = [keys for keys, found in preset.fingers.items() if found == gesture]
            known += [f"{keys}+two fingers" if keys else "two fingers" for keys in fingers]
            known += (["pinch"] if preset.fingers else ["wheel"]) if gesture == "zoom" else []
            assert sorted(ways) == sorted(known), (name, preset.label)
