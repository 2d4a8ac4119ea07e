"""Signals: order, disconnecting, and changes of the receivers while they are called."""

from __future__ import annotations

import pytest

from studio_core.signal import Signal


def test_receivers_are_called_in_order_with_what_was_emitted() -> None:
    signal: Signal[[int, str]] = Signal()
    heard: list[tuple[str, int, str]] = []
    signal.connect(lambda n, text: heard.append(("first", n, text)))
    signal.connect(lambda n, text: heard.append(("second", n, text)))
    signal.emit(1, text="a")
    assert heard == [("first", 1, "a"), ("second", 1, "a")]


def test_disconnecting_twice_is_once() -> None:
    signal: Signal[[]] = Signal()
    heard: list[int] = []

    def receiver() -> None:
        heard.append(1)

    stop_one, _ = signal.connect(receiver), signal.connect(receiver)
    stop_one()
    signal.emit()
    assert heard == [1]
    stop_one()
    stop_one()
    signal.emit()


def test_a_receiver_may_leave_or_bring_another_while_it_is_called() -> None:
    signal: Signal[[]] = Signal()
    heard: list[str] = []

    def once() -> None:
        heard.append("once")
        leave()
        signal.connect(lambda: heard.append("late"))

    leave = signal.connect(once)
    signal.connect(lambda: heard.append("always"))
    signal.emit()
    assert heard == ["once", "always"]
    signal.emit()
    assert heard == ["once", "always", "always", "late"]


def test_every_receiver_is_called_though_one_fails() -> None:
    signal: Signal[[]] = Signal()
    heard: list[str] = []

    def fails(error: Exception) -> None:
        heard.append(str(error))
        raise error

    signal.connect(lambda: fails(ValueError("first")))
    signal.connect(lambda: fails(KeyError("second")))
    signal.connect(lambda: heard.append("third"))
    with pytest.raises(ValueError, match="first") as caught:
        signal.emit()
    assert heard == ["first", "'second'", "third"]
    assert any("second" in note for note in caught.value.__notes__)


def test_who_was_disconnected_meanwhile_is_not_called() -> None:
    signal: Signal[[]] = Signal()
    heard: list[str] = []
    signal.connect(lambda: leave())
    leave = signal.connect(lambda: heard.append("gone"))
    signal.emit()
    assert heard == []


def test_two_signals_do_not_share_receivers() -> None:
    one: Signal[[]] = Signal()
    two: Signal[[]] = Signal()
    heard: list[str] = []
    one.connect(lambda: heard.append("one"))
    two.emit()
    assert heard == []
