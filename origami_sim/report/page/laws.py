"""One plot for each law that is named: what the recorded motion lacks without it, and what the law gives of that."""

from dataclasses import replace

import numpy as np

from origami_sim.effects import CATALOGUE
from origami_sim.hypotheses.hypothesis import SEPARATOR
from origami_sim.infer.discrepancy import of_recorder
from origami_sim.locate.places import REVERSAL, Curve, Partial
from origami_sim.report.diagnosis import Diagnosis, Trace
from origami_sim.report.page.markup import Html, element
from origami_sim.report.page.measures import array
from origami_sim.report.page.pieces import against, legend, moment_of
from origami_sim.report.page.plots import Plot, span_of
from origami_sim.report.page.wording import title_of, words_of

MOST = 4
"""Laws that are drawn; more are named in the headline only."""

TALL = 230
"""Height of these plots [px]."""


def laws(d: Diagnosis) -> list[Html]:
    """A figure for each named law, in the order in which they are named; where none is, one of the error in time."""
    parts = dict.fromkeys(part for label in d.chosen for part in label.split(SEPARATOR))
    named = [part for part in parts if part.partition(" at ")[0] in CATALOGUE]
    known = {p.label: p for p in d.partials}
    drawn = [_law(known[part]) if part in known else _of_recording(d, part) for part in named[:MOST]]
    out = [figure for figure in drawn if figure is not None]
    if not out:
        left = _trace(d, "What is left", "before")
        out = [left] if left is not None else []
    return out


def _law(p: Partial) -> Html:
    """The partial residual of an effect, with what the effect gives."""
    name, unit = ("residual", p.unit) if p.unit else moment_of(p.site)
    curve, goes = replace(p.curve, error=_error(p.curve).tolist()), p.curve.against.replace("_", " ")
    plot = against(p.site, curve, name if p.unit else f"missing {name}", unit, height=TALL, also=p.law)
    plot.line(array(curve.x), array(p.law), "law", title=title_of(p.label.partition(" at ")[0]))
    along = " along the motion" if curve.against == REVERSAL else ""
    said = f"The {name} at {p.site}{along} that the found model lacks without this effect, against the {goes} there."
    if p.unit:
        said = f"Recorded {p.site} minus what the found model predicts without this effect, against the {goes}."
    caption = element("figcaption", element("b", _capital(words_of(p.label))), element("span", said))
    key = legend(("place", "recorded, ± 2 se"), ("law", "what it gives with its fitted numbers"))
    return element("figure", caption, element("div", plot.html(), key), class_="law")


def _of_recording(d: Diagnosis, label: str) -> Html | None:
    """For what acts on no coordinate: the residual that it explains, in time."""
    effect, _, site = label.partition(" at ")
    channel = site.removeprefix("channel ") if of_recorder(effect) else ""
    return _trace(d, _capital(words_of(label)), channel=channel)


def _error(c: Curve) -> np.ndarray:
    """Standard error of each mean: no more than how much neighbours scatter about a smooth curve.

    Second differences of independent means have six times their variance. What was written down knows the noise of
    single accelerations only, most of which cancels in a mean over a motion that goes on.
    """
    mean, error = array(c.mean), array(c.error)
    if len(mean) < 5:
        return error
    return np.minimum(error, np.sqrt(np.mean(np.diff(mean, 2) ** 2) / 6.0))


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
        f"residual of {t.component} of {t.recording} by {t.clock[0]}",
        span_of(x, margin=0.0),
        span_of(before, after, zero=True),
        x_name=t.clock[0],
        x_unit=t.clock[1],
        y_name="residual",
        y_unit=t.unit,
        height=TALL,
    )
    if t.noise > 0:
        plot.band(array(plot.x), np.full(2, -2 * t.noise), np.full(2, 2 * t.noise), "noise")
    plot.level(0.0, "zero").line(x, before, without, breaks=t.breaks).line(x, after, "after", breaks=t.breaks)
    said = f"Recorded minus predicted {t.component} in {t.recording}, where it changes most. Shaded: noise, ± 2 sd."
    caption = element("figcaption", element("b", heading), element("span", said))
    key = legend((without, "as given" if without == "before" else "refitted without effects"), ("after", "now"))
    return element("figure", caption, element("div", plot.html(), key), class_="law")


def _gain(t: Trace, without: str) -> float:
    recorded, before, after = array(t.recorded), array(getattr(t, without)), array(t.after)
    return float(np.nansum((recorded - before) ** 2 - (recorded - after) ** 2)) / max(t.noise, 1e-300) ** 2


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
