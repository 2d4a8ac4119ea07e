"""Tags to click: as many as two rows hold, the rest behind *More*; only those that still lead somewhere."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from PySide6.QtCore import QEvent, QSize, Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QSizePolicy, QToolButton, QWidget

from studio_core.library.shelf import Entry, counted, folded

_GAP, _ROWS = 3, 2


class TagBar(QWidget):
    """`changed()` when the hand chose other tags; `chosen` are those that a material must have."""

    def __init__(self) -> None:
        super().__init__()
        self.changed: Callable[[], object] = lambda: None
        self.chosen: tuple[str, ...] = ()
        self._counts: dict[str, int] = {}
        self._chips: dict[str, QToolButton] = {}
        self._more = self._chip("More…")
        self._more.setToolTip("All tags")
        self._more.toggled.connect(self._unfold)
        self.setAccessibleName("Tags")
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    @property
    def shown(self) -> list[str]:
        """The tags that can be clicked now, in their order."""
        return [tag for tag, chip in self._chips.items() if not chip.isHidden()]

    def show_tags(self, counts: Mapping[str, int]) -> None:
        """How many of the materials that are found have which tag; chosen tags stay in any case."""
        wanted = {tag: counts.get(tag, 0) for tag in self.chosen}
        wanted.update({tag: count for tag, count in counts.items() if tag not in wanted})
        if wanted == self._counts and list(wanted) == list(self._counts):
            return
        self._counts = wanted
        for tag in [tag for tag in self._chips if tag not in wanted]:
            chip = self._chips.pop(tag)
            chip.hide()
            chip.deleteLater()
        for tag in wanted:
            if tag not in self._chips:
                chip = self._chips[tag] = self._chip(tag)
                chip.clicked.connect(lambda checked, tag=tag: self._click(tag, checked))
        self._chips = {tag: self._chips[tag] for tag in wanted}
        for tag, chip in self._chips.items():
            chip.setChecked(tag in self.chosen)
            chip.setToolTip(f"{wanted[tag]} with this tag")
        self._place()

    def clear(self) -> None:
        """No tag is needed, without telling."""
        self.chosen = ()
        for chip in self._chips.values():
            chip.setChecked(False)

    def choose(self, tag: str) -> None:
        """As a click does."""
        self._click(tag, tag not in self.chosen)

    def minimumSizeHint(self) -> QSize:
        """It fits into any width."""
        return QSize(60, self.height())

    def sizeHint(self) -> QSize:
        """As high as its rows."""
        return QSize(200, self.height())

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Other rows."""
        self._place()

    def changeEvent(self, event: QEvent) -> None:
        """Another font, another theme."""
        super().changeEvent(event)
        if event.type() in (QEvent.Type.FontChange, QEvent.Type.StyleChange):
            self._place()

    def _click(self, tag: str, on: bool) -> None:
        others = tuple(one for one in self.chosen if one != tag)
        self.chosen = (*others, tag) if on else others
        self.changed()

    def _unfold(self, on: bool) -> None:
        self._more.setText("Fewer" if on else "More…")
        self._more.setToolTip("The commonest tags" if on else "All tags")
        self._place()

    def _chip(self, text: str) -> QToolButton:
        made = QToolButton(self)
        made.setText(text)
        made.setCheckable(True)
        made.setProperty("role", "chip")
        made.setAccessibleName(f"Tag {text}" if text != "More…" else "All tags")
        made.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        return made

    def _place(self) -> None:
        """Rows from the left; where two do not hold all, *More* ends the second."""
        width, more = self.width(), self._more.sizeHint().width()
        high = self._more.sizeHint().height()
        chips = list(self._chips.values())
        sizes = [min(chip.sizeHint().width(), width) for chip in chips]
        places = _rows(sizes, width)
        fits = not places or places[-1][1] < _ROWS
        if not fits and not self._more.isChecked():
            room = [place for place in places if place[1] < _ROWS]
            while (
                room and room[-1][1] == _ROWS - 1 and room[-1][0] + sizes[len(room) - 1] + _GAP + more > width
            ):
                room.pop()
            shown = room
        else:
            shown = places
        for number, chip in enumerate(chips):
            chip.setVisible(number < len(shown))
            if number < len(shown):
                x, row = shown[number]
                chip.setGeometry(x, row * (high + _GAP), sizes[number], high)
        self._more.setVisible(not fits)
        rows = shown[-1][1] + 1 if shown else 0
        if not fits:
            x, row = shown[-1] if shown else (0, 0)
            x += sizes[len(shown) - 1] + _GAP if shown else 0
            if x + more > width:
                x, row = 0, row + 1
            self._more.setGeometry(x, row * (high + _GAP), more, high)
            rows = max(rows, row + 1)
        self.setFixedHeight(max(rows * (high + _GAP) - _GAP, 0))


def _rows(sizes: list[int], width: int) -> list[tuple[int, int]]:
    """x and row of things that are laid beside each other."""
    made: list[tuple[int, int]] = []
    x = row = 0
    for size in sizes:
        if x and x + size > width:
            x, row = 0, row + 1
        made.append((x, row))
        x += size + _GAP
    return made


def kinds_first(entries: Iterable[Entry]) -> dict[str, int]:
    """How many of the entries have which tag: what they are made of before how they look."""
    found = tuple(entries)
    counts = counted(found)
    kinds = {folded(entry.tags[0]) for entry in found if entry.tags}
    ordered = sorted(counts, key=lambda tag: folded(tag) not in kinds)
    return {tag: counts[tag] for tag in ordered}


__all__ = ["TagBar", "kinds_first"]
