"""Whether inertia could show in recordings: accelerations that they show, over the stiffness of the model."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import eigh

from origami_sim.diagnose.prepare import FRAMES
from origami_sim.drive import Drive
from origami_sim.errors import InputError
from origami_sim.hypotheses.hypothesis import Subject
from origami_sim.hypotheses.weight import weighed
from origami_sim.model import Model, Parameters, State, node_mass
from origami_sim.model.articulation import Articulation
from origami_sim.observation.channels import stacked
from origami_sim.observation.thinning import thinned
from origami_sim.predict.drives import drive_of
from origami_sim.recording import Recording
from origami_sim.solve.batch import Batch
from origami_sim.solve.statics.equilibria import equilibrium

INSTANTS = 5
"""Instants of a recording at which the model's lowest frequency is asked: its start, its end, and a few between."""

APART = 3.0
"""Half a swing, in radians: second differences over as much show swings, and a quarter of the noise."""

FEWEST = 8
"""Frames so far apart that a recording has at least if inertia is not to show."""

STEP = 1e-4
"""Change of a fold for differences of moments [rad]."""


def inertia(subject: Subject, recordings: Sequence[Recording]) -> float:
    """Root mean square change by inertia of what is measured, over the noise; infinite if that cannot be told.

    A force of inertia moves an equilibrium by acceleration over the square of the lowest angular frequency. The
    accelerations are those that the recordings show, so that a free swing counts as well as a fast drive; noise has
    its share in them, which is taken off. What means over frames hide of a recording counts in full.
    """
    try:
        made = subject.with_rigid_panels().build({f.name: f.start for f in subject.nominals})
        slowest = min(frequency(*made, r) for r in recordings)
    except InputError:
        return np.inf
    if not slowest > 0.0:
        return np.inf
    total, count = 0.0, 0
    for r in recordings:
        few = _paced(r, slowest)
        if len(few.times) < FEWEST:
            return np.inf
        moved, seen = _by_acceleration(few, slowest)
        total, count = total + moved + _hidden(r, few) * len(few.times), count + seen
    return float(np.sqrt(max(total, 0.0) / max(count, 1)))


def _paced(recording: Recording, slowest: float) -> Recording:
    """The recording thinned as `calmer` does, and to frames that are apart by `APART` over the frequency [rad/s]."""
    step = float(np.median(np.diff(recording.times)))
    return thinned(recording, max(1, len(recording.times) // FRAMES, round(APART / (slowest * step))))


def calmer(recording: Recording) -> Recording:
    """The recording and its drive thinned to about `FRAMES` frames: what is slow shows in as many."""
    return thinned(recording, max(1, len(recording.times) // FRAMES), driven=True)


def frequency(model: Model, parameters: Parameters, drive: Drive, recording: Recording) -> float:
    """Lowest angular frequency [rad/s] at the equilibria of a few instants; 0 where one is not found or not stable.

    Raises:
        InputError: what `drive_of` and the statics refuse.
    """
    arm = Articulation(model)
    if arm.floating or len(arm.open) or not arm.size or len(model.contacts):
        return 0.0
    model, parameters = weighed(model, parameters, recording.gravity)
    applied, span = drive_of(recording, drive), float(recording.times[-1] - recording.times[0])
    state, out = State.at_rest(model), np.inf
    for t in np.linspace(0.0, span, INSTANTS):
        held = applied.held(float(t))
        found = equilibrium(model, parameters, held, state=state, contact=False)
        if not found.converged or not found.stable:
            return 0.0
        state = found.state
        pose = replace(arm.reference(), angles=np.asarray(found.angles)[arm.creases, None])
        m = arm.size
        near = STEP * np.concatenate([np.eye(m), -np.eye(m), np.zeros((m, 1))], axis=1)
        moved = arm.moved(pose.select([0] * (2 * m + 1)), near)
        x = arm.positions(moved)
        by = arm.jacobian(moved, x)
        still = State.at_rest(model, 2 * m + 1, position=x)
        moments = np.einsum("mnwa,nwa->mw", by, Batch(model, parameters, held, still, threads=1).total_force(0.0))
        k = (moments[:, m : 2 * m] - moments[:, :m]) / (2 * STEP)
        mass = np.broadcast_to(node_mass(model, parameters), (len(x), 1))[:, 0]
        heavy = np.einsum("mna,n,kna->mk", by[:, :, -1], mass, by[:, :, -1])
        try:
            lowest = float(eigh(0.5 * (k + k.T), heavy, eigvals_only=True)[0])
        except np.linalg.LinAlgError:
            return 0.0
        out = min(out, np.sqrt(max(lowest, 0.0)))
    return float(out)


def _by_acceleration(recording: Recording, slowest: float) -> tuple[float, int]:
    """Sum of the squares of acceleration over frequency squared, in noise, without the noise's share; and its terms."""
    values, noise = stacked(recording)
    total, count = 0.0, 0
    for y, sd in zip(values.T, noise, strict=True):
        seen = np.flatnonzero(np.isfinite(y))
        if len(seen) < 3:
            continue
        t, y = recording.times[seen], y[seen] / sd
        before, after = np.diff(t)[:-1], np.diff(t)[1:]
        weights = 2.0 / (before + after) * np.array([1.0 / before, -1.0 / before - 1.0 / after, 1.0 / after])
        bend = weights[0] * y[:-2] + weights[1] * y[1:-1] + weights[2] * y[2:]
        total += float(np.sum(bend**2 - np.sum(weights**2, axis=0))) / slowest**4
        count += len(bend)
    return total, count


def _hidden(recording: Recording, few: Recording) -> float:
    """Mean square by which the frames of a recording depart from means over them, in noise, beyond that noise."""
    if len(few.times) == len(recording.times):
        return 0.0
    values, noise = stacked(recording)
    means, _ = stacked(few)
    out = 0.0
    for y, mean, sd in zip(values.T, means.T, noise, strict=True):
        seen, told = np.isfinite(y), np.isfinite(mean)
        if told.sum() < 2:
            continue
        off = (y[seen] - np.interp(recording.times[seen], few.times[told], mean[told])) / sd
        out += max(float(np.mean(off**2)) - 1.5, 0.0)
    return out
