"""What is left unnamed, in words: where it acts, with what it goes, its symmetry, and whether it takes energy."""

from collections.abc import Sequence

import numpy as np

from origami_sim.effects import get
from origami_sim.effects.crease_polynomial import EFFECT as MOMENT
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.locate.partial import lacking
from origami_sim.locate.places import Acting, Curve, Place
from origami_sim.locate.where import located

NEAR = 1.25
"""What another action may leave, times what the best leaves, to be named beside it."""

ALSO = 0.5
"""Part of what the best variable explains that another must explain to be named beside it."""

PURE = 4.0
"""How many times its even part the odd part of a curve is, in squares, for it to be called odd; and vice versa."""

WORKS = 0.3
"""|cos| of moment and rate from which on a moment is said to take or give energy."""

CLEAR = 0.3
"""Variance of the missing moment beyond its noise, by that noise, from which on parts of it are told."""


def described(places: Sequence[Place], actions: Sequence[Acting], what: str = "What is left") -> str:
    """One sentence on what the forces that are missing look like; "" where none were found.

    Args:
        places, actions: of the motion under an explanation, from `locate` and `acting`. what: how to call them.
    """
    places = [p for p in places if np.isfinite(p.share)]
    if not places:
        return ""
    p = max(places, key=lambda p: p.share)
    said = [_where(p, actions)]
    # in a periodic motion everything goes with the phase, and with the time since a reversal
    curves = [c for c in p.curves if not c.against.startswith(("phase of", "time since"))]
    size = {c.against: _explained(c) for c in curves}
    if curves and sum(curves[0].count) and max(size.values()) > 0.0:
        best = max(curves, key=lambda c: size[c.against])
        goes = [c.against.replace("_", " ") for c in curves if size[c.against] > ALSO * size[best.against]]
        text = f"goes with the {' and the '.join(goes)} at {p.site}"
        noise, all_ = (float(np.mean(np.square(v))) for v in (p.error, np.subtract(p.moment, np.mean(p.moment))))
        if all_ - noise > CLEAR * noise:
            share = min(size[best.against] / (all_ - noise), 1.0)
            text += f" ({share:.0%} of it{'' if share > 0.5 else '; the rest has a memory, or comes from outside'})"
        said.append(text)
        symmetry = _symmetry(best)
        if symmetry:
            said.append(f"is {symmetry} in the {best.against}")
        rate = next((c for c in curves if c.against == "rate"), None)
        if rate is not None:
            x, n = np.array(rate.x), np.array(rate.count, float)
            speed = np.sqrt(np.average(x**2, weights=n))
            along = p.power / max(speed * np.sqrt(size[best.against]), 1e-300)
            said.append("takes energy" if along < -WORKS else "gives energy" if along > WORKS else "keeps the energy")
    return f"{what} " + (", ".join(said[:-1]) + " and " if len(said) > 1 else "") + said[-1] + "."


def _where(p: Place, actions: Sequence[Acting]) -> str:
    near = [a for a in actions if a.left < NEAR * actions[0].left]
    if near and len(near) < 4:
        return "acts like a " + " or a ".join(f"{a.what} {a.site}" for a in near)
    return f"acts at {p.site}" if p.share > 0.5 else "acts at several places"


def _explained(c: Curve) -> float:
    """Mean square of a binned curve about its mean, less its error, where it is told from the mean.

    The error is no more than what its neighbours make of each bin: that of a mean moment is less than that of moments.
    """
    mean, error, count = (np.array(v, float) for v in (c.mean, c.error, c.count))
    far = mean - np.average(mean, weights=count)
    if len(mean) > 4:
        error = np.minimum(error, np.sqrt(np.mean(np.diff(mean, 2) ** 2) / 6.0))
    return float(np.average(np.where(np.abs(far) > 2.0 * error, far**2 - error**2, 0.0), weights=count))


def _symmetry(c: Curve) -> str:
    """Whether a curve is odd or even; "" if it is neither, or does not reach far to both sides of zero."""
    x, mean = np.array(c.x), np.array(c.mean) - np.mean(c.mean)
    reach = min(x.max(), -x.min())
    if reach < 0.5 * np.abs(x).max():
        return ""
    grid = np.linspace(0.1, 1.0, 10) * reach
    right, left = np.interp(grid, x, mean), np.interp(-grid, x, mean)
    odd, even = float(np.mean((right - left) ** 2)), float(np.mean((right + left) ** 2))
    return "odd" if odd > PURE * even else "even" if even > PURE * odd else ""


def unnamed(forward: Predictor, base: Fit, best: Fit) -> str:
    """What the best explanation does not name, in words; or, where frames do not tell that, what it was to explain.

    They know no memory, and are read as recorded, without what a hypothesis says of the measurement. A moment that no
    law gives is no name.
    """
    if (moment := next((s for s in best.hypothesis.suspects if s.effect == MOMENT.name), None)) is not None:
        return described(lacking(forward, best, moment), [], "What is missing")
    effects = best.hypothesis.effects
    lost = any(get(e).memory or get(e).family == "measurement" for e in effects)
    f, what = (base, "What is missing") if lost else (best, "What is left")
    places, actions = located(forward, f)
    return described(places, actions, what)
