"""Sentences of the verdict, on explanations and places made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from origami_sim.diagnose import compare, verdict
from origami_sim.diagnose.describe import described
from origami_sim.diagnose.diagnosis import Acting, Curve, Place
from origami_sim.diagnose.verdict import _named, _tied
from origami_sim.fit.hypothesis import Free, Hypothesis, Suspect
from origami_sim.recording import DriveChannel, Recording


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


def test_a_tie_says_what_all_of_its_explanations_contain():
    def hypothesis(*pairs):
        suspects = tuple(Suspect(effect, site, "crease", ()) for effect, site in pairs)
        return SimpleNamespace(hypothesis=Hypothesis(suspects))

    one, two, tilt = ("angle_offset", "channel 1"), ("angle_offset", "channel 2"), ("gravity_tilt", "the body")
    p = (0.7, 0.3)
    assert _tied([hypothesis(one, two), hypothesis(one, tilt)], p).endswith(
        "; all of them contain angle_offset at channel 1"
    )
    assert _tied([hypothesis(one), hypothesis(two)], p).endswith("contain angle_offset at one place or another")
    assert "contain" not in _tied([hypothesis(one), hypothesis(tilt)], p)


def test_that_nothing_is_missing_is_never_surer_than_it_was_before():
    assert verdict.chance_of_null(1.0) == verdict.chance_of_null(0.5) == 0.8
    assert 0.0 < verdict.chance_of_null(0.001) < 0.1 < verdict.chance_of_null(0.05) < 0.8


@pytest.mark.parametrize(
    ("shows", "does", "unknown"),
    [(9.0, 0.1, True), (9.0, 0.9, False), (2.3, 0.1, False), (verdict.STRUCTURED, 0.1, True)],
)
def test_two_that_cancel_are_refuted_where_something_shows_without_them(monkeypatch, shows, does, unknown):
    monkeypatch.setattr(verdict, "together", lambda f: does)
    monkeypatch.setattr(verdict, "_say", lambda f: "one and the other")
    best = SimpleNamespace(
        free=(), theta=(), hypothesis=SimpleNamespace(free=(), suspects=("one", "other"), label="one + other")
    )
    left = {"share": 0.0, "after": SimpleNamespace(repeated=0.0), "leaves": False, "fall": "it falls", "kept": []}
    error = {"over": 2.0, "left": 1.0}
    found = verdict._refuted(SimpleNamespace(best=best, before=SimpleNamespace(score=shows), **left, **error))  # type: ignore[arg-type]
    assert (found is not None) == unknown
    if found is not None:
        assert found.verdict == "UNKNOWN" and "mostly cancel" in found.sentence


@pytest.mark.parametrize(("over", "left", "unknown"), [(6.5, 433.0, True), (6.5, 1.0, False), (0.5, 1.2, False)])
def test_what_predicts_held_out_data_much_worse_than_nothing_is_not_named(monkeypatch, over, left, unknown):
    """An ageing friction of the proof was called static friction, with 433 instead of 6.5 times the noise held out."""
    monkeypatch.setattr(verdict, "_say", lambda f: "one")
    best = SimpleNamespace(
        free=(), theta=(), hypothesis=SimpleNamespace(free=(), suspects=("one",), label="one at a crease")
    )
    same = {"share": 0.0, "after": SimpleNamespace(repeated=0.0), "leaves": False, "fall": "it falls", "kept": []}
    found = verdict._refuted(
        SimpleNamespace(best=best, before=SimpleNamespace(score=9.0), over=over, left=left, **same)  # type: ignore[arg-type]
    )
    assert (found is not None) == unknown
    assert found is None or (found.verdict == "UNKNOWN" and "much worse" in found.sentence)


@pytest.mark.parametrize(
    ("levels", "folds"),
    [
        ((1.0, 2.0, 1.01, 2.0), [[0, 1, 4, 5], [2, 3, 6, 7]]),  # repeats tell what they are to predict
        ((1.0, 1.0, 1.0, 1.0), [[0, 1], [2, 3], [4, 5], [6, 7]]),
        ((None, None, None, None), [[0, 1], [2, 3], [4, 5], [6, 7]]),
        ((None, 1.0, 1.0, None), [[0, 1], [2, 3, 4, 5], [6, 7]]),
    ],
)
def test_recordings_of_one_drive_level_are_held_out_together(levels, folds):
    def recorded(level):
        t = np.linspace(0.0, 1.0, 11)
        values = np.stack([0.0 * t, -(level or 0.0) * np.sin(7.0 * t)], axis=1)
        drive = {} if level is None else {"field": DriveChannel("field", values, "T", False)}
        return Recording("a", t, {}, drive)

    forward = SimpleNamespace(
        recordings=[recorded(level) for level in levels],
        blocks=[SimpleNamespace(recording=n // 2) for n in range(8)],
    )
    assert compare.folds(forward, range(8)) == folds


def place(law, *, memory=0.0, share=0.9) -> Place:
    """A crease that misses a moment law(angle, rate), and one that goes with neither, in a swing that dies."""
    rng, t = np.random.default_rng(0), np.linspace(0.0, 40.0 * np.pi, 4000)
    angle, rate = np.array([np.sin(t), np.cos(t)]) * np.linspace(1.0, 0.2, len(t))
    moment = law(angle, rate) + memory * np.sign(np.sin(t / 20.0)) + 0.1 * rng.normal(size=len(t))
    curves = []
    for name, x in (("angle", angle), ("rate", rate)):
        parts = np.array_split(np.argsort(x), 13)
        mean, error = (np.array([f(moment[p]) for p in parts]) for f in (np.mean, np.std))
        counts = [len(p) for p in parts]
        curves.append(
            Curve(name, "rad", [x[p].mean() for p in parts], list(mean), list(error / np.sqrt(counts)), counts)
        )
    power = float(np.mean(moment * rate))
    return Place("fold1", 9.0, share, power, 0.0, list(t), list(moment), [0.1] * len(t), curves)


@pytest.mark.parametrize(
    "law, words",
    [
        (lambda a, w: -np.sign(w), ("goes with the rate at fold1 (", "odd in the rate", "takes energy")),
        (lambda a, w: 0.5 * w**3, ("odd in the rate", "gives energy")),
        (lambda a, w: a**3, ("goes with the angle at fold1 (", "odd in the angle", "keeps the energy")),
        (lambda a, w: a**2, ("goes with the angle at fold1 (", "even in the angle", "keeps the energy")),
    ],
)
def test_what_is_left_is_described_by_what_it_goes_with(law, words):
    said = described([place(law), place(lambda a, w: 0.0 * a, share=0.1)], [])
    assert said.startswith("What is left acts at fold1, ") and all(w in said for w in words)
    assert "memory" not in said
    assert "; the rest has a memory, or comes from outside" in described([place(law, memory=2.0)], [])


def test_what_is_left_is_placed_by_the_actions_that_leave_least():
    actions = [Acting("moment on", "panel2", 1.0, [], "", 0.0), Acting("moment at", "fold1", 1.1, [], "", 0.0)]
    far = Acting("moment at", "fold3", 4.0, [], "", 0.0)
    said = described([place(lambda a, w: a)], [*actions, far], "What is missing")
    assert said.startswith("What is missing acts like a moment on panel2 or a moment at fold1, goes")
    assert described([], [far]) == ""
    assert "acts at several places" in described([place(lambda a, w: a, share=0.4)], [])
