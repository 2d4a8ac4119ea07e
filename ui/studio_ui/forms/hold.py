"""Number fields that are held: keys kept down, a label dragged, a slider moved are one gesture each."""

from __future__ import annotations

from studio_core.params import Value
from studio_ui.forms.sinks import Sink
from studio_ui.forms.spin import Spin


class Hold:
    """Values of one parameter on their way to a sink: shown while a field is held, a step each otherwise."""

    def __init__(self, sink: Sink, name: str, *spins: Spin) -> None:
        self._sink, self._name = sink, name
        self.active = False
        for spin in spins:
            self.follow(spin)

    def follow(self, spin: Spin) -> None:
        """Begin and end with what happens to this field."""
        spin.held.connect(self.begin)
        spin.let_go.connect(self.end)
        spin.dropped.connect(self.drop)

    def begin(self) -> None:
        """What follows is one gesture, where one may start."""
        self.active = self._sink.begin(self._name)

    def give(self, value: Value) -> None:
        """Another value."""
        (self._sink.preview if self.active else self._sink.apply)(self._name, value)

    def end(self) -> None:
        """The gesture stays."""
        if self.active:
            self.active = False
            self._sink.commit()

    def drop(self) -> None:
        """The gesture is taken back."""
        if self.active:
            self.active = False
            self._sink.cancel()
