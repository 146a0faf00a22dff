"""A law that the catalogue lacks: a smooth moment of a crease, the same function of its angle and rate throughout.

What a named set leaves may be real and yet look like the noise of a recorder that averages. Noise is no function of the
motion: where a polynomial in angle and rate explains more than its many coefficients cost, a law acts at that crease.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import savgol_filter

from origami_sim.effects.crease_polynomial import EFFECT, TERMS
from origami_sim.fit.evidence import Group, Sets
from origami_sim.fit.hyper import HYPER, Hyper
from origami_sim.fit.hypothesis import Free, Suspect, scaled, suspects, told_apart
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.infer.foresight import Foresight
from origami_sim.infer.implied import OwnColumns
from origami_sim.infer.screen import Signature, screen
from origami_sim.predict.track import track

UNLISTED = EFFECT.name

WINDOW = 7
"""Frames over which a recorded angle is smoothed, to see how fast it goes: rates beyond the range have the moment of
the fastest in it, so that nothing depends on where exactly it ends."""

HELD = 1e-3
"""Deviation of the range, as a part of it, in a fit: it is no unknown."""


def anywhere(forward: Predictor) -> list[Suspect]:
    """Each coefficient of a polynomial moment alone, at each crease that the channels tell apart."""
    arm = forward.articulation
    if not len(arm.creases):
        return []
    tracks = [t for r in forward.recordings if (t := track(forward, r)) is not None]
    every = suspects(forward.model, forward.recordings, forward.drive, forward.parameters)
    every = [s for s in told_apart(every, len(forward.components)) if s.kind == "crease" and not s.stretch]
    each = {s.site: s.entities or tuple(range(len(forward.model.creases))) for s in every if s.entities or s.sites == 1}
    out = []
    for site, entities in each.items():
        mine = [len(arm.creases) - k - 1 for k, c in enumerate(arm.creases[::-1]) if c in entities]
        if not mine or not tracks:
            continue
        folds = [t.q[len(t.q) - len(arm.creases) :][mine] for t in tracks]
        low, high = min(float(q.min()) for q in folds), max(float(q.max()) for q in folds)
        fast = [_fastest(q, float(np.median(np.diff(t.times)))) for q, t in zip(folds, tracks, strict=True)]
        span = {"middle": 0.5 * (low + high), "reach": 0.5 * (high - low), "fastest": max(fast)}
        fixed = [_free(name, np.clip(value, *EFFECT.parameter(name).bounds), entities) for name, value in span.items()]
        for name, _, by_rate in TERMS:
            if not (by_rate and forward.curve):
                free = (Free(UNLISTED, name, "N m", 0.0, 1e-6, entities=entities), *fixed)
                out.append(Suspect(UNLISTED, site, "crease", free, entities, len(each)))
    return out


def _fastest(q: np.ndarray, step: float) -> float:
    """Largest rate of a recorded angle [.., n], but for what noise adds to a few."""
    if q.shape[-1] <= WINDOW:
        return 0.0
    return float(np.quantile(np.abs(savgol_filter(q, WINDOW, 2, deriv=1, delta=step, axis=-1)), 0.998))


def _free(name: str, value: float, entities: tuple[int, ...]) -> Free:
    unit = EFFECT.parameter(name).unit
    return Free(
        UNLISTED, name, unit, float(value), abs(value) or 1.0, spread=HELD * (abs(value) or 1.0), entities=entities
    )


def beside(
    forward: Predictor, f: Fit, coefficients: Sequence[Suspect], hyper: Hyper = HYPER
) -> list[tuple[Suspect, np.ndarray, float]]:
    """The polynomial moment of each crease beside a fit: its numbers, and the log evidence that it gains.

    Each is judged in the noise that it would leave itself; all is linear about the fit.
    """
    assert f.weights is not None and f.linear is not None
    # a constant moment tells at which size the others of its crease change about as much as is missed
    first = {s.site: s for s in coefficients[::-1]}
    size = {s.suspect.site: abs(s.size) for s in screen(forward, list(first.values()), f, f.weights)}
    coefficients = [scaled(s, size[s.site]) for s in coefficients]
    found = [s for s in screen(forward, coefficients, f, f.weights) if s.parts and not s.status]
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
    effects = [
        np.concatenate([t[:, own.columns], *(s.parts[b][:, None] for s in each)], axis=1)
        for b, t in enumerate(f.linear.tangent)
    ]
    ahead = Foresight.of(forward, f, own, effects, hyper)
    sets = [(*range(before), before + n) for n in range(len(sites))]
    gains = ahead.gains([[groups[g] for g in s] for s in sets], hyper)
    out = []
    for s, gain, mine in zip(sets, gains, sites.values(), strict=True):
        _, values = ahead.white.of(Sets.of([s], groups, before, count), hyper)
        suspect, sizes = _joint(mine), np.array([m.size for m in mine])
        shapes = [n.start for n in suspect.free[len(mine) :]]
        out.append((suspect, np.array([*values[0, -len(mine) :] * sizes, *shapes]), float(gain)))
    return out


def _joint(mine: Sequence[Signature]) -> Suspect:
    """One suspect with all of its coefficients."""
    strengths = [replace(s.suspect.free[0], scale=abs(s.size)) for s in mine]
    first = mine[0].suspect
    return replace(first, free=(*strengths, *first.free[1:]))


def largest(f: Fit) -> float:
    """The largest moment of a fit's polynomial on the ellipse of its angles and rates [N m]."""
    value = {n.name: v for n, v in zip(f.free, f.theta, strict=True) if n.owner == UNLISTED}
    grid = np.linspace(-1.0, 1.0, 41)
    waves = np.cos(np.arange(6)[:, None] * np.arccos(grid))
    table = np.sum([value.get(name, 0.0) * np.outer(waves[i], waves[j]) for name, i, j in TERMS], axis=0)
    return float(np.max(np.abs(table[np.hypot(*np.meshgrid(grid, grid)) <= 1.0])))
