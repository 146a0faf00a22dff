"""What the sections of the page are made of: tables, legends, and plots of what is missing."""

from collections.abc import Sequence

import numpy as np

from origami_sim.locate.places import REVERSAL, Curve, clock
from origami_sim.report.page.markup import Html, amount, element, join, percent, plus_minus
from origami_sim.report.page.measures import array, known
from origami_sim.report.page.plots import Plot, span_of


def table(head: Sequence[str], rows: Sequence[Html], label: str, *, kind: str = "") -> Html:
    """A table from its column names and from rows of `row`; on a narrow screen, a list of cards."""
    names = element("tr", [element("th", name, scope="col") for name in head])
    return element(
        "table", element("thead", names), element("tbody", rows), class_=f"cards {kind}".strip(), aria_label=label
    )


def row(head: Sequence[str], first, *cells, kind: str = "") -> Html:
    """One row; a cell is text, markup or, if it says so itself, a whole `td`.

    Args:
        head: names of the columns, which stand beside each cell on a narrow screen.
    """
    out = [element("th", first, scope="row")]
    for name, content in zip(head[1:], cells, strict=True):
        inner = content if isinstance(content, tuple) else (content, "")
        out.append(element("td", element("div", inner[0]), class_=inner[1] or None, data_label=name))
    return element("tr", out, class_=kind or None)


def figure(content) -> tuple:
    """A cell that holds a number: digits stand under each other and are not broken."""
    return content, "n"


def bar(part: float, text: str | None = None) -> tuple:
    """A cell with a number and a bar as long as a part between 0 and 1."""
    filled = float(np.clip(known(part, 0.0), 0.0, 1.0))
    drawn = element("i", element("i", style=f"width:{100 * filled:.1f}%"), class_="bar")
    return join([element("span", percent(known(part)) if text is None else text), drawn]), "n barred"


def legend(*entries: tuple[str, str]) -> Html:
    return element("p", [element("span", name, class_=f"key k-{kind}") for kind, name in entries], class_="legend")


def nothing(text: str) -> Html:
    return element("p", text, class_="nothing")


def quiet(*text) -> Html:
    return element("p", *text, class_="quiet")


def fold(title, *content, name: str = "", open_: bool = False) -> Html:
    """A part of a section that can be folded away."""
    return element("details", element("summary", element("h3", title)), *content, id=name or None, open=open_)


def moment_of(site: str) -> tuple[str, str]:
    """(name, unit) of the generalised force of a coordinate."""
    return ("force", "N") if site.startswith("shift ") else ("moment", "N m")


def in_time(
    name: str, site: str, unit: str, times: Sequence, values: Sequence, error: Sequence, *, by_step: bool = False
) -> Plot:
    """Something at a place in time or by load steps, with twice its standard deviation where that is known."""
    counted, second = clock(by_step)
    x, y, e = array(times), array(values), array(error)
    plot = Plot(
        f"{name} at {site} by {counted}",
        span_of(x, margin=0.0),
        span_of(y, zero=True, margin=0.15),
        x_name=counted,
        x_unit=second,
        y_name=name,
        y_unit=unit,
    )
    if len(e) == len(x):
        plot.band(x, y - 2 * e, y + 2 * e, "noise")
    return plot.level(0.0, "zero").line(x, y, "place")


def against(
    site: str, c: Curve, name: str, unit: str, *, height: int = 180, also: Sequence[float] | np.ndarray = ()
) -> Plot:
    """A binned curve with bars of two standard errors.

    Args:
        also: values that the plot has to hold besides.
    """
    x, y, e = array(c.x), array(c.mean), array(c.error)
    goes = c.against.replace("_", " ")
    plot = Plot(
        f"{name} at {site} against {goes}",
        span_of(x),
        span_of(y - 2 * np.nan_to_num(e), y + 2 * np.nan_to_num(e), array(also), zero=True),
        x_name=goes,
        x_unit=c.unit,
        y_name=name,
        y_unit=unit,
        height=height,
    )
    titles = [
        f"{goes} {amount(a, c.unit, 3)}: {plus_minus(b, s, unit)}, {n} values"
        for a, b, s, n in zip(x, y, e, c.count, strict=False)
    ]
    return plot.level(0.0, "zero").bars(x, y - 2 * e, y + 2 * e, "place").dots(x, y, "place", titles=titles)


def curve_figure(site: str, c: Curve, name: str, unit: str) -> Html:
    """A binned curve with its caption."""
    how = " along the motion, bars: ± 2 se" if c.against == REVERSAL else " bars: ± 2 se"
    caption = element("figcaption", element("b", f"against {c.against.replace('_', ' ')}"), how)
    return element("figure", caption, against(site, c, name, unit).html())
