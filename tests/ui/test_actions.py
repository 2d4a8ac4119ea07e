"""The catalogue of actions, and what puts it together with the features."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from PySide6.QtWidgets import QMenuBar, QToolBar, QWidget
from pytestqt.qtbot import QtBot
from ui_support import Driver

from studio_ui.actions.action_set import ActionSet
from studio_ui.actions.catalogue import ACTIONS, MENUS, specs
from studio_ui.actions.spec import REASONS
from studio_ui.features import gather


class _Feature:
    def __init__(self, handlers: list[str], conditions: list[str]) -> None:
        self._handlers: dict[str, Callable[[], object]] = {name: lambda: None for name in handlers}
        self._conditions: dict[str, Callable[[], bool]] = {name: lambda: True for name in conditions}

    def handlers(self) -> dict[str, Callable[[], object]]:
        return self._handlers

    def conditions(self) -> dict[str, Callable[[], bool]]:
        return self._conditions


HANDLERS = [spec.id for spec in specs()]
CONDITIONS = sorted({name for spec in specs() for name in (spec.enabled, spec.checked) if name})


def test_menus_are_in_the_order_of_the_catalogue(driver: Driver) -> None:
    tops = list(dict.fromkeys(spec.menu.split("/")[0] for spec in specs()))
    assert [action.text().replace("&", "") for action in driver.window.menuBar().actions()] == tops
    assert len(MENUS) <= len(tops)
    assert None in ACTIONS


def test_every_condition_has_a_reason() -> None:
    """A reason tells a person why an action cannot be done: a sentence without its stop."""
    assert {spec.enabled for spec in specs() if spec.enabled} == set(REASONS)
    for reason in REASONS.values():
        assert reason[0].isupper()
        assert not reason.endswith(".")


def test_every_action_says_what_it_does() -> None:
    """In a tooltip, the status bar and the palette: no sentence's stop, not its name again."""
    for spec in specs():
        assert spec.tip, spec.id
        assert not spec.tip.endswith("."), spec.id
        assert spec.tip.casefold() != spec.text.casefold(), spec.id


@pytest.mark.parametrize("kind", ["handler", "condition"])
@pytest.mark.parametrize("more", [True, False])
def test_what_does_not_match_is_named(kind: str, more: bool, qtbot: QtBot) -> None:
    handlers, conditions = list(HANDLERS), list(CONDITIONS)
    changed = handlers if kind == "handler" else conditions
    name = "nothing.such" if more else changed[0]
    if more:
        changed.append(name)
    else:
        changed.remove(name)
    owner = QWidget()
    qtbot.addWidget(owner)
    with pytest.raises(ValueError, match=f"{kind}.*{name}"):
        ActionSet(owner, owner, *gather([_Feature(handlers, conditions)]))


def test_two_features_do_not_bring_the_same() -> None:
    with pytest.raises(ValueError, match=r"file\.new"):
        gather([_Feature(["file.new"], []), _Feature(["file.new"], [])])
    with pytest.raises(ValueError, match="undo"):
        gather([_Feature([], ["undo"]), _Feature([], ["undo"])])


def test_conditions_enable_and_check(qtbot: QtBot) -> None:
    owner = QWidget()
    qtbot.addWidget(owner)
    done: list[int] = []
    handlers, conditions = gather([_Feature(HANDLERS, CONDITIONS)])
    state = {"undo": False, "grid": True, "tool_move": True, "tool_select": False, "tool_rotate": False}
    state["tool_scale"] = state["tool_stroke"] = False
    conditions |= {name: lambda name=name: state[name] for name in state}  # type: ignore[misc]
    made = ActionSet(owner, owner, handlers, conditions, lambda: done.append(1))
    made.refresh()
    assert not made["edit.undo"].isEnabled()
    assert made["edit.redo"].isEnabled()
    assert made["view.grid"].isChecked()
    state |= {"undo": True, "grid": False, "tool_move": False, "tool_rotate": True}
    made.refresh()
    assert made["edit.undo"].isEnabled()
    assert not made["view.grid"].isChecked()
    assert [made[f"tool.{name}"].isChecked() for name in ("select", "move", "rotate")] == [False, False, True]
    made["file.new"].trigger()
    assert done == [1]


def test_the_toolbar_has_what_the_data_says(qtbot: QtBot) -> None:
    owner, bar, menus = QWidget(), QToolBar(), QMenuBar()
    for widget in (owner, bar, menus):
        qtbot.addWidget(widget)
    made = ActionSet(owner, owner, *gather([_Feature(HANDLERS, CONDITIONS)]))
    made.fill_menus(menus)
    made.fill_bar(bar)
    shown = [action.text() for action in bar.actions() if not action.isSeparator()]
    assert shown == [spec.text for spec in specs() if spec.bar]
    assert all(made.actions[spec.id] in made.menus[spec.menu].actions() for spec in specs())
