"""The drive: fields, voltages and loads as functions of time, as data."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from origami_sim.errors import InputError, named_arguments
from origami_sim.quantities import ANY, Quantity, converted

if TYPE_CHECKING:
    from origami_sim.drive.gridded import FieldTable
    from origami_sim.drive.sources import Source

CHANNELS = (
    "field_x",
    "field_y",
    "field_z",
    *(f"gradient_{i}{j}" for i in "xyz" for j in "xyz"),
    "temperature",
    "load",
    "origin",
)
"""Fixed channels, in the order of the kernels; `voltage_0`, `voltage_1`, ... (electrode groups) follow, and after them
the numbers of the sources, `source_0_strength`, `source_0_x`, ...

The origin is the age [s] of the device at the start: laws of time count from it. Paths of grips come last: `grip_top`
[m] of one that moves along a direction, `turn_top` [rad] of one that turns about an axis.
"""
FOREVER = 1e9
"""Instant to which the end of a ramp is held [s], as if for ever: thirty years."""

UNITS = {
    "field": "T", "gradient": "T/m", "voltage": "V", "temperature": "K", "load": "1", "origin": "s",
    "grip": "m", "turn": "rad",
}  # fmt: skip
"""SI unit of each family of channels, which is what stands before the first underscore."""

PATHS = ("grip", "turn")
"""Families of channels that are paths of grips."""

SMOOTH = 33
"""Samples of a smooth ramp: cubics between them are off by 1e-6 of its way, and by 0.5 % of its largest acceleration.

Half as many are off by 1e-5 and 2 %, twice as many by 5e-8 and 0.1 %.
"""

SAMPLES_PER_SECOND, SAMPLES_PER_PERIOD = 2000.0, 200
"""How finely a signal is sampled that something distorts: at least so often per second, and per period of its wave."""


@dataclass(frozen=True)
class Signal:
    """One channel: offset + amplitude sin(2 pi frequency t + phase) + scale * series(t).

    All numbers may be arrays with one value per world. The series is linear between its samples, unless it has slopes.

    Attributes:
        offset, amplitude: in the channel's SI unit.
        frequency: [Hz]. phase: [rad].
        times, values: samples [s] and their values (n,), or (n, worlds), or None. scale: factor on the series.
        slopes: of a path that is smooth, its derivatives at the samples (as the values), by which cubics join them.
    """

    offset: float | np.ndarray = 0.0
    amplitude: float | np.ndarray = 0.0
    frequency: float | np.ndarray = 0.0
    phase: float | np.ndarray = 0.0
    times: np.ndarray | None = None
    values: np.ndarray | None = None
    scale: float | np.ndarray = 1.0
    slopes: np.ndarray | None = None

    unit = ANY
    """SI unit that its numbers were stated in; no field, as only who takes it for a channel asks for it."""

    def __post_init__(self):
        if (self.times is None) != (self.values is None):
            raise InputError("a sampled signal needs both times and values", field="times")
        wave = ("offset", "amplitude", "frequency", "phase", "scale")
        for name in wave:
            if not np.all(np.isfinite(getattr(self, name))):
                raise InputError("a signal must be finite", field=name, value=getattr(self, name))
        counts = {np.size(getattr(self, n)) for n in wave} - {1}
        if len(counts) > 1:
            value = ", ".join(map(str, sorted(counts)))
            raise InputError("numbers of a signal are for different numbers of worlds", field="signal", value=value)
        if self.times is None or self.values is None:
            return
        times, values = np.asarray(self.times, float), np.asarray(self.values, float)
        if times.ndim != 1 or values.ndim not in (1, 2) or len(times) != len(values) or len(times) < 2:
            raise InputError(
                "a sampled signal needs at least two times and as many values",
                field="values",
                value=values.shape,
                allowed=f"shape {times.shape}",
            )
        if not np.all(np.isfinite(values)):
            raise InputError("a sampled signal must be finite", field="values", value=float("nan"))
        back = np.flatnonzero(~(np.diff(times) > 0))
        if len(back):
            raise InputError(
                f"times must increase; sample {back[0] + 1} does not", field="times", value=float(times[back[0] + 1])
            )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", values)
        if self.slopes is not None:
            object.__setattr__(self, "slopes", np.broadcast_to(np.asarray(self.slopes, float), values.shape))

    @property
    def numbers(self) -> tuple[float | np.ndarray | None, ...]:
        """All that it is made of, in the order of the attributes, whatever unit it was stated in."""
        return tuple(getattr(self, f.name) for f in fields(self))

    @property
    def is_zero(self) -> bool:
        """Whether the signal is zero at all times."""
        sampled = self.values is not None and np.any(self.scale) and np.any(self.values)
        return not (np.any(self.offset) or np.any(self.amplitude) or sampled)

    @property
    def constant(self) -> bool:
        """Whether it is the offset alone."""
        return self.times is None and not np.any(self.amplitude)

    def __call__(self, t: float | np.ndarray) -> np.ndarray:
        """The signal at times t [s]; arrays of worlds and of times broadcast."""
        value = self.offset + self.amplitude * np.sin(2 * math.pi * np.asarray(self.frequency) * t + self.phase)
        if self.times is not None and self.values is not None:
            value = value + np.asarray(self.scale) * self._sampled(t)
        return np.asarray(value, float)

    def _sampled(self, t) -> np.ndarray:
        """The series at times t; [..., worlds] where the worlds differ."""
        assert self.times is not None and self.values is not None
        if self.slopes is not None:
            return self._joined(t, 0)
        if self.values.ndim == 1:
            return np.interp(t, self.times, self.values)
        t = np.asarray(t, float)
        if t.ndim and t.shape[-1] == 1:
            t = t[..., 0]
        return np.stack([np.interp(t, self.times, column) for column in self.values.T], axis=-1)

    def _joined(self, t, order: int) -> np.ndarray:
        """The series at times t as its slopes join it, or as straight lines; or its first or second derivative.

        Beyond its ends it rests. At a sample a derivative is that of what comes before.
        """
        assert self.times is not None and self.values is not None
        at = np.asarray(t, float)
        at = at[..., 0] if at.ndim and at.shape[-1] == 1 and self.values.ndim == 2 else at
        if self.slopes is not None:
            out = self._cubics(np.clip(at, *self.times[[0, -1]]), order)
        elif order == 1:
            shape = (-1, *(1,) * (self.values.ndim - 1))
            i = np.clip(np.searchsorted(self.times, at), 1, len(self.times) - 1)
            out = (np.diff(self.values, axis=0) / np.diff(self.times).reshape(shape))[i - 1]
        else:
            out = np.zeros((*at.shape, *self.values.shape[1:]))
        if not order:
            return out
        inside = (at >= self.times[0]) & (at <= self.times[-1])
        return np.where(inside.reshape((*at.shape, *(1,) * (out.ndim - at.ndim))), out, 0.0)

    @cached_property
    def _cubics(self) -> CubicHermiteSpline:
        """The cubics by which slopes join the samples; solvers ask for them at every step."""
        assert self.times is not None and self.values is not None and self.slopes is not None
        return CubicHermiteSpline(self.times, self.values, self.slopes)

    def derivatives(self, t: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Its first and second derivative at times t [s], shaped like the signal; without the jumps at `kinks`."""
        omega = 2 * math.pi * np.asarray(self.frequency)
        angle = omega * t + self.phase
        out = [self.amplitude * omega * np.cos(angle), -self.amplitude * omega**2 * np.sin(angle)]
        if self.times is not None:
            out = [o + np.asarray(self.scale) * self._joined(t, k) for k, o in enumerate(out, 1)]
        return np.asarray(out[0], float), np.asarray(out[1], float)

    @property
    def smooth(self) -> bool:
        """Whether nothing but its ends makes its rate jump: a wave, or samples that cubics join."""
        return self.slopes is not None or not len(self.kinks)

    @property
    def kinks(self) -> np.ndarray:
        """Instants (k,) at which its rate jumps [s]: samples that lines join, and ends at which cubics do not rest."""
        if self.times is None or self.values is None or not np.any(self.scale):
            return np.zeros(0)
        if self.slopes is None:
            spans = np.diff(self.times).reshape(-1, *(1,) * (self.values.ndim - 1))
            jumps = np.diff(np.diff(self.values, axis=0) / spans, axis=0, prepend=0.0, append=0.0)
            most = np.abs(jumps).max(initial=0.0)
        else:
            jumps, most = self.slopes.copy(), np.abs(self.slopes).max(initial=0.0)
            jumps[1:-1] = 0.0
        return self.times[np.abs(jumps).reshape(len(self.times), -1).max(axis=1) > 1e-12 * most]

    def seen_from(self, start: float) -> "Signal":
        """The same signal on a clock that shows 0 at `start` [s] of this one."""
        phase = self.phase + 2 * math.pi * np.asarray(self.frequency) * start
        return replace(self, phase=phase, times=None if self.times is None else self.times - start)

    def sampled(self, duration: float) -> np.ndarray:
        """Times (n,) from 0 to `duration` [s], fine enough for the wave and with the series' own."""
        fastest = float(np.max(np.abs(self.frequency) * (np.asarray(self.amplitude) != 0)))
        rate = max(SAMPLES_PER_SECOND, SAMPLES_PER_PERIOD * fastest)
        duration = max(duration, 1.0 / rate)
        times = np.linspace(0.0, duration, max(2, math.ceil(duration * rate) + 1))
        own = times[:0] if self.times is None else self.times[(self.times >= 0) & (self.times <= duration)]
        return np.unique(np.concatenate([times, own]))

    @property
    def worlds(self) -> int:
        """Number of worlds that the signal tells apart."""
        arrays = (self.offset, self.amplitude, self.frequency, self.phase, self.scale)
        sampled = self.values.shape[1] if self.values is not None and self.values.ndim == 2 else 1
        return max(sampled, *(np.size(a) for a in arrays))

    def each(self) -> list["Signal"]:
        """The signals of its worlds, one of each."""
        count = self.worlds
        names = ("offset", "amplitude", "frequency", "phase", "scale")
        numbers = [np.broadcast_to(getattr(self, n), count).tolist() for n in names]
        values = [self.values] * count
        if self.values is not None and self.values.ndim == 2:
            values = list(np.broadcast_to(self.values, (len(self.values), count)).T)
        slopes = [self.slopes] * count
        if self.slopes is not None and self.slopes.ndim == 2:
            slopes = list(np.broadcast_to(self.slopes, (len(self.slopes), count)).T)
        parts = [dict(zip(names, mine, strict=True)) for mine in zip(*numbers, strict=True)]
        return [replace(self, **part, values=v, slopes=d) for part, v, d in zip(parts, values, slopes, strict=True)]


Value = float | str | np.ndarray | Signal
"""What a channel is given: a number, a quantity ("50 mT"), one number per world, or a signal."""


@named_arguments
def sine(amplitude: Any, frequency: Any, *, phase: Any = 0.0, offset: Any = 0.0) -> Signal:
    """offset + amplitude sin(2 pi frequency t + phase); frequency [Hz], phase [rad].

    Numbers are SI or quantities: sine("50 mT", "1 Hz").
    """
    level, height = (converted(v, ANY, "amplitude") for v in (offset, amplitude))
    often, shift = converted(frequency, "Hz", "frequency"), converted(phase, "rad", "phase")
    return _in(
        _unit(amplitude=height, offset=level), Signal(offset=level, amplitude=height, frequency=often, phase=shift)
    )


@named_arguments
def ramp(final: Any, duration: float | str, *, start: Any = 0.0, smooth: bool = False) -> Signal:
    """From `start` linearly to `final` within `duration` [s], then constant; SI or quantities: ramp("0.1 T", "1 s").

    With `smooth`, the path of a grip begins and ends at rest, without jumps of acceleration: s^3 (10 - 15 s + 6 s^2)
    at the share s of the duration, by cubics between `SMOOTH` samples.
    """
    final, start, duration = converted(final, ANY, "final"), converted(start, ANY, "start"), _seconds(duration)
    if not 0 < duration < FOREVER:
        allowed = f"above 0, below {FOREVER:g} s"
        raise InputError("a ramp needs a positive duration", field="duration", value=duration, allowed=allowed)
    s = np.linspace(0.0, 1.0, SMOOTH if smooth else 2)
    times, values = np.append(duration * s, FOREVER), np.append(s**3 * (10 - 15 * s + 6 * s**2) if smooth else s, 1.0)
    slopes = np.append(30 * (s * (1 - s)) ** 2 / duration, 0.0) if smooth else None
    signal = Signal(offset=start, times=times, values=values, scale=np.subtract(final, start), slopes=slopes)
    return _in(_unit(final=final, start=start), signal)


def _unit(**numbers: Any) -> str:
    """SI unit in which some of the numbers of a signal were stated, "SI" if none was.

    Raises:
        InputError: they were stated in units of two kinds.
    """
    units = [(n, v.unit) for n, given in numbers.items() for v in _each(given) if v.unit != ANY]
    for name, other in units:
        if other != units[0][1]:
            raise InputError("units of two kinds", field=name, value=other, allowed=units[0][1])
    return units[0][1] if units else ANY


def _each(value: Any) -> list[Quantity]:
    """The quantities in a number, or in nested sequences of them, one for each world."""
    if isinstance(value, list | tuple):
        return [one for v in value for one in _each(v)]
    return [value] if isinstance(value, Quantity) else []


def _in(unit: str, signal: Signal) -> Signal:
    """The signal, which remembers the unit of its numbers."""
    object.__setattr__(signal, "unit", unit)
    return signal


@named_arguments
def series(times: Any, values: Any, *, scale: Any = 1.0, smooth: bool = False) -> Signal:
    """Samples with linear interpolation; a run may not last longer than they do.

    With `smooth`, the path of a grip goes through them on a cubic spline, without jumps of its velocity.
    """
    signal = Signal(times=np.asarray(times, float), values=np.asarray(values, float), scale=scale)
    if not smooth or signal.times is None or signal.values is None:
        return signal
    return replace(signal, slopes=CubicSpline(signal.times, signal.values)(signal.times, 1))


def held_to(end: float, times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Samples, the last of them held to a second after `end` [s], which is no earlier."""
    return np.append(times, end + 1.0), np.append(values, values[-1:], axis=0)


def held_series(end: float, times: np.ndarray, values: np.ndarray) -> Signal:
    """The series of samples of which the last holds until after `end` [s]."""
    return series(*held_to(end, times, values))


def path_to(end: float, times: np.ndarray, values: np.ndarray) -> Signal:
    """The smooth path of a grip through samples, which goes on for one of their steps and then comes to rest.

    It is held until after `end` [s].
    """
    curve = CubicSpline(times, values)
    at = np.append(times, 2 * times[-1] - times[-2])
    return replace(held_series(max(end, at[-1]), at, curve(at)), slopes=np.append(curve(at, 1), 0.0))


def as_signal(value, unit: str = ANY, name: str = "") -> Signal:
    """The signal of a number or of a quantity, which must have that unit.

    Raises:
        InputError: a quantity, or a signal of quantities, of another kind.
    """
    if not isinstance(value, Signal):
        return Signal(offset=converted(value, unit, name or unit))
    if value.slopes is not None and name.partition("_")[0] not in PATHS:
        allowed = "the path of a grip; other channels are linear between their samples"
        raise InputError("only paths are smooth", field=name or unit, value="smooth", allowed=allowed)
    if value.unit != unit and ANY not in (unit, value.unit):
        allowed = "a factor on the loads, such as ramp(1, '1 s')" if name == "load" else f"a signal in {unit}"
        raise InputError("wrong unit", field=name or unit, value=value.unit, allowed=allowed)
    return value


def _seconds(duration: float | str) -> float:
    return converted(duration, "s", "duration")


class Drive:
    """Named channels in time, the same object for a simulation and a recording.

    Args:
        field: flux density at the origin, three numbers or signals [T]; numbers may be quantities, "50 mT".
        gradient: 3 x 3 nested numbers or signals, dB_i/dx_j [T/m].
        voltage: a number or signal [V], or one for each electrode group.
        temperature: rise above the rest state [K]. load: load factor [-]. origin: age of the device at the start [s].
        sources: magnets, coils and tables around the device (`sources`), whose field is added at every place.
        grips: path of each grip that moves along a direction (`Sheet.grip`), by its name [m]. turns: of each that turns
            about an axis [rad].

    Raises:
        InputError: wrong number of components, times that do not increase, values that are not finite.
    """

    @named_arguments
    def __init__(
        self,
        *,
        field: Sequence[Value] = (0.0, 0.0, 0.0),
        gradient: Sequence[Sequence[Value]] | None = None,
        voltage: Value | Sequence[Value] = 0.0,
        temperature: Value = 0.0,
        load: Value = 0.0,
        origin: Value = 0.0,
        sources: Sequence["Source | Sequence[Source]"] = (),
        grips: Mapping[str, Value] | None = None,
        turns: Mapping[str, Value] | None = None,
    ):
        if not isinstance(field, Sequence | np.ndarray) or isinstance(field, str) or len(field) != 3:
            raise InputError("a field has three components", field="field", value=field, allowed="(x, y, z)")
        gradient = gradient if gradient is not None else ((0.0,) * 3,) * 3
        if len(gradient) != 3 or any(len(row) != 3 for row in gradient):
            raise InputError("a field gradient has 3 x 3 components", field="gradient", allowed="dB_i/dx_j [T/m]")
        voltages = list(voltage) if isinstance(voltage, (list, tuple)) else [voltage]
        values: list = [*field, *(g for row in gradient for g in row), temperature, load, origin, *voltages]
        names = [*CHANNELS, *(f"voltage_{i}" for i in range(len(voltages)))]
        for family, paths in zip(PATHS, (grips, turns), strict=True):
            if paths is not None and not isinstance(paths, Mapping):
                field = f"{family}s"
                raise InputError("paths go by the names of grips", field=field, value=paths, allowed='{"top": "5 mm"}')
            names += [f"{family}_{n}" for n in paths or ()]
            values += (paths or {}).values()
        self.signals = {n: as_signal(v, UNITS[n.partition("_")[0]], n) for n, v in zip(names, values, strict=True)}
        self._place(sources)

    def _place(self, sources: Sequence["Source | Sequence[Source]"]) -> None:
        if sources:
            from origami_sim.drive.sources import NUMBERS, flattened  # which need signals

            found = flattened(sources)
            self.placed = tuple((s.kind, s.table) for s in found)
            for k, source in enumerate(found):
                self.signals |= {f"source_{k}_{n}": s for n, s in zip(NUMBERS, source.numbers, strict=True)}

    placed: tuple[tuple[str, "FieldTable | None"], ...] = ()
    """Kind and table of each source."""

    grid: np.ndarray | None = None
    """Instants at which what distorts the drive samples it [s]; None: as finely as a motion asks for."""

    def on(self, grid: np.ndarray) -> "Drive":
        """The same drive for a slow motion, which is sampled at these instants [s] and eight times in between."""
        out = self.replace()
        fine = np.interp(np.arange(8 * (len(grid) - 1) + 1) / 8, np.arange(len(grid)), grid)
        out.grid = fine if len(fine) > 1 else np.array([grid[0], grid[0] + 1.0])
        return out

    def with_signals(self, signals: Mapping[str, Signal]) -> "Drive":
        """The same sources with these signals for channels."""
        out = object.__new__(Drive)
        out.signals, out.grid, out.placed = dict(signals), self.grid, self.placed
        return out

    def with_sources(self, sources: Sequence["Source | Sequence[Source]"]) -> "Drive":
        """The same channels with these sources of a field in place of its own."""
        out = self.with_signals({n: s for n, s in self.signals.items() if not n.startswith("source_")})
        out.placed = ()
        out._place(sources)
        return out

    @property
    def levels(self) -> list[str]:
        """Channels that say how strong something is, and not where a source is, how large, or how old the device."""
        return [n for n in self.signals if n != "origin" and (not n.startswith("source_") or n.endswith("_strength"))]

    @property
    def fingerprint(self) -> bytes:
        """What its sources are, besides their signals."""
        return b"".join(
            kind.encode() + (b"" if t is None else b"".join(a.tobytes() for a in (*t.axes, t.values)))
            for kind, t in self.placed
        )

    @property
    def constant(self) -> bool:
        """Whether no signal changes in time."""
        return all(s.constant for s in self.signals.values())

    @property
    def groups(self) -> int:
        """Number of electrode groups."""
        return sum(n.startswith("voltage_") for n in self.signals)

    def __getitem__(self, channel: str) -> Signal:
        return self.signals[channel]

    def field(self, t: float) -> np.ndarray:
        """Uniform part of the flux density at time t [T]: shape (3,) or (3, worlds)."""
        return np.stack(np.broadcast_arrays(*(self.signals[c](t) for c in CHANNELS[:3])))

    def series(self, channels: Sequence[str], duration: float) -> tuple[np.ndarray, np.ndarray]:
        """Common times (n,) up to `duration` [s], or the grid, and these channels there [channel, n, world]."""
        times = self.grid
        if times is None:
            times = np.unique(np.concatenate([self.signals[c].sampled(duration) for c in channels]))
        values = [np.asarray(self.signals[c](times[:, None])).reshape(len(times), -1) for c in channels]
        return times, np.stack(np.broadcast_arrays(*values))

    def held(self, time: float) -> "Drive":
        """The drive held at its value at one instant [s], one number for all worlds or for each."""
        return self.replace(**{n: np.atleast_1d(np.squeeze(s(time))) for n, s in self.signals.items()})

    @property
    def worlds(self) -> int:
        """Number of worlds that the drive tells apart (1 if none differs)."""
        return max(s.worlds for s in self.signals.values())

    def replace(self, **signals: Value) -> "Drive":
        """The same drive with other signals in the channels named; paths of grips may be new ones.

        Raises:
            InputError: there is no such channel.
        """
        for name in signals:
            if name not in self.signals and name.partition("_")[0] not in PATHS:
                raise InputError("no such drive channel", field="channel", value=name, allowed=", ".join(self.signals))
        new = {n: as_signal(s, UNITS.get(n.partition("_")[0], ANY), n) for n, s in signals.items()}
        return self.with_signals({**self.signals, **new})

    @property
    def end(self) -> float:
        """Time at which the first sampled channel ends [s]; infinite if none is sampled."""
        return min((float(s.times[-1]) for s in self.signals.values() if s.times is not None), default=math.inf)

    def require(self, duration: float):
        """Raises InputError naming the channel if a sampled channel ends before `duration` [s]."""
        for name, s in self.signals.items():
            if s.times is not None and s.times[-1] < duration * (1 - 1e-12):
                raise InputError(
                    "the drive ends before the run does",
                    field=name,
                    value=float(s.times[-1]),
                    allowed=f"samples up to {duration:g} s",
                )

    def slots(self) -> dict[str, np.ndarray]:
        """Wave parameters as arrays [channel, world or 1], by the kernels' names."""
        out = {}
        for name, value in (
            ("offset", lambda s: s.offset),
            ("amplitude", lambda s: s.amplitude),
            ("angular_frequency", lambda s: 2 * math.pi * np.asarray(s.frequency)),
            ("phase", lambda s: s.phase),
            ("scale", lambda s: s.scale if s.times is not None else 0.0),
        ):
            rows = [value(s) for s in self.signals.values()]
            out[name] = np.empty((len(rows), max(map(np.size, rows))))
            for row, own in zip(out[name], rows, strict=True):
                row[:] = own
        return out

    def samples(self) -> tuple[np.ndarray, np.ndarray]:
        """Knot times of all sampled channels together, and the values of every channel there [channel, knot, world].

        The last axis has length 1 if no world differs.
        """
        sampled = [s.times for s in self.signals.values() if s.times is not None]
        times = np.unique(np.concatenate(sampled)) if sampled else np.zeros(0)
        shapes = [s.values.shape for s in self.signals.values() if s.values is not None]
        worlds = max((shape[1] for shape in shapes if len(shape) == 2), default=1)
        values = np.zeros((len(self.signals), len(times), worlds))
        for k, s in enumerate(self.signals.values()):
            if s.times is not None:
                values[k] = s._sampled(times).reshape(len(times), -1)
        return times, values
