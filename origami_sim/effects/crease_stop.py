"""Angle stop: keeps a crease from passing through flat-folded, or from where the edges of thick panels meet."""

import math

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar

STEEPEST = 30.0
"""Slope at which the barrier goes straight on, in units of its stiffness: as stiff as it gets."""

BEND = math.atan(math.sqrt(STEEPEST))
"""u at which tan u - u has that slope, tan(u)^2."""


@wp.func
def room_of(stop_angle: scalar, stop_room: scalar):
    room = scalar(math.pi) - stop_angle
    if stop_room > scalar(0.0):
        room = stop_room
    return room


@wp.func
def moment(angle: scalar, stop_stiffness: scalar, stop_angle: scalar, stop_middle: scalar, stop_room: scalar):
    value = scalar(0.0)
    room = room_of(stop_angle, stop_room)
    over = wp.abs(angle - stop_middle) - stop_angle
    if over > scalar(0.0):
        scale = scalar(2.0) / scalar(math.pi) * room
        u = wp.min(over / scale, scalar(BEND))
        value = -stop_stiffness * (scale * (wp.tan(u) - u) + scalar(STEEPEST) * (over - scale * u))
        if angle < stop_middle:
            value = -value
    return value


@wp.func
def energy(angle: scalar, stop_stiffness: scalar, stop_angle: scalar, stop_middle: scalar, stop_room: scalar):
    value = scalar(0.0)
    room = room_of(stop_angle, stop_room)
    over = wp.abs(angle - stop_middle) - stop_angle
    if over > scalar(0.0):
        scale = scalar(2.0) / scalar(math.pi) * room
        u = wp.min(over / scale, scalar(BEND))
        beyond = over - scale * u
        value = stop_stiffness * scale * scale * (-wp.log(wp.cos(u)) - scalar(0.5) * u * u)
        value += stop_stiffness * (scale * (wp.tan(u) - u) * beyond + scalar(0.5) * scalar(STEEPEST) * beyond * beyond)
    return value


EFFECT = Effect(
    name="crease_stop",
    family="crease",
    force=moment,
    energy=energy,
    conservative=True,
    parameters=(
        Parameter(
            "stop_stiffness", "ks", "N m/rad", 0.0, (0.0, math.inf), "scale of the barrier's stiffness", typical=1e-3
        ),
        Parameter(
            "stop_angle",
            "theta_s",
            "rad",
            2.8,
            (0.0, 3.13),
            "fold from the middle, either way, where it begins",
            typical=1.5,
            threshold="fold",
        ),
        Parameter("stop_middle", "theta_m", "rad", 0.0, (-math.pi, math.pi), "fold angle half way between both stops"),
        Parameter("stop_room", "s0", "rad", 0.0, (0.0, math.pi), "within which it gets steep; 0: what is left to pi"),
    ),
    fitted=("stop_stiffness", "stop_angle"),
    stiffness=lambda p: p["stop_stiffness"] * STEEPEST,
    formula="M = -ks s (tan u - u) sign(theta - theta_m),  u = (|theta - theta_m| - theta_s) / s,  s = 2 s0 / pi, or "
    "2 (pi - theta_s) / pi where s0 = 0",
    source="barrier after Liu & Paulino 2017, smooth at its onset; straight on beyond slope 30 ks (u = 1.39)",
    matters="folds that close; patches whose edges touch",
    confused_with="stiffening crease",
    separated_by="kink in angle against field; vary the gap",
)
