"""Fits: curved valleys, bounds, steps that cost too much, derivatives that are used again, other weights."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from origami_sim.diagnose import Options, Subject, factor
from origami_sim.diagnose.arrange import arranged
from origami_sim.diagnose.prepare import prepared
from origami_sim.fit.derivatives import linearise
from origami_sim.fit.least_squares import fit, promised, renewed, settled
from origami_sim.fit.nominal import nominal_fits
from origami_sim.fit.predictor import Block, Prediction
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Free, Hypothesis, Suspect
from origami_sim.hypotheses.suspects import suspects
from tests.diagnose.strips import hanging, record, subject

FRICTION = {"crease_friction": {"friction_moment": (2e-5, [1])}}
STIFFENING = {"crease_stiffening": {"cubic_stiffness": (4e-4, [1])}}
SMALL = {"duration": 3.0, "panels": 3, "rate": 100}


def made(values: np.ndarray) -> Block:
    """A block of these values whose start is not fitted."""
    return Block(0, 0, np.arange(float(len(values))), values, np.ones(1), None, np.zeros(0), np.zeros(0))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def stiff():
    """The nominal fit of a strip with a stiffening crease, which it lacks."""
    recordings = prepared([record(STIFFENING, **SMALL)], 200.0)
    forward, _ = arranged(subject(3), recordings, Options())
    _, base, weights = nominal_fits(forward)
    every = suspects(forward.model, recordings, forward.drive)
    one = next(s for s in every if s.effect == "crease_stiffening" and s.entities == (1,))
    return forward, base, weights, one


def test_derivatives_that_are_used_again_lead_to_the_same_fit(stiff):
    forward, base, weights, one = stiff
    theta = np.concatenate([base.theta, [0.0]])
    given = {"theta": theta, "local": base.local, "most": 12}
    plain = fit(forward, Hypothesis((one,)), weights, **given)
    again = fit(forward, Hypothesis((one,)), weights, **given, known=base.linear, kept=len(base.free))
    assert again.cost == pytest.approx(plain.cost, abs=0.5)
    assert np.all(np.abs(again.theta - plain.theta) < 0.3 * plain.deviations() + 1e-12)
    assert again.deviations() == pytest.approx(plain.deviations(), rel=0.25)  # measured: 0.22 for the effect's own


class Valley:
    """Rosenbrock's valley as something to fit: y = x^2 is told `narrow` times better than where along it.

    Where y is below `lowest`, the simulation fails.
    """

    local, nudge, blur = 0, 0.01, 0.0
    model = SimpleNamespace(contacts=())
    blocks = (made(np.zeros((2, 1))),)

    def __init__(self, narrow: float, lowest: float = -np.inf, most: float = np.inf) -> None:
        x = Free("valley", "x", "-", start=-1.2, scale=1.0, upper=most)
        self.subject = SimpleNamespace(nominals=(x, Free("valley", "y", "-", start=1.0, scale=1.0)))
        self.narrow, self.lowest, self.simulated = narrow, lowest, 0

    def step(self, hypothesis, theta) -> float:
        return 1.0

    def shoot(self, hypothesis, thetas, locals_, blocks) -> Prediction:
        self.simulated += 1
        x, y = thetas.T
        seen = np.stack([self.narrow * (y - x * x), 1.0 - x], axis=1)
        return Prediction([np.where(y[:, None] < self.lowest, np.nan, seen)[:, :, None]], [None])


@pytest.mark.parametrize("narrow", [10.0, 100.0])
def test_a_curved_valley_is_followed_to_its_end(narrow):
    """Straight steps take 65 and 129 simulations; one more each is of a derivative's smaller step and of the end."""
    valley = Valley(narrow)
    found = fit(valley, Hypothesis(), Weights(np.ones(1)), most=4)
    assert found.theta == pytest.approx([1.0, 1.0], abs=3e-6) and found.cost < 5e-8
    assert valley.simulated <= 8


def test_a_fit_goes_on_by_its_derivatives_as_far_as_steps_come_true():
    """A whole step across a bend first misses 10^5 times as much; what cannot be simulated is still owed."""
    begun = fit(valley := Valley(100.0), Hypothesis(), Weights(np.ones(1)), theta=np.array([-3.0, 9.0]), most=0)
    simulated = valley.simulated
    found, owed = settled(valley, begun)
    assert begun.cost == pytest.approx(16.0) and found.cost < 1e-4 and owed < 1e-4
    assert valley.simulated == simulated + 2, "no derivative is taken anew"
    begun = fit(valley := Valley(30.0, lowest=-2.0), Hypothesis(), Weights(np.ones(1)), most=0)
    found, owed = settled(valley, begun)
    assert found is begun and owed == pytest.approx(begun.cost - promised(valley, begun)) and owed > 100.0


def test_a_curved_valley_is_followed_past_what_cannot_be_simulated():
    """The first straight step ends at y = -3.8."""
    found = fit(Valley(30.0, lowest=-2.0), Hypothesis(), Weights(np.ones(1)), most=8)
    assert found.theta == pytest.approx([1.0, 1.0], abs=1e-8)


def test_a_curved_valley_is_followed_to_a_bound():
    found = fit(Valley(30.0, most=0.5), Hypothesis(), Weights(np.ones(1)), most=8)
    assert found.theta == pytest.approx([0.5, 0.25], abs=1e-9) and found.at_bound.tolist() == [True, False]
    low, high = found.intervals()
    assert low[0] < found.theta[0] and high[0] == 0.5 < high[1], "no interval goes beyond a bound"


class Film:
    """Something whose strength shows by its logarithm, and slows the simulation down as it grows."""

    local, nudge, blur = 0, 0.01, 0.0
    model = SimpleNamespace(contacts=())
    blocks = (made(np.log1p([30.0, 10.0])[:, None]),)
    subject = SimpleNamespace(nominals=(Free("film", "x", "-", start=0.0, scale=1.0, spread=1e-3),))

    def step(self, hypothesis, theta) -> float:
        return 1.0 / (1.0 + np.sum(theta[1:]))

    def shoot(self, hypothesis, thetas, locals_, blocks) -> Prediction:
        return Prediction([np.log1p(np.stack([thetas[:, 1], thetas[:, 1]], axis=1))[:, :, None]], [None])


def test_no_series_of_fits_asks_for_ever_smaller_steps_of_the_solver():
    """Each may ask for steps 2.5 times smaller; all of them only for ten times smaller ones than without a suspect."""
    film = Hypothesis((Suspect("film", "here", "ground", (Free("film", "C", "N", 0.0, 1.0, 0.0, 1e6),)),))
    theta, steps = np.array([0.0, 0.1]), []
    for _ in range(8):
        theta = fit(Film(), film, Weights(np.ones(1)), theta=theta).theta
        steps.append(Film().step(film, theta))
    assert steps[0] < 0.5, "it does grow"
    assert 0.1 <= steps[-1] < 0.25


def test_new_weights_are_those_of_a_new_linearisation(stiff):
    forward, base, weights, _ = stiff
    new = Weights(weights.deviation * [0.5, 2.0], (0.7 ** np.arange(20), np.ones(1)), 0.5 * weights.gap)
    quick = base.linear.reweighted(weights, new)
    slow = linearise(forward, base.hypothesis, base.free, base.theta, base.local, base.blocks, new)
    for a, b in zip(quick.residual, slow.residual, strict=True):
        assert a == pytest.approx(b, abs=1e-6)
    one, other = (np.concatenate(line.cleared(slow.residual)) for line in (quick, slow))
    assert one @ one == pytest.approx(other @ other, rel=1e-3)


def test_a_better_hypothesis_leaves_the_noise(stiff):
    forward, base, weights, one = stiff
    named = fit(forward, Hypothesis((one,)), weights, local=base.local)
    assert named.theta[-1] == pytest.approx(4e-4, abs=2.5 * named.deviations()[-1]) and named.theta[-1] > 2e-4
    left = np.sqrt(np.mean(np.concatenate(named.residuals) ** 2, axis=0))
    assert left == pytest.approx(forward.blocks[0].noise, rel=0.1)
    assert named.cost < base.cost - 50.0


def test_a_fit_does_not_depend_on_where_its_starts_begin():
    heavy = {("crease_viscosity", "viscosity"): 30.0}  # rates of the start die at once: their directions hardly show
    model, parameters = hanging(3)
    parameters.set("crease_viscosity", "viscosity", 30.0 * parameters["crease_viscosity", "viscosity"])
    known = Subject.from_model(model, parameters, None, [factor("crease.stiffness", 0.05)])
    forward, _ = arranged(known, prepared([record(factors=heavy, **SMALL)], 200.0), Options(start="fit"))
    _, base, weights = nominal_fits(forward)
    away = base.local.copy()
    away[:, forward.local // 2 :] += 2.0
    for local in (None, away):
        assert fit(forward, Hypothesis(), weights, local=local, most=20).cost == pytest.approx(base.cost, abs=0.5)


def test_what_cannot_be_simulated_is_said_and_no_crash():
    class Lost(Valley):
        def shoot(self, hypothesis, thetas, locals_, blocks) -> Prediction:
            return Prediction([np.full((len(thetas), 2, 1), np.nan)], [None])

    assert "unstable" in fit(Lost(10.0), Hypothesis(), Weights(np.ones(1))).failed


@pytest.mark.parametrize(("turning", "gap"), [(0.01, 0.03), (1e-4, 0.03), (1e-4, 1e-4)])
def test_the_scale_of_all_moments_is_known_no_better_than_before(turning, gap):
    """Inertia, weight, stiffness, losses and friction times one number move alike: only priors tell that number."""
    rubbing = {"crease_friction": {"friction_moment": (2e-5, [1]), "yield_angle": (turning, [1])}}
    forward, _ = arranged(subject(3), prepared([record(rubbing, **SMALL)], 200.0), Options())
    every = suspects(forward.model, forward.recordings, forward.drive)
    one = next(s for s in every if s.effect == "crease_friction" and s.entities == (1,))
    coarse = replace(one, free=(replace(one.free[0], scale=1e-4), *one.free[1:]))  # five times what it is
    weights = Weights(forward.blocks[0].noise, gap=gap)
    f = fit(forward, Hypothesis((coarse,)), weights, theta=np.array([1.0, 1.0, 1.0, 1e-5, turning]), most=15)
    f = renewed(forward, f)
    known = 1.0 / np.sqrt(0.05**-2 + 0.3**-2 + 0.03**-2)
    spread = f.deviations()[[0, 2]]
    assert f.cost < 600.0, "946 and 7564 if segments do not begin where those before lead"
    assert np.all(spread > 0.965 * known) and np.all(spread < 1.005 * known)
    assert f.theta[3] / f.theta[2] == pytest.approx(2e-5, rel=0.02)
