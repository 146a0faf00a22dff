"""Mirrored pictures, reversed signs, exchanged channels and mistaken units, found before a fit.

Such a mistake is no effect with a strength: it is so or it is not, and what is not seen at once is explained away by
wrong physics. So each of a few changes of the recording is compared with the model as given, from starts that are read
from the recording changed in this way. A clock, which decides how a device gets to where it goes, may show only once
numbers of the model are refitted.
"""

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from origami_sim.diagnose.arrange import arranged
from origami_sim.diagnose.options import Options
from origami_sim.errors import InputError
from origami_sim.fit.least_squares import Fit
from origami_sim.fit.nominal import nominal_fits
from origami_sim.fit.predictor import Predictor
from origami_sim.hypotheses.hypothesis import Hypothesis, Subject
from origami_sim.hypotheses.mistakes import Change, Slip, slips
from origami_sim.infer.budget import pooled
from origami_sim.recording import Recording
from origami_sim.recording.axes import EXPLAINED, FAR, alike
from origami_sim.threads import told

LEAST, PART = 30.0, 0.1
"""Seconds, and part of the limit of time, in which units but those of time are asked for, whichever is longer.

Rigid panels take 1 to 15 s on one core; of bars that take longer some units are not asked for. Half of both leaves
fewer of these, double takes a fifth of the time of a search.
"""


@dataclass(frozen=True)
class Mistake:
    """A change of the recording after which the model agrees far better.

    Attributes:
        sentence: what is wrong, in words. given, changed: error over the noise (root mean square), before and after.
    """

    sentence: str
    given: float
    changed: float


def mistaken(
    subject: Subject, recordings: Sequence[Recording], o: Options, forward: Predictor, base: Fit | None = None
) -> Mistake | None:
    """The one change of axes, signs, order or units that explains recordings far better, if there is one.

    Args:
        forward: what predicts the recordings as they are. base: the refitted model, of which only clocks are asked;
            None: the model as given is asked for all.
    """
    given, moved = missed(forward)
    as_given = given
    given = given if base is None else left_by(forward, base)
    if given < (max(FAR, EXPLAINED * moved) if base is None else FAR):
        return None  # nothing can be so many times closer, or as it is most is explained
    same, found = replace(o, panels=forward.panels or o.panels), list[tuple[float, Slip]]()

    def predicted(change: Change) -> Predictor | None:
        try:
            return arranged(subject, [change(r) for r in recordings], same)[0]
        except InputError:
            return None

    def error(change: Change) -> tuple[float, float]:
        one = predicted(change)
        return (np.inf, 0.0) if one is None else missed(one)

    # of bars, which take steps of microseconds, a long motion is not predicted
    frames = len(forward.blocks[0].times) if forward.panels == "rigid" else None
    until = clock.perf_counter() + max(LEAST, PART * o.limit)
    for slip in slips(recordings[0], frames):
        if base is not None and not slip.late:
            continue
        if slip.rivals and not slip.late and not told(lambda: clock.perf_counter() < until):
            continue
        left, moved = error(slip.change)
        if left >= (as_given if base is not None else given / FAR) or (base is None and left >= EXPLAINED * moved):
            continue
        if any(error(rival)[0] < FAR * max(left, 1.0) for rival in slip.rivals):
            continue
        if base is not None and (one := predicted(slip.change)) is not None:
            try:
                left = left_by(one, nominal_fits(one)[1])
            except InputError:
                continue
        if FAR * max(left, 1.0) < given and left < EXPLAINED * moved:
            found.append((left, slip))
    if not found:
        return None
    least = min(left for left, _ in found)
    left, slip = next(one for one in found if alike(one[0], least, 1.0))
    who = "the model" if base is None else "the refitted model"
    text = f"{slip.what}: as recorded {who} misses {given:.3g} times the noise, so changed {left:.3g} times."
    return Mistake(f"{text} {slip.remedy}, and diagnose again.", given, left)


def left_by(forward: Predictor, f: Fit) -> float:
    """What a fit leaves, over the noise that was stated, or read from neighbouring frames."""
    return pooled(f.rms() / forward.blocks[0].noise)


def missed(forward: Predictor) -> tuple[float, float]:
    """What the model as given misses, and what moves, over the noise (root mean square); inf where it goes unstable."""
    theta = np.array([f.start for f in forward.subject.nominals])
    local = np.zeros((1, len(forward.blocks), forward.local))
    shot = forward.predict(Hypothesis(), theta[None], local)
    read = np.concatenate([b.values / b.noise for b in forward.blocks])
    moved = float(np.sqrt(np.nanmean((read - np.nanmean(read, axis=0)) ** 2)))
    if any(np.any(np.isfinite(b.values) & ~np.isfinite(v[0])) for b, v in zip(forward.blocks, shot, strict=True)):
        return np.inf, moved
    left = np.concatenate([(b.values - v[0]) / b.noise for b, v in zip(forward.blocks, shot, strict=True)])
    return float(np.sqrt(np.nanmean(left**2))), moved
