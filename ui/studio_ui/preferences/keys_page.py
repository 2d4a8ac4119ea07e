"""Preferences ▸ Keys: every action with its key; record another, see what had it, go back."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import (
    QHBoxLayout,
    QHeaderView,
    QKeySequenceEdit,
    QLabel,
    QLineEdit,
    QPushButton,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from studio_ui.actions.catalogue import specs
from studio_ui.look.role import set_role
from studio_ui.palette import fuzzy
from studio_ui.shortcuts import Shortcuts, portable, shown

_ID = Qt.ItemDataRole.UserRole


class KeysPage(QWidget):
    """Follows `Shortcuts`; what is recorded works at once, unless something else has the key."""

    def __init__(self, shortcuts: Shortcuts) -> None:
        super().__init__()
        self._shortcuts = shortcuts
        self._items: dict[str, QTreeWidgetItem] = {}
        self._asked = ""  # the key that something else has
        self.find = QLineEdit()
        self.find.setPlaceholderText("Find by name or key")
        self.find.setAccessibleName("Find by name or key")
        self.find.setClearButtonEnabled(True)
        self.find.textChanged.connect(self._filter)
        self.tree = QTreeWidget()
        self.tree.setHeaderLabels(["Command", "Key"])
        self.tree.setAccessibleName("Commands and their keys")
        self.tree.setRootIsDecorated(True)
        self.tree.header().setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        self.tree.header().setSectionResizeMode(1, QHeaderView.ResizeMode.ResizeToContents)
        self.tree.header().setStretchLastSection(False)
        self.tree.currentItemChanged.connect(lambda *_: self._show())
        self.edit = QKeySequenceEdit()
        self.edit.setMaximumSequenceLength(1)
        for recorder in (self.edit, *self.edit.findChildren(QLineEdit)):
            recorder.setAccessibleName("Press the new key")
        self.edit.setToolTip("Click here, then press the key, with Ctrl, Shift or Alt if you like")
        self.edit.keySequenceChanged.connect(self._recorded)
        self.clear = _button("No key", "The command keeps its place in the menus")
        self.back = _button("Reset", "The key of the first start")
        self.take = _button("Use it here", "")
        self.reset_all = _button("Reset all keys", "Every key as at the first start")
        self.told = QLabel()
        self.told.setWordWrap(True)
        self.clear.clicked.connect(lambda: self._give(""))
        self.back.clicked.connect(lambda: self._shortcuts.reset(self._chosen))
        self.take.clicked.connect(lambda: self._give(self._asked))
        self.reset_all.clicked.connect(shortcuts.reset_all)
        self._lay_out()
        self._fill()
        self._off = shortcuts.changed.connect(self._follow)
        self._follow()

    def close_panel(self) -> None:
        """Stop following."""
        self._off()

    def choose(self, name: str) -> None:
        """Show an action."""
        self.find.clear()
        self.tree.setCurrentItem(self._items[name])
        self.tree.scrollToItem(self._items[name])

    @property
    def _chosen(self) -> str:
        item = self.tree.currentItem()
        return "" if item is None else item.data(0, _ID) or ""

    def _lay_out(self) -> None:
        keys, told = QHBoxLayout(), QHBoxLayout()
        for widget in (self.edit, self.clear, self.back):
            keys.addWidget(widget)
        keys.addStretch(1)
        keys.addWidget(self.reset_all)
        told.addWidget(self.told, 1)
        told.addWidget(self.take)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        for part in (self.find, self.tree):
            column.addWidget(part)
        column.addLayout(keys)
        column.addLayout(told)

    def _fill(self) -> None:
        places: dict[str, QTreeWidgetItem] = {}
        for spec in specs():
            place = spec.menu.replace("/", " ▸ ")
            if place not in places:
                places[place] = QTreeWidgetItem([place])
                places[place].setFlags(Qt.ItemFlag.ItemIsEnabled)
                self.tree.addTopLevelItem(places[place])
            item = QTreeWidgetItem([spec.text.rstrip("…"), ""])
            item.setData(0, _ID, spec.id)
            item.setToolTip(0, spec.tip)
            places[place].addChild(item)
            self._items[spec.id] = item
        self.tree.expandAll()

    def _follow(self) -> None:
        for name, item in self._items.items():
            item.setText(1, shown(self._shortcuts.of(name)))
            font = item.font(1)
            font.setBold(self._shortcuts.is_own(name))
            item.setFont(1, font)
        self._show()

    def _show(self) -> None:
        """The key of the chosen action; nothing is asked."""
        name = self._chosen
        self._asked = ""
        self.edit.blockSignals(True)
        self.edit.setKeySequence(QKeySequence(self._shortcuts.of(name) if name else ""))
        self.edit.blockSignals(False)
        self.edit.setEnabled(bool(name))
        self.clear.setEnabled(bool(name) and bool(self._shortcuts.of(name)))
        self.back.setEnabled(bool(name) and self._shortcuts.is_own(name))
        self._tell("" if name else "Choose a command to change its key.")

    def _recorded(self, sequence: QKeySequence) -> None:
        name, keys = self._chosen, portable(sequence.toString(QKeySequence.SequenceFormat.PortableText))
        if not name or not keys:
            return
        why = self._shortcuts.refuses(name, keys)
        holder = self._shortcuts.holder(keys, but=name)
        if why:
            self._show()
            self._tell(f"{why}.")
        elif holder:
            self._asked = keys
            self._tell(f"{shown(keys)} is the key of “{self._items[holder].text(0)}”.")
        else:
            self._give(keys)

    def _give(self, keys: str) -> None:
        if self._chosen:
            self._shortcuts.give(self._chosen, keys)

    def _tell(self, text: str) -> None:
        self.told.setText(text)
        set_role(self.told, "warning" if self._chosen else "dim")
        self.take.setVisible(bool(self._asked))

    def _filter(self, text: str) -> None:
        for name, item in self._items.items():
            keys = self._shortcuts.of(name)
            fits = fuzzy.match(text, item.text(0)) is not None
            item.setHidden(not fits and text.casefold() not in (keys.casefold(), shown(keys).casefold()))
        for row in range(self.tree.topLevelItemCount()):
            place = self.tree.topLevelItem(row)
            assert place is not None
            place.setHidden(all(place.child(i).isHidden() for i in range(place.childCount())))


def _button(text: str, tip: str) -> QPushButton:
    button = QPushButton(text)
    button.setToolTip(tip)
    button.setAutoDefault(False)
    return button
