"""The next experiment: of a menu, the one that would best tell the surviving explanations apart."""

import copy
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from origami_sim.diagnose.diagnosis import Experiment
from origami_sim.drive import Drive, Signal
from origami_sim.fit.least_squares import Fit, linearise
from origami_sim.fit.linear import Linearisation
from origami_sim.fit.rollouts import Rollouts
from origami_sim.fit.weights import Weights
from origami_sim.model import Parameters

WANTED = 5.0
"""Separation d' at which two explanations count as told apart."""

TOLD = 1.0
"""Separation in the best experiment of the menu below which a rival is left out: no number of repeats would do."""

LENGTH = 8
"""A proposed experiment is simulated in four stretches of this part of a recording."""

CREASE, PANEL = ("crease", "stiffness"), ("panel_bending", "stiffness")

CLAMPED = 300.0
"""Times as stiff as the stiffest crease that a clamped one is; as stiff as panels where creases have no stiffness."""


def propose(
    forward: Rollouts, judged, weights: Weights, *, progress: Callable[[float], None] | None = None, most: int = 4
) -> list[Experiment]:
    """Experiments, best first: the expected whitened separation of the best explanation from the nearest of its rivals.

    Rivals that nothing in the menu would tell from it do not count, unless none would. Each experiment is simulated
    under both explanations from the same start. What the rival's numbers, known as well as the recordings left them,
    and a new start could still absorb is projected out.
    """
    rivals = rivals_of(judged)
    if not rivals:
        return []
    menu = forward.menu() if forward.curve else _menu(forward)
    apart = np.zeros((len(menu), len(rivals)))
    for n, (_, changed) in enumerate(menu):
        known = None
        for k, rival in enumerate(rivals if recorded(changed, judged.best) else ()):
            try:
                apart[n, k], known = separation(changed, rival, weights, known)
            except (FloatingPointError, np.linalg.LinAlgError):
                apart[n, k] = 0.0
        if progress:
            progress((n + 1) / len(menu))
    apart = np.where(np.isfinite(apart), apart, 0.0)
    told = np.flatnonzero(apart.max(axis=0) >= TOLD)
    told = told if len(told) else np.arange(len(rivals))
    labels = [judged.best.hypothesis.label, *(rivals[k].hypothesis.label for k in told)]
    out = []
    for (what, _), row in zip(menu, apart, strict=True):
        d = float(row[told].min())
        out.append(Experiment(what, labels, d, int(np.clip(np.ceil((WANTED / max(d, 0.05)) ** 2), 1, 9999))))
    return sorted(out, key=lambda e: -e.expected)[:most]


def rivals_of(judged, most: int = 4) -> list[Fit]:
    """The strongest other explanations that were fitted."""
    tied = [f for f in judged.tied if f is not judged.best]
    return tied[:most] if tied else judged.others[:1]


def recorded(forward: Rollouts, f: Fit) -> bool:
    """Puts what a fitted explanation predicts in the place of what was recorded; False where it goes unstable."""
    blocks = range(len(forward.blocks))
    local = np.zeros((1, len(blocks), forward.local))
    truth = [v[0] for v in forward.predict(f.hypothesis, f.theta[None], local, blocks)]
    forward.blocks = [replace(b, values=v) for b, v in zip(forward.blocks, truth, strict=True)]
    return all(np.all(np.isfinite(v)) for v in truth)


def separation(
    forward: Rollouts, rival: Fit, weights: Weights, known: Linearisation | None = None
) -> tuple[float, Linearisation | None]:
    """Expected separation d' of a fitted explanation from what was recorded, and the derivatives under it.

    Args:
        known: derivatives under another explanation, of which those by nominal numbers and starts hold here too.
    """
    blocks = list(range(len(forward.blocks)))
    local = np.zeros((len(blocks), forward.local))
    own = len(rival.free) - len(rival.hypothesis.free)
    line = linearise(forward, rival.hypothesis, rival.free, rival.theta, local, blocks, weights, known=known, kept=own)
    rows = np.concatenate(line.cleared(line.tangent))
    gap = np.concatenate(line.cleared(line.residual))
    scale = np.array([f.scale for f in rival.free])
    # a number on its bound has next to no spread
    value, vector = np.linalg.eigh(rival.covariance / np.outer(scale, scale))
    learnt = vector.T / np.sqrt(np.maximum(value, 1e-12))[:, None]
    stacked = np.concatenate([rows, learnt])
    target = np.concatenate([gap, np.zeros(len(learnt))])
    if not np.all(np.isfinite(stacked)) or not np.all(np.isfinite(target)):
        return 0.0, known
    x, *_ = np.linalg.lstsq(stacked, target, rcond=None)
    return float(np.linalg.norm(target - stacked @ x)), line


def _menu(forward: Rollouts) -> list[tuple[str, Rollouts]]:
    """Variants of the recordings' own experiments that a user could make."""
    out = [("repeat the same experiment", _variant(forward))]
    if forward.start == "fit":
        for size in (0.1, 0.3, 2.0):
            out.append((f"start from {size:g} times the displacement and rate", _variant(forward, size=size)))
        out.append(("let it run three times as long", _variant(forward, stretch=3.0)))
    varying = [n for d in forward.drives for n, s in d.signals.items() if not s.is_zero]
    if varying:
        names = ", ".join(sorted({n.split("_")[0] for n in varying}))
        for gain in (0.3, 0.6, 1.5):
            out.append((f"{names} at {gain:g} times the level", _variant(forward, gain=gain)))
        out.append((f"{names} reversed", _variant(forward, gain=-1.0)))
        for speed in (0.3, 3.0):
            out.append((f"{names} at {speed:g} times the frequency", _variant(forward, speed=speed)))
        out.append((f"a step of {names} to its highest level, held", _variant(forward, held=True)))
    if ("gravity", "gravity_z") in set(forward.parameters):
        out.append(("the set-up tilted by 10 degrees about y", _variant(forward, tilt=np.deg2rad(10.0))))
        if not len(forward.model.contacts):
            out.append(("the set-up upside down", _variant(forward, tilt=np.pi)))
    out.append(("a tenth more mass on every panel", _variant(forward, load=1.1)))
    if len(forward.articulation.creases) > 1 and _splint(forward.parameters):
        for joint, c in enumerate(forward.articulation.creases):
            name = forward.model.name("crease", int(c))
            out.append((f"{name} clamped as it is in the reference state", _variant(forward, clamped=joint)))
    return out


def _splint(parameters: Parameters) -> float:
    """Stiffness of a clamped crease [N m/rad]; 0 where neither creases nor panels have one."""
    known = set(parameters)
    if CREASE not in known:
        return 0.0
    panel = float(np.max(parameters[PANEL])) if PANEL in known else 0.0
    return CLAMPED * float(np.max(parameters[CREASE])) or panel


def _variant(
    forward: Rollouts,
    *,
    size=1.0,
    stretch=1.0,
    gain=1.0,
    speed=1.0,
    held=False,
    tilt=0.0,
    load=1.0,
    clamped: int | None = None,
) -> Rollouts:
    """The same object in another experiment; recordings keep their frames, whose values are replaced by predictions."""
    out = copy.copy(forward)
    arm = forward.articulation
    out.blocks = []
    chosen = forward.blocks[:: max(1, len(forward.blocks) // 4)][:4]
    for b in chosen:
        pose, rates = b.pose, b.rates
        if forward.start == "fit" and size != 1.0 and not arm.floating:
            rest = arm.reference()
            pose = arm.moved(rest, size * (b.pose.angles - rest.angles))
            rates = size * rates
        if clamped is not None:
            here = np.arange(len(pose.angles)) == clamped
            pose = replace(pose, angles=np.where(here[:, None], arm.reference().angles, pose.angles))
            rates = np.where(np.arange(len(rates)) == len(rates) - len(here) + clamped, 0.0, rates)
        times = b.times
        step = times[1] - times[0]
        whole = len(forward.recordings[b.recording].times) // LENGTH if b.reach is not None else 0
        if stretch != 1.0 or whole > len(times):
            times = np.arange(round((max(whole, len(times)) - 1) * stretch) + 1) * step
        values = np.zeros((len(times), b.values.shape[1]))
        out.blocks.append(replace(b, pose=pose, rates=rates, times=times, values=values, reach=None, lasting=0.0))
    if gain != 1.0 or speed != 1.0:
        out.drives = [_changed(d, gain, speed) for d in forward.drives]
    if held:
        spans = [float(r.times[-1] - r.times[0]) for r in forward.recordings]
        out.drives = [_held(d, span) for d, span in zip(forward.drives, spans, strict=True)]
    if tilt or load != 1.0 or clamped is not None:
        build = forward.subject.build

        def other(values):
            model, parameters, drive = build(values)
            parameters = parameters.copy()
            if clamped is not None:
                c = arm.creases[clamped : clamped + 1]
                parameters.set("crease", "stiffness", _splint(parameters), c)
                parameters.set("crease", "rest_angle", arm.reference().angles[clamped], c)
            if load != 1.0:
                parameters.replace("inertia", "mass", parameters["inertia", "mass"] * load)
            if tilt:
                gx, gz = parameters["gravity", "gravity_x"], parameters["gravity", "gravity_z"]
                parameters.set("gravity", "gravity_x", np.cos(tilt) * gx - np.sin(tilt) * gz)
                parameters.set("gravity", "gravity_z", np.sin(tilt) * gx + np.cos(tilt) * gz)
            return model, parameters, drive

        out.subject = replace(forward.subject, build=other)
    out._built = {}
    return out


def _held(drive: Drive, span: float) -> Drive:
    """Every channel at the value of its that is furthest from zero, from the start on."""
    at = np.linspace(0.0, span, 1000)
    changed = {}
    for name, s in drive.signals.items():
        values = np.broadcast_to(np.squeeze(s(at)), at.shape)
        changed[name] = float(values[np.argmax(np.abs(values))])
    return drive.replace(**changed)


def _changed(drive: Drive, gain: float, speed: float) -> Drive:
    changed = {}
    for name, s in drive.signals.items():
        if s.is_zero:
            continue
        times = None if s.times is None else s.times / speed
        changed[name] = Signal(
            offset=gain * np.asarray(s.offset),
            amplitude=gain * np.asarray(s.amplitude),
            frequency=speed * np.asarray(s.frequency),
            phase=s.phase,
            times=times,
            values=s.values,
            scale=gain * np.asarray(s.scale),
        )
        if times is not None and s.values is not None and speed > 1.0:  # a run must not outlast its drive: repeat it
            span = times[-1] - times[0]
            count = int(np.ceil(speed)) + 1
            tiled = np.concatenate([times + k * (span + (times[1] - times[0])) for k in range(count)])
            changed[name] = replace(changed[name], times=tiled, values=np.concatenate([s.values] * count))
    return drive.replace(**changed)
