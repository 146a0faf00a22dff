"""A law that the catalogue lacks: a smooth moment of a crease, the same function of its angle and rate throughout.

What a named set leaves may be real and yet look like the noise of a recorder that averages. Noise is no function of the
motion: where a polynomial in angle and rate explains more than its many coefficients cost, a law acts at that crease.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.polynomial.chebyshev import chebval2d
from scipy.signal import savgol_filter

from origami_sim.effects.crease_polynomial import ANGLE, EFFECT, RATE, TERMS
from origami_sim.fit.evidence import Group
from origami_sim.fit.hyper import HYPER, Hyper
from origami_sim.fit.implied import OwnColumns
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.linear import Linearisation
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.hypothesis import Free, Suspect, scaled
from origami_sim.hypotheses.suspects import suspects, told_apart
from origami_sim.infer.columns import Columns
from origami_sim.infer.foresight import Foresight
from origami_sim.infer.screen import Signature, screen
from origami_sim.predict.track import followed

UNLISTED = EFFECT.name

WINDOW = 7
"""Frames over which a recorded angle is smoothed, to see how fast it goes: rates beyond the range have the moment of
the fastest in it. Of a friction that falls with speed, 5 and 15 add 3 and 11 to a log evidence that leads by 234."""

HELD = 1e-3
"""Deviation of the range, as a part of it, in a fit: no unknown. Half and double change no log evidence by 0.01."""

WIDE = 3.0
"""Deviation of the coefficients, over one that changes as much as is missed: what angle and rate do not tell apart,
such as their squares in a swing that keeps its energy, stays small. Half and double change no log evidence by 0.1, and
the moment by 2 %."""


def anywhere(forward: Predictor) -> list[Suspect]:
    """Each coefficient of a polynomial moment alone, at each crease that the channels tell apart."""
    every = suspects(forward.model, forward.recordings, forward.drive, forward.parameters)
    every = [s for s in told_apart(every, len(forward.components)) if s.kind == "crease" and not s.stretch]
    each = {s.site: s.entities or tuple(range(len(forward.model.creases))) for s in every if s.entities or s.sites == 1}
    out, moved = [], motion(forward)
    for site, entities in each.items():
        mine = np.isin(forward.articulation.creases, entities)
        if not np.any(mine) or moved is None:
            continue
        angles, rates = (values[mine] for values in moved)
        low, high = float(angles.min()), float(angles.max())
        usual, fastest = np.quantile(np.abs(rates), [0.5, 0.998])
        span = {"middle": 0.5 * (low + high), "reach": 0.5 * (high - low), "usual": usual, "fastest": fastest}
        fixed = [_free(name, np.clip(value, *EFFECT.parameter(name).bounds), entities) for name, value in span.items()]
        for name, _, by_rate in TERMS:
            if not (by_rate and forward.curve):
                free = (Free(UNLISTED, name, "N m", 0.0, 1e-6, entities=entities), *fixed)
                out.append(Suspect(UNLISTED, site, "crease", free, entities, len(each)))
    return out


def motion(forward: Predictor) -> tuple[np.ndarray, np.ndarray] | None:
    """Recorded angles of creases and their rates, [J, n] each, all recordings one after the other; None if not told.

    Where the motion is prescribed, moments were recorded and no angles.
    """
    if forward.prescribed:
        return None
    every = [followed(forward, r) for r in range(len(forward.recordings))]
    tracks = [t for t in every if t is not None and len(t.times) > WINDOW]
    folds = len(forward.articulation.creases)
    if not tracks or not folds:
        return None
    angles = [t.q[len(t.q) - folds :] for t in tracks]
    steps = [float(np.median(np.diff(t.times))) for t in tracks]
    rates = [savgol_filter(q, WINDOW, 2, deriv=1, delta=h, axis=1) for q, h in zip(angles, steps, strict=True)]
    return np.concatenate(angles, axis=1), np.concatenate(rates, axis=1)


def _free(name: str, value: float, entities: tuple[int, ...]) -> Free:
    scale = abs(value) or 1.0
    unit = EFFECT.parameter(name).unit
    return Free(UNLISTED, name, unit, float(value), scale, spread=HELD * scale, entities=entities)


def beside(
    forward: Predictor, f: Fit, coefficients: Sequence[Suspect], hyper: Hyper = HYPER
) -> list[tuple[Suspect, np.ndarray, float]]:
    """The polynomial moment of each crease beside a fit: its numbers, and the log evidence that it gains.

    Each is judged in the noise that it would leave itself; all is linear about the fit.
    """
    assert f.weights is not None
    # in coloured noise that a fit leaves for lack of a moment, that moment would not show
    f = f.reweighted(Weights(f.weights.deviation, gap=f.weights.gap))
    assert f.weights is not None and f.linear is not None
    # a constant moment tells at which size the others of its crease change about as much as is missed
    first = {s.site: s for s in coefficients[::-1]}
    size = {s.suspect.site: s.size for s in screen(forward, list(first.values()), f, f.weights)}
    coefficients = [scaled(s, size[s.site]) for s in coefficients]
    found = [s for s in screen(forward, coefficients, f, f.weights, sized=True) if s.parts and not s.status]
    sites: dict[str, list[Signature]] = {}
    for s in found:
        sites.setdefault(s.suspect.site, []).append(s)
    if not sites:
        return []
    own = OwnColumns(f)
    before, count = len(own.groups), len(own.columns)
    each = [s for mine in sites.values() for s in mine]
    groups = list(own.groups)
    for mine in sites.values():
        k = len(mine)
        groups.append(Group(tuple(range(count, count + k)), k, np.zeros(k), 0, np.full(k, np.inf)))
        count += k
    ahead = Foresight.of(forward, f, own, Columns(f.linear, f.weights, own.columns, each, f.weights), hyper)
    sets = [(*range(before), before + n) for n in range(len(sites))]
    gains = ahead.gains([[groups[g] for g in s] for s in sets], hyper)
    out = []
    for of, gain, mine in zip(sets, gains, sites.values(), strict=True):
        columns = [c for g in of for c in groups[g].columns]
        suspect, sizes = _joint(mine, f.linear), np.concatenate([m.size for m in mine])
        known = [0.0] * len(own.columns) + [s.size[0] / n.spread for s, n in zip(mine, suspect.free, strict=False)]
        gram = ahead.white.gram
        values = np.linalg.lstsq(
            gram[np.ix_(columns, columns)] + np.diag(np.square(known)), gram[columns, -1], rcond=None
        )[0]
        shapes = [n.start for n in suspect.free[len(mine) :]]
        out.append((suspect, np.array([*values[-len(mine) :] * sizes, *shapes]), float(gain)))
    return out


def crease_of_the_rest(forward: Predictor, f: Fit, hyper: Hyper = HYPER) -> str:
    """The crease at which such a moment explains most of what a fit leaves; "" where it explains nothing anywhere."""
    if any(s.effect == UNLISTED for s in f.hypothesis.suspects):
        return ""
    low = {name for name, *orders in TERMS if max(orders) <= ANGLE // 3}  # these tell the crease
    some = [s for s in anywhere(forward) if s.free[0].name in low]
    found = max(beside(forward, f, some, hyper), key=lambda one: one[2], default=None)
    return found[0].site if found is not None and found[2] > 0.0 else ""


def _joint(mine: Sequence[Signature], line: Linearisation) -> Suspect:
    """One suspect with all of its coefficients: of a moment that changes readings about as much as is missed.

    Args:
        line: of the fit that they are beside.
    """

    def read(parts: Sequence[np.ndarray]) -> float:
        """Norm of what concerns readings: where segments are tied, far less shows."""
        return float(np.linalg.norm(np.concatenate([p[: r.data] for p, r in zip(parts, line.rows, strict=True)])))

    unit = read(line.residual) * float(np.median([abs(s.size) / max(read(s.parts), 1e-300) for s in mine]))
    strengths = [replace(s.suspect.free[0], scale=abs(float(s.size[0])), spread=WIDE * unit) for s in mine]
    first = mine[0].suspect
    return replace(first, free=(*strengths, *first.free[1:]))


def usual_moment(forward: Predictor, f: Fit) -> float:
    """Root mean square of a fit's polynomial moment over the recorded motion [N m]."""
    (suspect,) = (s for s in f.hypothesis.suspects if s.effect == UNLISTED)
    value = dict(zip((id(n) for n in f.free), f.theta, strict=True))
    of = {n.name: float(value[id(n)]) for n in suspect.free}
    moved = motion(forward)
    assert moved is not None and suspect.entities is not None
    angle, rate = (v[np.isin(forward.articulation.creases, suspect.entities)] for v in moved)
    x = np.clip((angle - of["middle"]) / of["reach"], -1.0, 1.0)
    y = np.clip(np.arcsinh(rate / of["usual"]) / np.arcsinh(of["fastest"] / of["usual"]), -1.0, 1.0)
    table = np.zeros((ANGLE + 1, RATE + 1))
    for name, i, j in TERMS:
        table[i, j] = of.get(name, 0.0)
    return float(np.sqrt(np.mean(np.square(chebval2d(x, y, table)))))
