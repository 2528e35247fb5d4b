"""Small plots as SVG files: dots in rows, and lines, on logarithmic axes; readable on light and on dark pages.

Text and axes are of a grey that either background bears, and follow the reader's choice of colours where the viewer
tells it; the background is transparent. Every plot has a title and a description for those who do not see it. Equal
data give equal bytes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape, quoteattr

_WIDTH = 760
_FONT = "font-family:system-ui,-apple-system,'Segoe UI',Roboto,'Helvetica Neue',Arial,sans-serif"
_STYLE = f"""
  text {{ {_FONT}; font-size: 12px; fill: #57606a }}
  .title {{ font-size: 14px; font-weight: 600; fill: #24292f }}
  .small {{ font-size: 11px }}
  .grid {{ stroke: #8c959f; stroke-opacity: .28 }}
  .axis {{ stroke: #8c959f }}
  @media (prefers-color-scheme: dark) {{
    text {{ fill: #9da7b3 }}
    .title {{ fill: #e6edf3 }}
  }}"""
_COLOURS = ("#2f81f7", "#c98500", "#2ea043", "#a371f7", "#db61a2", "#8b949e", "#d1532b")


@dataclass(frozen=True)
class Dots:
    """Rows of dots in groups: a group has a heading, a row a label and a value for each kind of dot, or None."""

    title: str
    description: str
    unit: str
    kinds: Sequence[str]
    groups: Sequence[tuple[str, Sequence[tuple[str, Sequence[float | None]]]]]

    def svg(self) -> str:
        """The first kind is filled, the second hollow."""
        values = [v for _, rows in self.groups for _, own in rows for v in own if v]
        left, top, row, gap = 190.0, 66.0, 22.0, 30.0
        axis = _Log(values, left, _WIDTH - 70)
        height = top + sum(gap + row * len(rows) for _, rows in self.groups) + 34
        out = [*_legend(self.kinds, left, 44)]
        bottom = height - 34
        for tick in axis.ticks:
            x = axis.at(tick)
            out.append(_line(x, top, x, bottom, "grid"))
            out.append(_text(x, bottom + 16, _number(tick), anchor="middle"))
        out.append(_text(_WIDTH - 50, bottom + 16, self.unit))
        y = top
        names = list(dict.fromkeys(label for _, rows in self.groups for label, _ in rows))
        for heading, rows in self.groups:
            y += gap
            out.append(_text(10, y - 8, heading, style="font-weight:600"))
            for label, own in rows:
                colour = _COLOURS[names.index(label) % len(_COLOURS)]
                out.append(_text(left - 10, y + row / 2 + 4, label, anchor="end"))
                out.append(_line(left, y + row / 2, _WIDTH - 70, y + row / 2, "grid"))
                for kind, value in enumerate(own):
                    if value:
                        x = axis.at(value)
                        fill = colour if kind == 0 else "none"
                        out.append(
                            f'<circle cx="{x:.1f}" cy="{y + row / 2:.1f}" r="5" fill="{fill}" stroke="{colour}" '
                            f'stroke-width="2"><title>{escape(f"{heading}, {label}, {self.kinds[kind]}")}: '
                            f"{_number(value)} {escape(self.unit)}</title></circle>"
                        )
                        if kind == 0:
                            out.append(_text(x + 9, y + row / 2 + 4, _number(value), style="font-size:11px"))
                y += row
        return _document(self.title, self.description, height, out)


@dataclass(frozen=True)
class Lines:
    """A line a series over common places, both axes logarithmic; a value that is 0 or less is left out."""

    title: str
    description: str
    across: str
    unit: str
    places: Sequence[float]
    series: Mapping[str, Sequence[float]]

    def svg(self) -> str:
        """The names stand at the lines' ends."""
        left, right, top, height = 64.0, _WIDTH - 170.0, 56.0, 400.0
        bottom = height - 52
        values = [v for own in self.series.values() for v in own if v > 0]
        y = _Log(values, bottom, top)
        x = _Log(self.places, left + 16, right, ticks=self.places)
        out = []
        for tick in y.ticks:
            out.append(_line(left, y.at(tick), right + 8, y.at(tick), "grid"))
            out.append(_text(left - 8, y.at(tick) + 4, _number(tick), anchor="end"))
        for place in self.places:
            out.append(_text(x.at(place), bottom + 18, _number(place), anchor="middle"))
        out.append(_text((left + right) / 2, bottom + 40, self.across, anchor="middle"))
        out.append(_text(left - 8, top - 12, self.unit, anchor="end"))
        ends = []
        for i, (name, own) in enumerate(self.series.items()):
            points = [(x.at(p), y.at(v), v) for p, v in zip(self.places, own, strict=True) if v > 0]
            if not points:
                continue
            colour = _COLOURS[i % len(_COLOURS)]
            path = " ".join(f"{px:.1f},{py:.1f}" for px, py, _ in points)
            out.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
            for px, py, value in points:
                tip = f"{name}: {_number(value)} {self.unit}"
                dot = (
                    f'<circle cx="{px:.1f}" cy="{py:.1f}" r="3.5" fill="{colour}"><title>{escape(tip)}</title></circle>'
                )
                out.append(dot)
            ends.append((points[-1][1], name, colour))
        for at, name, colour in _apart(ends, 15.0):
            out.append(f'<text x="{right + 14:.1f}" y="{at + 4:.1f}" style="fill:{colour}">{escape(name)}</text>')
        return _document(self.title, self.description, height, out)


class _Log:
    """A logarithmic axis over what it must hold, from one end on the page to the other."""

    def __init__(self, values: Iterable[float], begin: float, end: float, ticks: Sequence[float] | None = None) -> None:
        found = [v for v in values if v > 0] or [1.0]
        low, high = min(found), max(found)
        self.ticks = list(ticks) if ticks else _ticks(low, high)
        low, high = min(low, *self.ticks), max(high, *self.ticks)
        self._low, self._span = math.log(low), math.log(high) - math.log(low) or 1.0
        self._begin, self._end = begin, end

    def at(self, value: float) -> float:
        """Where a value is on the page."""
        return self._begin + (self._end - self._begin) * (math.log(value) - self._low) / self._span


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers that enclose a range: powers of ten, with others between them where those are few."""
    first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
    steps = (1, 2, 5) if last - first <= 3 else (1, 3) if last - first <= 5 else (1,)
    all_ = [step * 10.0**power for power in range(first, last + 1) for step in steps]
    below = [t for t in all_ if t <= low * 1.0001]
    above = [t for t in all_ if t >= high * 0.9999]
    return [t for t in all_ if (not below or t >= below[-1]) and (not above or t <= above[0])]


def _apart(ends: Sequence[tuple[float, str, str]], gap: float) -> list[tuple[float, str, str]]:
    """Labels at their lines' ends, moved down where two would overlap."""
    placed: list[tuple[float, str, str]] = []
    for at, name, colour in sorted(ends):
        placed.append((max(at, placed[-1][0] + gap) if placed else at, name, colour))
    return placed


def _legend(kinds: Sequence[str], x: float, y: float) -> list[str]:
    out = []
    for i, kind in enumerate(kinds):
        fill = "#8b949e" if i == 0 else "none"
        out.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="5" fill="{fill}" stroke="#8b949e" stroke-width="2"/>')
        out.append(_text(x + 10, y + 4, kind))
        x += 34 + 6.6 * len(kind)
    return out


def _line(x1: float, y1: float, x2: float, y2: float, kind: str) -> str:
    return f'<line class="{kind}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def _text(x: float, y: float, text: str, *, anchor: str = "start", style: str = "") -> str:
    extra = f' style="{style}"' if style else ""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{extra}>{escape(text)}</text>'


def _number(value: float) -> str:
    """Three digits, without zeros that say nothing."""
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def _document(title: str, description: str, height: float, parts: Sequence[str]) -> str:
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height:.0f}" width="{_WIDTH}" '
        f'height="{height:.0f}" role="img" aria-label={quoteattr(title)}>'
    )
    lines = [head, f"<title>{escape(title)}</title>", f"<desc>{escape(description)}</desc>", f"<style>{_STYLE}</style>"]
    lines.append(f'<text class="title" x="10" y="22">{escape(title)}</text>')
    return "\n".join([*lines, *parts, "</svg>", ""])
