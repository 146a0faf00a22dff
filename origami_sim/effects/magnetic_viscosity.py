"""Magnetic after-effect: part of the moment follows the field only slowly, evenly in the logarithm of time."""

import warp as wp

from origami_sim.effects import magnetic_torque as nominal
from origami_sim.effects._effect import Effect, Memory, Parameter, scalar
from origami_sim.effects._lag import following
from origami_sim.effects._magnet import MAGNET, along_poling


@wp.func
def force(
    x1: wp.vec3d,
    x2: wp.vec3d,
    x3: wp.vec3d,
    dt: scalar,
    field: wp.vec3d,
    q1: scalar,
    q2: scalar,
    q3: scalar,
    before: scalar,
    remanence: scalar,
    volume: scalar,
    poling_1: scalar,
    poling_2: scalar,
    poling_n: scalar,
    after_effect: scalar,
    shortest_time: scalar,
    reversing_field: scalar,
):
    b = along_poling(x1, x2, x3, field, poling_1, poling_2, poling_n)
    target = wp.tanh(b / reversing_field)
    ten = scalar(10.0)
    p1 = following(q1, before, target, dt, shortest_time)
    p2 = following(q2, before, target, dt, ten * shortest_time)
    p3 = following(q3, before, target, dt, ten * ten * shortest_time)
    extra = after_effect * wp.abs(remanence) * (p1 + p2 + p3)
    return nominal.force(x1, x2, x3, field, extra, volume, poling_1, poling_2, poling_n), p1, p2, p3, target


EFFECT = Effect(
    name="magnetic_viscosity",
    family="triangle",
    force=force,
    memory=(Memory("q1"), Memory("q2"), Memory("q3"), Memory("before")),
    parameters=(
        *MAGNET,
        Parameter("after_effect", "S", "-", 0.0, (0.0, 0.3), "share of the moment per decade of time", typical=0.02),
        Parameter("shortest_time", "tau", "s", 0.1, (1e-6, 1e6), "time constant of the first of three decades"),
        Parameter("reversing_field", "Bs", "T", 0.05, (1e-6, 5.0), "field along the poling that drives most of it"),
    ),
    fitted=("after_effect",),
    formula="m = Br V / mu0 (1 + S sum q_i),  10^(i-1) tau dq_i/dt = tanh(u . B / Bs) - q_i,  i = 1, 2, 3",
    source="Street & Woolley 1949 (log-time decay from a flat spread of relaxation times), one branch per decade",
    matters="0.1 to 1 % of the moment per decade; drift after a reversal of the field",
    confused_with="creep of the creases",
    separated_by="reverse the field with the device held; remanence against time by a Hall probe",
)
