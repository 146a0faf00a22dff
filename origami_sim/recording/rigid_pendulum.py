"""Reference for tests and stand-ins: two rigid arms on two hinges, from Lagrange's equations, sharing no code with the
simulator.

Angles are absolute, from the upright vertical, so that hanging still is pi. With c = cos(theta1 - theta2),
s = sin(theta1 - theta2), p = m2 L1 a2:

    T = (I1 + m1 a1^2 + m2 L1^2) w1^2 / 2 + (I2 + m2 a2^2) w2^2 / 2 + p c w1 w2
    V = g ((m1 a1 + m2 L1) cos theta1 + m2 a2 cos theta2)

    (I1 + m1 a1^2 + m2 L1^2) dw1/dt + p c dw2/dt + p s w2^2 = g (m1 a1 + m2 L1) sin theta1 + Q1 - Q2
    p c dw1/dt + (I2 + m2 a2^2) dw2/dt - p s w1^2           = g m2 a2 sin theta2 + Q2

Q1 is the moment of hinge 1 on arm 1, Q2 that of hinge 2 on arm 2 (its reaction acts on arm 1); both are friction,
Q = -k rate - dry tanh(rate / dry_rate) with the hinge's relative rate.
"""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from origami_sim.errors import InputError


@dataclass(frozen=True)
class DoublePendulum:
    """Parameters of a double compound pendulum; with m2 = 0 arm 1 is a single one.

    Attributes:
        m1, m2: masses of the arms [kg].
        a1, a2: distance from an arm's upper hinge to its centre of mass [m].
        L1: distance between the hinges [m].
        I1, I2: moments of inertia about the centres of mass [kg m^2].
        k1, k2: viscous friction of hinge 1 and hinge 2 [N m s/rad].
        g: acceleration of gravity [m/s^2].
        dry1, dry2: dry (Coulomb) friction moment of hinge 1 and hinge 2 [N m].
        dry_rate: relative rate over which dry friction changes sign, smoothed by tanh [rad/s].
    """

    m1: float
    m2: float
    a1: float
    a2: float
    L1: float
    I1: float
    I2: float
    k1: float = 0.0
    k2: float = 0.0
    g: float = 9.81
    dry1: float = 0.0
    dry2: float = 0.0
    dry_rate: float = 0.02


PUBLISHED_DOUBLE = DoublePendulum(
    m1=0.093844,
    m2=0.137596,
    a1=0.108565,
    a2=0.116779,
    L1=0.172719,
    I1=4.3753e-4,
    I2=1.26883e-3,
    k1=2.3714e-4,
    k2=1.0e-5,
    g=9.80858,
)
"""Fit published with the double-pendulum recording of github.com/dynamicslab/MultiArm-Pendulum (MIT)."""


def double_pendulum_rhs(t: float, y: np.ndarray, parameters: DoublePendulum) -> np.ndarray:
    """Time derivative of y = [theta1, theta2, w1, w2] (4,) [rad, rad/s]; `t` [s] does not enter."""
    p = parameters
    theta1, theta2, w1, w2 = y
    coupling = p.m2 * p.L1 * p.a2
    c, s = np.cos(theta1 - theta2), np.sin(theta1 - theta2)
    inertia1 = p.I1 + p.m1 * p.a1**2 + p.m2 * p.L1**2
    inertia2 = p.I2 + p.m2 * p.a2**2
    hinge1 = -p.k1 * w1 - p.dry1 * np.tanh(w1 / p.dry_rate)
    hinge2 = -p.k2 * (w2 - w1) - p.dry2 * np.tanh((w2 - w1) / p.dry_rate)
    moment1 = p.g * (p.m1 * p.a1 + p.m2 * p.L1) * np.sin(theta1) - coupling * s * w2**2 + hinge1 - hinge2
    moment2 = p.g * p.m2 * p.a2 * np.sin(theta2) + coupling * s * w1**2 + hinge2
    determinant = inertia1 * inertia2 - (coupling * c) ** 2
    return np.array(
        [
            w1,
            w2,
            (inertia2 * moment1 - coupling * c * moment2) / determinant,
            (inertia1 * moment2 - coupling * c * moment1) / determinant,
        ]
    )


def double_pendulum_energy(y: np.ndarray, parameters: DoublePendulum) -> np.ndarray:
    """Kinetic plus potential energy [J] of states (..., 4); zero potential at the height of hinge 1."""
    p = parameters
    theta1, theta2, w1, w2 = np.moveaxis(np.asarray(y, dtype=float), -1, 0)
    kinetic = (
        0.5 * (p.I1 + p.m1 * p.a1**2 + p.m2 * p.L1**2) * w1**2
        + 0.5 * (p.I2 + p.m2 * p.a2**2) * w2**2
        + p.m2 * p.L1 * p.a2 * np.cos(theta1 - theta2) * w1 * w2
    )
    potential = p.g * ((p.m1 * p.a1 + p.m2 * p.L1) * np.cos(theta1) + p.m2 * p.a2 * np.cos(theta2))
    return kinetic + potential


def simulate_double_pendulum(
    parameters: DoublePendulum, y0: np.ndarray, times: np.ndarray, rtol: float = 1e-10, atol: float = 1e-12
) -> np.ndarray:
    """Motion of the double pendulum by DOP853, an explicit Runge-Kutta pair of order 8.

    Args:
        parameters: the pendulum.
        y0: (4,) state [theta1, theta2, w1, w2] at times[0] [rad, rad/s].
        times: (n,) increasing times [s].
        rtol: relative tolerance per step.
        atol: absolute tolerance per step [rad, rad/s].

    Returns:
        (n, 4) states at `times`.
    """
    solution = solve_ivp(
        double_pendulum_rhs,
        (times[0], times[-1]),
        y0,
        method="DOP853",
        t_eval=times,
        args=(parameters,),
        rtol=rtol,
        atol=atol,
    )
    if not solution.success:
        raise InputError(f"the double pendulum could not be integrated: {solution.message}")
    return solution.y.T
