"""Drift of the rest angle towards another one with one time constant, as a device that warms up or dries."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def moment(time: scalar, stiffness: scalar, drift: scalar, settling_time: scalar):
    return stiffness * drift * (scalar(1.0) - wp.exp(-time / settling_time))


@wp.func
def energy(angle: scalar, time: scalar, stiffness: scalar, drift: scalar, settling_time: scalar):
    return -moment(time, stiffness, drift, settling_time) * angle


EFFECT = Effect(
    name="crease_warming",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("stiffness", "K", "N m/rad", 0.0, (0.0, math.inf), "that of the crease", typical=1e-3),
        Parameter("drift", "A", "rad", 0.0, (-3.0, 3.0), "turn of the rest angle in the end", typical=0.05),
        Parameter("settling_time", "tau", "s", 1.0, (1e-6, 1e9), "in which it goes most of the way", typical=2.0),
    ),
    fitted=("drift", "settling_time"),
    formula="theta0(t) = theta0 + A (1 - exp(-t / tau)),  so M = K A (1 - exp(-t / tau)) beside the elastic crease",
    source="a bilayer, or a coil or supply nearby, that warms up (Newton's law of cooling), from the recording's start",
    matters="two layers of 50 um that differ by 50 ppm/K, 2 mm long, 10 K warmer: 0.9 deg (Timoshenko 1925)",
    confused_with="aging (the logarithm of time, without an end), swelling (linear in time), relaxation of a held fold",
    separated_by="log the temperature; record the same motion half an hour after everything was switched on",
)
