"""Where it goes wrong: the moment that the recorded motion lacks at each coordinate, and what could act there."""

from collections.abc import Sequence

import numpy as np

from origami_sim.locate.acting import DRAWN
from origami_sim.locate.places import Acting, Impulse, Place
from origami_sim.report.diagnosis import Diagnosis
from origami_sim.report.page.markup import Html, amount, element, number, percent
from origami_sim.report.page.measures import array, known, when
from origami_sim.report.page.pieces import (
    bar,
    curve_figure,
    figure,
    fold,
    in_time,
    moment_of,
    nothing,
    quiet,
    row,
    table,
)

DETAILED = 6
"""Places whose curves are drawn."""

BLOWS = 12
"""Blows that are listed."""


def finding(d: Diagnosis) -> str:
    """The place where most is missing, and what alone could be missing."""
    best = max(d.places, key=lambda p: known(p.share, -1.0), default=None)
    if best is None:
        return "not located"
    alone = f"; like a {d.acting[0].what} {d.acting[0].site}" if d.acting else ""
    return f"{best.site}: {percent(best.share)} of the structure in what is missing{alone}"


def section(d: Diagnosis) -> list:
    blows = [_impulses(d.impulses)] if d.impulses else []
    if not d.places:
        return blows or [nothing("The missing moment could not be located.")]
    ordered = sorted(d.places, key=lambda p: -known(p.share, -1.0))
    ids = {p.site: f"place-{n}" for n, p in enumerate(ordered[:DETAILED])}
    timed = () if d.by_step else ("Unexplained power",)  # by load steps nothing has a power
    head = ("Place", "Share of structure", "Structure [sd]", *timed, "Departs at")
    body = [
        row(
            head,
            element("a", p.site, href=f"#{ids[p.site]}") if p.site in ids else p.site,
            bar(p.share),
            figure(number(p.score)),
            *(figure(amount(known(p.power), "W")) for _ in timed),
            figure(when(d, p.onset) if np.isfinite(known(p.onset)) else "never"),
        )
        for p in ordered
    ]
    about = (
        "Found without fitting any suspect: the moment that the recorded motion needs minus the moment that the "
        "refitted model has, at each coordinate. Structure: what noise cannot make."
        + " Negative power is lost, positive gained."
        * bool(timed)
    )
    out = [quiet(about), table(head, body, "Places")]
    out += [
        fold(f"Missing {moment_of(p.site)[0]} at {p.site}", _place(d, p), name=ids[p.site], open_=n == 0)
        for n, p in enumerate(ordered[:DETAILED])
    ]
    if len(ordered) > DETAILED:
        rest = sum(known(p.share, 0.0) for p in ordered[DETAILED:])
        out.append(quiet(f"{len(ordered) - DETAILED} more places share {percent(rest)}; their curves are in the data."))
    return [*out, *_alone(d.acting), *blows]


def _place(d: Diagnosis, p: Place) -> Html:
    name, unit = moment_of(p.site)
    figures = []
    if p.times:
        plot = in_time(f"missing {name}", p.site, unit, p.times, p.moment, p.error, by_step=d.by_step)
        if np.isfinite(known(p.onset)):
            plot.mark(p.onset, "onset", f"departs at {when(d, p.onset)}")
        caption = element("figcaption", element("b", "by load step" if d.by_step else "in time"), " shaded: ± 2 sd")
        figures.append(element("figure", caption, plot.html()))
    if p.balance is not None:  # what is left of the change of energy less the work, block by block
        c = p.balance
        plot = in_time("unexplained power", p.site, "W", c.x, c.mean, c.error)
        width = amount(float(np.median(np.diff(array(c.x)))), "s", 2) if len(c.x) > 1 else "one block"
        caption = element("figcaption", element("b", "unexplained power"), f" means over {width}, shaded: ± 2 sd")
        figures.append(element("figure", caption, plot.html()))
    figures += [curve_figure(p.site, c, f"missing {name}", unit) for c in p.curves]
    return element("div", figures or nothing("No curves."), class_="figures three")


def _alone(actions: Sequence[Acting]) -> list[Html]:
    """What one action alone leaves of the missing forces, and how large it would have to be."""
    if not actions:
        return []
    head = ("Acting alone", "Leaves [sd]", "Most like it", "Size (rms)")
    body = [
        row(
            head,
            ", ".join([f"{a.what} {a.site}", *a.same]),
            figure(number(a.left)),
            f"{a.like} ({a.overlap:.2f})" if a.like else "",
            figure(amount(_size(a), a.unit) if a.curves else ""),
        )
        for a in actions[:DRAWN]
    ]
    about = (
        "If one thing alone acted, as strongly as it takes from moment to moment: what would be left of the missing "
        "forces, in standard deviations (1: nothing), and which other action looks most like it (1: the same)."
    )
    out = [element("h3", "One action"), quiet(about), table(head, body, "Actions")]
    for a in actions:
        if a.curves:
            out.append(fold(f"If only a {a.what} {a.site}", element("div", *_action(a), class_="figures three")))
    return out


def _size(a: Acting) -> float:
    """Root mean square of an action in time, less its error's."""
    c = a.curves[0]
    return float(np.sqrt(max(np.mean(array(c.mean) ** 2 - array(c.error) ** 2), 0.0)))


def _action(a: Acting) -> list[Html]:
    """The size of an action in time, and against what it may go with."""
    time, *rest = a.curves
    name = a.what.split()[0]
    plot = in_time(name, a.site, a.unit, time.x, time.mean, time.error)
    caption = element("figcaption", element("b", "in time"), " shaded: ± 2 sd")
    return [element("figure", caption, plot.html()), *(curve_figure(a.site, c, name, a.unit) for c in rest)]


def _impulses(impulses: Sequence[Impulse]) -> Html:
    """Momentum that contacts give, recorded and predicted, the most different first."""
    head = ("Contact", "At", "Recorded", "Refitted model", "Error", "Apart [sd]")
    body = [
        row(
            head,
            f"{i.site}, {i.recording}",
            figure(amount(i.time, "s", 3)),
            *(figure(", ".join(f"{1e3 * v:.3g}" for v in part)) for part in (i.recorded, i.predicted, i.error)),
            figure(number(i.apart)),
        )
        for i in sorted(impulses, key=lambda i: -i.apart)[:BLOWS]
    ]
    about = (
        "Impulses on the device (x, y, z) [mN s]: inertia times the change of its rates, from lines through the frames "
        f"before and after each blow. {len(impulses)} blows are seen on both sides."
    )
    return element("div", element("h3", "Blows"), quiet(about), table(head, body, "Impulses"))
