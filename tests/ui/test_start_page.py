"""The start page: recent projects with their pictures, samples, and when it comes and goes."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from ui_support import Answers, Driver, Make, room

from studio_core.edits import SetFields
from studio_core.project.store import save
from studio_ui.files.recent import RecentProject, folder_text, shared_names, when
from studio_ui.files.thumbnails import LONGEST, Thumbnails, read_small, small_picture


def page(driver: Driver):
    return driver.window.front.start_page


def saved(driver: Driver, path: Path) -> Path:
    driver.answers.target = path
    driver.do("file.save_as")
    driver.until(lambda: driver.window.files.path == path)
    return path


def test_the_page_is_there_as_long_as_the_scene_is_empty(driver: Driver) -> None:
    assert page(driver).isHidden()
    driver.do("file.new")
    assert page(driver).isVisible()
    assert page(driver).geometry() == driver.window.front.widget.rect()
    driver.open(room())
    assert page(driver).isHidden()
    driver.do("file.new")
    assert page(driver).isVisible()


def test_an_empty_scene_can_be_begun_with(driver: Driver) -> None:
    driver.do("file.new")
    button = next(b for b, _ in page(driver).buttons if b.text() == "Empty scene")
    button.click()
    assert page(driver).isHidden()
    assert "Drop a model" in driver.viewport._message
    driver.do("file.new")
    assert page(driver).isVisible(), "a document later it is there again"


def test_a_new_room_is_begun_with_daylight(make: Make) -> None:
    driver = make()
    driver.do("file.new")
    button = next(b for b, _ in page(driver).buttons if b.text() == "New room")
    button.click()
    assert page(driver).isHidden()
    driver.until(lambda: driver.labels()[-1] == "Daylight")
    scene = driver.document.scene
    assert [type(node).__name__ for node in scene.children(None)] == ["Room", "Environment"]
    driver.do("edit.undo")
    driver.do("edit.undo")
    assert page(driver).isVisible()


def test_recent_projects_have_pictures_and_open(make: Make, tmp_path: Path) -> None:
    driver = make()
    driver.show(room())
    path = saved(driver, tmp_path / "flat.lucarne")
    driver.do("file.new")
    driver.until(lambda: bool(page(driver).projects.cards))
    (card,) = page(driver).projects.cards
    assert card.text() == "flat"
    assert card.lines[0] == folder_text(path)
    assert card.lines[1].startswith(("today", "yesterday"))
    assert max(card.image.width(), card.image.height()) == LONGEST
    driver.bot.mouseClick(card, Qt.MouseButton.LeftButton)
    driver.until(lambda: driver.window.files.path == path)
    assert page(driver).isHidden()


def test_a_project_that_was_only_looked_at_has_a_picture_too(make: Make, tmp_path: Path) -> None:
    path = tmp_path / "flat.lucarne"
    save(path, room())
    driver = make()
    driver.window.files.open(path)
    driver.until(lambda: driver.feed.last is not None)
    driver.do("file.new")
    driver.until(lambda: any(card.image is not None for card in page(driver).projects.cards))


def test_what_is_missing_is_greyed_and_can_be_removed(make: Make, tmp_path: Path) -> None:
    driver = make()
    driver.show(room())
    gone = saved(driver, tmp_path / "gone.lucarne")
    stays = saved(driver, tmp_path / "stays.lucarne")
    driver.do("file.new")
    gone.unlink()
    driver.do("file.new")
    driver.until(lambda: any(card.faded for card in page(driver).projects.cards))
    cards = {card.text(): card for card in page(driver).projects.cards}
    assert (cards["gone"].faded, cards["stays"].faded) == (True, False)
    driver.bot.mouseClick(cards["gone"], Qt.MouseButton.LeftButton)
    assert driver.problems() == []
    menu = driver.window.menus
    menu.fill_recent()
    enabled = {a.text(): a.isEnabled() for a in menu.recent.actions() if a.text()}
    assert enabled == {"stays": True, "gone": False, "Clear list": True}
    cards["gone"].corner("Remove from list").click()
    assert [card.text() for card in page(driver).projects.cards] == ["stays"]
    assert driver.window.settings.recent == [stays]


def test_samples_open_as_copies(make: Make) -> None:
    driver = make()
    driver.do("file.new")
    cards = page(driver).samples.cards
    assert [card.text() for card in cards] == ["Living room", "Captured room", "Red cabinet", "Terrace"]
    assert all(card.image is not None for card in cards)
    cards[3].click()
    driver.until(lambda: bool(driver.document.scene.nodes))
    assert driver.window.files.path is None
    assert driver.window.files.name == "Terrace"


def test_cards_keep_within_the_page_however_narrow(driver: Driver) -> None:
    driver.do("file.new")
    shelf = page(driver).samples
    for width in (1400, 900, 620):
        driver.window.resize(width, 600)
        driver.bot.wait(1)
        for card in shelf.cards:
            assert shelf.rect().contains(card.geometry())
        boxes = [card.geometry() for card in shelf.cards]
        assert not boxes[0].intersects(boxes[1])


def test_thumbnails_are_small_tone_mapped_and_bounded(tmp_path: Path) -> None:
    linear = np.full((400, 800, 3), 0.18, np.float32)
    made = small_picture(linear, 1.0, "srgb")
    assert made.shape == (LONGEST // 2, LONGEST, 3)
    assert abs(int(made[5, 5, 0]) - 162) <= 1  # 0.36 as sRGB
    thumbnails = Thumbnails(tmp_path / "cache")
    project = tmp_path / "a.lucarne"
    assert thumbnails.find(project) is None
    for number in range(104):
        thumbnails.keep(tmp_path / f"{number}.lucarne", linear[:9, :16], 0.0, "srgb")
    assert len(list(thumbnails.folder.iterdir())) == 100
    image = thumbnails.find(tmp_path / "103.lucarne")
    assert (image.width(), image.height()) == (16, 9)


@pytest.mark.parametrize("content", [b"", b"no picture", b"\x89PNG\r\n\x1a\n" + b"\0" * 64])
def test_a_damaged_thumbnail_is_none(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.png"
    path.write_bytes(content)
    assert read_small(path) is None


def test_times_are_told_as_people_do() -> None:
    now = time.mktime((2026, 3, 2, 12, 0, 0, 0, 0, -1))
    told = {
        "today, 9:05": (2026, 3, 2, 9, 5, 0),
        "yesterday, 23:59": (2026, 3, 1, 23, 59, 0),
        "28 February": (2026, 2, 28, 8, 0, 0),
        "31 December 2025": (2025, 12, 31, 8, 0, 0),
    }
    for text, then in told.items():
        assert when(time.mktime((*then, 0, 0, -1)), now) == text


def test_equal_names_are_told_apart_by_folder() -> None:
    paths = [Path("/a/flat.lucarne"), Path("/b/flat.lucarne"), Path("/b/loft.lucarne")]
    assert shared_names([RecentProject(p) for p in paths]) == {"flat"}
    assert folder_text(Path("/home/me/work/x.lucarne"), Path("/home/me")) == str(Path("~/work"))


def test_the_status_bar_says_where_the_work_is(make: Make, tmp_path: Path) -> None:
    driver = make(answers=Answers())
    driver.show(room())
    label = driver.window.saved
    assert label.text() == ""
    saved(driver, tmp_path / "room.lucarne")
    assert label.text().startswith("Saved ")
    driver.document.apply(SetFields("stool", {"name": "Other"}))
    assert label.text() == "Not saved"
    keeper = driver.window.files.keeper
    driver.until(lambda: keeper.autosaver.due(time.monotonic()) or label.text().startswith("Auto"))
    driver.window.files.tick()
    driver.until(lambda: label.text().startswith("Autosaved "))
    driver.do("file.save")
    driver.until(lambda: label.text().startswith("Saved "))
