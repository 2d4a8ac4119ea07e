"""Line charts with logarithmic axes as SVG: what the figures of a paper need, and no more."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000")
"""Told apart by those who see few colours, too (Okabe & Ito)."""
DASHES = ("", "7 3", "2 3", "9 3 2 3", "1 2", "12 4", "5 5")
WIDTH, HEIGHT = 400, 300
LEFT, RIGHT, TOP, BOTTOM = 58, 118, 30, 44


@dataclass(frozen=True)
class Chart:
    """Curves by name, all over the same places x; both greater than 0. `unit` follows numbers of y."""

    title: str
    across: str
    up: str
    x: Sequence[float]
    curves: Mapping[str, Sequence[float]]
    scale: float = 1.0
    unit: str = ""


def svg(charts: Sequence[Chart], columns: int = 2) -> str:
    """Charts in rows of so many, each with its legend to the right."""
    wide, high = WIDTH * min(len(charts), columns), HEIGHT * -(-len(charts) // columns)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide}" height="{high}" '
        f'viewBox="0 0 {wide} {high}" font-family="sans-serif" font-size="11">',
        f'<rect width="{wide}" height="{high}" fill="#ffffff"/>',
    ]
    for number, chart in enumerate(charts):
        row, column = divmod(number, columns)
        parts += [f'<g transform="translate({column * WIDTH} {row * HEIGHT})">', *_drawn(chart), "</g>"]
    return "\n".join([*parts, "</svg>", ""])


def _drawn(chart: Chart) -> list[str]:
    values = [chart.scale * y for curve in chart.curves.values() for y in curve if y > 0]
    low, high = min(values), max(values)
    low, high = _nice_below(low), _nice_above(high)
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM

    def across(x: float) -> float:
        first, last = math.log(chart.x[0]), math.log(chart.x[-1])
        return LEFT + (right - LEFT) * (math.log(x) - first) / max(last - first, 1e-9)

    def up(y: float) -> float:
        share = (math.log(max(y, low)) - math.log(low)) / (math.log(high) - math.log(low))
        return bottom - (bottom - TOP) * share

    made = [_text(LEFT, 18, chart.title, "start", "bold")]
    for y in _ticks(low, high):
        made.append(_line(LEFT, up(y), right, up(y), "#dddddd"))
        made.append(_text(LEFT - 5, up(y) + 4, f"{y:g}{chart.unit}", "end"))
    for x in chart.x:
        made.append(_line(across(x), bottom, across(x), bottom + 4, "#555555"))
        made.append(_text(across(x), bottom + 16, f"{x:g}", "middle"))
    made.append(_line(LEFT, bottom, right, bottom, "#555555"))
    made.append(_line(LEFT, TOP, LEFT, bottom, "#555555"))
    made.append(_text((LEFT + right) / 2, HEIGHT - 10, chart.across, "middle"))
    middle = (TOP + bottom) / 2
    turned = f'<text transform="translate(13 {middle:.1f}) rotate(-90)" text-anchor="middle">'
    made.append(f"{turned}{escape(chart.up)}</text>")
    for number, (name, curve) in enumerate(chart.curves.items()):
        colour, dash = COLOURS[number % len(COLOURS)], DASHES[number % len(DASHES)]
        points = [(across(x), up(chart.scale * y)) for x, y in zip(chart.x, curve, strict=True)]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        style = f'fill="none" stroke="{colour}" stroke-width="1.8" stroke-dasharray="{dash}"'
        made.append(f'<polyline points="{path}" {style}/>')
        made += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.4" fill="{colour}"/>' for x, y in points]
        at = TOP + 8 + 18 * number
        made.append(f'<polyline points="{right + 8},{at} {right + 30},{at}" {style}/>')
        made.append(_text(right + 34, at + 4, name, "start"))
    return made


def _line(x: float, y: float, to_x: float, to_y: float, colour: str) -> str:
    return f'<line x1="{x:.1f}" y1="{y:.1f}" x2="{to_x:.1f}" y2="{to_y:.1f}" stroke="{colour}"/>'


def _text(x: float, y: float, text: str, anchor: str, weight: str = "normal") -> str:
    style = f'text-anchor="{anchor}" font-weight="{weight}" fill="#222222"'
    return f'<text x="{x:.1f}" y="{y:.1f}" {style}>{escape(text)}</text>'


def _ticks(low: float, high: float) -> list[float]:
    """1, 2 and 5 of each power of ten."""
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    every = [digit * 10.0**power for power in powers for digit in (1, 2, 5)]
    return [y for y in every if low * 0.999 <= y <= high * 1.001]


def _nice_below(value: float) -> float:
    return max(y for y in _ticks(value / 10, value * 1.0005))


def _nice_above(value: float) -> float:
    made = min(y for y in _ticks(value * 0.9995, value * 10))
    return made if made > _nice_below(value) * 1.01 else made * 2


__all__ = ["Chart", "svg"]
