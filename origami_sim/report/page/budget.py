"""The budget of the mismatch as one bar: what goes to which effect, measurement or number, and what is left."""

import numpy as np

from origami_sim.infer.budget import Share
from origami_sim.report.diagnosis import Diagnosis
from origami_sim.report.page.markup import Html, element, percent
from origami_sim.report.page.measures import known
from origami_sim.report.page.pieces import nothing, quiet
from origami_sim.report.page.wording import words_of

WORDS = {"numbers": "numbers of the model that were off", "rest": "real, but not named"}
"""What a share that belongs to no effect is called."""

WIDE = 0.22
"""Part of the bar from which its name has room inside, on a screen that is not narrow."""

NARROW = 0.12
"""Part of the bar below which not even the percentage has room on a narrow screen."""

LITTLE = 0.005
"""Share below which a part is not listed."""

WITHIN = 1.1
"""Error of the model as given, over the noise, below which there is hardly a mismatch to share out."""


def section(d: Diagnosis, over: float) -> Html:
    """The bar with its words.

    Args:
        over: error of the model as given in multiples of the noise.
    """
    shares = [s for s in d.budget if known(s.share, 0.0) >= LITTLE]
    if not shares:
        return element("div", element("h2", "Where the mismatch goes"), nothing("Nothing beyond the noise is missed."))
    kinds = [*_kinds(shares)]
    parts = [
        element(
            "span",
            element("b", percent(s.share)) if s.share >= 0.05 else "",
            element("span", f" {name_of(s)}") if s.share >= WIDE else "",
            class_=f"b-{kind}" + (" slim" if s.share < NARROW else ""),
            style=f"width:{100 * s.share:.2f}%",
            title=f"{name_of(s)}: {percent(s.share)}",
        )
        for s, kind in zip(shares, kinds, strict=True)
    ]
    words = [
        element("li", element("b", percent(s.share)), f" {name_of(s)}", class_=f"b-{kind}")
        for s, kind in zip(shares, kinds, strict=True)
    ]
    spoken = "; ".join(f"{name_of(s)} {percent(s.share)}" for s in shares)
    about = "Of all squares that the model as given misses beyond the noise."
    if np.isfinite(over) and over < WITHIN:
        about += f" They are few: it misses the recordings by {over:.2f} times the noise."
    return element(
        "div",
        element("h2", "Where the mismatch goes"),
        element("div", parts, class_="budget", role="img", aria_label=f"budget of the mismatch: {spoken}"),
        element("ul", words, class_="words"),
        quiet(about),
    )


def name_of(s: Share) -> str:
    """A share in words."""
    return WORDS.get(s.kind) or words_of(s.name)


def _kinds(shares: list[Share]):
    """Class of each part: effects and errors of the measurement each have colours of their own."""
    count = {"effect": 0, "measurement": 0}
    for s in shares:
        if s.kind in count:
            yield f"{s.kind} tint-{min(count[s.kind], 3)}"
            count[s.kind] += 1
        else:
            yield s.kind
