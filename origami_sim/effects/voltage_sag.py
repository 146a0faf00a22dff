"""Dielectric leakage: pulls the voltage down the more, the higher it is."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import sampled, voltages


def loaded(command: np.ndarray, sag: np.ndarray, sag_voltage: np.ndarray, leakage_voltage: np.ndarray) -> np.ndarray:
    """Voltage left of a commanded one [n, W], by Newton's method from above, where it cannot overshoot."""
    # sinh(v / Ve) / sinh(V1 / Ve) without large numbers
    full = np.expm1(-2 * sag_voltage / leakage_voltage)

    def drop(v: np.ndarray, sign: float) -> np.ndarray:
        rising = np.exp((v - sag_voltage) / leakage_voltage)
        return -sag * sag_voltage * (rising + sign * np.exp(-(v + sag_voltage) / leakage_voltage)) / full

    target = np.abs(command)
    v = np.broadcast_to(target, np.broadcast_shapes(target.shape, (1, len(sag)))).copy()
    for _ in range(200):
        step = (v + drop(v, -1.0) - target) / (1 + drop(v, 1.0) / leakage_voltage)
        v -= step
        if np.all(np.abs(step) <= 1e-12 * (1 + target)):
            break
    return np.copysign(v, command)


def apply(
    drive: Drive, duration: float, sag: np.ndarray, sag_voltage: np.ndarray, leakage_voltage: np.ndarray
) -> Drive:
    def leak(_: np.ndarray, values: np.ndarray) -> np.ndarray:
        return loaded(values, sag, sag_voltage, leakage_voltage)

    return sampled(drive, voltages(drive), duration, leak, when=sag)


EFFECT = Effect(
    name="voltage_sag",
    family="drive",
    force=None,
    apply=apply,
    channels=("voltage",),
    parameters=(
        Parameter("sag", "s", "-", 0.0, (0.0, 10.0), "voltage lost over voltage left, at V1", typical=0.05),
        Parameter("sag_voltage", "V1", "V", 4000.0, (1.0, 1e5), "voltage at which that is stated", typical=4000.0),
        Parameter(
            "leakage_voltage", "Ve", "V", 1000.0, (10.0, 1e5), "rise that multiplies the leakage by e", typical=1000.0
        ),
    ),
    fitted=("sag",),
    formula="V + s V1 sinh(V / Ve) / sinh(V1 / Ve) = V_command",
    source="conduction J ~ sinh(E / E0) (hopping, Poole-Frenkel at high field) through a series resistance",
    matters="angle grows slower than V^2 above some 15 MV/m",
    confused_with="dielectric relaxation, buckling, friction",
    separated_by="a current monitor; the voltage at the stack",
)
