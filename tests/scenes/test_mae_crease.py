"""One magnetic panel on one crease, against k theta = (Br V / mu0) B cos(theta) and its small swings."""

import numpy as np
import pytest
from scipy.optimize import brentq, least_squares

from origami_sim.device.scene import read_calibration
from origami_sim.drive import Drive
from origami_sim.model import State
from origami_sim.scenes import mae_crease
from origami_sim.solve.motion.dynamics import simulate
from origami_sim.solve.statics.equilibria import equilibrium

ANGLE = 47.788428
"""Root of the closed form for 20 x 20 x 3 mm, 130 mT, 0.2 T, 0.02 N m/rad [deg]."""

MU0 = 1.25663706212e-6


@pytest.fixture(scope="module")
def settings():
    return read_calibration(mae_crease.CALIBRATION)


def test_statics_and_dynamics_give_the_closed_form(settings):
    outcome = mae_crease.run(settings)
    assert outcome.numbers["angle_deg"] == pytest.approx(ANGLE, abs=1e-4)
    assert outcome.numbers["dynamic_angle_deg"] == pytest.approx(ANGLE, abs=1e-4)
    table = outcome.tables["fold_angle"]
    moment = settings.remanence * settings.length * settings.width * settings.thickness / MU0
    for b, angle in zip(1e-3 * table["field_mT"], np.radians(table["angle_deg"]), strict=True):
        exact = brentq(lambda th, b=b: settings.stiffness * th - moment * b * np.cos(th), 0, np.pi / 2, xtol=1e-14)
        assert angle == pytest.approx(exact, abs=np.radians(1e-4))


def test_the_fold_is_odd_in_the_field(settings):
    model, parameters, _ = mae_crease.build(settings)
    up, down = (equilibrium(model, parameters, Drive(field=(0, 0, b))).angles[0] for b in (0.2, -0.2))
    assert down == pytest.approx(-up, abs=1e-9)


@pytest.mark.parametrize("field", [0.0, 0.2])
def test_small_swings_have_the_period_of_the_closed_form(settings, field):
    """T = 2 pi sqrt(I / (k + m B sin(theta))), I = M L^2 / 3 of a thin plate about its edge."""
    s = settings.replace(loss_time=0.0)
    model, parameters, _ = mae_crease.build(s)
    drive = Drive(field=(0, 0, field))
    rest = equilibrium(model, parameters, drive)
    moving = model.position[:, 0] > 0.5 * s.length + 1e-9
    tilt, arm = 1e-3, rest.x[moving] - (0.5 * s.length, 0, 0)
    x = rest.x.copy()
    x[moving, 0] = 0.5 * s.length + np.cos(tilt) * arm[:, 0] - np.sin(tilt) * arm[:, 2]
    x[moving, 2] = np.sin(tilt) * arm[:, 0] + np.cos(tilt) * arm[:, 2]
    motion = simulate(model, parameters, drive, duration=0.2, rate=2000, state=State.at_rest(model, position=x))

    volume = s.length * s.width * s.thickness
    inertia = s.density * volume * s.length**2 / 3
    stiffness = s.stiffness + s.remanence * volume / MU0 * field * np.sin(rest.angles[0])
    rate = np.sqrt(stiffness / inertia)
    swing = motion.creases[:, 0, 0] - rest.angles[0]
    scale = np.array([tilt, rate, 1.0])

    def misfit(p):
        a, w, phase = p * scale
        return (a * np.cos(w * motion.times + phase) - swing) / tilt

    amplitude, measured, phase = least_squares(misfit, [1.0, 1.0, 0.0]).x * scale
    assert amplitude == pytest.approx(tilt, rel=1e-3)
    assert phase == pytest.approx(0.0, abs=1e-3)
    assert 2 * np.pi / measured == pytest.approx(2 * np.pi / rate, rel=1e-4)
