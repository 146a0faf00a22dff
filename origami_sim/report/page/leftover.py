"""What is left: correlations of the residuals, which are none if they are noise."""

import numpy as np

from origami_sim.locate.places import clock
from origami_sim.report.diagnosis import Diagnosis
from origami_sim.report.page.markup import element, percent
from origami_sim.report.page.measures import array, limit, outside
from origami_sim.report.page.pieces import legend, nothing
from origami_sim.report.page.plots import Plot, span_of

EXPECTED = 0.05
"""Part of the lags of noise that lies outside of the band that holds 95 %."""


def finding(d: Diagnosis) -> str:
    """Whether as many lags stand out as noise would have, within two standard errors."""
    out = np.array([outside(d, c, "after") for c in d.correlations])
    out = out[np.isfinite(out)]
    if not len(out):
        return "not judged"
    lags = sum(max(len(c.lags) - 1, 1) for c in d.correlations)
    close = out.mean() <= EXPECTED + 2 * np.sqrt(EXPECTED * (1 - EXPECTED) / lags)
    return f"{'like noise' if close else 'not noise'}: {percent(float(out.mean()))} of the lags stand out"


def section(d: Diagnosis) -> list:
    if not d.correlations:
        return [nothing("No correlations were computed.")]
    keys = legend(("before", "refitted, nothing added"), ("after", "now"))
    note = element("p", "Shaded: where 95 % of the values lie if the residual is noise.")
    out = []
    for c in d.correlations:
        lags, most = array(c.lags), limit(d, c)
        pairs = [("autocorrelation", c.before, c.after)]
        if len(c.cross_before) or len(c.cross_after):
            pairs.append(
                (f"correlation with {(c.against or 'the drive').replace('_', ' ')}", c.cross_before, c.cross_after)
            )
        for name, before, after in pairs:
            plot = Plot(
                f"{name} of the residual of {c.component}",
                span_of(lags, margin=0.02),
                (-1.05, 1.05),
                x_name="lag in load steps" if d.by_step else "lag",
                x_unit=clock(d.by_step)[1],
                y_name=name.split(" with")[0],
                height=170,
            )
            if np.isfinite(most):
                ends = array(plot.x)
                plot.band(ends, np.full(2, -most), np.full(2, most), "noise")
            plot.level(0.0, "zero")
            for kind, values in (("before", before), ("after", after)):
                y = array(values)
                plot.line(lags[: len(y)], y, kind, title="nothing added" if kind == "before" else "now")
            facts = ""
            if name == "autocorrelation" and np.isfinite(most):
                facts = f" outside: {percent(outside(d, c, 'before'))} → {percent(outside(d, c, 'after'))}"
            caption = element("figcaption", element("b", f"{c.component}, {name}"), facts)
            out.append(element("figure", caption, plot.html()))
    return [element("div", keys, note, class_="legendrow"), element("div", out, class_="figures three")]
