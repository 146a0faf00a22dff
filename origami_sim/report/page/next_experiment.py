"""What to record next, so that the explanations part."""

from origami_sim.report.diagnosis import Diagnosis, Experiment
from origami_sim.report.page.markup import element, number
from origami_sim.report.page.measures import known
from origami_sim.report.page.pieces import nothing, quiet
from origami_sim.report.page.wording import worded, words_of

WORTHWHILE = 0.02
"""Expected information below which an experiment is not listed [bits]: it is known no better than that."""


def finding(d: Diagnosis) -> str:
    listed = _listed(d)
    if listed:
        return worded(listed[0].what)
    return "nothing that was considered would tell more" if d.experiments else "nothing is proposed"


def section(d: Diagnosis) -> list:
    listed = _listed(d)
    if not listed:
        return [nothing("No further experiment that was considered would tell the explanations apart.")]
    out = []
    for n, e in enumerate(listed):
        runs = f"do {e.repeats} recording{'s' if e.repeats != 1 else ''}"
        runs = runs if e.repeats < 9999 else "no number of recordings tells all"
        told = f"{number(known(e.information))} of {number(known(e.entropy))} bits"
        out.append(
            element(
                "li",
                element("b", worded(e.what)),
                element("span", f"tells {told} in one recording; {runs}"),
                element("small", "separates ", " from ".join(map(words_of, e.separates))) if e.separates else None,
                class_="best" if n == 0 else None,
            )
        )
    about = (
        "Bits: by how much one recording is expected to lower the entropy of the probabilities of the explanations, of "
        "what it is now (1 bit: two that are as likely); best first."
    )
    return [quiet(about), element("ol", out, class_="experiments")]


def _listed(d: Diagnosis) -> list[Experiment]:
    return [e for e in d.experiments if known(e.information, 0.0) >= WORTHWHILE]
