"""Partial residuals: what a found model lacks without one of its effects, and what that effect gives.

Both are moments along the recorded motion, averaged over the same bins (a component-plus-residual plot; Ezekiel 1924,
Larsen & McCleary 1972). So each law can be seen through the data, whatever it acts on and whatever else was found. Of
errors of a recorder both are readings.

What the whole model lacks is the difference between what the recorded motion needs and what the predicted one does,
read and smoothed alike: what smoothing takes from accelerations would else look like a law.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from origami_sim.drive import Drive
from origami_sim.effects import get
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.hypotheses.hypothesis import Suspect
from origami_sim.locate.locate import Motion, binned, bins, dynamics, frozen, locate, loose, motion
from origami_sim.locate.locate_curves import places
from origami_sim.locate.places import Curve, Partial, Place, clock
from origami_sim.model import Model, Parameters, State
from origami_sim.model.distort import distorted
from origami_sim.observation.channels import units_of
from origami_sim.predict.rollouts import Rollouts
from origami_sim.predict.track import track
from origami_sim.solve.batch import Batch
from origami_sim.solve.statics.settling import levels, per_world

FRAMES = 4000
"""Frames of a recording along which laws with a memory are followed, at most, evenly spread: 0.3 s.

Half and double take half and twice that; nothing is named by what is drawn."""


WIDER = 2.0
"""Frames of the smoother for what the whole model lacks, over those that leave no more than noise of the motion.

Of two flaps that swing (2 mrad, 150 Hz) bars are a sixth of those with as many frames (half), and 2.4 times those with
three times as many. It decides on what is drawn alone: a law is drawn along the motion as it is read elsewhere.
"""


def partials(forward: Predictor, shown: Sequence[tuple[Suspect, Fit]]) -> list[Partial]:
    """Of each effect of a fit its partial residual, at the coordinate and against the quantity that show it best.

    What does not show in the motion has none.
    """
    out, fits = [], {id(f): f for _, f in shown}
    for f in fits.values():
        misread = [s for s, by in shown if by is f and s.kind == "measurement"]
        out += _misread(forward, f, misread) if misread else []
        mine = [s for s, by in shown if by is f and s.kind != "measurement"]
        if not mine:
            continue
        whole, *without = _places(forward, f, [f.theta, *(_without(f, s) for s in mine)])
        for suspect, found in zip(mine, without, strict=True):
            pairs = [(a.site, _laws(a, b)) for a in found for b in whole if a.site == b.site]
            site, laws = max(pairs, key=lambda pair: max(map(_seen, pair[1]), default=0.0), default=("", []))
            curve, law = max(laws, key=_ordered, default=(None, np.zeros(0)))
            if curve is not None and np.any(law):
                out.append(Partial(suspect.label, site, curve, law.tolist()))
    return out


def lacking(forward: Predictor, f: Fit, suspect: Suspect) -> list[Place]:
    """Places of what a fit's model lacks without one of its effects."""
    return _places(forward, f, [f.theta, _without(f, suspect)])[1]


def _misread(forward: Predictor, f: Fit, suspects: Sequence[Suspect]) -> list[Partial]:
    """Of errors of a recorder what readings differ by from those predicted without each, and what that gives."""
    thetas = [f.theta, *(_without(f, s) for s in suspects)]
    shot = forward.shoot(f.hypothesis, thetas, np.repeat(f.local[None], len(thetas), axis=0), f.blocks)
    whole, *without = (np.concatenate(each) for each in zip(*shot.values, strict=True))
    blocks, units = [forward.blocks[b] for b in f.blocks], units_of(forward.recordings[0])
    read, noise = np.concatenate([b.values for b in blocks]), blocks[0].noise
    times = np.concatenate([forward.recordings[b.recording].times[b.first] + b.times for b in blocks])
    by_step = forward.recordings[0].by_step  # then all are
    out = []
    for suspect, less in zip(suspects, without, strict=True):
        gives = whole - less
        d = int(np.argmax(np.nansum(np.square(gives / noise), axis=0)))
        against = [("reading", units[d], read[:, d]), (*clock(by_step), times)]
        if not by_step:
            rate = np.concatenate([np.gradient(b.values[:, d], b.times) for b in blocks])
            against.append(("rate", f"{units[d]}/s", rate))
        laws = []
        for name, unit, x in against:
            parts = bins(np.where(np.isnan(read[:, d]), np.nan, x))
            left = read[:, d] - less[:, d]
            curve = binned(name, unit, x, left, parts, [left[p].std() / np.sqrt(len(p)) for p in parts])
            laws.append((curve, np.array([gives[p, d].mean() for p in parts])))
        curve, law = max(laws, key=_ordered)
        if np.any(law):
            out.append(Partial(suspect.label, forward.components[d], curve, law.tolist(), units[d]))
    return out


def _without(f: Fit, suspect: Suspect) -> np.ndarray:
    """Numbers of a fit (P,) with the strengths of one of its effects at none, and all others as they are."""
    none = {id(n): n.start for n in suspect.strengths}
    return np.array([none.get(id(n), value) for n, value in zip(f.free, f.theta, strict=True)])


def _laws(without: Place, whole: Place) -> list[tuple[Curve, np.ndarray]]:
    """Curves of what is missing without an effect, and what the effect gives in their bins."""
    found = {c.against: c for c in whole.curves}
    both = [(c, found[c.against]) for c in without.curves if c.against in found and c.x == found[c.against].x]
    return [(a, np.array(a.mean) - np.array(b.mean)) for a, b in both if len(a.x) > 2]


def _seen(one: tuple[Curve, np.ndarray]) -> float:
    """Mean square of what an effect gives in the bins of a curve, over the error there."""
    curve, law = one
    return float(np.mean(law**2) / max(float(np.mean(np.square(curve.error))), 1e-300))


def _ordered(one: tuple[Curve, np.ndarray]) -> float:
    """How much of what an effect gives goes with the quantity of a curve: its variance between bins."""
    curve, law = one
    return float(np.cov(law, aweights=curve.count, ddof=0))


def _places(forward: Predictor, f: Fit, thetas: Sequence[np.ndarray]) -> list[list[Place]]:
    """Places of what a fit's hypothesis lacks with each of some numbers."""
    if forward.curve:
        steps = forward.recordings[0].by_step
        return [places(forward.balance(f.hypothesis, theta), by_step=steps) for theta in thetas]  # type: ignore[attr-defined]
    assert isinstance(forward, Rollouts)
    each: list[list[Motion]] = [[] for _ in thetas]
    for r in range(len(forward.recordings)):
        m = motion(forward, f, r)
        if m is None:
            continue
        m, residual = _with_residual(forward, f, r, m)
        whole, *without = _lacking(forward, f, thetas, r, m)
        for found, one in zip(each, (whole, *without), strict=True):
            found.append(replace(one, missing=one.missing - whole.missing + residual))
    return [locate(forward, found) for found in each]


def _with_residual(forward: Rollouts, f: Fit, index: int, m: Motion) -> tuple[Motion, np.ndarray]:
    """What a fit lacks [m, n] along the motion of a recording, and the frames of that in which it is known."""
    mine = [b for b in f.blocks if forward.blocks[b].recording == index]
    shot = forward.shoot(f.hypothesis, f.theta[None], f.local[None], mine)
    values, recording = np.concatenate([v[0] for v in shot.values]), forward.recordings[index]
    path = track(forward, recording, values) if len(values) == len(recording.times) else None
    wide = motion(forward, f, index, half=round(WIDER * m.half)) or m
    own = motion(forward, f, index, path=path, half=wide.half, frames=wide.times) if path is not None else None
    residual = _lacking(forward, f, [f.theta], index, wide)[0].missing
    if own is not None:
        residual = residual - _lacking(forward, f, [f.theta], index, own)[0].missing
    return m.part(np.isin(m.times, wide.times)), residual


def _lacking(forward: Rollouts, f: Fit, thetas: Sequence[np.ndarray], index: int, m: Motion) -> list[Motion]:
    """The motion of a recording, with what is missing in it with each of some numbers of a fit's hypothesis."""
    every = [loose(*forward.world(f.hypothesis, theta, f.hypothesis.effects)) for theta in thetas]
    if any(get(e).memory for e in f.hypothesis.effects):
        m = m.thinned(max(1, len(m.times) // FRAMES))
    times = m.times - forward.recordings[index].times[0]
    drives = [distorted(model, parameters, forward.drives[index], float(times[-1])) for model, parameters in every]
    out, model = [], every[0][0]
    remembers = any(get(e).memory for e in model.effects)
    more = _remembered(forward, model, [p for _, p in every], drives, times, m) if remembers else np.zeros(len(every))
    for (model, parameters), drive, beside in zip(every, drives, more, strict=True):
        inertia, free, _ = dynamics(forward, model, parameters, frozen(drive, times), m.pose, m.rate)
        missing = np.einsum("mkw,kw->mw", inertia, m.acceleration) - (free + beside)
        missing[~m.told] = 0.0
        out.append(replace(m, missing=missing))
    return out


def _remembered(
    forward: Rollouts,
    model: Model,
    each: Sequence[Parameters],
    drives: Sequence[Drive],
    times: np.ndarray,
    m: Motion,
) -> np.ndarray:
    """What laws with a memory of the way add [K, m, n] to the forces that they give without one, in K worlds."""
    arm = forward.articulation
    x = arm.positions(m.pose)
    jacobian = arm.jacobian(m.pose, x)
    velocity = np.einsum("mnwa,mw->nwa", jacobian, m.rate)
    still, worlds = replace(model, free=np.zeros_like(model.free)), 2 * len(each)  # of each one that forgets at once

    def level(time: float) -> np.ndarray:
        return np.repeat(np.concatenate([levels(d, time, 1) for d in drives], axis=1), 2, axis=1)

    state = State.at_rest(model, worlds, position=np.repeat(x[:, :1], worlds, axis=1))
    held = per_world(drives[0], level(0.0))
    batch = Batch(still, Parameters.join(each, repeat=2), held, state, threads=1, supports=model)
    none, steady = batch.remembered()[:, 1::2], all(d.constant for d in drives)
    out = np.zeros((len(each), arm.size, len(times)))
    for k, t in enumerate(times.tolist()):
        if k:
            batch.lead(np.repeat(x[:, k : k + 1], worlds, axis=1), float(times[k] - times[k - 1]))
            memory = batch.remembered()
            memory[:, 1::2] = none
            batch._overwrite(batch._memory, memory)
        if not steady:
            batch.hold(level(t))
        batch._overwrite(batch._v, np.repeat(velocity[:, k : k + 1], worlds, axis=1))
        force = batch.total_force(t)
        out[:, :, k] = np.einsum("mna,nka->km", jacobian[:, :, k], force[:, ::2] - force[:, 1::2])
    return out
