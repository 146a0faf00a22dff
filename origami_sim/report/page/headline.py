"""What opens the page: the verdict in a sentence, and three numbers."""

import numpy as np

from origami_sim.report.diagnosis import Diagnosis
from origami_sim.report.page.markup import Html, element, number, percent
from origami_sim.report.page.measures import has_noise, known, multiples
from origami_sim.report.page.wording import worded

MEANING = {
    "ADEQUATE": "Nothing is found that the model lacks.",
    "PARAMETER": "The model has the right effects; its own numbers were off.",
    "MEASUREMENT": "The measurement, not the device, makes the difference.",
    "MECHANISM": "A physical effect was left out of the model.",
    "TIE": "Several explanations do equally well.",
    "SEVERAL": "More than one effect was left out of the model.",
    "UNKNOWN": "Something real is missing that the catalogue does not name.",
    "UNTESTABLE": "These recordings cannot answer the question.",
}

OF = {
    "ADEQUATE": "that nothing is missing",
    "PARAMETER": "that only numbers were off",
    "TIE": "that it is one of these",
    "UNTESTABLE": "of what the headline says",
}
"""What the probability is of; else of what was found."""


def section(d: Diagnosis) -> Html:
    """Subject, verdict and sentence."""
    count = len(d.recordings)
    recorded = f"{count} recording{'s' if count != 1 else ''}: {', '.join(d.recordings)}" if count else ""
    return element(
        "header",
        element(
            "p", element("b", f"Diagnosis of {d.subject}" if d.subject else "Diagnosis"), f" {recorded}", class_="quiet"
        ),
        element(
            "div",
            element("div", element("span", d.verdict, class_="pill"), element("span", MEANING[d.verdict])),
            element("h1", worded(d.sentence)),
            class_=f"verdict v-{d.verdict.lower()}",
        ),
    )


def numbers(d: Diagnosis) -> Html:
    """Probability, error before and after, share of the frames that were compared."""
    unit = "noise" if has_noise(d) else "recorded spread"
    before, refitted, after = (multiples(d, e) for e in (d.error_before, d.error_refitted, d.error_after))
    out = []
    if np.isfinite(known(d.probability)):
        out.append(("Probability", percent(d.probability), OF.get(d.verdict, "of what is named here")))
    else:
        out.append(("Probability", "not stated", "no explanation is named"))
    if np.isfinite(after):
        again = f"; {number(refitted)} by refitting alone" if np.isfinite(refitted) else ""
        parts = [v for f in d.folds if np.isfinite(v := multiples(d, f.after))]
        spread = f"; {number(min(parts))} to {number(max(parts))} by what is left out" if parts else ""
        where = "where left out" if d.left_out else "where fitted, as nothing could be left out"
        said = f"times the {unit} {where}, as given → now{again}{spread}"
        out.append(("Error", f"{number(before)} → {number(after)}", said))
    else:
        out.append(("Error", "not measured", "nothing could be left out and predicted"))
    out.append(("Compared", "100 %" if d.compared >= 1.0 else percent(known(d.compared)), "of the recorded frames"))
    return element(
        "div",
        [element("div", element("span", a), element("b", b), element("small", c), class_="tile") for a, b, c in out],
        class_="tiles",
    )
