"""Which rows of the outliner are shown: by name and by kind; what holds them is shown with them."""

from __future__ import annotations

from PySide6.QtCore import QModelIndex, QObject, QPersistentModelIndex, QSortFilterProxyModel

from studio_core.scene.nodes import Node
from studio_ui.panels.outliner_model import OutlinerModel


class OutlinerFilter(QSortFilterProxyModel):
    """Everything until `narrow` is called."""

    def __init__(self, model: OutlinerModel, parent: QObject) -> None:
        super().__init__(parent)
        self._model = model
        self._text = ""
        self._kind: type[Node] = Node
        self.setRecursiveFilteringEnabled(True)
        self.setSourceModel(model)

    @property
    def narrowed(self) -> bool:
        """Whether some rows may be left out."""
        return bool(self._text) or self._kind is not Node

    def narrow(self, text: str, kind: type[Node]) -> None:
        """Names that hold `text` (and, without a kind, all that hangs under them) of nodes of `kind`."""
        self.beginFilterChange()
        self._text, self._kind = text.strip().casefold(), kind
        self.setAutoAcceptChildRows(kind is Node)
        self.endFilterChange(QSortFilterProxyModel.Direction.Rows)

    def filterAcceptsRow(self, row: int, parent: QModelIndex | QPersistentModelIndex) -> bool:
        """Whether a row itself fits."""
        if not self.narrowed:
            return True
        node = self._model.seen(row, parent)
        return node is not None and isinstance(node, self._kind) and self._text in node.name.casefold()
