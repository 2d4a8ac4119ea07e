"""Above a material's form: what it looks like, live while its sliders are dragged."""

from __future__ import annotations

import dataclasses

from PySide6.QtCore import QSignalBlocker, QSize, Qt, QTimer
from PySide6.QtGui import QAction, QResizeEvent, QShowEvent
from PySide6.QtWidgets import QGridLayout, QMenu, QSizePolicy, QToolButton, QVBoxLayout, QWidget

from studio_core.scene.diff import Aspect, Changes
from studio_core.scene.nodes import MaterialId, Scene
from studio_core.shading.lamps import shown_environment
from studio_ui.context import Context, Subscriptions
from studio_ui.forms.fields import Combo
from studio_ui.look.theme import GAP, Theme
from studio_ui.material_view.albedo_plot import AlbedoPlot
from studio_ui.material_view.ball_view import BallView
from studio_ui.material_view.polar_plot import PolarPlot
from studio_ui.material_view.work import PreviewWork, Seen, Wish, light_of
from studio_ui.panels.panel import row

_NARROWEST, _LOWEST = 118, 70  # pixels of a view
_ALONE = "Compare with…"


class MaterialStrip(QWidget):
    """Ball, lobe and albedo side by side, as many in a row as there is room for; the rest below them."""

    def __init__(self, context: Context, work: PreviewWork) -> None:
        super().__init__()
        self._context, self._work = context, work
        self.material: MaterialId | None = None
        self.other: MaterialId | None = None
        self.seen: Seen | None = None
        self._asked: Wish | None = None
        self._offered: list[tuple[MaterialId, str]] = []
        self._columns = 0
        self._views = 0
        self._arranging = False
        self.ball, self.lobe, self.albedo = BallView(), PolarPlot(), AlbedoPlot()
        self.views: dict[str, QWidget] = {"Ball": self.ball, "Lobe": self.lobe, "Albedo": self.albedo}
        self.fold = _fold_button()
        self.compare = Combo()
        self.compare.setAccessibleName("Compare with")
        self.compare.setToolTip("Another material of the scene, in the ball's right half and dashed in plots")
        self.compare.activated.connect(self._compare)
        self.shown: dict[str, QAction] = {}
        self._box = QWidget()
        self._grid = QGridLayout(self._box)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setSpacing(GAP)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(GAP)
        column.setSizeConstraint(QVBoxLayout.SizeConstraint.SetNoConstraint)
        self._header = row(self.fold, self.compare, self._options(), stretch=1)
        column.addLayout(self._header)
        column.addWidget(self._box, 1)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Maximum)
        self.fold.toggled.connect(self._fold)
        self.ball.resized = self.refresh
        self.lobe.turned = self._turn
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self._ask)
        self.subscriptions = Subscriptions()
        self.subscriptions.add(
            context.document.changed.connect(self._edited),
            context.editing.settled.connect(self.refresh),
            context.session.displayed.connect(self._show_balls),
            context.warmed.connect(self.refresh),
        )
        self._arrange()

    def close_strip(self) -> None:
        """Stop listening."""
        self.subscriptions.close()

    def set_theme(self, theme: Theme) -> None:
        """Other colours."""
        for view in (self.ball, self.lobe, self.albedo):
            view.set_theme(theme)

    def show_material(self, material: MaterialId | None) -> None:
        """That material as it is now; none is a scene without materials."""
        self.material = material
        self._offer()
        self.refresh()

    def compare_with(self, other: MaterialId | None) -> None:
        """Show another material beside it; None for nothing."""
        self.other = other
        self._offer()
        self.refresh()

    def refresh(self) -> None:
        """What is there is to be seen as it is now."""
        if self.isVisible() and not self._soon.isActive():
            self._soon.start(0)

    # what is asked and shown

    def wish(self) -> Wish | None:
        """What the scene and the controls ask for now."""
        materials = self._context.document.scene.materials
        material = materials.get(self.material or "")
        if material is None or not self._box.isVisible():
            return None
        other = materials.get(self.other or "") if self.other != self.material else None
        busy = self._context.editing.busy
        environment = shown_environment(self._context.document.scene)
        if busy and self._asked is not None and environment is not None:
            environment = self._asked.environment  # light that is being turned is followed at its rest
        return Wish(
            material,
            other,
            light_of(environment),
            self.ball.pixels if self._on("Ball") else 0,
            self.lobe.incidence,
            self.lobe.cosine,
            self._on("Lobe"),
            self._on("Albedo"),
            quick=busy and self._on("Albedo"),
            environment=environment,
        )

    def _ask(self) -> None:
        wish = self.wish()
        if wish is None or not self.isVisible() or (wish == self._asked and self.seen is not None):
            return
        if wish.albedo and not wish.quick:
            rough = dataclasses.replace(wish, quick=True)
            wish = wish if self._asked == rough else rough  # exact albedo comes after all that is quick
        self._asked = wish
        self._work.see(wish, self._see)

    def _see(self, seen: Seen | None) -> None:
        self.seen = seen
        other = seen.other if seen is not None else None
        own = seen.own if seen is not None else None
        self.lobe.show_lobe(own.lobe if own else None, other.lobe if other else None)
        self.albedo.incidence = self.lobe.incidence
        self.albedo.show_albedo(own.albedo if own else None, other.albedo if other else None)
        self._show_balls()
        if seen is not None and seen.wish.quick:
            self.refresh()  # at rest it is made exact

    def _show_balls(self) -> None:
        seen, session = self.seen, self._context.session
        if seen is None or seen.own.ball is None:
            self.ball.show_balls(None, None, (1.0, 1.0, 1.0), 0.0, "srgb")
            return
        environment = shown_environment(self._context.document.scene)
        light = environment if not seen.neutral else None
        self.ball.show_balls(
            seen.own.ball,
            seen.other.ball if seen.other is not None else None,
            light.gain() if light is not None else (1.0, 1.0, 1.0),
            session.exposure if light is not None else 0.0,
            session.tonemap,
        )
        where = f"In the light of {light.name}" if light is not None else "In a neutral light"
        halves = f"\nLeft {seen.wish.material.name}, right {seen.wish.other.name}" if seen.wish.other else ""
        self.ball.setToolTip(f"{where}, as bright as the view{halves}")

    def _edited(self, before: Scene, after: Scene, changes: Changes) -> None:
        if changes.aspects & (Aspect.LIGHT | Aspect.GAIN):
            self._show_balls()
        if changes.materials or changes.aspects & (Aspect.LIGHT | Aspect.STRUCTURE):
            self.refresh()

    def _turn(self, degrees: float) -> None:
        self.albedo.incidence = degrees
        self.albedo.update()
        self.refresh()

    # what is shown

    def _on(self, name: str) -> bool:
        return self.shown[name].isChecked()

    def _options(self) -> QToolButton:
        button = QToolButton()
        button.setText("Show")
        button.setToolTip("What is shown of the material, and how")
        button.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(button)
        menu.setToolTipsVisible(True)
        for name in self.views:
            self.shown[name] = action = menu.addAction(name)
            action.setCheckable(True)
            action.setChecked(name != "Albedo")
            action.toggled.connect(self._arrange_again)
        menu.addSeparator()
        for name, tip, told in (
            ("Logarithmic lobe", "Four decades from the middle to the edge", self._log),
            ("Lobe with cosine", "Light that is given, rather than the ratio f alone", self._cosine),
            ("Luminance alone", "One curve instead of red, green and blue", self._luminance),
        ):
            self.shown[name] = action = menu.addAction(name)
            action.setCheckable(True)
            action.setToolTip(tip)
            action.setChecked(name == "Lobe with cosine")
            action.toggled.connect(told)
        button.setMenu(menu)
        return button

    def _log(self, on: bool) -> None:
        self.lobe.logarithmic = on
        self.lobe.update()

    def _cosine(self, on: bool) -> None:
        self.lobe.cosine = on
        self.refresh()

    def _luminance(self, on: bool) -> None:
        for plot in (self.lobe, self.albedo):
            plot.luminance = on
            plot.update()

    def _fold(self, open_: bool) -> None:
        self.fold.setArrowType(Qt.ArrowType.DownArrow if open_ else Qt.ArrowType.RightArrow)
        self._arrange_again()

    def _arrange_again(self) -> None:
        self._columns = 0
        self._arrange()
        self.updateGeometry()
        self.refresh()

    def _arrange(self) -> None:
        """As many views side by side as there is room for."""
        if self._arranging:
            return  # what is laid out anew may change the width: it is looked at again below
        self._arranging = True
        views = [view for name, view in self.views.items() if self._on(name)]
        for _ in range(2):
            columns = max(min(len(views), (self.width() + GAP) // (_NARROWEST + GAP)), 1)
            if columns == self._columns:
                break
            self._columns = columns
            self._place(views, columns)
            self.updateGeometry()
        self._views = len(views)
        rows = -(-self._views // self._columns)
        room = self.height() - self._header.sizeHint().height() - GAP * rows
        self._box.setVisible(bool(views) and self.fold.isChecked() and room >= _LOWEST * rows)
        self._arranging = False

    def _place(self, views: list[QWidget], columns: int) -> None:
        for view in self.views.values():
            self._grid.removeWidget(view)
            view.setVisible(view in views)
        for index, view in enumerate(views):
            self._grid.addWidget(view, index // columns, index % columns)
        for column in range(len(self.views)):  # plots are wider than high
            plot = column < columns and bool(views) and views[column] is not self.ball
            self._grid.setColumnStretch(column, 6 if plot else 5 if column < columns else 0)

    def _offer(self) -> None:
        """Materials that it can be compared with."""
        scene = self._context.document.scene
        if self.other is not None and self.other not in scene.materials:
            self.other = None
        made = [(one.id, one.name) for one in scene.materials.values() if one.id != self.material]
        if made != self._offered or self.compare.count() != len(made) + 1:
            self._offered = made
            with QSignalBlocker(self.compare):
                self.compare.clear()
                self.compare.addItems([_ALONE, *(name for _, name in made)])
        ids = [material for material, _ in made]
        at = ids.index(self.other) + 1 if self.other in ids else 0
        with QSignalBlocker(self.compare):
            self.compare.setCurrentIndex(at)
        self.compare.setEnabled(bool(made))

    def _compare(self, index: int) -> None:
        self.compare_with(self._offered[index - 1][0] if index > 0 else None)

    def sizeHint(self) -> QSize:
        """As high as views about as high as wide; with none of them, its header."""
        found = super().sizeHint()
        rows = -(-self._views // max(self._columns, 1)) if self.fold.isChecked() else 0
        each = (self.width() - GAP * (self._columns - 1)) // max(self._columns, 1)
        height = self._header.sizeHint().height() + rows * (min(max(each, 100), 150) + GAP)
        return QSize(found.width(), height)

    def minimumSizeHint(self) -> QSize:
        """Its header, one view wide: where there is no room for views they go."""
        return QSize(_NARROWEST, self._header.sizeHint().height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Another number of views side by side."""
        super().resizeEvent(event)
        self._arrange()

    def showEvent(self, event: QShowEvent) -> None:
        """Only now is anything made."""
        super().showEvent(event)
        self.refresh()


def _fold_button() -> QToolButton:
    button = QToolButton()
    button.setToolTip("Fold the views away")
    button.setAccessibleName("Views of the material")
    button.setCheckable(True)
    button.setChecked(True)
    button.setAutoRaise(True)
    button.setProperty("role", "fold")
    button.setArrowType(Qt.ArrowType.DownArrow)
    return button


__all__ = ["MaterialStrip"]
