"""Recorded and predicted in time: the model as given, refitted, and with what was found."""

import numpy as np

from origami_sim.report.diagnosis import Diagnosis, Trace
from origami_sim.report.page.markup import Html, element, fit_percent, join
from origami_sim.report.page.measures import array, fit, known, when
from origami_sim.report.page.pieces import fold, legend, nothing
from origami_sim.report.page.plots import Plot, span_of

OPEN = 3
"""Recordings that are not folded once the section is open."""

NAMES = (("before", "as given"), ("refitted", "refitted"), ("after", "now"))


def finding(d: Diagnosis) -> str:
    """Since when the refitted model is wrong."""
    if not d.traces:
        return "nothing to compare"
    if not np.isfinite(known(d.onset)):
        return "the refitted model never departs lastingly"
    return f"the refitted model departs lastingly after {when(d, d.onset)}"


def section(d: Diagnosis) -> list:
    if not d.traces:
        return [nothing("No channel could be compared.")]
    groups = {r: [t for t in d.traces if t.recording == r] for r in dict.fromkeys(t.recording for t in d.traces)}
    single = len(groups) == 1
    keys = [
        legend(("recorded", "recorded"), *NAMES),
        element("p", "Shaded: ± 2 sd of the prediction; below, recorded minus predicted, shaded ± 2 sd of the noise."),
    ]
    out = [element("div", keys, class_="legendrow")]
    for n, (name, traces) in enumerate(groups.items()):
        drawn = [overlay(t, d.onset if single else np.nan, when(d, d.onset)) for t in traces]
        figures = element("div", drawn, class_="figures")
        out.append(figures if single else fold(name, figures, open_=n < OPEN))
    return out


def overlay(t: Trace, onset: float, said: str) -> Html:
    """A channel of a recording over its predictions, and the residuals below.

    Args:
        onset: when the refitted model departs [s, steps], marked if finite. said: that in words.
    """
    x = array(t.times)
    y = {kind: array(getattr(t, kind)) for kind in ("recorded", "before", "refitted", "after")}
    along = span_of(x, margin=0.0)
    top = Plot(
        f"{t.component} of {t.recording} by {t.clock[0]}: recorded and predicted",
        along,
        span_of(*y.values()),
        y_name=t.component,
        y_unit=t.unit,
        height=190,
        bare=True,
    )
    low = Plot(
        f"residual of {t.component} of {t.recording} by {t.clock[0]}",
        along,
        span_of(y["recorded"] - y["before"], y["recorded"] - y["after"], [2 * known(t.noise, 0.0)], symmetric=True),
        x_name=t.clock[0],
        x_unit=t.clock[1],
        y_name="residual",
        y_unit=t.unit,
        height=90,
    )
    if np.isfinite(known(t.band)) and t.band > 0:
        top.band(x, y["after"] - t.band, y["after"] + t.band, "band", breaks=t.breaks)
    if known(t.noise, 0.0) > 0:
        ends = array(along)
        low.band(ends, np.full(2, -2 * t.noise), np.full(2, 2 * t.noise), "noise")
    if len(x) <= 150:
        top.dots(x, y["recorded"], "recorded")
    else:
        top.line(x, y["recorded"], "recorded", title="recorded")
    for kind, title in NAMES:
        top.line(x, y[kind], kind, breaks=t.breaks, title=title)
    low.level(0.0, "zero")
    for kind, title in (("before", "as given"), ("after", "now")):
        low.line(x, y["recorded"] - y[kind], kind, breaks=t.breaks, title=f"residual, {title}")
    if np.isfinite(onset):
        for plot in (top, low):
            plot.mark(onset, "onset", f"departs lastingly at {said}")
    for b in t.breaks if len(t.breaks) <= 40 else []:
        if 0 < b < len(x):
            for plot in (top, low):
                plot.mark(x[b], "cut", "a segment with a start of its own")
    fits = [("given", "before"), ("refitted", "refitted"), ("now", "after")]
    caption = element(
        "figcaption",
        element("b", t.component),
        " fit: ",
        join(element("span", f"{name} {fit_percent(fit(t, kind))}", class_=f"key k-{kind}") for name, kind in fits),
    )
    return element("figure", caption, top.html(), low.html())
