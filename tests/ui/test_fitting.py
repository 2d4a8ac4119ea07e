"""Narrow windows: nothing is clipped, what matters least is left out."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PySide6.QtCore import QRect
from PySide6.QtWidgets import QLabel, QWidget
from ui_support import Driver

from studio_ui.look.fitting import show_what_fits


class _Wide(QWidget):
    def __init__(self, width: int) -> None:
        super().__init__()
        self.wide = width

    def sizeHint(self):  # type: ignore[no-untyped-def]
        from PySide6.QtCore import QSize

        return QSize(self.wide, 10)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)
@given(st.lists(st.integers(0, 100), max_size=6), st.integers(-50, 500), st.integers(0, 20))
def test_the_most_important_ones_that_fit_are_shown(
    qapp: object, widths: list[int], room: int, gap: int
) -> None:
    parent = QWidget()
    widgets = [_Wide(width) for width in widths]
    for widget in widgets:
        widget.setParent(parent)
    show_what_fits(room, widgets, gap)
    shown = [not widget.isHidden() for widget in widgets]
    assert shown == sorted(shown, reverse=True), "none is shown after one that is left out"
    used = sum(width + gap for width, is_shown in zip(widths, shown, strict=True) if is_shown)
    assert used <= max(room, 0)
    if not all(shown):
        assert used + widths[shown.index(False)] + gap > room


@pytest.mark.parametrize("width", [854, 1067, 1440])
def test_no_text_of_a_bar_is_clipped(width: int, driver: Driver) -> None:
    """A screen of 1280 × 720 at 150 %, one of 1600 × 900, and the usual window."""
    driver.window.resize(width, 600)
    driver.until(lambda: driver.window.width() == width)
    driver.settle()
    driver.window.status.say("The chair stands on the floor")  # the narrowest window tells nothing else
    for bar in (driver.window.status, driver.window.hints):
        labels = [label for label in bar.findChildren(QLabel) if label.isVisible() and label.text()]
        assert labels
        for label in labels:
            assert label.width() >= label.sizeHint().width(), label.text()
        boxes = [label.geometry() for label in labels if label.parentWidget() is bar]
        inside = QRect(0, 0, bar.width(), bar.height())
        for number, box in enumerate(boxes):
            assert inside.contains(box)
            assert not any(box.intersects(other) for other in boxes[number + 1 :])


def test_the_window_fits_a_small_screen(driver: Driver) -> None:
    assert driver.window.minimumSizeHint().width() <= 854
