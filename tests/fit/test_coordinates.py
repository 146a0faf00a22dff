"""Numbers are fitted by their departures, positive scales by those of their logarithms, angles of yield by roots."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import lognorm

from origami_sim.effects import CATALOGUE
from origami_sim.fit.least_squares import fit, penalty
from origami_sim.fit.predictor import Prediction
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.coordinates import Coordinates
from origami_sim.hypotheses.hypothesis import PLAUSIBLE, Free, Hypothesis
from origami_sim.hypotheses.suspects import free_number
from tests.fit.test_least_squares import made

LENGTH = Free("", "length", "m", 0.2, 0.01, 0.1, 0.4, 0.02)
TIME = Free("law", "time", "s", 0.5, 1.0, 1e-6, np.inf, 2.0, power=0.0)
ANGLE = Free("law", "angle", "rad", 0.01, 1.0, 1e-6, 0.03, 4.0, power=0.5)


def test_coordinates_and_numbers_are_each_others_inverse_within_the_bounds():
    both, theta = Coordinates([LENGTH, TIME]), np.array([[0.22, 0.5e-3], [0.1, 40.0]])
    assert both.of(theta) == pytest.approx(np.array([[2.0, np.log(1e-3)], [-10.0, np.log(80.0)]]))
    assert both.values(both.of(theta)) == pytest.approx(theta)
    assert both.values(np.array([99.0, -99.0])) == pytest.approx([0.4, 1e-6]), "not beyond the bounds"
    assert both.low == pytest.approx([-10.0, np.log(2e-6)]) and both.high[1] == np.inf
    root = Coordinates([ANGLE])
    assert root.of(np.array([0.0025])) == pytest.approx([-1.0]) and root.values(np.array([-1.0])) == pytest.approx(
        [0.0025]
    )
    assert root.values(np.array([-9.0])) == pytest.approx([1e-6]) and root.low == pytest.approx([-1.98])
    assert Coordinates([]).of(np.zeros(0)).shape == (0,)


def test_slopes_are_derivatives_of_the_numbers():
    both, theta = Coordinates([LENGTH, TIME, ANGLE]), np.array([0.22, 3.0, 0.002])
    at = both.of(theta)
    for k in range(3):
        step = 1e-6 * (np.arange(3) == k)
        assert both.slopes(theta)[k] == pytest.approx((both.values(at + step) - both.values(at - step))[k] / 2e-6)


def test_the_prior_of_a_positive_scale_is_log_normal():
    both = Coordinates([LENGTH, TIME])
    for time in (0.01, 0.5, 30.0):
        expected = -2.0 * (
            lognorm.logpdf(time, 2.0, scale=0.5) - lognorm.logpdf(0.5, 2.0, scale=0.5) + np.log(time / 0.5)
        )
        assert penalty(both, np.array([0.2, time])) == pytest.approx(expected, abs=1e-12)
    assert penalty(both, np.array([0.24, 0.5])) == pytest.approx(4.0)


class Decay:
    """A decay exp(-t / time), of which only the time is to be fitted."""

    local, nudge, blur = 0, 0.01, 0.0
    model = SimpleNamespace(contacts=())
    subject = SimpleNamespace(nominals=(TIME,))
    times = np.linspace(0.0, 1.0, 101)

    def __init__(self, time: float):
        self.blocks = (made(np.exp(-self.times / time)[:, None]),)

    def step(self, hypothesis, theta) -> float:
        return 1.0

    def shoot(self, hypothesis, thetas, locals_, blocks) -> Prediction:
        return Prediction([np.exp(-self.times / thetas)[:, :, None]], [None])


@pytest.mark.parametrize("time", [0.02, 20.0])
def test_a_time_constant_is_found_that_is_far_from_where_it_begins(time):
    noise = Weights(np.full(1, 1e-4))
    found = fit(Decay(time), Hypothesis(), noise, most=20)
    assert found.theta == pytest.approx([time], rel=1e-3) and not found.at_bound[0]
    low, high = found.intervals()
    assert low[0] < time < high[0] and low[0] * high[0] == pytest.approx(found.theta[0] ** 2), "even by factors"
    assert found.deviations()[0] == pytest.approx((high[0] - low[0]) / 3.92, rel=0.01)
    assert found.strain[0] == pytest.approx(abs(np.log(time / 0.5)) / 2.0, rel=1e-3)


def test_positive_scales_beside_strengths_are_fitted_by_their_logarithms():
    scales = {(name, p) for name, e in CATALOGUE.items() for p in e.fitted if free_number(name, p, None).power == 0.0}
    assert {
        ("crease_relaxation", "time_1"),
        ("stribeck", "fading_speed"),
        ("ground_compliance", "reach"),
    } <= scales
    for name, number in scales:
        f = free_number(name, number, None)
        assert f.start > 0.0 and f.lower >= 0.0 and f.spread == pytest.approx(np.log(PLAUSIBLE)), name
    assert free_number("crease_friction", "yield_angle", None).power == 0.5
    # a strength and an angle may be nothing; thresholds lie within what was recorded; a ratio may be nothing
    absent = {
        ("crease_friction", "friction_moment"),
        ("crease_friction", "yield_angle"),
        ("crease_stop", "stop_angle"),
        ("field_slope", "narrowing"),
    }
    assert not absent & scales
