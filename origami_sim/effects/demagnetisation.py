"""Demagnetisation: lasting loss of remanence where an opposing field has exceeded a threshold."""

import warp as wp

from origami_sim.effects import magnetic_torque as nominal
from origami_sim.effects._effect import Effect, Memory, Parameter, scalar
from origami_sim.effects._magnet import MAGNET, along_poling


@wp.func
def force(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    field: wp.vec3d,
    lost: scalar,
    remanence: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
    poling_n: scalar,
    loss: scalar,
    threshold: scalar,
):
    opposing = -wp.sign(remanence) * along_poling(x1, x2, x3, field, poling_1, poling_2, poling_n)
    now = wp.clamp(loss * (opposing - threshold), lost, scalar(1.0))
    return nominal.force(x1, x2, x3, field, -now * remanence, volume, poling_1, poling_2, poling_n), now


EFFECT = Effect(
    name="demagnetisation",
    family="triangle",
    force=force,
    memory=(Memory("lost"),),
    parameters=(
        *MAGNET,
        Parameter("loss", "c", "1/T", 0.0, (0.0, 100.0), "share lost per field beyond the threshold", typical=1.0),
        Parameter(
            "threshold", "B0", "T", 0.0, (0.0, 5.0), "opposing field that does no harm", typical=0.1, threshold="field"
        ),
    ),
    fitted=("loss", "threshold"),
    formula="m = (1 - q) Br V / mu0,  q = max over the past of c (-u . B - B0), between 0 and 1",
    source="irreversible branch of a demagnetisation curve, linearised (Cullity & Graham 2009, ch. 14)",
    matters="1 to 5 % for opposing fields of a third of the coercivity; more for thin patches poled across",
    confused_with="Mullins softening (which makes the first cycle stiffer, not stronger), creep",
    separated_by="a step at the first reversed peak, permanent, then stable; measure the remanence again",
)
