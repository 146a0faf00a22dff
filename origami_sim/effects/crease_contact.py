"""One-sided stop: patches that touch, or a limit, from a fold angle on."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def overlap(angle: scalar, contact_angle: scalar, contact_side: scalar):
    side = contact_side
    if side == scalar(0.0):
        side = contact_angle
    over = angle - contact_angle
    if side < scalar(0.0):
        over = wp.min(over, scalar(0.0))
    else:
        over = wp.max(over, scalar(0.0))
    return over


@wp.func
def moment(
    angle: scalar,
    rate: scalar,
    contact_stiffness: scalar,
    contact_angle: scalar,
    contact_side: scalar,
    contact_loss: scalar,
):
    over = overlap(angle, contact_angle, contact_side)
    approach = rate
    if over < scalar(0.0):
        approach = -rate
    return -contact_stiffness * over * wp.max(scalar(1.0) + contact_loss * approach, scalar(0.0))


@wp.func
def energy(angle: scalar, contact_stiffness: scalar, contact_angle: scalar, contact_side: scalar):
    over = overlap(angle, contact_angle, contact_side)
    return scalar(0.5) * contact_stiffness * over * over


EFFECT = Effect(
    name="crease_contact",
    family="crease",
    force=moment,
    energy=energy,
    parameters=(
        Parameter(
            "contact_stiffness", "kc", "N m/rad", 0.0, (0.0, math.inf), "stiffness of what touches", typical=5e-3
        ),
        Parameter(
            "contact_angle", "theta_c", "rad", 1.0, (-math.pi, math.pi), "fold where they touch",
            typical=1.0, threshold="fold", side="contact_side",
        ),
        Parameter(
            "contact_side", "side", "-", 0.0, (-1.0, 1.0),
            "which folds press: 1 larger ones, -1 smaller ones, 0 those farther from flat",
        ),
        Parameter(
            "contact_loss", "c", "s/rad", 0.0, (0.0, math.inf),
            "more moment on the way in, less on the way out; slow blows return 1 - 2/3 c w of their rate w",
            typical=0.05,
        ),
    ),
    fitted=("contact_stiffness", "contact_angle"),
    further=("contact_loss",),
    stiffness=lambda p: p["contact_stiffness"],
    formula="M = -kc (theta - theta_c) (1 + c w), beyond theta_c on one side only; w: rate inwards, never pulling",
    source="penalty contact of patch edges: tan(theta_c / 2) = gap / (2 height) for patches flush with the crease; "
    "loss after Hunt & Crossley 1975",
    matters="a kink in the fold against the drive; rattling; folds that stop early on one side",
    confused_with="stiffening (no kink), asymmetry (kink at rest)",
    separated_by="vary the gap between the patches; listen; look along the crease",
)  # fmt: skip
