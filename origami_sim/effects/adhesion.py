"""Foot adhesion: pull-off force of a soft foot that sticks to the ground."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def force(gap: scalar, pull_off: scalar, reach: scalar):
    return -pull_off * wp.clamp(scalar(1.0) - gap / reach, scalar(0.0), scalar(1.0))


@wp.func
def energy(gap: scalar, pull_off: scalar, reach: scalar):
    open = wp.clamp(gap, scalar(0.0), reach)
    return -pull_off * (scalar(0.5) * (reach - open) * (reach - open) / reach - wp.min(gap, scalar(0.0)))


EFFECT = Effect(
    name="adhesion",
    family="contact",
    force=force,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("pull_off", "Fa", "N", 0.0, (0.0, 100.0), "largest tension; 3/2 pi W R for a sphere", typical=0.01),
        Parameter("reach", "r", "m", 5e-5, (1e-7, 1e-2), "gap at which the pull has faded", typical=5e-5),
    ),
    fitted=("pull_off",),
    stiffness=lambda p: p["pull_off"] / p["reach"],
    formula="fn = -Fa clamp(1 - gap / r, 0, 1)",
    source="pull-off after Johnson, Kendall & Roberts 1971, with a linear decay over the reach",
    matters="threshold field for lifting a foot; 25 mm^2 of PDMS at 10 kPa holds the crawler down",
    confused_with="gravity preload, friction",
    separated_by="dusted foot; pull-off test",
)
