"""How recordings are predicted: as curves, as slow motions, by rigid panels, or by bars where panels visibly bend."""

from dataclasses import replace

import numpy as np

from origami_sim.diagnose.inertia import calmer, inertia
from origami_sim.diagnose.options import Options
from origami_sim.errors import InputError
from origami_sim.fit.derivatives import linearise
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.nominal import nominal_fits
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.recorder import fast_noise
from origami_sim.fit.weights import Weights
from origami_sim.hypotheses.coordinates import Coordinates
from origami_sim.hypotheses.hypothesis import Hypothesis, Subject
from origami_sim.infer.budget import pooled
from origami_sim.predict.at_rest import starting
from origami_sim.predict.bars import BarRollouts
from origami_sim.predict.prescribed import curves
from origami_sim.predict.rigid import RigidRollouts
from origami_sim.predict.rollouts import Rollouts
from origami_sim.predict.slow import Slow, restless
from origami_sim.predict.starts import spans
from origami_sim.recording import Recording

GROWTH = 3.0
"""Growth of a difference in the start within a segment: numbers are found by linear steps only where it is small.

Segments half or twice as long change what a diagnosis says by less than its rounding.
"""

FRAMES = 50
"""Frames of a segment of rigid panels, at most: what a force that is missing does within one has to be small.

As many tell the rates at its start to a few parts in a thousand; half or twice as many make no difference. Where the
refitted model misses far more than noise, segments are as short as tells a rate (`shortened`).
"""

STEADY = 10.0
"""The same for what begins at rest and is predicted by bars, beyond which it is cut into segments."""

FEWEST = 8
"""Segments that a single recording is cut into at least, where bars predict it."""

BENT = (
    "Panels are taken as rigid: with those of the model, bending would change what is measured by {:.2g} times its "
    "noise."
)

UNNOTICED = 0.3
"""Change, over the noise, up to which bending, inertia and what is not linear in missing forces are left out.

Of ten objects with strong effects the last is 0.9 to 28 of seven (stops, yield, a lag, a van der Pol moment), 0.3 to
0.6 of three (friction, softening, a power law), and below 0.02 of two real pendulums and of four without any.
"""

LOOKED_AT = 16
"""Frames of a slow motion in which bending is looked for."""

JOINTS = 16
"""Creases of rigid panels beyond which their dense equations are slower than bars."""

PROBED = 0.3
"""Time over which bending is looked for, in a few places [s]."""


def arranged(subject: Subject, recordings: list[Recording], o: Options) -> tuple[Predictor, list[str]]:
    """What predicts the recordings, with segments that are short enough to be predictable; and notes.

    Raises:
        InputError: a segment that is too short; rigid panels that are asked for and impossible.
    """
    curve = curves(subject, recordings, o.threads)
    if curve is not None:
        return curve, []
    slow = slowly(subject, recordings, o)
    if slow is not None:
        return slow
    shortest = 8 * max(float(np.median(np.diff(r.times))) for r in recordings)
    if o.segment is not None and not shortest <= o.segment < np.inf:
        raise InputError(
            "a segment needs frames to be compared", field="segment", value=o.segment, allowed=f">= {shortest:.3g} s"
        )
    given = subject.build({f.name: f.start for f in subject.nominals})[0].panels
    if given == "rigid" and o.panels == "elastic":
        raise InputError("the model's panels are rigid", field="panels", value=o.panels, allowed="auto, rigid")
    if o.panels != "elastic":
        try:
            found = rigid_rollouts(subject, recordings, o, forced="rigid" in (o.panels, given))
        except InputError:
            if "rigid" in (o.panels, given):
                raise
        else:
            if found is not None:
                return found
    return bar_rollouts(subject, recordings, o), []


def slowly(subject: Subject, recordings: list[Recording], o: Options) -> tuple[Predictor, list[str]] | None:
    """Predictions by equilibria along time; None unless that is stated, or inertia could not show.

    Raises:
        InputError: recordings that state different motions; what `Slow` refuses where it was asked for.
    """
    stated = {r.motion for r in recordings} - {None}
    if len(stated) > 1:
        raise InputError(
            "recordings that move quasi-statically and others cannot be diagnosed together",
            field="motion",
            value=", ".join(f"{r.name}: {r.motion}" for r in recordings),
        )
    asked = o.motion if o.motion != "auto" else next(iter(stated), "auto")
    if asked == "dynamic" or (asked == "auto" and (o.segment is not None or o.start is not None)):
        return None
    notes = ["The motion is quasi-static, as stated: inertia is left out."]
    if asked == "auto":
        if any(r.start is not None and r.start.state != "equilibrium" for r in recordings):
            return None
        shows = inertia(subject, recordings)
        if shows > UNNOTICED:
            return None
        notes = [
            "The motion is taken as quasi-static: its accelerations would change what is measured by "
            f"{shows:.2g} times its noise. What is simulated are equilibria along time, with losses and memory."
        ]
    for what, value in (("segment", o.segment), ("start-at", o.start)):
        if value is not None:
            raise InputError("a quasi-static motion has no such start", field=what, value=value, allowed="none")
    few = [calmer(r) for r in recordings]
    if sum(len(r.times) for r in few) < sum(len(r.times) for r in recordings):
        notes.append(
            f"Frames and drive are averaged to {sum(len(r.times) for r in few):,}, in which what is slow shows."
        )
    out, more = _slow_panels(subject, few, o)
    if asked == "auto":
        nominal = np.array([f.start for f in out.subject.nominals])
        if not all(np.all(np.isfinite(v)) for v in out.predict(Hypothesis(), nominal[None])):
            return None
    return out, [*notes, *more, *restless(few, out.drives)]


def _slow_panels(subject: Subject, recordings: list[Recording], o: Options) -> tuple[Slow, list[str]]:
    """Slow motions of rigid panels, or of bars where they visibly bend."""
    given = subject.build({f.name: f.start for f in subject.nominals})[0].panels
    if o.panels == "elastic" or given == "rigid":
        return Slow(subject, recordings, threads=o.threads), []
    try:
        rigid = Slow(subject, recordings, panels="rigid", threads=o.threads)
        if o.panels == "rigid":
            return rigid, []
        bent = np.inf
        if len(rigid.articulation.creases) <= JOINTS:
            bent = slow_bending(subject, recordings, o)
    except InputError:
        if o.panels == "rigid":
            raise
        return Slow(subject, recordings, threads=o.threads), []
    if bent > UNNOTICED:
        return Slow(subject, recordings, threads=o.threads), []
    return rigid, [BENT.format(bent)]


def slow_bending(subject: Subject, recordings: list[Recording], o: Options) -> float:
    """Root mean square change by the bending of panels, over the noise, in a few frames of a slow motion."""
    few = [r.only(np.unique(np.linspace(0, len(r.times) - 1, LOOKED_AT).round().astype(int))) for r in recordings]
    bars = Slow(subject, few, pieces=1, threads=o.threads)
    rigid = Slow(subject, few, pieces=1, panels="rigid", threads=o.threads)
    return _absorbed(bars, rigid, np.zeros((len(rigid.blocks), 0)))


def rigid_rollouts(
    subject: Subject, recordings: list[Recording], o: Options, *, forced: bool
) -> tuple[Predictor, list[str]] | None:
    """Predictions by rigid panels; None if bending shows and rigid panels were not asked for.

    Raises:
        InputError: panels that cannot be rigid.
    """
    frame = max(float(np.median(np.diff(r.times))) for r in recordings)
    probe = RigidRollouts(subject, recordings, segment=FRAMES * frame, tied=False, threads=o.threads)
    if len(probe.articulation.creases) > JOINTS and not forced:
        return None
    bent = 0.0 if forced else bending(subject, recordings, o)
    if not np.isfinite(bent):
        return None
    if len(probe.model.contacts):  # a contact is no smooth function of a start
        start = o.start or starting(subject, recordings)
        found = RigidRollouts(subject, recordings, segment=o.segment, start=start, threads=o.threads, probe=probe)
    else:
        length = o.segment or min(FRAMES * frame, predictable(probe, GROWTH))
        found = RigidRollouts(subject, recordings, segment=length, threads=o.threads, probe=probe)
    if bent <= UNNOTICED:
        return found, found.notes if forced else [BENT.format(bent), *found.notes]
    # a recorder that averages over frames has more noise than neighbouring frames show
    noise = float(np.sqrt(np.mean((fast_noise(found, nominal_fits(found)[1]) / found.blocks[0].noise) ** 2)))
    return (found, [BENT.format(bent / noise), *found.notes]) if bent <= UNNOTICED * noise else None


def shortened(forward: Predictor, base: Fit, o: Options) -> Predictor | None:
    """The same predictor with segments as short as tells a start, where the refitted model is far off; else None.

    What it misses is not linear in what is missing then, as at a stop, off which a flap bounces within a few frames:
    its square over the motion's size shows. Noise is correlated within a segment only, and more segments take longer,
    so others are not shortened.
    """
    motion = np.nanstd(np.concatenate([b.values for b in forward.blocks]), axis=0)
    missed, noise = base.rms(), forward.blocks[0].noise
    far = pooled(missed**2 / np.maximum(motion * noise, 1e-300)) > UNNOTICED
    return forward.abruptly() if far and o.segment is None else None


def bending(subject: Subject, recordings: list[Recording], o: Options) -> float:
    """Root mean square change by the bending of panels, over the noise, of the model as it is given.

    What numbers of the model (within their priors) and starts could take the place of does not count.
    """
    whole = min(float(r.times[-1] - r.times[0]) for r in recordings)
    length = min(PROBED, whole)
    try:
        bars = BarRollouts(subject, recordings, segment=length, most=2, threads=o.threads)
    except InputError:
        return np.inf
    rigid = RigidRollouts(subject, recordings, segment=length, tied=False, threads=o.threads)
    rigid.blocks = [replace(rigid.segment(b.recording, b.first, len(b.times)), values=b.values) for b in bars.blocks]
    return _absorbed(bars, rigid, np.zeros((len(rigid.blocks), rigid.local)))


def _absorbed(bars: Predictor, rigid: Predictor, local: np.ndarray) -> float:
    """Root mean square change from rigid panels to bars, in noise, beyond what numbers and starts could absorb."""
    free, every = rigid.subject.nominals, list(range(len(rigid.blocks)))
    theta = np.array([f.start for f in free])
    weights = Weights(rigid.blocks[0].noise)
    line = linearise(rigid, Hypothesis(), free, theta, local, every, weights)
    gaps = []
    for n, (one, other) in enumerate(
        zip(bars.predict(Hypothesis(), theta[None]), rigid.predict(Hypothesis(), theta[None]), strict=True)
    ):
        seen = bars.blocks[n].seen()
        change = weights.whitened(np.where(seen, one[0] - other[0], 0.0), line.rows[n])
        gaps.append(line.padded(n, change))
    if not all(np.all(np.isfinite(g)) for g in gaps):
        return np.inf
    prior = np.diag(Coordinates(free).precision)
    a = np.concatenate([*line.cleared(line.tangent), prior])
    y = np.concatenate([*line.cleared(gaps), np.zeros(len(free))])
    x, *_ = np.linalg.lstsq(a, y, rcond=1e-10)
    count = sum(b.seen().sum() for b in bars.blocks)
    return float(np.linalg.norm(y - a @ x) / np.sqrt(max(count, 1)))


def bar_rollouts(subject: Subject, recordings: list[Recording], o: Options) -> Predictor:
    """Predictions by bars, from rest or from free starts."""
    whole = max(float(r.times[-1] - r.times[0]) for r in recordings)
    told = any(r.start is not None for r in recordings)
    start = o.start or ("fit" if o.segment is not None or told else starting(subject, recordings))
    if start == "rest" and o.start is None and not steady(subject, recordings, whole, o.threads):
        start = "fit"
    if start == "rest":  # later segments would not begin there
        return BarRollouts(subject, recordings, start="rest", threads=o.threads)
    length = o.segment
    if length is None:
        count = FEWEST if len(recordings) == 1 else max(1, FEWEST // len(recordings))
        probe = BarRollouts(subject, recordings, segment=whole / count, most=4, threads=o.threads)
        length = min(whole / count, predictable(probe))
    return BarRollouts(subject, recordings, segment=length, threads=o.threads)


def steady(subject: Subject, recordings: list[Recording], whole: float, threads: int | None) -> bool:
    """Whether a difference in the start hardly grows in a whole recording; where feet stand, that is not asked."""
    forward = BarRollouts(subject, recordings, segment=whole, threads=threads)
    if forward.articulation.floating or not forward.articulation.size:
        return True
    return predictable(forward, STEADY) >= whole


def predictable(forward: Rollouts, growth: float = GROWTH) -> float:
    """Time over which a difference in the start grows less than so many times [s].

    Shifts of all coordinates and rates, each as a part of its usual size, are followed through every segment; what the
    channels show of them together is compared with what they show in the first frames.
    """
    half = forward.local // 2
    local = np.zeros((2 * half + 1, len(forward.blocks), 2 * half))
    size = spans(forward.articulation, forward.model)
    for b, block in enumerate(forward.blocks):
        nudges = 1e-6 * np.concatenate([size, forward.readings.usual_rates(block.recording)])
        local[1:, b][np.diag_indices(2 * half)] = nudges
    theta = np.array([f.start for f in forward.subject.nominals])
    predicted = forward.predict(Hypothesis(), [theta] * (2 * half + 1), local)
    shortest = np.inf
    for block, values in zip(forward.blocks, predicted, strict=True):
        gap = np.nan_to_num((values[1:] - values[0]) / block.noise, nan=np.inf)
        moved = np.maximum.accumulate(np.sqrt(np.sum(gap**2, axis=(0, 2))))
        beyond = moved > growth * max(float(moved[min(2, len(moved) - 1)]), 1e-12)
        shortest = min(shortest, block.times[np.argmax(beyond)] if np.any(beyond) else block.times[-1] + 1e-9)
    return max(float(shortest), 8 * float(np.median(np.diff(forward.recordings[0].times))))
