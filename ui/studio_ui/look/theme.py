"""Colours and spacing: a dark and a light theme, neutral so that they do not tint the eye."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from string import Template

from PySide6.QtGui import QColor, QPalette
from PySide6.QtWidgets import QApplication

GAP = 6  # pixels between things, everywhere
PANEL_WIDTH = 300


@dataclass(frozen=True)
class Theme:
    """Named colours.

    `border` parts areas, `edge` shows where a control ends, `canvas` surrounds the picture. Over the
    picture, which no theme changes, lie `mark` and `alarm`.
    """

    name: str
    window: str
    base: str
    raised: str
    border: str
    text: str
    dim: str
    edge: str
    accent: str
    on_accent: str
    canvas: str
    warning: str
    problem: str
    mark: str = "#f2a83b"
    alarm: str = "#ff9a85"


DARK = Theme(
    name="dark",
    window="#2c2c2d",
    base="#222223",
    raised="#3a3a3c",
    border="#19191a",
    text="#dededd",
    dim="#a6a6a4",
    edge="#7b7b79",
    accent="#e0a24a",
    on_accent="#1d1a15",
    canvas="#191919",
    warning="#e8c15a",
    problem="#f58d7a",
)
LIGHT = Theme(
    name="light",
    window="#ededec",
    base="#fbfbfa",
    raised="#ffffff",
    border="#c9c9c6",
    text="#242423",
    dim="#5f5f5c",
    edge="#848481",
    accent="#9c610d",
    on_accent="#ffffff",
    canvas="#c4c4c2",
    warning="#7f5c00",
    problem="#b3351f",
)
THEMES = {theme.name: theme for theme in (DARK, LIGHT)}

_ASSETS = Path(__file__).parent / "assets"
_SHEET = Template("""
QToolTip { background: $raised; color: $text; border: 1px solid $border; padding: 3px 5px; }
QMainWindow::separator { background: $border; width: 3px; height: 3px; }
QMainWindow::separator:hover { background: $accent; }
QMenuBar { background: $window; padding: 2px 4px; }
QMenuBar::item { padding: 4px 9px; border-radius: 3px; background: transparent; }
QMenuBar::item:selected { background: $raised; }
QMenu { background: $raised; border: 1px solid $border; padding: 4px; }
QMenu::item { padding: 5px 26px 5px 24px; border-radius: 3px; }
QMenu::item:selected { background: $accent; color: $on_accent; }
QMenu::item:disabled { color: $dim; }
QMenu::indicator { width: 14px; height: 14px; left: 5px; }
QMenu::indicator:checked { image: url("$assets/tick-$name.svg"); }
QMenu::separator { height: 1px; background: $border; margin: 4px 6px; }
QToolBar { background: $window; border: none; border-bottom: 1px solid $border; padding: 3px 6px;
    spacing: 2px; }
QToolBar::separator { width: 1px; background: $border; margin: 4px 5px; }
QToolButton { border: 1px solid transparent; border-radius: 4px; padding: 4px; }
QToolButton:hover { background: $raised; }
QToolButton:focus { border-color: $accent; }
QToolButton:pressed, QToolButton:checked { background: $accent; color: $on_accent; }
QToolButton::menu-indicator { image: none; }
QToolButton#qt_toolbar_ext_button { padding: 0; border: none; }
QToolButton[role="filter"] { color: $dim; padding: 2px 5px; }
QToolButton[role="filter"]:checked { background: $raised; color: $text; }
QToolButton[role="chip"] { color: $dim; padding: 1px 6px; border-color: $border; border-radius: 9px; }
QToolButton[role="chip"]:hover { color: $text; }
QToolButton[role="chip"]:focus { border-color: $accent; }
QToolButton[role="chip"]:checked { background: $accent; color: $on_accent; }
QToolButton[role="problem"] { color: $problem; padding: 1px 6px; }
QToolButton[role="warning"] { color: $warning; padding: 1px 6px; }
QToolButton[role="small"] { padding: 1px; }
QToolButton[role="fold"]:checked { background: transparent; color: $text; }
QDockWidget { color: $dim; font-weight: 600; }
QDockWidget::title { background: $window; padding: 6px 8px; border-bottom: 1px solid $border; }
QTabBar { qproperty-drawBase: 0; }
QTabBar::tab { background: transparent; color: $dim; padding: 5px 7px; border: none;
               border-bottom: 2px solid transparent; }
QTabBar::tab:selected { color: $text; border-bottom-color: $accent; }
QTabBar::tab:hover { color: $text; }
QTabBar::tab:selected:focus { background: $raised; }
QStatusBar { background: $window; border-top: 1px solid $border; color: $dim; }
QStatusBar::item { border: none; }
QStatusBar QLabel { color: $dim; padding: 0 6px; }
QTreeView, QListView, QTableView, QPlainTextEdit { background: $base; border: 1px solid $border;
    border-radius: 4px; outline: 0; selection-background-color: $accent; selection-color: $on_accent; }
QTreeView:focus, QListView:focus, QTableView:focus, QPlainTextEdit:focus { border-color: $accent; }
QTreeView::item, QListView::item { padding: 3px 2px; }
QAbstractItemView QLineEdit { border-radius: 0; padding: 0 2px; margin: 0; min-height: 0; }
QTreeView::item:hover, QListView::item:hover { background: $raised; }
QTreeView::item:selected, QListView::item:selected { background: $accent; color: $on_accent; }
QHeaderView::section { background: $window; color: $dim; border: none; padding: 4px 6px; }
QLineEdit, QSpinBox, QDoubleSpinBox, QComboBox { background: $base; border: 1px solid $edge;
    border-radius: 4px; padding: 3px 6px; min-height: 18px; selection-background-color: $accent;
    selection-color: $on_accent; }
QLineEdit:focus, QSpinBox:focus, QDoubleSpinBox:focus, QComboBox:focus { border-color: $accent; }
QLineEdit:disabled, QSpinBox:disabled, QDoubleSpinBox:disabled, QComboBox:disabled { color: $dim;
    border-color: $border; }
QComboBox::drop-down { border: none; width: 18px; }
QComboBox::down-arrow { image: url("$assets/down-$name.svg"); width: 10px; height: 10px; }
QAbstractSpinBox QLineEdit, QComboBox QLineEdit { border: none; padding: 0 5px; min-height: 0; margin: 0;
    background: transparent; }
QSpinBox::up-button, QSpinBox::down-button, QDoubleSpinBox::up-button, QDoubleSpinBox::down-button {
    width: 0; height: 0; border: none; }
QCheckBox::indicator, QTreeView::indicator, QListView::indicator { width: 14px; height: 14px;
    border: 1px solid $edge; border-radius: 3px; background: $base; }
QCheckBox::indicator:checked, QTreeView::indicator:checked, QListView::indicator:checked {
    background: $accent; border-color: $accent; image: url("$assets/check-$name.svg"); }
QCheckBox::indicator:indeterminate, QTreeView::indicator:indeterminate { background: $accent;
    border-color: $accent; image: url("$assets/partly-$name.svg"); }
QCheckBox::indicator:disabled { border-color: $border; }
QCheckBox::indicator:focus, QRadioButton::indicator:focus { border: 2px solid $text; width: 12px;
    height: 12px; }
QRadioButton::indicator { width: 14px; height: 14px; border: 1px solid $edge; border-radius: 8px;
    background: $base; }
QRadioButton::indicator:checked { width: 6px; height: 6px; border: 5px solid $accent;
    background: $on_accent; }
QTreeView::indicator, QListView::indicator { width: 12px; height: 12px; }
QTreeView::indicator:checked, QListView::indicator:checked { border-color: $text; }
QComboBox QAbstractItemView { background: $raised; border: 1px solid $border; outline: 0; }
QPushButton { background: $raised; border: 1px solid $edge; border-radius: 4px; padding: 5px 12px; }
QPushButton:hover { border-color: $accent; }
QPushButton:pressed, QPushButton:checked { background: $accent; color: $on_accent; }
QPushButton:default { border-color: $accent; }
QPushButton:focus { border: 2px solid $accent; padding: 4px 11px; }
QPushButton:disabled { color: $dim; border-color: $border; }
QDialogButtonBox { dialogbuttonbox-buttons-have-icons: 0; }
QProgressBar { background: $base; border: 1px solid $border; border-radius: 3px; max-height: 8px; }
QProgressBar::chunk { background: $accent; border-radius: 2px; }
QSlider::groove:horizontal { height: 4px; background: $base; border: 1px solid $border; border-radius: 2px; }
QSlider::sub-page:horizontal { background: $accent; border-radius: 2px; }
QSlider { border: 1px solid transparent; border-radius: 4px; }
QSlider:focus { border-color: $accent; }
QSlider::handle:horizontal { width: 11px; margin: -5px 0; border-radius: 6px; background: $text; }
QSlider::sub-page:horizontal:disabled, QSlider::handle:horizontal:disabled { background: $dim; }
QScrollArea { border: none; background: transparent; }
QScrollBar:vertical { width: 10px; background: transparent; margin: 0; }
QScrollBar:horizontal { height: 10px; background: transparent; margin: 0; }
QScrollBar::handle { background: $edge; border-radius: 4px; min-height: 24px; min-width: 24px;
    margin: 1px; }
QScrollBar::add-line, QScrollBar::sub-line { width: 0; height: 0; }
QScrollBar::add-page, QScrollBar::sub-page { background: transparent; }
QGroupBox { border: none; border-top: 1px solid $border; margin-top: 14px; padding-top: 6px;
    font-weight: 600; }
QGroupBox::title { subcontrol-origin: margin; left: 0; color: $dim; }
QFrame#notice { background: $raised; border: 1px solid $border; border-left: 4px solid $dim;
    border-radius: 5px; }
QFrame#notice[role="problem"] { border-left-color: $problem; }
QFrame#notice[role="warning"] { border-left-color: $warning; }
QToolButton#corner { background: rgba(20, 20, 20, 150); border: none; border-radius: 12px; }
QToolButton#corner:hover, QToolButton#corner:focus { background: rgba(20, 20, 20, 230); }
QFrame#palette { background: $raised; border: 1px solid $border; border-radius: 6px; }
QFrame#hints { background: $raised; border: none; border-bottom: 1px solid $border; }
QLabel[role="dim"] { color: $dim; }
QLabel[role="warning"] { color: $warning; }
QLabel[role="problem"] { color: $problem; }
QLabel[role="title"] { font-weight: 600; }
""")


def palette(theme: Theme) -> QPalette:
    """The theme as Qt's palette, for what the style sheet leaves alone."""
    made = QPalette()
    role = QPalette.ColorRole
    pairs = {
        role.Window: theme.window,
        role.WindowText: theme.text,
        role.Base: theme.base,
        role.AlternateBase: theme.raised,
        role.ToolTipBase: theme.raised,
        role.ToolTipText: theme.text,
        role.Text: theme.text,
        role.Button: theme.raised,
        role.ButtonText: theme.text,
        role.BrightText: theme.problem,
        role.Highlight: theme.accent,
        role.HighlightedText: theme.on_accent,
        role.Link: theme.accent,
        role.PlaceholderText: theme.dim,
    }
    for key, colour in pairs.items():
        made.setColor(key, QColor(colour))
    for key in (role.WindowText, role.Text, role.ButtonText):
        made.setColor(QPalette.ColorGroup.Disabled, key, QColor(theme.dim))
    return made


def wear(application: QApplication, theme: Theme) -> None:
    """Dress the whole application; nothing happens when it wears the theme already."""
    sheet = _SHEET.substitute(vars(theme), assets=_ASSETS.as_posix())
    if application.styleSheet() != sheet:
        application.setStyle("Fusion")
        application.setPalette(palette(theme))
        application.setStyleSheet(sheet)
