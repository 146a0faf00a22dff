"""Creep of the rest angle: ever more slowly, as the logarithm of time since a crease was folded."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def moved(time: scalar, stiffness: scalar, drift: scalar, onset: scalar):
    return stiffness * drift * wp.log(scalar(1.0) + time / onset)


@wp.func
def moment(time: scalar, stiffness: scalar, drift: scalar, onset: scalar):
    return moved(time, stiffness, drift, onset)


@wp.func
def energy(angle: scalar, time: scalar, stiffness: scalar, drift: scalar, onset: scalar):
    return -moved(time, stiffness, drift, onset) * angle


EFFECT = Effect(
    name="crease_aging",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("stiffness", "K", "N m/rad", 0.0, (0.0, math.inf), "that of the crease", typical=1e-3),
        Parameter(
            "drift", "A", "rad", 0.0, (-3.0, 3.0), "turn of the rest angle as log(1 + t/t0) grows by one", typical=0.02
        ),
        Parameter(
            "onset", "t0", "s", 1.0, (1e-6, 1e9), "time since the last fold when the recording starts", typical=1.0
        ),
    ),
    fitted=("drift", "onset"),
    formula="theta0(t) = theta0 + A log(1 + t / t0),  so M = K A log(1 + t / t0) beside the elastic crease",
    source=(
        "logarithmic aging of creases: Thiria & Adda-Bedia 2011 (PRL 107, 025506), Jules, Lechenault & Adda-Bedia 2020 "
        "(PRE 102, 033005); natural logarithm, t from the start of the recording"
    ),
    matters="paper and polyester open by 2 to 10 deg per decade of time, for days, without a load",
    confused_with="relaxation with few time constants, swelling (linear in time), temperature, a set",
    separated_by="ten times as long a recording: a decade moves it as far as the last; fold anew, and it starts again",
)  # fmt: skip
