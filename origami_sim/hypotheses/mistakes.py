"""What may be wrong with the columns of a recording while nothing is with the device: axes, signs, order and units.

None of these has a strength that could be fitted: it is so or it is not. Each is a change after which the recording is
as it should be, with what has to be stated, and with what else could do the same.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from origami_sim.recording import Recording
from origami_sim.recording.axes import groups_of, orders, picture_of, reordered, words
from origami_sim.recording.recording import CHANNEL_KINDS, Channel
from origami_sim.units import UNITS, spelled, unit_factor

Change = Callable[[Recording], Recording]

RATIOS = {"angle": unit_factor("rad") / unit_factor("deg"), "ratio": 1.0 / unit_factor("%"), "temperature": 1.0}
"""Ratio of two units of a dimension that are mistaken for each other, where it is not `PREFIX`."""

PREFIX = 1e3
"""Ratio of neighbouring units of all other dimensions. Half or double of it is no unit."""

MINUTE = unit_factor("min")
"""The other ratio of times."""

ORDINARY = 5.0
"""What numbers of a model, a gain or a scale may be off by: a unit has to explain far more than such a factor.

A stop that every large drive reaches is then no unit of the drive. With half of it an amplifier that gives six times
its voltage could pass for kV; with double a field of mT that is read as G (a tenth) is what a number may be off by.
"""


@dataclass(frozen=True)
class Slip:
    """A mistake in how a recording is stated.

    Attributes:
        what: is wrong, in words. remedy: what has to be stated. change: makes the recording as it should be.
        rivals: changes that are no such mistake; where one explains as much, this is none either.
        late: whether the model as given may hide it, as it decides only how a device gets to where it goes.
    """

    what: str
    remedy: str
    change: Change
    rivals: tuple[Change, ...] = ()
    late: bool = False


def slips(recording: Recording, frames: int | None) -> Iterator[Slip]:
    """All that may be wrong with recordings like this one.

    Args:
        frames: how many are predicted of motions that last longer than they are said to; None: no such motion is.
    """
    yield from _turns(recording)
    yield from _units(recording)
    if not recording.by_step and all(d.times is None for d in recording.drive.values()):
        yield from _clocks(recording, frames)


def _turns(recording: Recording) -> Iterator[Slip]:
    """Axes in another order, with other signs, and channels with each other's values."""
    for group in groups_of(list(recording.channels.values())):
        width = group[0].values.reshape(len(recording.times), -1).shape[1]
        names = [c.name for c in group]
        where = {1: "sign = -1 of the channel", 2: "right and up of the camera"}.get(width, "axes under [source]")
        for order, signs in orders(width)[1:]:
            what = f"{_named(names)}: {words(group[0], order, signs)}"
            yield Slip(what, f"State {where} in the sidecar", turned(names, order, signs))
    for a, b in combinations(recording.channels.values(), 2):
        if a.kind == b.kind and picture_of(a) == picture_of(b):
            remedy = "Exchange their columns or tracks in the sidecar"
            yield Slip(f"Channels {a.name} and {b.name} are exchanged", remedy, exchanged(a.name, b.name))


def _units(recording: Recording) -> Iterator[Slip]:
    """Readings of one dimension, or a drive, in another unit than the stated one."""
    stated = recording.metadata.get("units", {})
    readings: dict[tuple[str, str], list[str]] = {}
    for c in recording.channels.values():
        if (own := stated.get(c.name, c.unit)) != "px":  # whose scale is a number of the camera
            readings.setdefault((CHANNEL_KINDS[c.kind][0], own), []).append(c.name)
    for (dimension, own), names in readings.items():
        for factor in _factors(dimension):
            what = f"{_named(names)}: the {'reading is' if len(names) == 1 else 'readings are'} {_off(factor)}"
            remedy = f"State {_unit(own, factor)} of the channel{'s' if len(names) > 1 else ''} in the sidecar"
            others = tuple(scaled(names, f) for f in (ORDINARY, 1.0 / ORDINARY))
            yield Slip(f"{what}{_as(own, factor)}", remedy, scaled(names, factor), others)
    for name, drive in recording.drive.items():
        own = stated.get(f"drive.{name}", drive.unit)
        for factor in _factors(_dimension(own)):
            remedy = f"State {_unit(own, factor)} under [drive.{name}] in the sidecar"
            others = tuple(driven(name, f) for f in (ORDINARY, 1.0 / ORDINARY, 0.0))
            yield Slip(f"Drive {name} is {_off(factor)}{_as(own, factor)}", remedy, driven(name, factor), others)


def _clocks(recording: Recording, frames: int | None) -> Iterator[Slip]:
    """Times in another unit than the stated one."""
    own = recording.metadata.get("units", {}).get("time", "s")
    remedy = "State their unit or rate_hz under [time] in the sidecar"
    for ratio in (PREFIX, MINUTE):
        # what moves on by its rates alone, as the still faster does, tells nothing of a clock
        what, inert = f"Times are {_times(ratio)} too long{_as(own, 1.0 / ratio)}", clocked(1.0 / (ratio * PREFIX))
        yield Slip(what, remedy, clocked(1.0 / ratio), (inert,), late=True)
        if frames is not None:
            yield Slip(f"Times are {_times(ratio)} too short{_as(own, ratio)}", remedy, clocked(ratio, frames))


def _factors(dimension: str) -> list[float]:
    ratio = RATIOS.get(dimension, PREFIX)
    return [] if ratio == 1.0 else [ratio, 1.0 / ratio]


def _dimension(unit: str) -> str:
    """The dimension of a unit; "" of one that is unknown."""
    return next((d for d, units in UNITS.items() if spelled(unit) in units), "")


def _right(own: str, factor: float) -> str | None:
    """The unit that is so many times as large as the stated one, if it has a name."""
    units = UNITS.get(_dimension(own), {})
    return next((u for u, f in units.items() if np.isclose(f, factor * units[spelled(own)], rtol=1e-6)), None)


def _unit(own: str, factor: float) -> str:
    right = _right(own, factor)
    return "the unit" if right is None else f'unit = "{right}"'


def _as(own: str, factor: float) -> str:
    right = _right(own, factor)
    return "" if right is None else f", as {right} stated as {own}"


def _off(factor: float) -> str:
    return f"{_times(max(factor, 1.0 / factor))} too {'small' if factor > 1.0 else 'large'}"


def _times(ratio: float) -> str:
    return f"{ratio:.3g} times" if ratio < PREFIX else f"{ratio:.0f} times"


def _named(names: Sequence[str]) -> str:
    return f"{'Channel' if len(names) == 1 else 'Channels'} {', '.join(names)}"


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


def scaled(names: Sequence[str], factor: float) -> Change:
    """A recording of which channels read so many times as much, noise included."""

    def of(channel: Channel) -> Channel:
        return replace(channel, values=factor * channel.values, noise=factor * channel.noise)

    return lambda r: replace(r, channels={n: of(c) if n in names else c for n, c in r.channels.items()})


def driven(name: str, factor: float) -> Change:
    """A recording of which a drive is so many times as large."""

    def change(r: Recording) -> Recording:
        values = {n: factor * d.values if n == name else d.values for n, d in r.drive.items()}
        return replace(r, drive={n: replace(d, values=values[n]) for n, d in r.drive.items()})

    return change


def clocked(factor: float, frames: int | None = None) -> Change:
    """A recording of which all times are so many times as long; or so many frames of it, those that move most."""

    def change(r: Recording) -> Recording:
        if frames is not None and frames < len(r.times):
            first = _liveliest(r, frames)
            r = r.only(slice(first, first + frames))
        return replace(r, times=r.times[0] + factor * (r.times - r.times[0]))

    return change


def _liveliest(r: Recording, frames: int) -> int:
    """Where the frames begin in which readings spread most, over their noise."""
    columns = [c.values.reshape(len(r.times), -1) / c.noise for c in r.channels.values()]
    read = np.nan_to_num(np.concatenate(columns, axis=1))
    begins = range(0, len(r.times) - frames + 1, max(frames // 2, 1))
    return max(begins, key=lambda k: float(np.var(read[k : k + frames], axis=0).sum()))
