"""Stribeck friction: static friction exceeds kinetic friction, and fades with the speed of sliding."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def coefficient(speed: scalar, static_excess: scalar, fading_speed: scalar):
    # the elastic speed of a foot that sticks counts too, so its bristle should be stiff
    ratio = speed / fading_speed
    return static_excess * wp.exp(-ratio * ratio)


EFFECT = Effect(
    name="stribeck",
    family="coefficient",
    force=coefficient,
    parameters=(
        Parameter("static_excess", "dmu", "-", 0.0, (0.0, 5.0), "static minus kinetic coefficient", typical=0.3),
        Parameter("fading_speed", "vs", "m/s", 0.01, (1e-4, 10.0), "speed at which 37 % of it is left", typical=0.01),
    ),
    fitted=("static_excess", "fading_speed"),
    formula="mu = mu_k + dmu exp(-(v / vs)^2)",
    source="Stribeck curve as in LuGre (Canudas de Wit et al. 1995); rubber vs 1-50 mm/s",
    matters="stick-slip; stride that depends on the frequency",
    confused_with="adhesion",
    separated_by="vary the load at fixed frequency; high-speed video of the foot",
)
