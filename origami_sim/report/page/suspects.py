"""All that was suspected: posterior of each effect at each site, scores of the screening, and what looks alike."""

import numpy as np

from origami_sim.hypotheses.hypothesis import SEPARATOR
from origami_sim.report.diagnosis import Diagnosis, Suspected
from origami_sim.report.page.markup import MISSING, Html, element, number, percent, plus_minus
from origami_sim.report.page.measures import array, known
from origami_sim.report.page.pieces import bar, figure, fold, nothing, quiet, row, table
from origami_sim.report.page.plots import colour, is_dark
from origami_sim.report.page.wording import effect_of, site_of, title_of, worded, words_of

OPEN = 12
"""Suspects that are listed at first."""

LIKELY = 0.005
"""Probability from which an effect at a site is listed."""

TWINS = 0.98
"""Overlap from which two signatures are framed."""


def finding(d: Diagnosis) -> str:
    """How many there are, and the one that alone explains most."""
    if not d.screening:
        return "nothing in the catalogue could act here"
    best = d.screening[0]
    return f"{len(d.screening)} suspects; alone, {words_of(best.label)} explains most ({number(known(best.z))} sd)"


def section(d: Diagnosis) -> list:
    if not d.screening:
        return [nothing("Nothing in the catalogue could act on this object in these recordings.")]
    return [*_marginals(d), *_screening(d)]


def _marginals(d: Diagnosis) -> list:
    """Posterior of each effect at each site, over all explanations that hold it."""
    likely = {k: v for k, v in d.marginals.items() if known(v, 0.0) >= LIKELY}
    if not likely:
        return []
    head = ("Effect", "Where", "Probability")
    rows = [row(head, _capital(title_of(effect_of(k) or k)), site_of(k), bar(v)) for k, v in likely.items()]
    less = len(d.marginals) - len(rows)
    about = "Posterior probability that the effect acts there, alone or with others, if no law outside acts"
    about += f"; {less} more have less than {LIKELY:.1%} each." if less else "."
    out = [
        element("h3", "Probability of each effect"),
        quiet(about),
        table(head, rows[:OPEN], "Probability of each effect"),
    ]
    if len(rows) > OPEN:
        out.append(fold(f"{len(rows) - OPEN} more", table(head, rows[OPEN:], "More effects")))
    return out


def _screening(d: Diagnosis) -> list:
    largest = max((abs(s.z) for s in d.screening if np.isfinite(known(s.z))), default=1.0) or 1.0
    head = ("Suspect", "Score [sd]", "Strength, linearised", "Explains alone", "Remarks")
    rows = [_suspected(head, s, largest) for s in d.screening]
    about = (
        "Score: how far the recordings, less what the model's own numbers and the starts could take up, point along "
        "the suspect's signature, in standard deviations. Explains alone: part of the squares that the refitted model "
        "misses."
    )
    out = [element("h3", "Scores of the screening"), quiet(about), table(head, rows[:OPEN], "Best suspects")]
    if len(rows) > OPEN:
        out.append(fold(f"{len(rows) - OPEN} more", table(head, rows[OPEN:], "Other suspects")))
    return out


def _suspected(head, s: Suspected, largest: float) -> Html:
    return row(
        head,
        _capital(words_of(s.label)),
        bar(abs(known(s.z)) / largest, number(known(s.z))),
        figure(plus_minus(known(s.strength), known(s.error), s.unit)),
        figure(percent(min(known(s.explained), 1.0))),
        worded(s.status) or MISSING,
    )


def likeness(d: Diagnosis) -> str:
    """The suspect that looks most like the named one, in words."""
    m = array(d.isolability)
    named = {n for label in d.chosen for n in label.split(SEPARATOR)}
    at = [n for n, label in enumerate(d.isolability_labels) if label in named]
    if len(at) != 1 or len(m) < 2:
        return "overlap of the suspects' signatures"
    values = np.where(np.isfinite(m[at[0]]), m[at[0]], -1.0)
    values[at[0]] = -1.0
    best = int(np.argmax(values))
    return f"what was found looks most like {words_of(d.isolability_labels[best])} (overlap {values[best]:.2f})"


def alike(d: Diagnosis) -> list:
    """The matrix of overlaps."""
    m = array(d.isolability)
    if m.size == 0:
        return [nothing("There are no suspects to tell apart.")]
    names = [_capital(words_of(label)) for label in d.isolability_labels]
    head = element("tr", element("th", "Overlap of the signatures", scope="col"), [
        element("th", str(n + 1), scope="col", class_="n") for n in range(len(names))
    ])  # fmt: skip
    body = []
    for n, (name, values) in enumerate(zip(names, m, strict=True)):
        cells = [
            element(
                "td",
                "" if k == n else f"{v:.2f}".removeprefix("0") if np.isfinite(v) else MISSING,
                class_="cell" + (" light" if is_dark(v) and k != n else "") + (" twin" if v > TWINS and k != n else ""),
                style=f"background:{'#fff' if k == n else colour(float(v))}",
                title=f"{name} and {names[k]}",
            )
            for k, v in enumerate(values)
        ]
        body.append(element("tr", element("th", f"{n + 1}", element("span", f" {name}"), scope="row"), cells))
    about = (
        "1: the recordings cannot tell the two apart, whatever the noise; 0: entirely different signatures. What the "
        f"model's own numbers and the starts could take up has been taken out. Framed: more than {TWINS}."
    )
    listed = element("ol", [element("li", name) for name in names], class_="narrow")
    matrix = element(
        "table", element("thead", head), element("tbody", body), class_="matrix", aria_label="Overlap of signatures"
    )
    return [quiet(about), listed, matrix]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
