"""Encoder eccentricity: the disc does not turn about its own middle, an error that comes back once a turn."""

import numpy as np

from origami_sim.effects._effect import Effect, Parameter
from origami_sim.effects._signals import Read


def apply(read: Read, times: np.ndarray, sine: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    angle = read(times)
    return angle + sine * np.sin(angle) + cosine * (np.cos(angle) - 1.0)


EFFECT = Effect(
    name="angle_eccentricity",
    family="measurement",
    force=None,
    apply=apply,
    channels=("panel_angle", "crease_angle"),
    parameters=(
        Parameter("sine", "a", "rad", 0.0, (-0.1, 0.1), "part of the error that goes with the sine", typical=5e-3),
        Parameter("cosine", "b", "rad", 0.0, (-0.1, 0.1), "part that goes with the cosine", typical=0.0),
    ),
    fitted=("sine", "cosine"),
    formula="y = x + a sin x + b (cos x - 1): amplitude sqrt(a^2 + b^2), phase atan2(b, a); none at the angle zero",
    source=(
        "first order in the eccentricity e over the disc's radius r, amplitude e / r (Ernst 1998, Digital Linear and "
        "Angular Metrology)"
    ),
    matters="a disc of 20 mm that is 0.1 mm off its axis: 5 mrad; magnets before Hall sensors alike; bound: 2 mm",
    confused_with="scale and zero of the angle for small swings, weight on a side, stiffness that goes with the angle",
    separated_by="turn the joint by hand once around against a protractor; two reading heads opposite to each other",
)
