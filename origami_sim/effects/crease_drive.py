"""A crease whose rest angle is driven towards a target by the load factor, as in self-folding sheets."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def moment(load: scalar, drive_stiffness: scalar, target_angle: scalar):
    return drive_stiffness * load * target_angle


@wp.func
def energy(angle: scalar, load: scalar, drive_stiffness: scalar, target_angle: scalar):
    return -drive_stiffness * load * target_angle * angle


EFFECT = Effect(
    name="crease_drive",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter("drive_stiffness", "K", "N m/rad", 0.0, (0.0, math.inf), "moment per radian of target, at full load"),
        Parameter("target_angle", "theta_t", "rad", 0.0, (-math.pi, math.pi), "fold angle aimed at, valley positive"),
    ),
    formula="M = load(t) K theta_t; beside an elastic crease of the same K the rest angle moves by load * theta_t",
    source="target-angle actuation as in Origami Simulator (Ghassaei, Demaine & Gershenfeld 2018), in SI units",
    matters="folding a pattern to its target angles",
    confused_with="rest-angle drift",
    separated_by="remove the drive",
)
