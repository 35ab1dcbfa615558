# SPDX-License-Identifier: Apache-2.0
"""Line charts as SVG for the scaling section of docs/performance.md."""

import math
from xml.sax.saxutils import escape

WIDTH, HEIGHT = 720, 400
LEFT, RIGHT, BOTTOM = 70, 26, 56
LEGEND_ROW, LETTER = 22, 7.5  # heights and widths of the text
COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"]  # colour-blind safe (Okabe, Ito)


class Axis:
    """Maps values to positions between two edges of the chart, with ticks at round numbers."""

    def __init__(self, values, log, edges):
        self.log, self.edges = log, edges
        low, high = min(values), max(values)
        if log:
            self.ticks = self._log_ticks(low, high)
            self.low, self.high = math.log10(self.ticks[0]), math.log10(self.ticks[-1])
        else:
            whole = all(value == round(value) for value in values)
            step = max(self._round_up(high / 6), 1 if whole else 0)
            self.ticks = [step * i for i in range(math.ceil(high / step - 1e-9) + 1)]
            self.low, self.high = 0, self.ticks[-1]

    @staticmethod
    def _round_up(step):
        power = 10 ** math.floor(math.log10(step))
        return next(m * power for m in (1, 2, 5, 10) if m * power >= step * (1 - 1e-9))

    @staticmethod
    def _log_ticks(low, high):
        decades = range(math.floor(math.log10(low) + 1e-9), math.ceil(math.log10(high) - 1e-9) + 1)
        fine = [m * 10.0**d for d in decades for m in (1, 2, 5)]
        first = max((t for t in fine if t <= low * (1 + 1e-9)), default=fine[0])
        last = min((t for t in fine if t >= high * (1 - 1e-9)), default=fine[-1])
        return [t for t in fine if first <= t <= last] if len(decades) <= 4 else [10.0**d for d in decades]

    def place(self, value):
        share = ((math.log10(value) if self.log else value) - self.low) / (self.high - self.low)
        return self.edges[0] + share * (self.edges[1] - self.edges[0])


def label(value):
    """Formats a round number without trailing zeros, with k or M for large ones."""
    if value >= 1e6:
        return f"{value / 1e6:g} M"
    if value >= 1e4:
        return f"{value / 1e3:g} k"
    return f"{value:g}"


def text(x, y, words, anchor="middle", extra=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{extra}>{escape(words)}</text>'


def grid(x_axis, y_axis):
    (left, right), (bottom, top) = x_axis.edges, y_axis.edges
    lines = []
    for tick in x_axis.ticks:
        x = x_axis.place(tick)
        lines.append(f'<line x1="{x:.1f}" y1="{top}" x2="{x:.1f}" y2="{bottom}" stroke="#ddd"/>')
        lines.append(text(x, bottom + 18, label(tick)))
    for tick in y_axis.ticks:
        y = y_axis.place(tick)
        lines.append(f'<line x1="{left}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}" stroke="#ddd"/>')
        lines.append(text(left - 8, y + 4, label(tick), "end"))
    return lines


def legend(names):
    """Returns the legend above the chart, wrapped into rows, and the y coordinate of its end."""
    parts, x, y = [], LEFT, LEGEND_ROW
    for colour, name in zip(COLOURS, names):
        width = 28 + LETTER * len(name)
        if x > LEFT and x + width > WIDTH - RIGHT:
            x, y = LEFT, y + LEGEND_ROW
        parts.append(f'<line x1="{x}" y1="{y - 4}" x2="{x + 22}" y2="{y - 4}" stroke="{colour}" stroke-width="3"/>')
        parts.append(text(x + 28, y, name, "start"))
        x += width + 20
    return parts, y + LEGEND_ROW


def chart(series, x_label, y_label, log_x=False, log_y=False):
    """Returns an SVG of lines by name, each a list of (x, y). Linear axes start at zero."""
    points = [point for line in series.values() for point in line]
    x_axis = Axis([x for x, _ in points], log_x, (LEFT, WIDTH - RIGHT))
    names, top = legend(series)
    y_axis = Axis([y for _, y in points], log_y, (HEIGHT - BOTTOM, top))
    parts = grid(x_axis, y_axis) + names
    for colour, line in zip(COLOURS, series.values()):
        places = [(x_axis.place(x), y_axis.place(y)) for x, y in line]
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        parts.append(f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="2"/>')
        if len(line) <= 12:
            parts += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}"/>' for x, y in places]
    parts.append(text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 12, x_label))
    middle = (top + HEIGHT - BOTTOM) / 2
    parts.append(text(18, middle, y_label, extra=f' transform="rotate(-90 18 {middle:.1f})"'))
    return "\n".join(
        [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
         'font-family="sans-serif" font-size="13" fill="#222">',
         f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>', *parts, "</svg>\n"])
