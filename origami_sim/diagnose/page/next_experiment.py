"""What to record next, so that the explanations part."""

from origami_sim.diagnose.diagnosis import Diagnosis
from origami_sim.diagnose.page.markup import element, number
from origami_sim.diagnose.page.measures import known
from origami_sim.diagnose.page.pieces import nothing, quiet
from origami_sim.diagnose.page.wording import worded, words_of


def finding(d: Diagnosis) -> str:
    return worded(d.experiments[0].what) if d.experiments else "nothing is proposed"


def section(d: Diagnosis) -> list:
    if not d.experiments:
        return [nothing("No further experiment is proposed.")]
    out = []
    for n, e in enumerate(d.experiments):
        runs = f"{e.repeats} recording{'s' if e.repeats != 1 else ''}"
        out.append(
            element(
                "li",
                element("b", worded(e.what)),
                element("span", f"expected separation d′ = {number(known(e.expected))} in one recording; do {runs}"),
                element("small", "separates ", " from ".join(map(words_of, e.separates))) if e.separates else None,
                class_="best" if n == 0 else None,
            )
        )
    about = "d′ is the distance between the predictions in standard deviations of the noise; best first."
    return [quiet(about), element("ol", out, class_="experiments")]
