"""Mirrored pictures, reversed signs, exchanged channels and milliseconds read as seconds, found before a fit.

Such a mistake is no effect with a strength: it is so or it is not, and what is not seen at once is explained away by
wrong physics. So each of a few changes of the recording is compared with the model as given, from starts that are read
from the recording changed in this way.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from origami_sim.diagnose.arrange import arranged
from origami_sim.diagnose.options import Options
from origami_sim.errors import InputError
from origami_sim.fit.predictor import Predictor
from origami_sim.hypotheses.hypothesis import Hypothesis, Subject
from origami_sim.recording import Recording
from origami_sim.recording.axes import EXPLAINED, FAR, alike, groups_of, orders, picture_of, reordered, words
from origami_sim.recording.recording import Channel
from origami_sim.units import unit_factor

Change = Callable[[Recording], Recording]


@dataclass(frozen=True)
class Mistake:
    """A change of the channels after which the model as given agrees far better.

    Attributes:
        sentence: what is wrong, in words. given, changed: error over the noise (root mean square), before and after.
    """

    sentence: str
    given: float
    changed: float


def mistaken(subject: Subject, recordings: Sequence[Recording], o: Options, forward: Predictor) -> Mistake | None:
    """The one change of axes, signs or order of channels that explains recordings far better, if there is one.

    Args:
        forward: what predicts the recordings as they are.
    """
    given, moved = missed(forward)
    if given < max(FAR, EXPLAINED * moved):  # nothing can be so many times closer, or as it is most is explained
        return None
    same, found = replace(o, panels=forward.panels or o.panels), []
    clocks = [("too long", clocked(unit_factor("ms")))]
    if forward.panels == "rigid":  # of bars, which take steps of microseconds, a long motion is not predicted
        clocks.append(("too short", clocked(1.0 / unit_factor("ms"), len(forward.blocks[0].times))))
    for what, remedy, change in changes(recordings[0], clocks):
        changed = [change(r) for r in recordings]
        try:
            left, moved = missed(arranged(subject, changed, same)[0])
        except InputError:
            continue
        if FAR * max(left, 1.0) < given and left < EXPLAINED * moved:
            found.append((left, what, remedy))
    if not found:
        return None
    least = min(left for left, *_ in found)
    left, what, remedy = next(one for one in found if alike(one[0], least, 1.0))
    text = f"{what}: as recorded the model misses {given:.3g} times the noise, so changed {left:.3g} times."
    return Mistake(f"{text} {remedy}, and diagnose again.", given, left)


def missed(forward: Predictor) -> tuple[float, float]:
    """What the model as given misses, and what moves, over the noise (root mean square); inf where it goes unstable."""
    theta = np.array([f.start for f in forward.subject.nominals])
    local = np.zeros((1, len(forward.blocks), forward.local))
    shot = forward.predict(Hypothesis(), theta[None], local)
    left = np.concatenate([(b.values - v[0]) / b.noise for b, v in zip(forward.blocks, shot, strict=True)])
    read = np.concatenate([b.values / b.noise for b in forward.blocks])
    moved = float(np.sqrt(np.nanmean((read - np.nanmean(read, axis=0)) ** 2)))
    return (float(np.sqrt(np.nanmean(left**2))) if np.any(np.isfinite(left)) else np.inf), moved


def changes(recording: Recording, clocks: Sequence[tuple[str, Change]]) -> Iterator[tuple[str, str, Change]]:
    """What may be wrong with a recording, in words, what then has to be stated, and the recording as it should be.

    Args:
        clocks: how times may be 1000 times wrong, as milliseconds that were read as seconds, and as they should be.
    """
    for group in groups_of(list(recording.channels.values())):
        width = group[0].values.reshape(len(recording.times), -1).shape[1]
        names = [c.name for c in group]
        where = {1: "sign = -1 of the channel", 2: "right and up of the camera"}.get(width, "axes under [source]")
        for order, signs in orders(width)[1:]:
            what = f"{'Channel' if len(names) == 1 else 'Channels'} {', '.join(names)}: {words(group[0], order, signs)}"
            yield what, f"State {where} in the sidecar", turned(names, order, signs)
    for a, b in combinations(recording.channels.values(), 2):
        if a.kind == b.kind and picture_of(a) == picture_of(b):
            remedy = "Exchange their columns or tracks in the sidecar"
            yield f"Channels {a.name} and {b.name} are exchanged", remedy, exchanged(a.name, b.name)
    if not recording.by_step and all(d.times is None for d in recording.drive.values()):
        for what, change in clocks:
            yield f"Times are 1000 times {what}", "State their unit or rate_hz under [time] in the sidecar", change


def turned(names: Sequence[str], order: Sequence[int], signs: Sequence[int]) -> Change:
    """A recording with components of channels in another order, and with other signs."""

    def of(channel: Channel) -> Channel:
        return replace(channel, values=reordered(channel.values, order, signs))

    return lambda r: replace(r, channels={n: of(c) if n in names else c for n, c in r.channels.items()})


def exchanged(a: str, b: str) -> Change:
    """A recording of which two channels have each other's values."""
    other = {a: b, b: a}

    def change(r: Recording) -> Recording:
        values = {n: r.channels[other.get(n, n)].values for n in r.channels}
        return replace(r, channels={n: replace(c, values=values[n]) for n, c in r.channels.items()})

    return change


def clocked(factor: float, frames: int | None = None) -> Change:
    """A recording, or the first frames of it, of which all times are so many times as long."""

    def change(r: Recording) -> Recording:
        n = min(frames or len(r.times), len(r.times))
        channels = {name: replace(c, values=c.values[:n]) for name, c in r.channels.items()}
        drive = {name: d if d.constant else replace(d, values=d.values[:n]) for name, d in r.drive.items()}
        return replace(r, times=r.times[0] + factor * (r.times[:n] - r.times[0]), channels=channels, drive=drive)

    return change
