"""Constant moment: on a crease whose rest angle was read wrongly, or of which one side has swollen before."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def moment(offset_moment: scalar):
    return offset_moment


@wp.func
def energy(angle: scalar, offset_moment: scalar):
    return -offset_moment * angle


EFFECT = Effect(
    name="crease_offset",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("offset_moment", "M0", "N m", 0.0, (-10.0, 10.0), "K times the error of rest angle", typical=1e-4),
    ),
    fitted=("offset_moment",),
    formula="M = M0 = K (error of the rest angle)",
    source="linear crease about another angle",
    matters="an offset at zero drive that is the same from the first frame to the last",
    confused_with="gravity, set, swelling, attraction between panels",
    separated_by="turn the set-up by 90 and 180 degrees; a picture before the first drive",
)
