"""The colour that is painted with: kept as radiance, shown and chosen as the picture shows it now."""

from __future__ import annotations

from typing import Any

import numpy as np
from PySide6.QtGui import QColor

from studio_core.kernels.tonemap import tonemap
from studio_core.params import Colour, ParamInfo
from studio_core.session import Session
from studio_core.strokes.picking import radiance_of_display
from studio_ui.forms.colour_button import ColourButton, to_display, to_linear
from studio_ui.forms.fields import Field
from studio_ui.forms.sinks import Sink


def field_of(session: Session) -> type[Field]:
    """A field for forms, that shows radiance with the session's exposure and view."""

    class RadianceField(Field):
        def __init__(self, name: str, info: ParamInfo, sink: Sink) -> None:
            super().__init__(name, info, sink)
            self.button = ColourButton(info.label)
            self.button.began = lambda: sink.begin(name)
            self.button.previewed = lambda colour: sink.preview(name, self._radiance(colour))
            self.button.committed = sink.commit
            self.button.cancelled = sink.cancel
            self.row.addWidget(self.button, 1)

        def show_value(self, value: Any) -> None:
            """As the picture would show that light."""
            seen = tonemap(np.array([[value]], np.float32), session.exposure, session.tonemap)[0, 0]
            self.button.show_colour(to_linear(QColor(*(int(one) for one in seen))))
            numbers = " / ".join(f"{part:.3g}" for part in value)
            self.button.setToolTip(f"Radiance {numbers}\nAlt+click in the picture picks what is seen there")

        def show_mixed(self, value: Any) -> None:
            """There is one brush."""

        def _radiance(self, colour: Colour) -> Colour:
            shown = to_display(colour)
            display = (shown.redF(), shown.greenF(), shown.blueF())
            return radiance_of_display(display, session.exposure, session.tonemap).radiance

    return RadianceField


__all__ = ["field_of"]
