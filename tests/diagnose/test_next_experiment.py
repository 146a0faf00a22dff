"""The next experiment: expected information against numbers that are known, and what a set-up can do."""

import copy
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm

from origami_sim.diagnose.experiment import Prospect, entropy, propose
from origami_sim.diagnose.menu import menu
from origami_sim.errors import InputError
from origami_sim.fit.least_squares import fit
from origami_sim.fit.nominal import nominal_fits
from origami_sim.hypotheses.hypothesis import Hypothesis, Suspect
from origami_sim.hypotheses.suspects import suspects
from origami_sim.predict.rigid import RigidRollouts
from origami_sim.recording.possible import Possible
from origami_sim.recording.sidecar import Sidecar
from tests.diagnose.strips import record, subject

HALVES = np.array([0.5, 0.5])


def binary(d: float, sd: float = 1.0) -> float:
    """Mutual information [bits] of two as likely normal distributions, by quadrature."""
    y = np.linspace(-12 * sd, 12 * sd + d, 20001)
    one, other = norm.pdf(y, 0.0, sd), norm.pdf(y, d, sd)
    mixed = 0.5 * (one + other)
    parts = [np.where(p > 0, p * np.log2(np.maximum(p, 1e-300) / np.maximum(mixed, 1e-300)), 0.0) for p in (one, other)]
    return float(0.5 * np.trapezoid(parts[0] + parts[1], y))


@pytest.mark.parametrize("d", [0.3, 1.0, 2.0, 4.0])
def test_information_is_that_of_two_normal_distributions(d):
    """Along any direction of any number of data; what numbers could take up widens it."""
    rng = np.random.default_rng(1)
    away = rng.normal(size=400)
    away *= d / np.linalg.norm(away)
    base = rng.normal(size=400)
    none = np.zeros((400, 0))
    plain = Prospect.of(np.stack([base, base + away]), [none, none])
    assert plain.information(HALVES) == pytest.approx(binary(d), abs=0.02)
    assert plain.information(HALVES, 4.0) == pytest.approx(binary(2 * d), abs=0.02), "four recordings"
    loose = Prospect.of(np.stack([base, base + away]), [2.0 * (away / d)[:, None]] * 2)
    assert loose.information(HALVES) == pytest.approx(binary(d, np.sqrt(5.0)), abs=0.02)
    wide = Prospect.of(np.stack([base, base + away]), [300.0 * (away / d)[:, None]] * 2)
    assert wide.information(HALVES) < 0.02, "a number that is not known takes the place of the difference"


def test_information_of_several_is_at_most_what_is_open():
    means = 30.0 * np.eye(4)[:3]
    chance = np.array([0.7, 0.2, 0.1])
    none = [np.zeros((4, 0))] * 3
    assert Prospect.of(means, none).information(chance) == pytest.approx(entropy(chance), abs=1e-6)
    means[2] = means[1]  # two that nothing tells apart
    told = Prospect.of(means, none).information(chance)
    assert told == pytest.approx(entropy(np.array([0.7, 0.3])), abs=1e-6)
    assert entropy(HALVES) == 1.0


def losses(size: float):
    """Fits of a swing with a linear loss by that loss and by a quadratic one at the same crease, which imitates it."""
    truth = {"mass_damping": {"decay_rate": (0.6, None)}}
    recording = record(truth, panels=2, duration=4.0, rate=60, size=size, noise=2e-3)
    forward = RigidRollouts(subject(2), [recording], segment=0.5)
    _, base, weights = nominal_fits(forward)
    every = suspects(forward.model, [recording], forward.drive)

    def of(name: str) -> Suspect:
        return next(s for s in every if s.effect == name)

    fits = [fit(forward, Hypothesis((of(n),)), weights, local=base.local) for n in ("mass_damping", "air_drag")]
    assert not any(f.failed for f in fits)
    return forward, fits, weights


def test_look_alikes_are_told_by_the_amplitude_that_parts_them():
    """A loss by the rate and one by its square are alike at one amplitude: to double or to divide it tells them."""
    forward, fits, weights = losses(0.35)
    all_ = {e.what: e for e in propose(forward, fits, HALVES, weights, most=99)}
    best = next(iter(all_.values()))
    again = all_["repeat the same experiment"]
    assert again.information < 0.5 * best.information
    assert best.what.startswith(("start from", "let go at rest"))
    assert best.separates == [f.hypothesis.label for f in fits]
    louder = all_["start from 2 times the displacement and rate"]
    assert louder.information > 2 * again.information
    ring = next(e for e in all_.values() if e.what.startswith("let go at rest from 0.2 times"))
    assert ring.information > 0.0
    order = [e.information for e in all_.values()]
    assert order == sorted(order, reverse=True)
    assert min(e.repeats for e in all_.values()) == best.repeats < 9999
    # one that is nearly sure leaves little to learn
    sure = propose(forward, fits, np.array([0.99, 0.01]), weights)
    assert sure[0].entropy == pytest.approx(0.081, abs=1e-3) and sure[0].information <= sure[0].entropy
    assert propose(forward, fits, np.array([0.999, 0.001]), weights) == []


def test_a_menu_is_what_the_set_up_can_do():
    forward = RigidRollouts(subject(3), [record(panels=3, duration=1.0, rate=60)], segment=0.5)
    every = [t.what for t in menu(forward, Possible())]
    assert not [w for w in every if "upside down" in w], "a rig on a bench"
    assert "the set-up tilted by 10 degrees about y" in every and "let it run 3 times as long" in every
    assert [w for w in every if w.startswith("let go at rest from 0.2 times")]
    assert {w for w in every if "clamped" in w} == {
        f"crease {c} clamped as it is in the reference state" for c in (0, 1)
    }
    bare = Possible().but(
        {"starts": [], "ring_down": 0, "clamps": ["crease 1"], "tilt": 0, "weights": False, "longest": "1 s"}
    )
    assert [t.what for t in menu(forward, bare)] == [
        "repeat the same experiment",
        "crease 1 clamped as it is in the reference state",
    ]
    turned = [t.what for t in menu(forward, Possible().but({"tilt": "180 deg", "longest": "10 s"}))]
    assert "the set-up upside down" in turned and "let it run 10 times as long" in turned
    with pytest.raises(InputError, match=r"no such crease.*allowed: crease 0, crease 1"):
        menu(forward, Possible(clamps=("hinge",)))
    down = next(t.forward for t in menu(forward, Possible()) if t.what.startswith("let go at rest"))
    (block,) = down.blocks
    assert np.all(block.rates == 0.0) and len(block.times) == pytest.approx(3 * 61, abs=3)
    furthest = max(np.abs(b.pose.angles).sum() for b in forward.blocks)
    assert np.abs(block.pose.angles).sum() == pytest.approx(0.2 * furthest, rel=1e-9)


def test_nothing_longer_is_asked_of_what_falls_freely():
    forward = RigidRollouts(subject(3), [record(panels=3, duration=1.0, rate=60)], segment=0.5)
    forward.articulation = copy.copy(forward.articulation)
    forward.articulation.motions = np.eye(6)
    words = [t.what for t in menu(forward, replace(Possible(), clamps=()))]
    assert not [w for w in words if "as long" in w or "tilted" in w or "let go" in w or "start from" in w]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("levels = [0.0]", "not a list of factors"),
        ("starts = [-1.0]", "a factor must be positive"),
        ("height = 3", "unknown key"),
        ('tilt = "3 mm"', "wrong unit"),
        ("weights = 1", "not a switch"),
        ('longest = "-2 s"', "must be positive"),
        ("ring_down = 2", "not a part"),
        ("clamps = [1]", "not a list of names"),
    ],
)
def test_a_sidecar_states_what_is_possible(tmp_path, line, said):
    head = '[time]\nrate_hz = 10\n[channels.a]\ncolumn = "a"\nkind = "crease_angle"\nunit = "rad"\ncrease = 0\n'
    head += "[possible]\n"
    path = tmp_path / "a.toml"
    path.write_text(head + 'levels = [2.0]\ntilt = "20 deg"\n')
    stated = Possible(weights=False).but(Sidecar.read(path).possible)
    assert stated.levels == (2.0,) and stated.tilt == pytest.approx(np.deg2rad(20.0)) and not stated.weights
    path.write_text(head + line + "\n")
    with pytest.raises(InputError, match=said) as error:
        Sidecar.read(path)
    assert str(path) in str(error.value) and "possible." in str(error.value)


def test_a_scene_states_what_its_set_up_can_do():
    from origami_sim.device.scene import scene_module, scene_settings
    from origami_sim.diagnose.diagnose import possible_of

    module = scene_module("pendulum_chain")
    for source in ("pendulum_chain", module, (module, scene_settings(module))):
        assert possible_of(source).tilt == 0.0
    assert possible_of(subject(2)) == possible_of("box") == Possible()
