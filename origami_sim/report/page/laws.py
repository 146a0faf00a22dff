"""One plot for each law that is named: what the recorded motion lacks against what it goes with, and the law in it."""

from dataclasses import replace

import numpy as np

from origami_sim.effects import CATALOGUE
from origami_sim.infer.diagnosis import Candidate, Curve, Diagnosis, Trace
from origami_sim.locate.describe import NEAR
from origami_sim.report.page.law import Law, law_of
from origami_sim.report.page.markup import Html, element
from origami_sim.report.page.measures import array
from origami_sim.report.page.pieces import against, legend, moment_of
from origami_sim.report.page.plots import Plot, span_of
from origami_sim.report.page.wording import SEPARATOR, title_of, words_of

MOST = 4
"""Laws that are drawn; more are named in the headline only."""

TALL = 230
"""Height of these plots [px]."""

POINTS = 121
"""Points of a drawn law."""


def laws(d: Diagnosis) -> list[Html]:
    """A figure for each named law, in the order in which they are named; where none is, one of the error in time."""
    out, seen = [], set()
    for label in d.chosen:
        c = _row(d, label)
        for part in label.split(SEPARATOR):
            if part in seen or len(out) == MOST or part.partition(" at ")[0] not in CATALOGUE:
                continue
            seen.add(part)
            drawn = _law(d, part, c)
            if drawn is not None:
                out.append(drawn)
    if not out:
        drawn = _trace(d, "What is left", "before")
        out += [drawn] if drawn is not None else []
    return out


def _row(d: Diagnosis, label: str) -> Candidate | None:
    """The most probable explanation that is, or else holds, what is named."""
    rows = [c for c in d.candidates if not c.failed]
    whole = [c for c in rows if c.label == label or set(c.label.split(SEPARATOR)) == set(d.chosen)]
    holds = [c for c in rows if label in c.label.split(SEPARATOR)]
    return next(iter([*whole, *holds]), None)


def _law(d: Diagnosis, label: str, c: Candidate | None) -> Html | None:
    effect, _, site = label.partition(" at ")
    heading = _capital(words_of(label))
    if CATALOGUE[effect].family == "measurement":
        return _trace(d, heading, channel=site.removeprefix("channel "))
    law = law_of(effect, _values(effect, site, c)) if c is not None else None
    found = _missing(d, site, law)
    curve = _curve(found[1], effect, law) if found is not None else None
    if found is None or curve is None:
        return _trace(d, heading)
    where, _, name, unit, about = found
    curve = replace(curve, error=_error(curve).tolist())
    x = np.linspace(min(curve.x), max(curve.x), POINTS)
    y, said = _through(law, curve, x) if law is not None else (x[:0], "")
    plot = against(where, curve, f"missing {name}", unit, height=TALL, also=y)
    if len(y):
        plot.line(x, y, "law", title=title_of(effect))
    goes = curve.against.replace("_", " ")
    caption = element(
        "figcaption",
        element("b", heading),
        element("span", f"{about}, against the {goes} there.{said}"),
    )
    entries = [("place", "recorded motion, ± 2 se")] + ([("law", "the law with its fitted numbers")] if len(y) else [])
    return element("figure", caption, element("div", plot.html(), legend(*entries)), class_="law")


def _missing(d: Diagnosis, site: str, law: Law | None) -> tuple[str, list[Curve], str, str, str] | None:
    """Where, the curves of what is missing, its name and unit, and what it is: at the site, or where most is missing.

    Where one thing is missing, its size, by all coordinates, is known better than the moment that one coordinate lacks
    by itself. But it is a mean over windows in time, which rounds what is not straight.
    """
    own = [p for p in d.places if p.site == site]
    near = [a for a in d.acting if a.curves and a.left < NEAR * d.acting[0].left]
    alone = next((a for a in near if a.site == site), None)
    bent = law is not None and not law.straight(np.linspace(-1.0, 1.0, 9))
    if alone is not None and not (own and (bent or d.verdict == "SEVERAL")):
        name = alone.what.split()[0]
        return site, alone.curves[1:], name, alone.unit, f"The {name} {alone.what.split()[1]} {site} that is missing"
    p = max(own or d.places, key=lambda p: p.share, default=None)
    if p is None:
        return None
    return p.site, p.curves, *moment_of(p.site), f"What the refitted model lacks at {p.site}"


def _values(effect: str, site: str, c: Candidate) -> dict[str, float]:
    """Fitted numbers of an effect at a site, by name; the effects' numbers come in the order of the effects."""
    mine = [n for n in c.numbers if n.label.startswith(f"{effect}.")]
    alike = [s for e, s in zip(c.effects, c.sites, strict=True) if e == effect]
    if site not in alike or len(mine) % len(alike):
        return {}
    each = len(mine) // len(alike)
    first = alike.index(site) * each
    return {n.label.partition(".")[2].partition("[")[0]: n.value for n in mine[first : first + each]}


def _curve(curves: list[Curve], effect: str, law: Law | None) -> Curve | None:
    """What the missing moment goes with: what the law says, what drives it, or what explains most of it."""
    curves = [c for c in curves if len(c.x) > 2]
    if law is not None:
        return next((c for c in curves if c.against == law.against), None)
    e = CATALOGUE[effect]
    names = [n for n in e.drives if n != "time"] or (["rate"] if e.dissipates else [effect.partition("_")[0]])
    driven = [c for c in curves if c.against.startswith(tuple(names))]
    plain = [c for c in curves if not c.against.startswith(("phase of", "time since"))]
    return max(driven or plain or curves, key=_structure, default=None)


def _error(c: Curve) -> np.ndarray:
    """Standard error of each mean: no more than how much neighbours scatter about a smooth curve.

    Second differences of independent means have six times their variance. What was written down knows the noise of
    single accelerations only, most of which cancels in a mean over a motion that goes on.
    """
    mean, error = array(c.mean), array(c.error)
    if len(mean) < 5:
        return error
    return np.minimum(error, np.sqrt(np.mean(np.diff(mean, 2) ** 2) / 6.0))


def _structure(c: Curve) -> float:
    """Mean square of a curve about its mean, over its error."""
    mean, error = array(c.mean), np.maximum(array(c.error), 1e-300)
    return float(np.nanmean(((mean - np.nanmean(mean)) / error) ** 2))


def _through(law: Law, c: Curve, x: np.ndarray) -> tuple[np.ndarray, str]:
    """The law at x, and what was taken off it.

    The refitted model has bent its own stiffness and loss towards the law as far as it could. In the plotted quantity
    that is a straight line; it is found from what the bins have beyond the law.
    """
    said = "".join(f" {_capital(k.replace('_', ' '))} taken as {v:g}." for k, v in law.assumed.items())
    at, mean, error = array(c.x), array(c.mean), array(c.error)
    y = law.moment(x)
    if law.straight(x) or len(at) < 4:
        return y, said
    weight = 1.0 / np.maximum(error, 1e-3 * np.ptp(mean) + 1e-300)
    line = np.polyfit(at, mean - law.moment(at), 1, w=weight)
    more = " The law is drawn less the straight line that refitting the model's own numbers had taken over."
    return y + np.polyval(line, x), more + said


def _trace(d: Diagnosis, heading: str, without: str = "refitted", *, channel: str = "") -> Html | None:
    """For what acts on the recording and not at a crease: the residual that it explains, before and after.

    Args:
        without: the prediction that is drawn beside what was found, see `Trace`. channel: which, if it is a matter of
            one; else the one that gains most.
    """
    t = max([t for t in d.traces if t.component == channel] or d.traces, key=lambda t: _gain(t, without), default=None)
    if t is None:
        return None
    x, y = array(t.times), array(t.recorded)
    before, after = y - array(getattr(t, without)), y - array(t.after)
    plot = Plot(
        f"residual of {t.component} of {t.recording} in time",
        span_of(x, margin=0.0),
        span_of(before, after, zero=True),
        x_name="time",
        x_unit="s",
        y_name="residual",
        y_unit=t.unit,
        height=TALL,
    )
    if t.noise > 0:
        plot.band(array(plot.x), np.full(2, -2 * t.noise), np.full(2, 2 * t.noise), "noise")
    plot.level(0.0, "zero").line(x, before, without, breaks=t.breaks).line(x, after, "after", breaks=t.breaks)
    said = f"Recorded minus predicted {t.component} in {t.recording}, where it changes most. Shaded: noise, ± 2 sd."
    caption = element("figcaption", element("b", heading), element("span", said))
    key = legend((without, "as given" if without == "before" else "without it"), ("after", "now"))
    return element("figure", caption, element("div", plot.html(), key), class_="law")


def _gain(t: Trace, without: str) -> float:
    recorded, before, after = array(t.recorded), array(getattr(t, without)), array(t.after)
    return float(np.nansum((recorded - before) ** 2 - (recorded - after) ** 2)) / max(t.noise, 1e-300) ** 2


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
