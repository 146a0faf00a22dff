"""Current limit of the supply: the stack is charged at a limited current."""

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import sampled, voltages


def slewed(times: np.ndarray, values: np.ndarray, charge_time: np.ndarray) -> np.ndarray:
    """Samples [n, W] with a slope of at most 1 / charge_time [W], from the first value on."""
    out = np.empty(np.broadcast_shapes(values.shape, (1, len(charge_time))))
    out[0] = values[0]
    for n, h in enumerate(np.diff(times)):
        reach = h / np.maximum(charge_time, 1e-30)
        out[n + 1] = np.clip(values[n + 1], out[n] - reach, out[n] + reach)
    return out


def apply(drive: Drive, duration: float, charge_time: np.ndarray) -> Drive:
    def limit(times: np.ndarray, values: np.ndarray) -> np.ndarray:
        return slewed(times, values, charge_time)

    return sampled(drive, voltages(drive), duration, limit, when=charge_time)


EFFECT = Effect(
    name="voltage_limit",
    family="drive",
    force=None,
    apply=apply,
    channels=("voltage",),
    parameters=(Parameter("charge_time", "C/I", "s/V", 0.0, (0.0, 1e-2), "time for each volt", typical=1e-5),),
    fitted=("charge_time",),
    formula="|dV/dt| <= I / C",
    source="constant-current limit of a high-voltage supply; 0.1 mA into 0.76 nF: 30 ms to 4 kV",
    matters="a delay that grows with the voltage",
    confused_with="viscous loss, creep; RC lag (a delay that does not depend on the voltage)",
    separated_by="record voltage and current; steps of different height",
)
