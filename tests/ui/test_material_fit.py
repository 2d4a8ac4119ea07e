"""Material from photographs: what is asked, how it goes, what the report shows, what becomes of it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import fit_support
import numpy as np
import pytest
from fit_support import AZIMUTHS, DARKER, FITTER, PLACES, Pattern
from names import nameless
from PySide6.QtCore import QPointF, Qt
from ui_support import Driver, Make, move_mouse, room

from studio_core.errors import Cancelled, InputError
from studio_core.fitting import CHECKERBOARD, NONE, FitRequest, Quality
from studio_core.library.lucmat import read
from studio_core.library.presets import PRESETS
from studio_core.library.shelf import Shelf
from studio_core.shading.scheduler import InlineExecutor
from studio_plugins.brdfs import plugin as brdfs
from studio_plugins.meshes import plugin as meshes
from studio_ui.files.drop_intent import intent_of
from studio_ui.look.theme import LIGHT
from studio_ui.material_fit.dialog import FitDialog
from studio_ui.material_fit.heat import LEAST, MOST, heat
from studio_ui.material_fit.lamp_tool import FURTHEST
from studio_ui.material_fit.pictures import COMPARE, DIFFERENCE, RELIGHT
from studio_ui.material_fit.words import amount, lamp_place, percent, rows, verdict


@pytest.fixture
def window(make: Make) -> Iterator[Driver]:
    """The small room, and a fitter that answers at once."""
    FITTER.requests.clear()
    FITTER.error = None
    made = make(plugins=(brdfs, meshes, fit_support.plugin))
    made.show(room())
    made.window.fitting.executor = InlineExecutor()
    yield made
    FITTER.error = None


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "Linen"
    made.mkdir()
    (made / "az-30.png").write_bytes(b"")
    return made


def opened(window: Driver) -> FitDialog:
    window.do("file.fit_material")
    dialog = window.window.fitting.dialog
    assert dialog is not None
    assert dialog.isVisible()
    return dialog


@pytest.fixture
def report(window: Driver, folder: Path) -> FitDialog:
    """The dialog with a report."""
    dialog = opened(window)
    dialog.order.take(folder)
    dialog.fit()
    window.until(lambda: dialog.report.fitted is not None)
    quiet(window, dialog)
    return dialog


def quiet(window: Driver, dialog: FitDialog) -> None:
    window.until(lambda: not dialog.report.pictures.asked.busy)


def test_the_order_says_what_is_chosen(window: Driver, folder: Path, tmp_path: Path) -> None:
    dialog = opened(window)
    assert dialog.order.request() is None
    assert not dialog.fit_button.isEnabled()
    window.answers.target = folder
    dialog.order.choose()
    assert dialog.fit_button.isEnabled()
    assert dialog.order.request() == FitRequest(folder, held=CHECKERBOARD)
    order = dialog.order
    order.sample.setCurrentIndex(1)
    order.near.setChecked(True)
    order.distance.setValue(2.5)
    order.size_.setCurrentText("64 × 64")
    order.held.setCurrentIndex(order.held.count() - 1)
    window.answers.files = [tmp_path / "lamps.lp"]
    order.lamps.setCurrentIndex(1)
    order.lamps.activated.emit(1)
    assert order.request() == FitRequest(
        folder, lamps=tmp_path / "lamps.lp", flat=True, distance=2.5, size=64, held=NONE
    )
    assert not order.whole.isEnabled()
    order.lamps.setCurrentIndex(0)
    request = order.request()
    assert request is not None
    assert request.lamps is None
    assert nameless(dialog) == []


def test_without_a_list_names_tell(window: Driver) -> None:
    order = opened(window).order
    window.answers.files = []
    order.lamps.setCurrentIndex(1)
    order.lamps.activated.emit(1)
    assert order.lamps.currentIndex() == 0


def test_the_report(window: Driver, report: FitDialog) -> None:
    assert FITTER.requests[0].folder.name == "Linen"
    page = report.report
    assert report.pages.currentIndex() == 1
    assert page.name.text() == "Linen"
    assert "close" in page.verdict.text() or "near" in page.verdict.text()
    assert page.fitted is not None
    assert page.fitted.lamps[page.bars.now].held, "one that was not seen comes first"
    assert page.pictures.lamp == page.bars.now
    assert "held back" in page.pictures.told.text()
    window.until(lambda: page.ball.image is not None)
    assert nameless(report) == []
    report.set_theme(LIGHT)
    assert not report.grab().isNull()


def test_bars_choose_lamps(window: Driver, report: FitDialog) -> None:
    bars, pictures = report.report.bars, report.report.pictures
    assert [PLACES[i][0] for i in bars.order] == list(AZIMUTHS) * 2
    high, low = bars.bar(1), bars.bar(0)
    assert high.height() > low.height()
    at = high.center().toPoint()
    window.bot.mouseClick(bars, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, at)
    assert (bars.now, pictures.lamp) == (1, 1)
    window.bot.keyClick(bars, Qt.Key.Key_Right)
    assert (bars.now, pictures.lamp) == (2, 2)
    window.bot.keyClick(bars, Qt.Key.Key_End)
    assert pictures.lamp == len(PLACES) - 1
    assert not bars.grab().isNull()
    bars.show_lamps(())
    assert bars.at(50.0) == -1
    window.bot.keyClick(bars, Qt.Key.Key_Right)
    assert bars.now == -1
    assert not bars.grab().isNull()


def test_photograph_against_reconstruction(window: Driver, report: FitDialog) -> None:
    pictures = report.report.pictures
    shown = pictures.view.shown
    assert shown is not None
    assert shown.before is not None
    assert np.allclose(shown.pixels, DARKER * shown.before)
    assert pictures.view.sides == ("photograph", "reconstruction")


def test_the_error_map(window: Driver, report: FitDialog) -> None:
    pictures = report.report.pictures
    pictures.buttons[DIFFERENCE].click()
    quiet(window, report)
    shown = pictures.view.shown
    assert shown is not None
    assert shown.pixels.dtype == np.uint8
    assert shown.before is None
    assert pictures.view.exposure == 0
    bright, dark, nothing = shown.pixels[4, 5].sum(), shown.pixels[0, 1].sum(), shown.pixels[0, 0]
    assert bright > dark
    assert tuple(nothing) == tuple(heat(np.full((1, 1), np.nan, np.float32))[0, 0])
    pictures.view.hovered.emit((5.5, 4.5))
    pattern = Pattern(FITTER.requests[0])
    seen = pattern.photograph(pictures.lamp)
    usual = np.sqrt((seen[pattern.trusted(pictures.lamp)].astype(float) ** 2).sum(axis=-1).mean())
    off = (1 - DARKER) * float(np.linalg.norm(seen[4, 5])) / usual
    assert pictures.told.text() == f"Here it is off by {percent(off)}"
    pictures.view.hovered.emit((0.5, 0.5))
    assert "nothing counts" in pictures.told.text()
    pictures.view.hovered.emit(None)
    assert "held back" in pictures.told.text()
    pictures.show_lamp(0)
    quiet(window, report)
    assert pictures.mode == DIFFERENCE
    assert pictures.view.shown is not None
    assert (pictures.view.shown.pixels[4, 5] == heat(np.zeros((1, 1), np.float32))[0, 0]).all()


def test_a_lamp_of_ones_own(window: Driver, report: FitDialog) -> None:
    pictures = report.report.pictures
    pictures.buttons[RELIGHT].click()
    quiet(window, report)
    view = pictures.view
    fitted = report.report.fitted
    assert fitted is not None

    def shows(azimuth: float, height: float) -> bool:
        assert view.shown is not None
        return bool(np.allclose(view.shown.pixels, fitted.relit(azimuth, height), atol=1e-6))

    start = pictures.tool.place
    assert shows(*start)
    to = view.to_widget(0.75 * 6, 0.25 * 5).toPoint()
    middle = view.to_widget(3, 2.5).toPoint()
    window.bot.mousePress(view, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, middle)
    move_mouse(view, to)
    quiet(window, report)
    azimuth, height = pictures.tool.place
    assert azimuth == pytest.approx(40, abs=1.5)
    assert height == pytest.approx(40, abs=1.5)
    assert shows(azimuth, height)
    window.bot.keyClick(view, Qt.Key.Key_Escape)
    quiet(window, report)
    assert pictures.tool.place == start
    window.bot.mouseRelease(view, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, to)
    pictures.azimuth.spin.setValue(-25)
    pictures.height_.spin.setValue(10)
    quiet(window, report)
    assert pictures.tool.place == (-25, 10)
    assert shows(-25, 10)
    assert "25° left, 10° up" in pictures.told.text()
    report.report.bars.picked(2)
    assert pictures.mode == COMPARE


def test_exposure_is_for_pictures_alone(window: Driver, report: FitDialog) -> None:
    pictures = report.report.pictures
    pictures.exposure_field.spin.setValue(2)
    assert pictures.view.exposure == 2
    pictures.show_mode(DIFFERENCE)
    quiet(window, report)
    assert pictures.view.exposure == 0
    pictures.show_mode(COMPARE)
    quiet(window, report)
    assert pictures.view.exposure == 2


def test_into_the_scene(window: Driver, report: FitDialog) -> None:
    report.report.name.setText("Linen, natural")
    report.add_button.click()
    window.idle()
    assert [m.name for m in window.document.scene.materials.values()][-1] == "Linen, natural"
    assert window.labels()[-1] == "Add Linen, natural"
    panel = window.window.panels["materials"]
    assert window.document.scene.material(panel.material).name == "Linen, natural"


def test_for_all_projects_and_as_files(window: Driver, report: FitDialog, tmp_path: Path) -> None:
    window.window.library.shelf = Shelf(tmp_path / "mine", PRESETS)
    report.keep_button.click()
    window.idle()
    (path,) = (tmp_path / "mine").glob("*.lucmat")
    kept = read(path)
    assert (kept.name, kept.tags, kept.about) == ("Linen", ("captured",), "Captured by nobody")
    window.answers.target = tmp_path / "other.lucmat"
    report.save_button.click()
    window.idle()
    assert read(tmp_path / "other.lucmat").name == "Linen"
    window.answers.target = tmp_path / "report.json"
    report.report_button.click()
    window.idle()
    told = json.loads((tmp_path / "report.json").read_text("utf-8"))
    assert len(told["lamps"]) == len(PLACES)
    window.answers.target = tmp_path / "nowhere" / "report.json"
    report.report_button.click()
    window.until(lambda: bool(window.problems()))
    assert "report.json cannot be written" in window.problems()[0]


def test_errors_are_one_sentence_and_the_order_stays(window: Driver, folder: Path) -> None:
    dialog = opened(window)
    dialog.order.take(folder)
    FITTER.error = InputError("az-30.png tells no light")
    dialog.fit()
    window.until(lambda: not dialog.busy)
    assert dialog.told.text() == "az-30.png tells no light."
    assert dialog.told.property("role") == "problem"
    assert dialog.pages.currentIndex() == 0
    FITTER.error = Cancelled("fit")
    dialog.fit()
    window.until(lambda: not dialog.busy)
    assert dialog.told.text() == "Stopped."
    FITTER.error = None
    dialog.fit()
    window.until(lambda: dialog.pages.currentIndex() == 1)
    dialog.again_button.click()
    assert dialog.order.request() is not None
    assert dialog.order.isVisible()


def test_closed_while_it_works_it_comes_back(window: Driver, folder: Path) -> None:
    dialog = opened(window)
    dialog.order.take(folder)
    dialog.fit()  # has ended, but the window does not know yet
    assert dialog.busy
    assert dialog.close_button.text() == "Go on in the background"
    dialog.take(folder.parent)
    assert dialog.order.folder.text() == str(folder), "an order at work is not changed"
    dialog.close_button.click()
    assert not dialog.isVisible()
    window.until(lambda: dialog.isVisible() and dialog.pages.currentIndex() == 1)


def test_without_a_fitter(driver: Driver, folder: Path) -> None:
    driver.window.fitting.executor = InlineExecutor()
    dialog = opened(driver)
    dialog.order.take(folder)
    dialog.fit()
    driver.until(lambda: not dialog.busy)
    assert "no plugin" in dialog.told.text()


def test_a_folder_is_dropped(window: Driver, folder: Path, tmp_path: Path) -> None:
    meant = intent_of([folder], ())
    assert meant
    assert meant.told(here=False, options=False) == "Make a material of the photographs in Linen"
    assert intent_of([tmp_path], ()).samples == tmp_path, "photographs lie in a folder in it"
    window.window.take_files([folder])
    dialog = window.window.fitting.dialog
    assert dialog is not None
    assert dialog.order.folder.text() == str(folder)
    assert FITTER.requests == [], "nothing begins by itself"


def test_the_panel_of_materials_offers_it(window: Driver) -> None:
    texts = [action.text() for action in window.window.panels["materials"].new.actions()]
    assert "Material from photographs…" in texts


def test_words(tmp_path: Path) -> None:
    assert [percent(x) for x in (0.0051, 0.12, 1e-7, 0.000104)] == [
        "0.51 %",
        "12 %",
        "under 0.001 %",
        "0.01 %",
    ]
    assert [amount(x) for x in (12, 6_144, 2_500_000)] == ["12 bytes", "6 kB", "2.5 MB"]
    assert [lamp_place(*x) for x in ((0, 0), (-30, 0), (10, -20))] == [
        "at the camera",
        "30° left",
        "10° right, 20° down",
    ]
    figures = Pattern(FitRequest(tmp_path)).figures
    told = {name: value for name, value, _ in rows(figures)}
    assert told["Lamps not seen"] == "1 %"
    assert told["Told by the lamps"] == "3 of 4"
    said = {x: verdict(replace(figures, unseen=Quality(x, x, 0.3))) for x in (0.001, 0.005, 0.03, 0.2)}
    assert len(set(said.values())) == 4
    assert "highlights" in said[0.03]
    assert "hardly helps" in verdict(replace(figures, unseen=Quality(0.3, 0.3, 0.3)))
    assert "not known" in verdict(replace(figures, unseen=None))


def test_colours_of_errors_go_from_dark_to_bright() -> None:
    errors = np.geomspace(LEAST / 3, 3 * MOST, 50).astype(np.float32)[None]
    luminance = heat(errors)[0].astype(float) @ np.array([0.2126, 0.7152, 0.0722])
    assert (np.diff(luminance) >= 0).all()
    assert luminance[-1] > 230 > 5 > luminance[0]
    assert (heat(np.zeros((1, 1), np.float32)) == heat(errors)[:, :1]).all()


def test_the_lamp_stays_within_reach(window: Driver, report: FitDialog) -> None:
    pictures = report.report.pictures
    pictures.show_mode(RELIGHT)
    quiet(window, report)
    tool, view = pictures.tool, pictures.view
    tool.press(view, QPointF(-4000, -4000), Qt.KeyboardModifier.NoModifier)
    assert tool.place == (-FURTHEST, FURTHEST)
