"""What follows its target with a time constant, as polarisation and magnetisation do."""

import warp as wp

from origami_sim.effects._effect import scalar


@wp.func
def following(q: scalar, before: scalar, target: scalar, dt: scalar, time: scalar):
    """q after dt of time * dq/dt = target - q, exact for a target that goes evenly from `before` to its last value."""
    r = dt / time
    left = wp.exp(-r)
    mean = scalar(1.0) - scalar(0.5) * r  # of exp(-s) for s from 0 to r
    if r > scalar(1.0e-6):
        mean = (scalar(1.0) - left) / r
    return left * q + (scalar(1.0) - mean) * target + (mean - left) * before
