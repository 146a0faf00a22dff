"""A stored search is judged anew as the search itself was, with these and with other hyperparameters."""

import json
from dataclasses import replace

import numpy as np
import pytest

from origami_sim.diagnose import Options
from origami_sim.diagnose.arrange import arranged
from origami_sim.diagnose.prepare import prepared
from origami_sim.errors import InputError
from origami_sim.fit.evidence import problem, summed
from origami_sim.fit.hyper import HYPER
from origami_sim.fit.linear import Linearisation, Rows
from origami_sim.fit.nominal import nominal_fits
from origami_sim.hypotheses.hypothesis import Free, Suspect
from origami_sim.hypotheses.suspects import suspects
from origami_sim.infer.judged import judged
from origami_sim.infer.placement import enter, log_priors, place
from origami_sim.infer.posterior import Posterior
from origami_sim.infer.screen import screen
from origami_sim.infer.search import search
from origami_sim.verdict.sentences import judge
from origami_sim.verdict.stored import Reduced, Stored, _plain, _suspect
from tests.diagnose.strips import record, subject

FRICTION = {"crease_friction": {"friction_moment": (2e-5, [1])}}
FEW = ("crease_friction", "air_drag", "crease_stiffening", "crease_offset")


@pytest.fixture(scope="module")
def kept():
    """What is said of a search, what was stored of it, the predictor and the posterior."""
    recordings = prepared([record(FRICTION, panels=3, duration=2.0, rate=60)], 200.0)
    forward, _ = arranged(subject(3), recordings, Options())
    given, base, weights = nominal_fits(forward)
    every = [s for s in suspects(forward.model, recordings, forward.drive) if s.effect in FEW]
    p = search(forward, base, screen(forward, every, base, weights), weights, most=3, store=True)
    said = judge(forward, given, base, p, 1.0)
    return said, Stored.of(forward, given, base, p, 1.0), forward, p


def test_the_same_posterior_and_verdict_follow(kept, tmp_path):
    found, stored, _, p = kept
    again = Stored.load(stored.save(tmp_path / "case.npz"))
    assert [f.name for f in tmp_path.iterdir()] == ["case.npz"]
    for one in (stored, again):
        other = one.judged()
        mine, theirs = p.probabilities(), other.probabilities()
        assert mine.keys() == theirs.keys()
        assert max(abs(mine[k] - theirs[k]) for k in mine) < 1e-4
        decided = one.decided(other)
        assert decided["verdict"] == found.verdict
        assert {c.replace("nominal", "nothing") for c in decided["chosen"]} == set(found.chosen)
        assert decided["probability"] == pytest.approx(found.probability, abs=1e-4)


@pytest.mark.parametrize(
    "changed",
    [
        {"effects": 0.1},
        {"flaws": (2.0, 8.0)},
        {"slabs": (8.0, 24.0, 80.0)},
        {"smooth": (0.0, 30.0)},
        {"gaps": HYPER.gaps[1:]},
    ],
)
def test_other_hyperparameters_give_what_the_fits_give_with_them(kept, changed):
    _, stored, forward, p = kept
    hyper = replace(HYPER, **changed)
    direct = Posterior(p.signatures, p.weights, hyper)
    direct.failed = dict(p.failed)
    prior = log_priors(p.signatures, hyper)
    for key, node in p.nodes.items():
        again, _ = judged(direct, forward, key, node.fit, node.owed)
        (place if node.wide else enter)(direct, again, prior)
    mine, theirs = direct.probabilities(), stored.judged(hyper).probabilities()
    assert max(abs(mine[k] - theirs[k]) for k in mine) < 1e-5
    if "smooth" not in changed:  # there is none in these recordings
        assert max(abs(mine[k] - p.probabilities()[k]) for k in mine) > 5e-5


def test_summed_in_axes_of_its_own_is_what_the_evidence_sums():
    rng = np.random.default_rng(2)
    rows, effects, smooth = 60, rng.normal(size=(60, 5)), rng.normal(size=(60, 7))
    smooth[:, 6] = smooth[:, 0] + smooth[:, 1]  # one axis says nothing
    none = [np.zeros((rows, 0))]
    line = Linearisation([Rows(rows)], [rng.normal(size=rows)], [rng.normal(size=(rows, 2))], none, [None])
    whole = problem(line, np.arange(2), np.ones(2), np.zeros(2), [effects], [smooth])
    for size, flaws, held in ((0.0, 2.0, []), (3.0, 8.0, []), (3.0, 8.0, [1, 3]), (100.0, 0.0, [])):
        one, other = summed(whole, size, flaws, held), Reduced.of(whole).summed(size, flaws, held)
        np.testing.assert_allclose(other.gram, one.gram, rtol=1e-9, atol=1e-9)
        assert other.log == pytest.approx(one.log, abs=1e-8)


def test_what_was_not_stored_is_refused(kept, tmp_path):
    with pytest.raises(InputError, match=r"this size was not stored.*gaps"):
        kept[1].judged(replace(HYPER, gaps=(2e-4,)))
    (tmp_path / "odd.npz").write_bytes(b"no archive")
    with pytest.raises(InputError, match=r"odd.npz: is no stored search"):
        Stored.load(tmp_path / "odd.npz")


def test_a_suspect_is_the_same_after_storing():
    free = (Free("crease_contact", "contact_stiffness", "N m/rad", 0.0, 1e-3, entities=(0,)),)
    one = Suspect("crease_contact", "crease 0", "crease", free, (0,), fixed=(("contact_side", -1.0),))
    again = _suspect(json.loads(json.dumps(_plain(one))))
    assert again == one and {again.form: 1}[one.form] == 1
