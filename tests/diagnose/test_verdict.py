"""Sentences of the verdict, on explanations made by hand."""

from types import SimpleNamespace

import numpy as np

from origami_sim.diagnose.hypothesis import Free, Hypothesis, Suspect
from origami_sim.diagnose.verdict import _named


def explanation(site: str, strength: float):
    free = (Free("crease_viscosity", "viscosity", "N m s/rad", 0.0, 1e-6),)
    suspect = Suspect("crease_viscosity", site, "crease", free, more=True)
    return SimpleNamespace(
        hypothesis=Hypothesis((suspect,)), free=free, theta=np.array([strength]), deviations=lambda: np.array([1e-7])
    )


def sentence(*p: float) -> str:
    """What is said of more viscosity at one crease, and less at another, that have these probabilities."""
    rows = [explanation("fold1", 2e-6), explanation("fold2", -2e-6)][: len(p)]
    weighed = SimpleNamespace(
        gain=100.0, best=rows[0], base=None, kept=rows, total=sum(p), small=False, rows=rows, fall="the error falls",
        probability=lambda f: p[rows.index(f)],
    )  # fmt: skip
    said = _named(weighed)  # type: ignore[arg-type]
    assert said.verdict == "MECHANISM" and said.chosen == ["crease_viscosity at fold1"]
    return said.sentence


def test_the_sentence_says_where_else_the_same_effect_may_act():
    assert ") (these recordings do not tell that from less at fold2), p = " in sentence(0.6, 0.4)
    for sure in (sentence(1.0), sentence(0.95, 0.05)):
        assert "these recordings" not in sure and "), p = " in sure
