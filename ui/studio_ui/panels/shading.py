"""Shading: which backend computes the picture, how finely, and how light goes on between surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from PySide6.QtWidgets import QWidget

from studio_core.contract import ShadingBackend
from studio_core.errors import PluginError
from studio_core.params import Value, defaults, param_infos
from studio_ui.context import Context
from studio_ui.forms.fields import Combo, tip
from studio_ui.forms.param_form import ParamForm, form_label, form_layout
from studio_ui.forms.sinks import PlainSink
from studio_ui.panels.between import BetweenSection
from studio_ui.panels.panel import Panel, clear, note
from studio_ui.quality import NAME, QualityControl, offers_quality


class ShadingPanel(Panel):
    """The session's backend and its parameters; no edits of the document."""

    id = "shading"
    title = "Shading"

    def __init__(self, context: Context) -> None:
        super().__init__(context)
        self.form: ParamForm | None = None
        self.combo = Combo()
        self.quality: QualityControl | None = None
        column = self.scroller()
        self._column = self.inside(column)
        self.between = BetweenSection(context)
        column.addWidget(self.between)
        column.addStretch(1)
        self.subscriptions.add(
            context.warmed.connect(self.refresh), context.session.changed.connect(self._told)
        )
        self.refresh()

    def refresh(self) -> None:
        """Build the form of the session's backend."""
        unfolded = self.form is not None and self.form.more is not None and self.form.more.isChecked()
        self._close_quality()
        clear(self._column)
        self.form = None
        self.combo = Combo()
        host, session = self.context.host, self.context.session
        names = list(host.names("backend"))
        for name in names:
            backend = self._backend(name)
            self.combo.addItem(backend.label if backend is not None else name, name)
        self.combo.setAccessibleName("Method")
        self.combo.setCurrentIndex(self.combo.findData(session.backend))
        self.combo.setEnabled(self.context.warm)
        self.combo.activated.connect(lambda i: session.shade_with(names[i]))
        box = QWidget()
        form_layout(box).addRow(form_label("Method", "How light is computed"), self.combo)
        self._column.addWidget(box)
        backend = self._backend(session.backend)
        if backend is not None:
            infos = param_infos(backend.Params)
            skip: tuple[str, ...] = ()
            if offers_quality(infos):
                skip, self.quality = (NAME,), QualityControl(self.context)
                line = QWidget()
                form_layout(line).addRow(form_label(infos[NAME].label, tip(infos[NAME])), self.quality)
                self._column.addWidget(line)
            self.form = ParamForm(infos, PlainSink(self._set), skip, unfolded=unfolded)
            self._column.addWidget(self.form)
            self.form.show_values(self._values(backend, session.params))
        elif not self.context.warm:
            self._column.addWidget(note("Loading…"))
        self._shown = session.backend

    def close_panel(self) -> None:
        """Stop listening."""
        super().close_panel()
        self.between.close_panel()
        self._close_quality()

    def _close_quality(self) -> None:
        if self.quality is not None:
            self.quality.close_panel()
            self.quality = None

    def _backend(self, name: str) -> ShadingBackend | None:
        if not self.context.warm:
            return None
        try:
            made: ShadingBackend = self.context.host.get("backend", name)
        except PluginError:
            return None
        return made

    def _values(self, backend: ShadingBackend, chosen: Mapping[str, Any]) -> dict[str, Any]:
        return {**defaults(backend.Params), **chosen}

    def _set(self, name: str, value: Value) -> None:
        session = self.context.session
        if session.params.get(name) != value:
            session.shade_with(session.backend, {**session.params, name: value})

    def _told(self, aspect: object) -> None:
        session = self.context.session
        if session.backend != self._shown:
            self.refresh()
        elif self.form is not None:
            backend = self._backend(session.backend)
            if backend is not None:
                self.form.show_values(self._values(backend, session.params))
