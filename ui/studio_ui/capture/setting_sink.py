"""Where the values of a step's form go: edits of one section of the settings."""

from __future__ import annotations

import dataclasses

from studio_core.capturing.settings import CaptureSettings
from studio_core.params import Value, param_infos
from studio_ui.capture.desk import CaptureDesk

_SECTIONS = {f.name: type(getattr(CaptureSettings(), f.name)) for f in dataclasses.fields(CaptureSettings)}


class SettingSink:
    """Satisfies `forms.sinks.Sink` for the parameters of a section."""

    def __init__(self, desk: CaptureDesk, section: str) -> None:
        self.desk, self.section = desk, section
        self.infos = param_infos(_SECTIONS[section])

    def label(self, name: str) -> str:
        """`Field of view of Capture`."""
        what = self.desk.capture.name if self.desk.capture is not None else "the capture"
        return f"{self.infos[name].label} of {what}"

    def begin(self, name: str) -> bool:
        """A drag starts."""
        return self.desk.begin(self.label(name))

    def preview(self, name: str, value: Value) -> None:
        """The drag goes on."""
        self.desk.preview(self.section, self.label(name), **{name: value})

    def commit(self) -> None:
        """One step."""
        self.desk.commit()

    def cancel(self) -> None:
        """Never was."""
        self.desk.cancel()

    def apply(self, name: str, value: Value) -> None:
        """One step."""
        self.desk.apply(self.section, self.label(name), **{name: value})
