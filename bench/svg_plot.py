# SPDX-License-Identifier: Apache-2.0
"""Line plots as SVG to stand in an HTML page, whose style sheet holds STYLE."""
import html
import itertools
import math

WIDTH, HEIGHT = 360, 250
LEFT, RIGHT, TOP, BOTTOM = 46, 350, 26, 208  # of the axes
# A line's class is its colour.
STYLE = """
.none { --line: #8a8f98 } .twin { --line: #3f8fd2 } .rgba { --line: #d9601a } .alpha { --line: #1f9d6b }
.rgb { --line: #c36ba5 } .size { --line: #b58900 }
svg.plot { width: 100%; height: auto; font: 11px system-ui, sans-serif }
svg.plot text { fill: var(--text) } svg.plot .title { font-weight: 600; font-size: 12px }
svg.plot .axis { stroke: var(--rule); fill: none } .dot { fill: var(--line) }
.curve { fill: none; stroke: var(--line); stroke-width: 2; stroke-linejoin: round }
.curve.dashed { stroke-dasharray: 5 3 }
.legend { display: flex; flex-wrap: wrap; gap: .2em 1.2em } .legend svg { width: 24px; height: 8px; margin-right: .4em }
"""


class Line:
    """points: (x, y), of which those with a None are left out, and the line broken there. Shown by dots, joined."""

    def __init__(self, label, style, points, dashed=False, dots=True, joined=True):
        self.label, self.style, self.dots, self.joined = label, style, dots, joined
        pieces = itertools.groupby(points, lambda point: None not in point)
        self.pieces = [list(piece) for there, piece in pieces if there]
        self.points = list(itertools.chain(*self.pieces))
        self.classes = f"curve {style}" + (" dashed" if dashed else "")


def round_ticks(low, high):
    """Three to six round numbers from `low` to `high`."""
    rough = (high - low) / 5
    power = 10 ** math.floor(math.log10(rough))
    step = next(power * s for s in (1, 2, 5, 10) if power * s >= rough)
    return [n * step for n in range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)]


def decade_ticks(low, high):
    """1, 2 and 5 of every decade from `low` to `high`; of many decades, 1 alone."""
    digits = (1, 2, 5) if high / low < 300 else (1,)
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    return [d * 10.0 ** n for n in decades for d in digits if low * 0.999 <= d * 10.0 ** n <= high * 1.001]


class Axis:
    """Takes values in [low, high] to places in [start, end]."""

    def __init__(self, values, start, end, logarithmic, ticks):
        low, high = min(values), max(values)
        if low == high:
            low, high = (low / 2, high * 2) if logarithmic else (low - 1, high + 1)
        self.scale = math.log if logarithmic else float
        self.ticks = ticks or (decade_ticks if logarithmic else round_ticks)(low, high)
        self.low, self.high, self.start, self.end = low, high, start, end

    def place(self, value):
        low, high = self.scale(self.low), self.scale(self.high)
        return self.start + (self.scale(value) - low) / (high - low) * (self.end - self.start)


def plot(title, lines, x_label, y_label, logarithmic=True, x_ticks=None):
    """An <svg>, or nothing where no line has a point."""
    points = [point for line in lines for point in line.points]
    if not points:
        return ""
    x = Axis([*(p[0] for p in points), *(x_ticks or [])], LEFT + 8, RIGHT - 8, logarithmic, x_ticks)
    y = Axis([p[1] for p in points], BOTTOM - 8, TOP + 8, False, None)
    parts = [f'<text class="title" x="{LEFT}" y="16">{html.escape(title)}</text>',
             f'<path class="axis" d="M{LEFT} {TOP}V{BOTTOM}H{RIGHT}"/>']
    for value in x.ticks:
        at = x.place(value)
        parts.append(f'<path class="axis" d="M{at:.1f} {BOTTOM}v4"/>'
                     f'<text x="{at:.1f}" y="{BOTTOM + 16}" text-anchor="middle">{value:g}</text>')
    for value in y.ticks:
        at = y.place(value)
        parts.append(f'<path class="axis" d="M{LEFT} {at:.1f}H{RIGHT}"/>'
                     f'<text x="{LEFT - 5}" y="{at + 4:.1f}" text-anchor="end">{value:g}</text>')
    parts.append(f'<text x="{(LEFT + RIGHT) / 2}" y="{HEIGHT - 6}" text-anchor="middle">{html.escape(x_label)}</text>'
                 f'<text transform="translate(11 {(TOP + BOTTOM) / 2}) rotate(-90)" text-anchor="middle">'
                 f"{html.escape(y_label)}</text>")
    for line in lines:
        if line.joined and line.points:
            paths = ("L".join(f"{x.place(a):.1f} {y.place(b):.1f}" for a, b in piece) for piece in line.pieces)
            parts.append(f'<path class="{line.classes}" d="M{"M".join(paths)}"/>')
        for a, b in line.points if line.dots else ():
            parts.append(f'<circle class="dot {line.style}" cx="{x.place(a):.1f}" cy="{y.place(b):.1f}" r="3">'
                         f"<title>{html.escape(line.label)}: {a:.4g}, {b:.4g}</title></circle>")
    shown = ", ".join(line.label for line in lines if line.points)
    name = html.escape(f"{title}: {y_label} over {x_label}, of {shown}")
    return f'<svg class="plot" viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{name}">{"".join(parts)}</svg>'


def legend(lines):
    def mark(line):
        if line.joined:
            return f'<path class="{line.classes}" d="M0 4H24"/>'
        return f'<circle class="dot {line.style}" cx="12" cy="4" r="3"/>'

    return '<div class="legend">' + "".join(f'<span><svg viewBox="0 0 24 8">{mark(line)}</svg>{html.escape(line.label)}'
                                            "</span>" for line in lines) + "</div>"
