"""Slow motions of a magnetic flap by an integration of its own, not by the simulator."""

import numpy as np
from scipy.integrate import solve_ivp

from origami_sim.device.scene import scene_module, scene_settings
from origami_sim.diagnose import Subject
from origami_sim.physics.materials import MU0
from origami_sim.recording import Channel, Recording
from origami_sim.recording.recording import DriveChannel

FLAP = scene_module("mae_crease")
SETTINGS = scene_settings(FLAP)
K = SETTINGS.stiffness
DIPOLE = SETTINGS.remanence * SETTINGS.length * SETTINGS.width * SETTINGS.thickness / MU0
NOISE = 1e-3
RISE, FALL, END = 20.0, 180.0, 300.0
"""When the field has risen, when it begins to fall, and the end [s]."""


def times(count: int = 61) -> np.ndarray:
    """Frames at even times [s]; the field bends at some of them."""
    return np.linspace(0.0, END, count)


def field(t, level: float):
    """A ramp, a hold, a ramp back and a rest [T]."""
    return np.interp(t, [0.0, RISE, FALL, FALL + RISE], [0.0, level, level, 0.0])


def angles(t: np.ndarray, level: float = 0.1, *, branch=0.0, time=30.0, drift=0.0, onset=5.0, viscosity=0.0):
    """Fold angles (n,) of k (a - drift log(1 + t / onset)) + q + c da/dt = m B cos a, with q a Maxwell branch."""

    def balance(s, a, q):
        return DIPOLE * field(s, level) * np.cos(a) - K * (a - drift * np.log1p(s / onset)) - q

    def rates(s, y):
        a, q = y
        if viscosity:
            rate = balance(s, a, q) / viscosity
        else:  # the derivative of the balance in time
            slope = (field(s + 1e-6, level) - field(s - 1e-6, level)) / 2e-6
            push = DIPOLE * slope * np.cos(a) + q / time + K * drift / (onset + s)
            rate = push / (K + branch + DIPOLE * field(s, level) * np.sin(a))
        return [rate, branch * rate - q / time]

    found = solve_ivp(rates, (0.0, t[-1]), [0.0, 0.0], "LSODA", t, rtol=1e-9, atol=1e-12, max_step=1.0)
    return found.y[0]


def recording(values: np.ndarray, level: float = 0.1, *, seed=0, noise=NOISE, name="hold", **stated) -> Recording:
    """The flap's fold angle, with noise, and the field."""
    t = times(len(values))
    seen = values + noise * np.random.default_rng(seed).normal(size=len(t))
    drive = DriveChannel("field", np.outer(field(t, level), [0.0, 0.0, 1.0]), "T", False)
    channel = Channel("fold", "crease_angle", seen, "rad", noise, {"crease": 0})
    return Recording(name, t, {"fold": channel}, {"field": drive}, **stated)


def flap() -> Subject:
    spreads = {"stiffness": 0.1 * K, "remanence": 0.05 * SETTINGS.remanence}
    return Subject.from_scene(FLAP, SETTINGS, spreads=spreads)
