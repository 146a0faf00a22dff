"""The menu of next experiments: what the set-up can do, each as a predictor of the object in that experiment."""

import copy
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from origami_sim.drive import Drive, Signal
from origami_sim.errors import InputError
from origami_sim.fit.predictor import Block, Predictor
from origami_sim.model import Parameters
from origami_sim.predict.curves import Curves
from origami_sim.predict.rollouts import Rollouts
from origami_sim.recording.possible import UPSIDE_DOWN, Possible

LENGTH = 8
"""A proposed experiment is simulated in four stretches of this part of a recording."""

LONGER = 3.0
"""How many times as long as the longest recording a device that is held can be recorded, if nobody says."""

FRAMES = 4000
"""Frames of a ring-down that are simulated at most; twice as many hardly tell more, it rests by then."""

CREASE, PANEL = ("crease", "stiffness"), ("panel_bending", "stiffness")

CLAMPED = 300.0
"""Times as stiff as the stiffest crease that a clamped one is; as stiff as panels where creases have no stiffness."""


@dataclass(frozen=True, eq=False)
class Trial:
    """An experiment that could be made.

    Attributes:
        what: in words, as a report proposes it. forward: predicts it. amount: frames that it would give, over those
            that are simulated.
    """

    what: str
    forward: Predictor
    amount: float = 1.0


def menu(forward: Predictor, possible: Possible) -> list[Trial]:
    """Experiments like those recorded that the set-up can make.

    Raises:
        InputError: a crease that is said to be clamped and that the device does not have.
    """
    if isinstance(forward, Curves):
        return [Trial(what, other) for what, other in forward.menu(possible.levels)]
    assert isinstance(forward, Rollouts)
    return _menu(forward, possible)


def _menu(forward: Rollouts, possible: Possible) -> list[Trial]:
    out: list[Trial] = []

    def add(what: str, **changes) -> None:
        other = _variant(forward, **changes)
        frames = float(np.mean([len(r.times) for r in forward.recordings])) * changes.get("stretch", 1.0)
        shown = sum(len(b.times) for b in other.blocks)
        out.append(Trial(what, other, 1.0 if "ring_down" in changes else max(frames / shown, 1.0)))

    falls = forward.articulation.floating and not len(forward.model.contacts)
    longest = max(float(r.times[-1] - r.times[0]) for r in forward.recordings)
    longer = possible.longest / longest if possible.longest is not None else 1.0 if falls else LONGER
    add("repeat the same experiment")
    if forward.start == "fit" and not forward.articulation.floating:
        for size in possible.starts:
            add(f"start from {size:g} times the displacement and rate", size=size)
        if possible.ring_down:
            add(
                f"let go at rest from {possible.ring_down:g} times the displacement, drives off, until it rests",
                ring_down=possible.ring_down,
                stretch=min(longer, LONGER),
            )
    if longer > 1.05 and forward.start == "fit":
        add(f"let it run {longer:.2g} times as long", stretch=longer)
    varying = [n for d in forward.drives for n in d.levels if not d[n].is_zero]
    if varying:
        names = ", ".join(sorted({n.split("_")[0] for n in varying}))
        for gain in possible.levels:
            turned = "reversed" if gain == -1.0 else f"at {gain:g} times the level"
            add(f"{names} {turned}", gain=gain)
        for speed in possible.frequencies:
            add(f"{names} at {speed:g} times the frequency", speed=speed)
        if possible.steps:
            add(f"a step of {names} to its highest level, held", held=True)
    if ("gravity", "gravity_z") in set(forward.parameters) and not falls:
        small = min(possible.tilt, Possible.tilt)
        if small > 0.0:
            add(f"the set-up tilted by {np.rad2deg(small):.3g} degrees about y", tilt=small)
        if possible.tilt >= UPSIDE_DOWN - 1e-9 and not len(forward.model.contacts):
            add("the set-up upside down", tilt=np.pi)
    if possible.weights:
        add("a tenth more mass on every panel", load=1.1)
    for joint in _clamps(forward, possible):
        name = forward.model.name("crease", int(forward.articulation.creases[joint]))
        add(f"{name} clamped as it is in the reference state", clamped=joint)
    return out


def _clamps(forward: Rollouts, possible: Possible) -> list[int]:
    """Joints that can be clamped; one alone has nothing left to tell."""
    names = [forward.model.name("crease", int(c)) for c in forward.articulation.creases]
    unknown = sorted(set(possible.clamps or ()) - set(names))
    if unknown:
        raise InputError("no such crease", field="possible.clamps", value=unknown[0], allowed=", ".join(names))
    if len(names) < 2 or not _splint(forward.parameters):
        return []
    return [n for n, name in enumerate(names) if possible.clamps is None or name in possible.clamps]


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
    ring_down: float | None = None,
) -> Rollouts:
    """The same object in another experiment; recordings keep their frames, whose values are those to be predicted."""
    out = copy.copy(forward)
    arm = forward.articulation
    rest = arm.reference()
    chosen: Sequence[Block] = forward.blocks[:: max(1, len(forward.blocks) // 4)][:4]
    if ring_down is not None:
        far = max(chosen, key=lambda b: float(np.abs(b.pose.angles - rest.angles).sum()))
        chosen, size = [replace(far, rates=0.0 * far.rates)], ring_down
    out.blocks = []
    for b in chosen:
        pose, rates = b.pose, b.rates
        if forward.start == "fit" and size != 1.0 and not arm.floating:
            pose = arm.moved(rest, size * (b.pose.angles - rest.angles))
            rates = size * rates
        if clamped is not None:
            here = np.arange(len(pose.angles)) == clamped
            pose = replace(pose, angles=np.where(here[:, None], rest.angles, pose.angles))
            rates = np.where(np.arange(len(rates)) == len(rates) - len(here) + clamped, 0.0, rates)
        times = b.times
        step = times[1] - times[0]
        whole = len(forward.recordings[b.recording].times)
        whole = whole if ring_down is not None else whole // LENGTH if b.reach is not None else 0
        if stretch != 1.0 or whole > len(times):
            frames = round((max(whole, len(times)) - 1) * stretch) + 1
            times = np.arange(frames if ring_down is None else min(frames, max(FRAMES, len(times)))) * step
        values = np.zeros((len(times), b.values.shape[1]))
        out.blocks.append(replace(b, pose=pose, rates=rates, times=times, values=values, reach=None, lasting=0.0))
    if ring_down is not None:
        out.drives = [d.replace(**dict.fromkeys(d.levels, 0.0)) for d in forward.drives]
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
    for name in drive.levels:
        values = np.broadcast_to(np.squeeze(drive[name](at)), at.shape)
        changed[name] = float(values[np.argmax(np.abs(values))])
    return drive.replace(**changed)


def _changed(drive: Drive, gain: float, speed: float) -> Drive:
    changed = {}
    for name, s in drive.signals.items():
        if s.is_zero:
            continue
        times, factor = None if s.times is None else s.times / speed, gain if name in drive.levels else 1.0
        changed[name] = Signal(
            offset=factor * np.asarray(s.offset),
            amplitude=factor * np.asarray(s.amplitude),
            frequency=speed * np.asarray(s.frequency),
            phase=s.phase,
            times=times,
            values=s.values,
            scale=factor * np.asarray(s.scale),
        )
        if times is not None and s.values is not None and speed > 1.0:  # a run must not outlast its drive: repeat it
            span = times[-1] - times[0]
            count = int(np.ceil(speed)) + 1
            tiled = np.concatenate([times + k * (span + (times[1] - times[0])) for k in range(count)])
            changed[name] = replace(changed[name], times=tiled, values=np.concatenate([s.values] * count))
    return drive.replace(**changed)
