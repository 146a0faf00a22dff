"""Plots as inline SVG whose lines stretch with the page while their text does not.

Data are drawn in a box that is stretched to the width there is; strokes keep their width (`non-scaling-stroke`), and
ticks and labels are ordinary text placed by percentages. So one drawing is sharp and readable at every width, in print,
and without a script. Colours come from the page's style by class.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from origami_sim.report.page.markup import Html, element, scaled_unit

POINTS = 900
"""Most points that a drawn line has; longer ones keep the least and the greatest value of every column."""

_WIDE, _HIGH = 2000, 1000

RAMP = ("#eef0ee", "#f9dd9d", "#f2a541", "#cf5a26", "#8a2318", "#46081a")
"""From nothing to all: lightness falls steadily, so that it reads in grey and to every eye."""


def colour(part: float) -> str:
    """Colour of a share between 0 and 1."""
    if not np.isfinite(part):
        return RAMP[0]
    place = float(np.clip(part, 0, 1)) * (len(RAMP) - 1)
    first = min(int(place), len(RAMP) - 2)
    a, b = ([int(RAMP[first + n][k : k + 2], 16) for k in (1, 3, 5)] for n in (0, 1))
    return "#" + "".join(f"{round(p + (place - first) * (q - p)):02x}" for p, q in zip(a, b, strict=True))


def is_dark(part: float) -> bool:
    """Whether text on the colour of this share must be white."""
    return bool(np.isfinite(part) and part > 0.5)


def span_of(*values, zero: bool = False, symmetric: bool = False, margin: float = 0.06) -> tuple[float, float]:
    """Range of all finite values with a margin; (-1, 1) about nothing."""
    flat = np.concatenate([np.ravel(np.asarray(v, float)) for v in values] or [np.zeros(0)])
    flat = flat[np.isfinite(flat)]
    low, high = (float(flat.min()), float(flat.max())) if len(flat) else (-1.0, 1.0)
    if zero:
        low, high = min(low, 0.0), max(high, 0.0)
    if symmetric:
        high = max(abs(low), abs(high))
        low = -high
    if high - low <= 1e-9 * max(abs(low), abs(high)):
        low, high = low - (abs(low) or 1.0) / 2, high + (abs(high) or 1.0) / 2
    pad = margin * (high - low)
    return low - pad, high + pad


def ticks(low: float, high: float, count: int = 5) -> list[float]:
    """Round numbers within a range, at most about `count`."""
    raw = (high - low) / count
    power = 10.0 ** np.floor(np.log10(raw))
    step = next(s * power for s in (1, 2, 5, 10) if s * power >= raw * (1 - 1e-9))
    return [float(k * step) for k in np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1)]


def thin(x: np.ndarray, y: np.ndarray, low: float, high: float, columns: int = (POINTS - 100) // 2) -> np.ndarray:
    """Indices of a line's points that can be seen: all, or the least and the greatest of every column, in order."""
    if len(x) <= 2 * columns:
        return np.arange(len(x))
    column = np.floor((x - low) / (high - low) * columns).astype(int)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(column)) + 1, [len(x)]])
    kept = {0, len(x) - 1}
    for a, b in pairwise(starts):
        kept |= {int(a + np.argmin(y[a:b])), int(a + np.argmax(y[a:b]))}
    return np.array(sorted(kept), int)


@dataclass
class Plot:
    """One pair of axes.

    Attributes:
        label: what is drawn, for those who do not see it. x, y: ranges [SI].
        x_name, y_name: names of the axes; units are added. x_unit, y_unit: SI units. height: [px].
        bare: without labels below, for a plot that shares its axis with the one underneath.
    """

    label: str
    x: tuple[float, float]
    y: tuple[float, float]
    x_name: str = ""
    y_name: str = ""
    x_unit: str = "1"
    y_unit: str = "1"
    height: int = 180
    bare: bool = False
    _parts: list[Html] = field(default_factory=list)

    def line(self, x, y, kind: str, *, breaks: Sequence[int] = (), title: str = "") -> "Plot":
        """A line, interrupted before the indices `breaks`, where time runs back and where a value is missing."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        path = [self._path(x, y, piece) for piece in _pieces(x, y, breaks)]
        return self._add("".join(path), kind, title)

    def band(self, x, low, high, kind: str, *, breaks: Sequence[int] = ()) -> "Plot":
        """The area between two lines."""
        x, low, high = (np.asarray(v, float) for v in (x, low, high))
        path = []
        for piece in _pieces(x, low + high, breaks):
            kept = piece[thin(x[piece], low[piece] + high[piece], *self.x)]
            outline = np.concatenate([kept, kept[::-1]])
            edge = np.concatenate([high[kept], low[kept][::-1]])
            path.append(self._steps(x[outline], edge) + "z")
        return self._add("".join(path), kind, "")

    def dots(self, x, y, kind: str, *, titles: Sequence[str] = ()) -> "Plot":
        """Single points: one path, or one each where they have titles to hover over."""
        x, y = np.asarray(x, float), np.asarray(y, float)
        shown = np.flatnonzero(np.isfinite(x) & np.isfinite(y)).tolist()
        spots = ["M{} {}h0".format(*self._at(a, b)) for a, b in zip(x[shown], y[shown], strict=True)]
        if not titles:
            return self._add("".join(spots), f"{kind} dots", "")
        for i, spot in zip(shown, spots, strict=True):
            self._add(spot, f"{kind} dots", titles[i])
        return self

    def bars(self, x, low, high, kind: str) -> "Plot":
        """Vertical error bars."""
        path = []
        for a, b, c in zip(*(np.asarray(v, float) for v in (x, low, high)), strict=True):
            if np.isfinite([a, b, c]).all():
                path.append("M{} {}V{}".format(*self._at(a, b), self._at(a, c)[1]))
        return self._add("".join(path), kind, "")

    def level(self, y: float, kind: str) -> "Plot":
        """A horizontal line through the whole plot."""
        return self._add(f"M0 {self._at(0, y)[1]}H{_WIDE}", kind, "") if self.y[0] <= y <= self.y[1] else self

    def mark(self, x: float, kind: str, title: str) -> "Plot":
        """A vertical line through the whole plot."""
        return self._add(f"M{self._at(x, 0)[0]} 0V{_HIGH}", kind, title) if self.x[0] <= x <= self.x[1] else self

    def html(self) -> Html:
        """The drawing with its axes."""
        below, x_label = _axis(self.x, self.x_name, self.x_unit)
        beside, y_label = _axis(self.y, self.y_name, self.y_unit)
        grid = "".join(f"M{round(_WIDE * p)} 0v{_HIGH}" for p, _ in below)
        grid += "".join(f"M0 {round(_HIGH * (1 - p))}h{_WIDE}" for p, _ in beside)
        drawing = element(
            "svg",
            element("path", d=grid, class_="grid"),
            self._parts,
            viewBox=f"0 0 {_WIDE} {_HIGH}",
            preserveAspectRatio="none",
            role="img",
            aria_label=self.label,
        )
        labels = [element("span", text, class_="ty", style=f"bottom:{100 * p:.2f}%") for p, text in beside]
        if not self.bare:
            labels += [element("span", text, class_="tx", style=f"left:{100 * p:.2f}%") for p, text in below]
            labels += [element("span", x_label, class_="nx")]
        labels += [element("span", y_label, class_="ny")]
        kind = "plot bare" if self.bare else "plot"
        return element("div", drawing, labels, class_=kind, style=f"height:{self.height}px")

    def _add(self, path: str, kind: str, title: str) -> "Plot":
        if path:
            shape = element("path", d=path, class_=kind)
            self._parts.append(element("g", element("title", title), shape) if title else shape)
        return self

    def _at(self, x: float, y: float) -> tuple[int, int]:
        right = (x - self.x[0]) / (self.x[1] - self.x[0])
        up = (y - self.y[0]) / (self.y[1] - self.y[0])
        return round(_WIDE * float(np.clip(right, -0.5, 1.5))), round(_HIGH * (1 - float(np.clip(up, -0.5, 1.5))))

    def _path(self, x, y, piece) -> str:
        kept = piece[thin(x[piece], y[piece], *self.x)]
        return self._steps(x[kept], y[kept])

    def _steps(self, x, y) -> str:
        """Steps in whole units of the box: short text, and no drift."""
        right = (x - self.x[0]) / (self.x[1] - self.x[0])
        up = (y - self.y[0]) / (self.y[1] - self.y[0])
        at = (
            np.column_stack([_WIDE * np.clip(right, -0.5, 1.5), _HIGH * (1 - np.clip(up, -0.5, 1.5))])
            .round()
            .astype(int)
        )
        steps = "".join(f" {a} {b}" if b >= 0 else f" {a}{b}" for a, b in np.diff(at, axis=0).tolist())
        return f"M{at[0, 0]} {at[0, 1]}" + (f"l{steps.strip()}" if len(at) > 1 else "h0")


def _pieces(x: np.ndarray, y: np.ndarray, breaks: Sequence[int]) -> list[np.ndarray]:
    """Runs of indices without a break, a step back or a missing value."""
    cut = np.zeros(len(x), bool)
    cut[[b for b in breaks if 0 <= b < len(x)]] = True
    cut[1:] |= np.diff(x) < 0
    fine = np.isfinite(x) & np.isfinite(y)
    cut[1:] |= fine[1:] != fine[:-1]
    return [p for p in np.split(np.arange(len(x)), np.flatnonzero(cut)) if len(p) and fine[p[0]]]


def _axis(span: tuple[float, float], name: str, unit: str) -> tuple[list[tuple[float, str]], str]:
    """(place between 0 and 1, text) of the ticks, and the axis' label with its unit."""
    # a range up to 0.7 rad reads better in rad than in mrad: prefixes change at a tenth
    factor, shown = scaled_unit(10 * max(abs(span[0]), abs(span[1])), unit)
    low, high = span[0] * factor, span[1] * factor
    at = ticks(low, high)
    step = at[1] - at[0] if len(at) > 1 else (high - low)
    power, note = 0, shown
    largest = max(map(abs, at), default=1.0)
    if largest and not 1e-3 <= largest < 1e5:  # no prefix was allowed: the power goes to the label
        power = int(np.floor(np.log10(largest)))
        note = f"10{str(power).translate(str.maketrans('0123456789-', '⁰¹²³⁴⁵⁶⁷⁸⁹⁻'))} {shown}".strip()
    decimals = int(np.clip(-np.floor(np.log10(step) - power + 1e-9), 0, 6))
    texts = [f"{v / 10.0**power + 0.0:.{decimals}f}".replace("-", "−") for v in at]
    return [((v - low) / (high - low), t) for v, t in zip(at, texts, strict=True)], f"{name} [{note}]" if note else name
