"""The explanations that were fitted, best first."""

import numpy as np

from origami_sim.hypotheses.hypothesis import SEPARATOR
from origami_sim.report.diagnosis import Candidate, Diagnosis, Number
from origami_sim.report.page.markup import MISSING, Html, amount, element, interval, number, times
from origami_sim.report.page.measures import has_noise, known, multiples
from origami_sim.report.page.pieces import bar, figure, fold, nothing, quiet, row, table
from origami_sim.report.page.wording import number_of, worded, words_of

OPEN = 5
"""Explanations that are listed at first."""

KINDS = {"nominal": "the model, refitted", "mechanism": "physics", "measurement": "measurement"}


def section(d: Diagnosis) -> list:
    if not d.candidates:
        return [nothing("No explanation was fitted.")]
    unit = "noise" if has_noise(d) else "spread"
    head = ("Explanation", "Probability", "Log odds", "Numbers, 95 % interval", f"Error × {unit}", "Remarks")
    rows = [_candidate(head, c, d) for c in d.candidates]
    of = "that are left out, estimated by one linear step from the fit to all" if d.left_out else "that were fitted"
    about = (
        "Probability: of exactly these effects there and no others. Log odds: natural logarithm of the posterior odds "
        f"over the first row. Error: root mean square over all channels, on data {of}."
    )
    if round(d.unfitted, 2) > 0.0:
        about += f" Sets that were estimated and not fitted hold {d.unfitted:.2f}."
    if round(d.outside, 2) > 0.0:
        about += f" A law that the catalogue lacks, which they imitate, holds {d.outside:.2f}."
    out = [quiet(about), table(head, rows[:OPEN], "Explanations", kind="wide")]
    if len(rows) > OPEN:
        out.append(fold(f"{len(rows) - OPEN} more", table(head, rows[OPEN:], "More explanations", kind="wide")))
    return out


def is_chosen(c: Candidate, d: Diagnosis) -> bool:
    """Whether it is the explanation that is named, or one of those in a tie."""
    whole = {n for label in d.chosen for n in label.split(SEPARATOR)}
    joint = any(set(o.label.split(SEPARATOR)) == whole for o in d.candidates)
    return set(c.label.split(SEPARATOR)) == whole if joint else c.label in d.chosen


def _candidate(head, c: Candidate, d: Diagnosis) -> Html:
    own = [n for n in c.numbers if n.label.partition(".")[0] in c.effects]
    others = [n for n in c.numbers if not any(n is o for o in own)]
    several = len(set(c.effects)) > 1
    cells: list = [_number(n, owner=several) for n in own]
    if others and own:
        said = f"{len(others)} number{'s' if len(others) > 1 else ''} of the model"
        cells.append(element("details", element("summary", said), [_number(n, owner=True) for n in others]))
    else:
        cells += [_number(n, owner=True) for n in others]
    remarks = [f"Could not be fitted: {worded(c.failed)}" if c.failed else _sentence(worded(c.why))]
    remarks += [element("div", _sentence(worded(c.distrust)), class_="warn")] if c.distrust else []
    name = (
        words_of(c.label)
        if c.effects
        else {"nominal": "nothing added", "nominal refitted": "nothing added"}.get(c.label, worded(c.label))
    )
    return row(
        head,
        [name[:1].upper() + name[1:], element("small", KINDS.get(c.kind, c.kind), class_="tag")],
        bar(c.probability),
        figure(_odds(c, d.candidates[0])),
        (cells or MISSING, "numbers"),
        figure(times(multiples(d, c.rms))),
        (remarks, "remarks"),
        kind="chosen" if is_chosen(c, d) else "failed" if c.failed else "",
    )


def _odds(c: Candidate, first: Candidate) -> str:
    odds = known(c.odds) - known(first.odds)
    if not np.isfinite(odds):
        return MISSING
    return "0" if c is first else f"{odds:+.1f}".replace("-", "−") if abs(odds) < 100 else number(odds, 3)


def _number(n: Number, *, owner: bool) -> Html:
    away, before = known(n.away), None
    if np.isfinite(away):
        before = element("small", f"before: {amount(known(n.prior), n.unit, 3)}, {away:.1f} sd away")
    bound = element("span", "at its bound", class_="badge") if n.at_bound else None
    sided = n.low < n.high or not np.isfinite(n.low)  # else it was not fitted
    value = (
        interval(known(n.value), known(n.low), known(n.high), n.unit) if sided else amount(known(n.value), n.unit, 3)
    )
    name = element("span", number_of(n.label, owner=owner), class_="name")
    return element("div", name, f" {value}{n.each} ", bound, before, class_="fitted")


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:] + "." if text else ""
