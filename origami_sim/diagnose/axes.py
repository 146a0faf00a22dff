"""Mirrored pictures, reversed signs, exchanged channels and mistaken units, found before a fit.

Such a mistake is no effect with a strength: it is so or it is not, and what is not seen at once is explained away by
wrong physics. So each of a few changes of the recording is compared with the model as given, from starts that are read
from the recording changed in this way. A clock, which decides how a device gets to where it goes, may show only once
numbers of the model are refitted.
"""

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

STEPS = 1e5
"""Steps of the solver, at most, of recordings for which units but those of time are asked.

Up to 15 predictions, of bars as large as the crawler 0.1 s each with as many steps (`benchmarks/README.md`). Rigid
panels take a step a frame or so, and are asked in any case that is met; stiff bars of some ten seconds are not. Half
leaves out bars of half the length, double takes twice as long before the first fit.
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

    def error(change: Change) -> tuple[float, float, Predictor | None]:
        """What the model as given misses of changed recordings, what of them moves, and what predicts them."""
        try:
            one = arranged(subject, [change(r) for r in recordings], same)[0]
        except InputError:
            return np.inf, 0.0, None
        return *missed(one), one

    # of bars, which take steps of microseconds, a long motion is not predicted
    frames = len(forward.blocks[0].times) if forward.panels == "rigid" else None
    short = _steps(forward) <= STEPS
    for slip in slips(recordings[0], frames):
        if not slip.late and (base is not None or (slip.rivals and not short)):
            continue
        left, moved, changed = error(slip.change)
        if left >= (as_given if base is not None else given / FAR) or (base is None and left >= EXPLAINED * moved):
            continue
        if any(error(rival)[0] < FAR * max(left, 1.0) for rival in slip.rivals):
            continue
        if base is not None and changed is not None:
            try:
                left = left_by(changed, nominal_fits(changed)[1])
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


def _steps(forward: Predictor) -> float:
    """Steps of the solver that one prediction of all recordings takes; a load step is one."""
    if forward.curve:
        return float(sum(len(b.times) for b in forward.blocks))
    least = forward.step(Hypothesis(), np.array([f.start for f in forward.subject.nominals]))
    return sum(b.times[-1] for b in forward.blocks) / least if least else np.inf


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
