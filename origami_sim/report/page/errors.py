"""The error of every model on data that it did not see, and of methods that name no physics."""

import numpy as np

from origami_sim.report.diagnosis import Diagnosis
from origami_sim.report.page.markup import MISSING, Html, amount, element, number, times
from origami_sim.report.page.measures import each_multiple, has_noise, multiples, padded
from origami_sim.report.page.pieces import figure, quiet, row, table
from origami_sim.report.page.wording import worded, words_of


def finding(d: Diagnosis) -> str:
    """Ours beside the best of the baselines."""
    ours = multiples(d, d.error_after)
    if not np.isfinite(ours):
        return "not measured"
    beside = [(multiples(d, b.rms), b.name) for b in d.baselines]
    beside = [b for b in beside if np.isfinite(b[0])]
    text = f"{number(ours)} times the {'noise' if has_noise(d) else 'spread'}"
    return text + (f"; {min(beside)[1]} {number(min(beside)[0])}" if beside else "")


def section(d: Diagnosis) -> list:
    unit = "noise" if has_noise(d) else "spread"
    ours = " with ".join(words_of(label) for label in d.chosen) if d.verdict != "TIE" else "the best of the tie"
    rows = [
        ("the model as given", d.error_before, "before", ""),
        ("the model, refitted", d.error_refitted, "refitted", ""),
    ]
    rows += [(b.name, b.rms, "other", b.note) for b in d.baselines]
    rows.append((f"now: {ours or 'nothing added'}", d.error_after, "after", ""))
    each = [each_multiple(d, rms) for _, rms, *_ in rows]
    finite = np.concatenate([np.zeros(0), *each])
    finite = finite[np.isfinite(finite) & (finite > 0)]
    low = min(0.7, 0.8 * float(finite.min())) if len(finite) else 0.7
    high = max(3.0, 1.25 * float(finite.max())) if len(finite) else 3.0
    head = ("Model or method", "Error", f"× {unit}", "By channel", "What it finds")
    body = []
    for (name, rms, kind, note), values in zip(rows, each, strict=True):
        total = multiples(d, rms)
        by = [
            element("span", f"{c} {amount(v, u, 3)} ({times(m)})", class_="piece")
            for c, v, u, m in zip(d.components, padded(rms, d), d.units, values, strict=True)
            if np.isfinite(v)
        ]
        strip = _strip(values, total, low, high, kind, f"{name}: {times(total)} {unit}")
        body.append(
            row(
                head,
                name,
                (strip, "strip"),
                figure(times(total)),
                by or MISSING,
                worded(note) or MISSING,
                kind="ours" if kind == "after" else "",
            )
        )
    marks = ", ".join(f"{v:g}" for v in log_ticks(low, high))
    seen = "did not see" if d.left_out else "saw, as nothing could be left out"
    note = (
        f"On data that the fit {seen}. Dot: over all channels; ticks: one each; vertical line: the noise; "
        f"grey marks: {marks} times the noise, by its logarithm."
        if has_noise(d)
        else "The noise is not known: errors are multiples of the recorded standard deviation (NRMSE)."
    )
    floor = [f"{c} {amount(s, u)}" for c, s, u in zip(d.components, padded(d.noise, d), d.units, strict=True)]
    return [
        table(head, body, "Error of every model", kind="errors"),
        quiet(note),
        quiet(f"Noise: {', '.join(floor)}.") if has_noise(d) else "",
        *_by_fold(d, unit),
    ]


def _by_fold(d: Diagnosis, unit: str) -> list:
    """A table of the parts of the data, each predicted with numbers that the others tell."""
    if not d.folds:
        return []
    head = ("Left out, and told by the rest", "as given", "refitted", "now")
    body = [
        row(head, f.name, *(figure(times(multiples(d, rms))) for rms in (f.before, f.refitted, f.after)))
        for f in d.folds
    ]
    note = f"Multiples of the {unit}. What the model was given may itself rest on these data."
    return [table(head, body, "Error by part of the data"), quiet(note)]


def _strip(values, total: float, low: float, high: float, kind: str, label: str) -> Html:
    """Dots on a logarithmic axis, 1 to be the noise."""
    at = [round(1000 * log_place(v, low, high)) for v in values if np.isfinite(v) and v > 0]
    parts = [element("path", d="M0 50h1000", class_="grid")]
    parts += [
        element("path", d=f"M{round(1000 * log_place(v, low, high))} 35v30", class_="grid")
        for v in log_ticks(low, high)
    ]
    parts.append(element("path", d=f"M{round(1000 * log_place(1.0, low, high))} 0v100", class_="floor"))
    parts += [element("path", d=f"M{x} 25v50", class_=f"{kind} tick") for x in at]
    if np.isfinite(total) and total > 0:
        spot = f"M{round(1000 * log_place(total, low, high))} 50h0"
        parts.append(element("path", d=spot, class_=f"{kind} dots big"))
    return element("svg", parts, viewBox="0 0 1000 100", preserveAspectRatio="none", role="img", aria_label=label)


def log_place(value: float, low: float, high: float) -> float:
    """Place between 0 and 1 on a logarithmic axis."""
    return float(np.log(value / low) / np.log(high / low))


def log_ticks(low: float, high: float) -> list[float]:
    """Round numbers for a logarithmic axis, the fewer the longer it is."""
    steps = (1, 2, 5) if high / low < 60 else (1, 3) if high / low < 300 else (1,)
    powers = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    return [s * 10.0**p for p in powers for s in steps if low <= s * 10.0**p <= high]
