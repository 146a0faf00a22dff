"""Stiffness and viscosity of a crease from a free swing."""

import math

import numpy as np
from scipy.optimize import least_squares

from origami_sim.calibrate.curves import checked_curve
from origami_sim.calibrate.fitting import Fit, Parameter, fit, identifiability, warned, with_curve
from origami_sim.errors import InputError


def fit_ring_down(time, angle, *, inertia: float | None = None) -> Fit:
    """Stiffness and viscosity of a crease from a free swing: I theta'' + c theta' + K (theta - theta0) = 0.

    Args:
        time: (n,) [s], rising. angle: (n,) [rad]. inertia: I about the crease [kg m^2]. Without it only K / I and c / I
            can be known: they are returned, and a warning says so.

    Returns:
        With an inertia `stiffness` [N m/rad] and `viscosity` [N m s/rad]; without, `stiffness_per_inertia` [1/s^2] and
        `viscosity_per_inertia` [1/s]. Also `rest_angle` [rad].

    Raises:
        InputError: fewer than 10 points, a time that turns back, NaN, no swing, an amplitude that grows (the viscosity
            would be negative), an inertia that is not positive.
    """
    if inertia is not None and not (inertia > 0 and math.isfinite(inertia)):
        raise InputError("not an inertia", field="inertia", value=inertia, allowed="> 0 kg m^2, or none")
    raw = np.asarray(time, float)
    time, angle = checked_curve(time, angle, ("time", "angle"), 10)
    if len(raw) and raw[0] != time[0]:
        raise InputError("the time runs backwards", field="time", value=float(raw[-1]), allowed="rising times")
    t = time - time[0]
    swing = angle - angle.mean()
    if not swing.std() > 1e-12 * max(np.abs(angle).max(), 1e-300):
        raise InputError("there is no swing", field="angle", value=float(swing.std()), allowed="a free oscillation")
    even = np.linspace(0, t[-1], len(t))
    power = np.abs(np.fft.rfft(np.interp(even, t, swing) * np.hanning(len(t)), 8 * len(t))) ** 2
    rates = 2 * math.pi * np.fft.rfftfreq(8 * len(t), even[1])
    lowest = 2 * math.pi / t[-1]
    peak = int(np.argmax(np.where(rates >= lowest, power, 0)))
    if power[peak] <= 0 or rates[peak] > 0.9 * math.pi / even[1]:
        raise InputError("the swing is not resolved in time", field="time", value=len(t), allowed="8 points per period")

    def columns(square, loss):
        gamma = loss / 2
        rate2 = square - gamma**2
        decay = np.exp(-gamma * t)
        rate = math.sqrt(abs(rate2)) + 1e-12
        if rate2 > 0:
            return np.column_stack([decay * np.cos(rate * t), decay * np.sin(rate * t)])
        return np.column_stack([np.exp((-gamma + rate) * t), np.exp((-gamma - rate) * t)])

    def predicted(square, loss, rest):
        c = columns(square, loss)
        return rest + c @ np.linalg.lstsq(c, angle - rest, rcond=None)[0]

    def start_of(loss):
        c = np.column_stack([columns(rates[peak] ** 2 + loss**2 / 4, loss), np.ones(len(t))])
        a = np.linalg.lstsq(c, angle, rcond=None)[0]
        return float(((angle - c @ a) ** 2).sum()), loss, float(a[-1])

    trials = [start_of(x / t[-1]) for x in (-4.0, -1.0, -0.2, 0.02, 0.1, 0.4, 1.0, 2.5, 6.0, 15.0)]
    _, loss, rest = min(trials)
    square = rates[peak] ** 2
    free = least_squares(
        lambda p: angle - predicted(p[0] * square, p[1] * lowest, p[2]), [1.0, loss / lowest, rest], max_nfev=200
    )
    jacobian = np.asarray(free.jac)
    error = np.linalg.pinv(jacobian.T @ jacobian) * 2 * free.cost / max(len(t) - 5, 1)
    if free.x[1] < -3 * math.sqrt(abs(error[1, 1])) and free.x[1] * lowest * t[-1] < -1e-3:
        raise InputError(
            "the amplitude grows: the viscosity would be negative",
            field="viscosity_per_inertia",
            value=float(free.x[1] * lowest),
            allowed=">= 0 1/s",
        )
    if not free.x[0] > 0:
        square = float(free.x[0] * square)
        raise InputError(
            "the stiffness would be negative", field="stiffness_per_inertia", value=square, allowed="> 0 1/s^2"
        )
    known = inertia or 1.0
    names = (
        (("stiffness", "N m/rad"), ("viscosity", "N m s/rad"))
        if inertia
        else (("stiffness_per_inertia", "1/s^2"), ("viscosity_per_inertia", "1/s"))
    )
    inf = math.inf
    parameters = (
        Parameter(*names[0], free.x[0] * square * known, (0.0, inf), "rotational stiffness of the whole crease"),
        Parameter(*names[1], max(free.x[1] * lowest, 0.0) * known, (0.0, inf), "Kelvin-Voigt loss of the crease"),
        Parameter("rest_angle", "rad", free.x[2], (-inf, inf), "angle without moment"),
    )
    found = fit(lambda p: angle - predicted(p[0] / known, p[1] / known, p[2]), parameters)
    model = predicted(found.values[0] / known, found.values[1] / known, found.values[2])
    if inertia is None:
        triple = [
            Parameter(n, u, v, (0.0, inf), "")
            for n, u, v in (
                ("stiffness", "N m/rad", found.values[0]),
                ("viscosity", "N m s/rad", max(found.values[1], 1e-9 * lowest)),
                ("inertia", "kg m^2", 1.0),
            )
        ]
        unknown = identifiability(
            lambda p: angle - predicted(p[0] / p[2], p[1] / p[2], found.values[2]), triple,
            np.array([p.start for p in triple]),
        )  # fmt: skip
        found = warned(found, unknown)
    return with_curve(found, time, angle, model, "time [s]", "angle [rad]")
