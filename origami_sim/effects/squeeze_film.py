"""Squeeze film: air or oil between a panel and the ground, which resists being squeezed and being filled."""

import warp as wp

from origami_sim.effects._effect import Effect, Parameter, scalar


@wp.func
def force(gap: scalar, rate: scalar, film: scalar, thinnest: scalar, reach: scalar):
    value = scalar(0.0)
    if gap < reach:
        inner = wp.max(gap, scalar(0.0)) + thinnest
        outer = reach + thinnest
        value = -film * rate * (scalar(1.0) / (inner * inner * inner) - scalar(1.0) / (outer * outer * outer))
    return value


EFFECT = Effect(
    name="squeeze_film",
    family="contact",
    force=force,
    parameters=(
        Parameter("film", "C", "N s m^2", 0.0, (0.0, 1e-6), "mu L b^3 of a strip b wide, L long", typical=2e-13),
        Parameter("thinnest", "h0", "m", 5e-5, (1e-6, 1e-2), "film left where the surfaces touch", typical=5e-5),
        Parameter("reach", "r", "m", 5e-3, (1e-5, 1.0), "gap at which the film ends", typical=5e-3),
    ),
    fitted=("film",),
    damping=lambda p: p["film"] / p["thinnest"] ** 3,
    formula="fn = -C (h^-3 - (r + h0)^-3) dgap/dt,  h = max(gap, 0) + h0",
    source="Reynolds lubrication: C = mu L b^3 for a long strip, 3 pi mu R^4 / 2 for a disc",
    matters="lift-off is late and landing soft; what the film bears also loads the friction",
    confused_with="adhesion (has a threshold), loss in the crease",
    separated_by="perforated base; vacuum; the delay falls as the cube of the gap",
)
