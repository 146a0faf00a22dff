"""Impulses of contacts: the momentum that a recorded motion takes up in a blow, beside what the model's motion does.

Between blows a device that nothing holds moves under forces that are known better than those of a contact. Lines
through a few frames before and after a blow, bent as these forces bend them, give the rates on both sides; inertia
times their difference is the impulse, whatever the law of the contact. Recorded and predicted motions go the same way.
"""

import numpy as np

from origami_sim.effects import CONTACTS, get
from origami_sim.fit.least_squares import Fit
from origami_sim.locate.locate import dynamics, loose, touching
from origami_sim.locate.places import Impulse
from origami_sim.model.distort import distorted
from origami_sim.predict.rollouts import Rollouts
from origami_sim.predict.track import Track, track

FEWEST, MOST = 3, 8
"""Frames before and after a blow that give a rate."""


def impulses(forward: Rollouts, fit: Fit) -> list[Impulse]:
    """Blows that are seen before and after, in order; none if the device is held or its pose is not told."""
    arm = forward.articulation
    if forward.curve or not arm.floating or not len(forward.model.contacts):
        return []
    out = []
    for n, b in enumerate(fit.blocks):
        block, recording = forward.blocks[b], forward.recordings[forward.blocks[b].recording]
        predicted = block.values - fit.residuals[n]
        both = [track(forward, recording, v) for v in (block.values, predicted)]
        if any(t is None or not np.all(t.told) for t in both):
            continue
        out += _blows(forward, fit, block, recording, [t for t in both if t is not None])
    return out


def _blows(forward: Rollouts, fit: Fit, block, recording, tracks: list[Track]) -> list[Impulse]:
    model, parameters = loose(*forward.world(fit.hypothesis, fit.theta, fit.hypothesis.effects))
    free = model.with_effects(without=tuple(e for e in model.laws if get(e).family in CONTACTS))
    given = parameters.for_model(free)
    step, count = float(np.median(np.diff(block.times))), len(block.times)
    start = float(recording.times[block.first] - recording.times[0])
    drive = distorted(model, parameters, forward.drives[block.recording], start + float(block.times[-1]))
    held = drive.held(start + float(block.times[count // 2]))
    along = forward.articulation.motions[: forward.articulation.shifts, :3]
    found = []
    for t in tracks:
        rate = np.gradient(t.q, step, axis=1)
        gaps = dynamics(forward, model, parameters, held, t.pose, 0.0 * rate)[2]
        found.append((*dynamics(forward, free, given, held, t.pose, rate)[:2], gaps))
    noise = tracks[0].noise
    near = np.any([touching(gaps, noise[: len(along)].max()) for *_, gaps in found], axis=0)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], near.astype(int), [0]])))
    runs = list(zip(edges[::2], edges[1::2], strict=True))  # from, to (beyond) of frames in contact
    ends = [(0, 0), *runs, (count, count)]
    out = []
    for (_, before), (first, last), (after, _) in zip(ends, runs, ends[2:], strict=False):
        left, right = np.arange(max(before, first - MOST), first), np.arange(last, min(after, last + MOST))
        if min(len(left), len(right)) < FEWEST:
            continue
        when, middle = 0.5 * step * (first + last - 1), (first + last - 1) // 2
        moved, error = [], np.zeros(3)
        for t, (inertia, force, _) in zip(tracks, found, strict=True):
            rates = []
            for side in (left, right):
                bend = np.linalg.solve(inertia[:, :, side].mean(axis=2), force[:, side].mean(axis=1))
                late = step * side - when
                line = np.polyfit(late, (t.q[:, side] - 0.5 * bend[:, None] * late**2).T, 1)[0]
                rates.append(line)
            moved.append(along.T @ (inertia[:, :, middle] @ (rates[1] - rates[0]))[: len(along)])
        for side in (left, right):
            spread = noise / (step * np.sqrt(np.sum((side - side.mean()) ** 2)))
            error += along.T**2 @ (found[0][0][: len(along), :, middle] ** 2 @ spread**2)
        error = np.sqrt(error)
        lowest = int(np.argmin(found[0][2][:, first:last].min(axis=1)))
        node = int(model.contacts[lowest][np.argmax(model.contact_weights[lowest])])
        seen = error > 0  # not across the plane to which a device is held
        apart = float(np.linalg.norm((moved[0] - moved[1])[seen] / error[seen]))
        time = float(recording.times[block.first] + when)
        site = model.name("node", node)
        out.append(Impulse(recording.name, time, site, moved[0].tolist(), moved[1].tolist(), error.tolist(), apart))
    return out
