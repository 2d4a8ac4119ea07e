"""The report of a fit: its ball, its numbers, a bar a lamp, and pictures under every lamp."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFormLayout, QLabel, QLineEdit, QSplitter, QVBoxLayout, QWidget

from studio_core.fitting import Fitted
from studio_core.library.lucmat import Kept
from studio_core.shading.lamps import shown_environment
from studio_ui.context import Context
from studio_ui.look.theme import GAP, PANEL_WIDTH, Theme
from studio_ui.material_fit.lamp_bars import LampBars
from studio_ui.material_fit.pictures import FitPictures
from studio_ui.material_fit.words import rows, verdict
from studio_ui.material_view.ball_view import BallView
from studio_ui.material_view.work import Linear, PreviewWork
from studio_ui.panels.panel import Panel, Scroller, heading, note

_BALL = 150  # pixels


class ReportPage(QWidget):
    """Shows one fit; `kept()` is its material by the name that was typed."""

    def __init__(self, context: Context) -> None:
        super().__init__()
        self._context = context
        self.fitted: Fitted | None = None
        self.work = PreviewWork(context)
        self.ball = BallView()
        self.ball.setFixedHeight(_BALL)
        self.ball.resized = self._draw_ball
        self.name = QLineEdit()
        self.name.setAccessibleName("Name of the material")
        self.verdict = QLabel()
        self.verdict.setWordWrap(True)
        self.numbers = QWidget()
        self.notes = QWidget()
        self.bars = LampBars()
        self.pictures = FitPictures(context)
        self.bars.picked = self.pictures.show_lamp
        side = QWidget()
        column = Panel.column_of(side)
        column.setContentsMargins(0, 0, GAP, 0)
        for widget in (self.ball, self.name, self.verdict, self.numbers, self.notes):
            column.addWidget(widget)
        column.addStretch(1)
        area = Scroller()
        area.setWidgetResizable(True)
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        area.setFrameShape(Scroller.Shape.NoFrame)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setWidget(side)
        right = QWidget()
        beside = Panel.column_of(right)
        beside.addWidget(self.pictures, 1)
        self.title = heading("")
        beside.addWidget(self.title)
        beside.addWidget(self.bars)
        split = QSplitter()
        split.setChildrenCollapsible(False)
        split.addWidget(area)
        split.addWidget(right)
        split.setStretchFactor(1, 1)
        split.setSizes([PANEL_WIDTH + 60, 2 * PANEL_WIDTH])
        whole = QVBoxLayout(self)
        whole.setContentsMargins(0, 0, 0, 0)
        whole.addWidget(split)

    def set_theme(self, theme: Theme) -> None:
        """Other colours."""
        for part in (self.ball, self.bars, self.pictures):
            part.set_theme(theme)

    def close_page(self) -> None:
        """Make nothing any more."""
        self.work.close()
        self.pictures.close_pictures()

    def show_fit(self, fitted: Fitted) -> None:
        """Another fit: the lamp held back that is farthest off comes first."""
        self.fitted = fitted
        self.name.setText(fitted.material.name)
        self.verdict.setText(verdict(fitted.figures))
        _refill(self.numbers, QFormLayout())
        form = self.numbers.layout()
        assert isinstance(form, QFormLayout)
        form.setContentsMargins(0, 0, 0, 0)
        form.setRowWrapPolicy(QFormLayout.RowWrapPolicy.WrapLongRows)
        for name, value, tip in rows(fitted.figures):
            label, told = note(name), QLabel(value)
            label.setWordWrap(False)
            told.setWordWrap(True)
            told.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
            told.setFocusPolicy(Qt.FocusPolicy.NoFocus)
            for part in (label, told):
                part.setToolTip(tip)
            form.addRow(label, told)
        column = QVBoxLayout()
        column.setContentsMargins(0, 0, 0, 0)
        _refill(self.notes, column)
        for text in fitted.notes:
            column.addWidget(note(text))
        held = [i for i, lamp in enumerate(fitted.lamps) if lamp.held]
        worst = max(held or range(len(fitted.lamps)), key=lambda i: fitted.lamps[i].whole)
        dots = "; those with a dot were held back" * bool(held)
        self.title.setText(f"Error of every lamp, lowest row first{dots}")
        self.bars.show_lamps(fitted.lamps)
        self.bars.choose(worst)
        self.pictures.show_fit(fitted, worst)
        self._draw_ball()

    def kept(self) -> Kept | None:
        """The material with what the library finds it by."""
        if self.fitted is None:
            return None
        name = self.name.text().strip() or self.fitted.material.name
        return Kept(replace(self.fitted.material, name=name), self.fitted.tags, self.fitted.about)

    def _draw_ball(self) -> None:
        fitted = self.fitted
        if fitted is None:
            return
        environment = shown_environment(self._context.document.scene)
        session = self._context.session

        def done(made: tuple[Linear, bool] | None) -> None:
            if made is None or self.fitted is not fitted:
                return
            pixels, neutral = made
            plain = neutral or environment is None
            gain = (1.0, 1.0, 1.0) if environment is None or neutral else environment.gain()
            self.ball.show_balls(pixels, None, gain, 0.0 if plain else session.exposure, session.tonemap)

        self.work.thumbnail(fitted.material, environment, self.ball.pixels, done)


def _refill(widget: QWidget, layout: QFormLayout | QVBoxLayout) -> None:
    """Another layout, without what was in the old one."""
    old = widget.layout()
    if old is not None:
        for child in widget.findChildren(QWidget):
            child.deleteLater()
        QWidget().setLayout(old)  # which goes with it
    widget.setLayout(layout)


__all__ = ["ReportPage"]
