"""Growing moment: on a crease, with time, as where one side swells or takes up water or oil."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def moment(time: scalar, moment_rate: scalar):
    return moment_rate * time


@wp.func
def energy(angle: scalar, time: scalar, moment_rate: scalar):
    return -moment_rate * time * angle


EFFECT = Effect(
    name="crease_swelling",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("moment_rate", "m", "N m/s", 0.0, (-1.0, 1.0), "K times the drift of rest angle", typical=2e-5),
    ),
    fitted=("moment_rate",),
    formula="M = m t = K (drift of the rest angle) t, from the start of the recording",
    source="one-sided swelling, 1-5 % by volume over days: linear in time over one recording",
    matters="a drift without load that does not turn back",
    confused_with="set and creep, which need a fold; temperature",
    separated_by="store it unloaded; weigh it; log the temperature",
)
