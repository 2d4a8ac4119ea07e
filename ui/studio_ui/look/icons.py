"""Icons drawn with strokes on a 24 × 24 grid, in the theme's colour and at any pixel ratio.

An icon is a few lines of text: `line x,y x,y …`, `ellipse x,y w,h`, `box x,y w,h`, `arc x,y w,h from,span`
(degrees, anticlockwise from three o'clock), `curve x,y control control end …` (quadratic).
"""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QIcon, QPainter, QPainterPath, QPen, QPixmap, QPixmapCache, QPolygonF

_SIZE = 24
_OBJECT = """line 12,3.5 19.5,7.5 19.5,16.5 12,20.5 4.5,16.5 4.5,7.5 12,3.5
line 4.5,7.5 12,11.5 19.5,7.5
line 12,11.5 12,20.5"""
_EYE = """curve 3,12 12,3.5 21,12 12,20.5 3,12
ellipse 9.3,9.3 5.4,5.4"""
_RAYS = """line 12,2.7 12,5
line 12,19 12,21.3
line 2.7,12 5,12
line 19,12 21.3,12
line 5.4,5.4 7,7
line 17,17 18.6,18.6
line 5.4,18.6 7,17
line 17,7 18.6,5.4"""

ICONS = {
    "new": """line 6,3.5 14,3.5 18.5,8 18.5,20.5 6,20.5 6,3.5
line 14,3.5 14,8 18.5,8""",
    "open": """line 3.5,19 3.5,5.5 9.5,5.5 11.5,8 19,8 19,10.5
line 3.5,19 6.5,10.5 21.5,10.5 18.5,19 3.5,19""",
    "save": """box 4,4 16,16
line 8,4 8,9.5 15.5,9.5 15.5,4
line 7.5,20 7.5,14 16.5,14 16.5,20""",
    "undo": """line 8.5,4.5 4,9 8.5,13.5
line 4,9 14,9
arc 9,9 10.5,10 -90,180""",
    "redo": """line 15.5,4.5 20,9 15.5,13.5
line 20,9 10,9
arc 4.5,9 10.5,10 90,180""",
    "select": "line 6,3.5 6,18 10,14.5 12.6,20.3 15.2,19.1 12.6,13.6 17.8,13 6,3.5",
    "move": """line 12,3 12,21
line 3,12 21,12
line 9.3,5.7 12,3 14.7,5.7
line 9.3,18.3 12,21 14.7,18.3
line 5.7,9.3 3,12 5.7,14.7
line 18.3,9.3 21,12 18.3,14.7""",
    "rotate": """arc 4,4 16,16 70,290
line 11.3,1.6 15,4.6 11.4,7.6""",
    "scale": """box 4,11 9,9
line 13.5,4 20,4 20,10.5
line 20,4 12,12""",
    "stroke": """line 20,4 12,12.5
line 20,4 10.5,11
line 10.5,11 12,12.5
curve 10.2,11.4 6.5,12 6.3,15.5 6,19 3.5,20 11,21 11.6,12.6""",
    "picker": """line 13,7 17,11
line 14.5,8.5 5,18 4,20 6,19 15.5,9.5
line 15,9 19,5""",
    "magnet": """line 5,4 5,12.5
line 19,4 19,12.5
arc 5,5.5 14,14 180,180
line 9.5,4 9.5,12.5
line 14.5,4 14.5,12.5
arc 9.5,10 5,5 180,180
line 5,4 9.5,4
line 14.5,4 19,4
line 5,8 9.5,8
line 14.5,8 19,8""",
    "frame": """line 3.5,8 3.5,3.5 8,3.5
line 16,3.5 20.5,3.5 20.5,8
line 20.5,16 20.5,20.5 16,20.5
line 8,20.5 3.5,20.5 3.5,16
box 8,8 8,8""",
    "bounce": """line 3.5,20.5 20.5,20.5
line 20.5,20.5 20.5,3.5
line 4,4 12,20 20,9.5 14,4
line 17.4,4.4 13.6,3.7 13.6,7.6""",
    "import": """line 12,9 19,12.3 19,18 12,21.3 5,18 5,12.3 8.5,10.7
line 12,2.5 12,14
line 8.6,10.8 12,14.2 15.4,10.8""",
    "object": _OBJECT,
    "room": """box 3.5,4.5 17,15
box 8,8 8,6
line 3.5,19.5 8,14
line 20.5,19.5 16,14
line 3.5,4.5 8,8
line 20.5,4.5 16,8""",
    "group": """box 3.5,6.5 17,12.5
line 3.5,10 3.5,4.5 9.5,4.5 11,6.5""",
    "camera": """box 3,7 12.5,10.5
line 15.5,11 21,8 21,16.5 15.5,13.5""",
    "environment": """ellipse 3.5,3.5 17,17
ellipse 8,3.5 8,17
line 3.5,12 20.5,12""",
    "capture": """ellipse 3,7 10,10
ellipse 11,7 10,10
line 12,2.5 12,5
line 12,19 12,21.5""",
    "lamp": """arc 6.5,3 11,11 -45,270
line 8.3,12.8 9.5,16.5 14.5,16.5 15.7,12.8
line 10,19.5 14,19.5""",
    "spot": """line 9,3.5 15,3.5 17,9 7,9 9,3.5
line 8,11 4.5,20.5
line 16,11 19.5,20.5
line 12,11.5 12,20.5""",
    "area": """box 4,4 16,5
line 7,12 6,20
line 12,12 12,20
line 17,12 18,20""",
    "sun": f"ellipse 7.8,7.8 8.4,8.4\n{_RAYS}",
    "material": """ellipse 4,4 16,16
arc 7,6.5 8,8 90,80""",
    "eye": _EYE,
    "eye-off": f"{_EYE}\nline 4,20 20,4",
    "lock": """box 5.5,10.5 13,9.5
arc 8,4 8,12 0,180""",
    "unlock": """box 5.5,10.5 13,9.5
arc 8,3 8,12 30,150""",
    "add": """line 12,5 12,19
line 5,12 19,12""",
    "duplicate": """box 8.5,8.5 12,12
line 15.5,5.5 15.5,3.5 3.5,3.5 3.5,15.5 5.5,15.5""",
    "delete": """line 4,6.5 20,6.5
line 9,6.5 9,3.5 15,3.5 15,6.5
line 6,6.5 7,20.5 17,20.5 18,6.5
line 10,10.5 10,16.5
line 14,10.5 14,16.5""",
    "drop": """line 12,3 12,15
line 7.5,10.5 12,15 16.5,10.5
line 4,20 20,20""",
    "picture": """box 3.5,4.5 17,15
line 3.5,16.5 9,11 13,15 15.5,12.5 20.5,17
ellipse 14.3,7.3 2.6,2.6""",
    "solo": """ellipse 8,8 8,8
ellipse 3.5,3.5 17,17""",
    "reset": """arc 5,5 14,14 -60,300
line 8.7,3.2 7.9,7.3 12,8.4""",
    "more": """line 6,5 13,12 6,19
line 12,5 19,12 12,19""",
    "cancel": """line 6,6 18,18
line 18,6 6,18""",
}
"""The strokes of every icon by name."""


def icon(name: str, colour: str, on: str = "", selected: str = "") -> QIcon:
    """The icon of that name; `on` colours it while checked, `selected` in a chosen row.

    Unknown names raise KeyError.
    """
    made = QIcon()
    faded = QColor(colour)
    faded.setAlphaF(0.35)
    for ratio in (1, 2, 3):
        made.addPixmap(_pixmap(name, QColor(colour), ratio), QIcon.Mode.Normal, QIcon.State.Off)
        made.addPixmap(_pixmap(name, QColor(on or colour), ratio), QIcon.Mode.Normal, QIcon.State.On)
        for state in (QIcon.State.Off, QIcon.State.On):  # trees draw what is unfolded as on
            made.addPixmap(_pixmap(name, QColor(selected or colour), ratio), QIcon.Mode.Selected, state)
        made.addPixmap(_pixmap(name, faded, ratio), QIcon.Mode.Disabled)
    return made


def _pixmap(name: str, colour: QColor, ratio: int) -> QPixmap:
    key = f"{name} {colour.rgba():08x} {ratio}"
    pixmap = QPixmap()
    if not QPixmapCache.find(key, pixmap):
        pixmap = _drawn(name, colour, ratio)
        QPixmapCache.insert(key, pixmap)
    return pixmap


def _drawn(name: str, colour: QColor, ratio: int) -> QPixmap:
    strokes = ICONS[name].splitlines()  # before a painter is open: an error would end the process
    pixmap = QPixmap(_SIZE * ratio, _SIZE * ratio)
    pixmap.fill(Qt.GlobalColor.transparent)
    painter = QPainter(pixmap)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.scale(ratio, ratio)
    pen = QPen(colour, 1.6)
    pen.setCapStyle(Qt.PenCapStyle.RoundCap)
    pen.setJoinStyle(Qt.PenJoinStyle.RoundJoin)
    painter.setPen(pen)
    for stroke in strokes:
        _stroke(painter, stroke)
    painter.end()
    pixmap.setDevicePixelRatio(ratio)
    return pixmap


def _stroke(painter: QPainter, stroke: str) -> None:
    kind, *words = stroke.split()
    pairs = [(float(a), float(b)) for a, b in (word.split(",") for word in words)]
    if kind == "line":
        painter.drawPolyline(QPolygonF([QPointF(x, y) for x, y in pairs]))
    elif kind == "curve":
        path = QPainterPath(QPointF(*pairs[0]))
        for control, end in zip(pairs[1::2], pairs[2::2], strict=True):
            path.quadTo(*control, *end)
        painter.drawPath(path)
    else:
        box = QRectF(*pairs[0], *pairs[1])
        if kind == "ellipse":
            painter.drawEllipse(box)
        elif kind == "box":
            painter.drawRoundedRect(box, 1.5, 1.5)
        else:
            painter.drawArc(box, round(pairs[2][0] * 16), round(pairs[2][1] * 16))
