"""Mass-proportional damping: drag by mass and velocity, the usual stand-in for air."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def force(v: wp.vec3d, mass: scalar, decay_rate: scalar):
    return -decay_rate * mass * v


EFFECT = Effect(
    name="mass_damping",
    family="node",
    force=force,
    parameters=(
        Parameter("decay_rate", "alpha", "1/s", 0.0, (0.0, 1e4), "rate at which free motion decays", typical=0.5),
    ),
    fitted=("decay_rate",),
    damping=lambda p: p["decay_rate"] * p["mass"],
    formula="f = -alpha m v",
    source="Rayleigh damping, mass part",
    matters="brings a model to rest; above 1 /s it visibly brakes free flight, which air does not",
    confused_with="air drag, crease viscosity",
    separated_by="decay against amplitude and against mode",
)
