"""Why: what a stroke was found to mean, how well that explains it, and what else it could mean."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QIcon, QImage, QPalette, QPixmap
from PySide6.QtWidgets import QGridLayout, QLabel, QSizePolicy, QToolButton, QVBoxLayout, QWidget

from studio_core.errors import EditError, PluginError
from studio_core.kernels.tonemap import tonemap
from studio_core.params import defaults, param_infos
from studio_core.registry import PluginHost
from studio_core.scene.nodes import MeshObject, Scene
from studio_core.shading.artifacts import Picture
from studio_core.strokes.solution import Finding, Reason, Solution
from studio_core.strokes.stroke import AUTOMATIC, Stroke
from studio_ui.forms.colour_button import to_display
from studio_ui.look.role import set_role
from studio_ui.look.theme import GAP
from studio_ui.panels.panel import clear, note
from studio_ui.strokes.sketches import HEIGHT, WIDTH, Sketches
from studio_ui.strokes.words import (
    SEPARATOR,
    changed,
    explained,
    nothing_found,
    number,
    place,
    sentence,
    silence,
)

_CARDS = 4
"""Reasons that are shown as pictures, the chosen one among them."""
_COLUMNS = 2
_NOTHING = 0.01
"""Of a stroke: what explains no more than that is no reason."""


class Why(QWidget):
    """`taken(finding, reason)` when somebody wants another reason."""

    def __init__(self, host: PluginHost, sketches: Sketches) -> None:
        super().__init__()
        self.taken: Callable[[Finding, Reason], object] = lambda finding, reason: None
        self.told = _line("")
        self.lines: list[QLabel] = []
        self.cards: list[QToolButton] = []
        self._host, self._sketches = host, sketches
        self._shown: tuple[object, ...] = ()
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(GAP)
        column.addWidget(self.told)
        self._rest = QVBoxLayout()
        self._rest.setSpacing(GAP)
        column.addLayout(self._rest)

    def say(self, text: str, *, problem: bool = False) -> None:
        """A sentence instead of findings."""
        self._empty()
        self.told.setText(text)
        set_role(self.told, "problem" if problem else "dim")

    def show_findings(
        self, scene: Scene, stroke: Stroke, findings: tuple[Finding, ...], solution: Solution
    ) -> None:
        """What a stroke of a scene was found to mean."""
        if self._shown and all(a is b for a, b in zip(self._shown, (scene, stroke, solution), strict=True)):
            return
        self._empty()
        self._shown = (scene, stroke, solution)
        self.told.setVisible(not findings and not solution.notes)
        self.told.setText(nothing_found(stroke))
        set_role(self.told, "dim")
        for rivals in together(findings):
            finding, chosen = held(stroke, rivals)
            self._add_line(scene, finding, chosen)
            close = max(one.close for one in rivals)
            if chosen.meaning or close:
                self._add_cards(scene, stroke, rivals)
            silent = silence(finding)
            if silent:
                self._rest.addWidget(note(silent))
            if close:
                others = "One other reason is" if close == 1 else f"{close} other reasons are"
                self._rest.addWidget(note(f"{others} nearly as good"))
        for text in solution.notes:
            self._rest.addWidget(note(text))

    def _add_line(self, scene: Scene, finding: Finding, chosen: Reason) -> None:
        where, change = place(scene, finding.node, finding.slot), self._change(scene, finding, chosen)
        told, shown = (change(how) for how in (number, swatch))
        line = _line(sentence(html.escape(where), chosen, shown))
        line.setTextFormat(Qt.TextFormat.RichText)
        line.setAccessibleName(sentence(where, chosen, told))
        line.setToolTip(told)
        self.lines.append(line)
        self._rest.addWidget(line)

    def _empty(self) -> None:
        self._sketches.forget()
        self._shown = ()
        self.cards, self.lines = [], []
        self.told.show()
        while self._rest.count():
            item = self._rest.takeAt(0)
            layout, widget = (item.layout(), item.widget()) if item is not None else (None, None)
            if isinstance(layout, QGridLayout):
                clear(layout)  # type: ignore[arg-type]
            if widget is not None:
                widget.hide()
                widget.deleteLater()

    def _add_cards(self, scene: Scene, stroke: Stroke, rivals: Sequence[Finding]) -> None:
        current = held(stroke, rivals)[1]
        shown = worth_showing(rivals, current)
        if len(shown) < 2:
            return
        grid = QGridLayout()
        grid.setSpacing(GAP)
        self._rest.addLayout(grid)
        for at, (finding, reason) in enumerate(shown):
            name = short_name(scene, rivals, finding, reason)
            card = self._card(scene, finding, reason, name, chosen=reason is current)
            grid.addWidget(card, at // _COLUMNS, at % _COLUMNS)
            self.cards.append(card)
            self._sketches.want(scene, stroke.id, reason, partial(self._drawn, card))

    def _card(
        self, scene: Scene, finding: Finding, reason: Reason, short: str, *, chosen: bool
    ) -> QToolButton:
        card = QToolButton()
        card.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextUnderIcon)
        card.setIconSize(QSize(WIDTH, HEIGHT))
        card.setCheckable(True)
        card.setChecked(chosen)
        card.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        blank = QPixmap(WIDTH, HEIGHT)
        blank.fill(self.palette().color(QPalette.ColorRole.Base))
        card.setIcon(QIcon(blank))
        name, where = reason.meaning or "no change", place(scene, finding.node, finding.slot)
        share = f"  {100 * min(max(reason.explained, 0.0), 1.0):.0f} %"
        room = WIDTH - card.fontMetrics().horizontalAdvance(f"{share}  ")  # Qt leaves a space at each end
        card.setText(card.fontMetrics().elidedText(short, Qt.TextElideMode.ElideRight, room) + share)
        name = f"{name} of {where}" if finding.rivals else name
        change = self._change(scene, finding, reason)(number)
        tip = "\n".join(text for text in (where * finding.rivals, change, explained(reason)) if text)
        card.setToolTip(f"{tip}\nThis is it now" if chosen else f"{tip}\nClick to take it instead")
        card.setAccessibleName(f"Explain by {name}")
        card.clicked.connect(lambda: card.setChecked(chosen) if chosen else self.taken(finding, reason))
        return card

    def _drawn(self, card: QToolButton, picture: Picture) -> None:
        if card not in self.cards:
            return
        session = self._sketches.session
        pixels = np.ascontiguousarray(tonemap(picture.linear, session.exposure, session.tonemap))
        height, width = pixels.shape[:2]
        image = QImage(pixels.data, width, height, 3 * width, QImage.Format.Format_RGB888)
        card.setIcon(QIcon(QPixmap.fromImage(image.copy())))

    def _change(
        self, scene: Scene, finding: Finding, reason: Reason
    ) -> Callable[[Callable[[object], str]], str]:
        """Which parameters differ, in the words of the material's own form; values as one shows them."""
        try:
            after = reason.edit(scene)
            node = after.nodes[finding.node]
            if not isinstance(node, MeshObject):
                return _nothing
            material = after.material(node.materials[finding.slot])
            params = self._host.brdf(material.model).Params
        except (EditError, PluginError, KeyError, IndexError):
            return _nothing
        before: Mapping[str, object] = {**defaults(params), **material.values}
        labels = {name: info.label for name, info in param_infos(params).items()}
        return partial(changed, before, labels, reason)


def swatch(value: object) -> str:
    """A colour as a patch of it; numbers as they are."""
    if not isinstance(value, tuple):
        return number(value)
    return f'<span style="background-color: {to_display(value).name()}">{"&nbsp;" * 5}</span>'


def _nothing(shown: Callable[[object], str]) -> str:
    return ""


def _line(text: str) -> QLabel:
    made = QLabel(text)
    made.setWordWrap(True)
    made.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    return made


def together(findings: Sequence[Finding]) -> list[list[Finding]]:
    """Findings of which each holds, alone; and those of which one alone holds, together."""
    rivals = [finding for finding in findings if finding.rivals]
    others = [[finding] for finding in findings if not finding.rivals]
    return [rivals, *others] if rivals else others


def held(stroke: Stroke, rivals: Sequence[Finding]) -> tuple[Finding, Reason]:
    """What a stroke means now: what was taken, or the best."""
    wanted = ((stroke.through, stroke.through_slot), (stroke.through, -1))
    finding = next((one for one in rivals if (one.node, one.slot) in wanted), rivals[0])
    return finding, chosen_reason(stroke, finding)


def short_name(scene: Scene, rivals: Sequence[Finding], finding: Finding, reason: Reason) -> str:
    """Of a card: what changes, of several objects which one does, and of one twice both."""
    what = reason.meaning or "no change"
    if len(rivals) == 1:
        return what
    where = place(scene, finding.node, finding.slot).split(SEPARATOR)[-1]
    return where if reason is finding.reasons[0] else f"{where}, {what}"


def worth_showing(rivals: Sequence[Finding], current: Reason) -> list[tuple[Finding, Reason]]:
    """Reasons that explain something, to change nothing, and the one that holds now; a few, best first."""
    made = [
        (finding, reason)
        for finding in rivals
        for reason in finding.reasons
        if not reason.meaning or reason.explained > _NOTHING or reason is current
    ]
    if len(rivals) > 1:
        made.sort(key=lambda one: one[1].score)
    shown = made[:_CARDS]
    return shown if any(reason is current for _, reason in shown) else [
        *shown[:-1], *(one for one in made if one[1] is current)
    ]  # fmt: skip


def chosen_reason(stroke: Stroke, finding: Finding) -> Reason:
    """The one that the stroke means now: what was taken, or the best."""
    return next(
        (
            reason
            for reason in finding.reasons
            if stroke.meaning not in ("", AUTOMATIC, None) and reason.meaning == stroke.meaning
        ),
        finding.reasons[0],
    )


__all__ = ["Why", "chosen_reason", "swatch", "worth_showing"]
