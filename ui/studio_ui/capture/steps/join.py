"""Fifth step: both lenses become one picture; its seam, and where up and the front are."""

from __future__ import annotations

import numpy as np
from PySide6.QtWidgets import QPushButton

from studio_core.capturing.artifacts import Stitched
from studio_core.capturing.settings import StitchSettings
from studio_core.capturing.standing import user_angles, user_turn
from studio_ui.capture.desk import CaptureDesk
from studio_ui.capture.preview.picture import Mark, Shown
from studio_ui.capture.steps.step import CLIPPED, UNSEEN, StepForm, direction_text
from studio_ui.capture.tools.turn_tool import TurnTool
from studio_ui.capture.turning import F64, between
from studio_ui.context import Context
from studio_ui.panels.panel import note, row

_ANGLES = ("pitch", "roll", "north")
_SEAM = (70, 190, 170)


class JoinStep(StepForm):
    """Angles are typed, or the picture is dragged: it turns at once, coarsely, and is made again after."""

    id = "join"

    def __init__(self, context: Context, desk: CaptureDesk) -> None:
        super().__init__(context, desk)
        self.tool = self.turn_tool = TurnTool()
        self._start = StitchSettings()
        self.turn_tool.begin = self._begin
        self.turn_tool.preview = lambda a, b, level: desk.preview(
            "stitch", "Turn the room", **self._turned(a, b, level)
        )
        self.turn_tool.commit, self.turn_tool.cancel = desk.commit, desk.cancel
        self.turn_tool.nudge = self._nudge
        self.column.addWidget(self.form("stitch"))
        straight = QPushButton("As found")
        straight.setToolTip("Neither tilted nor turned by hand")
        straight.clicked.connect(
            lambda: desk.apply("stitch", "Horizon as found", pitch=0.0, roll=0.0, north=0.0)
        )
        self.column.addLayout(row(straight))
        self.column.addWidget(note(TurnTool.tip))

    def pictures(self) -> list[str]:
        """The joined one."""
        return ["Joined"] if self.desk.state.stitched is not None else []

    def picture(self, name: str) -> Shown | None:
        """What both lenses see."""
        stitched = self.desk.state.stitched
        if stitched is None:
            return None
        self.turn_tool.size = (stitched.light.shape[1], stitched.light.shape[0])
        return Shown(
            "joined",
            "Joined",
            stitched.light,
            self.marks((stitched,), lambda: _marks(stitched)),
            say=direction_text(stitched.light.shape),
        )

    def turned(self) -> F64 | None:
        """How the picture that is shown has to be turned to be as the settings say now; None: it is."""
        made_with = self.desk.stitched_with
        if made_with is None:
            return None
        now = self.desk.settings.stitch
        if all(getattr(now, name) == getattr(made_with, name) for name in _ANGLES):
            return None
        return _turn(now) @ _turn(made_with).T

    def _begin(self) -> bool:
        self._start = self.desk.settings.stitch
        return self.desk.begin("Turn the room")

    def _turned(self, start: tuple[float, float], end: tuple[float, float], level: bool) -> dict[str, float]:
        """The angles after what was at `start` when the drag began has come to `end`."""
        found = user_angles(between(start, end, level=level) @ _turn(self._start))
        return {name: round(angle, 3) for name, angle in zip(_ANGLES, found, strict=True)}

    def _nudge(self, start: tuple[float, float], end: tuple[float, float], level: bool) -> None:
        self._start = self.desk.settings.stitch
        self.desk.apply("stitch", "Turn the room", **self._turned(start, end, level))


def _turn(settings: StitchSettings) -> F64:
    return user_turn(settings.pitch, settings.roll, settings.north)


def _marks(stitched: Stitched) -> tuple[Mark, ...]:
    seam = np.abs(stitched.from_front - 0.5) < 0.5
    return (
        Mark("Clipped", stitched.clipped, CLIPPED, "Brighter than any exposure resolves"),
        Mark("Never seen", stitched.unseen, UNSEEN, "Outside both lenses"),
        Mark("Seam", seam, _SEAM, "Made of both lenses", shown=False),
    )
