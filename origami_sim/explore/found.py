"""Where a device comes to rest, or how it moves, at many points of its design at once."""

import hashlib
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from origami_sim.device.device import built, lasting, valued
from origami_sim.drive import Drive, Signal
from origami_sim.effects import SHELLS, get
from origami_sim.errors import InputError, nearest
from origami_sim.model import Model, Parameters, State
from origami_sim.model.contact import engaged
from origami_sim.observation.gait import advances, period, summary
from origami_sim.quantities import ANY, Quantity, converted
from origami_sim.solve.batch import Batch
from origami_sim.solve.motion.dynamics import Trajectory, simulate
from origami_sim.solve.motion.frames import check_frames
from origami_sim.solve.statics.equilibria import Equilibrium, equilibrium
from origami_sim.solve.timestep import stable_step

Build = Callable[..., Any]
Point = Mapping[str, Any]

TOGETHER = 64
"""Worlds of one batch: enough for all cores of a desk, and a sweep that is interrupted loses no more than these.

Half loses less and keeps 32 cores busy, double runs as long on fewer than 64 cores.
"""


@dataclass(frozen=True)
class Way:
    """How a device is found: at rest, or in motion.

    Attributes:
        duration: of the motion from the reference state [s]; None: the equilibrium. rate: its frames per second.
        time: instant of the drive at which the equilibrium is meant [s]; None: when the drive has come to its end.
        follow: equilibria on the way there, along the drive; more where it could settle into another one.
        dt: step of motions [s]; None: the stable one. threads: CPU threads; None: all cores.
    """

    duration: float | None = None
    rate: float = 60.0
    time: float | None = None
    follow: int = 1
    dt: float | None = None
    threads: int | None = None

    def __post_init__(self):
        check_frames(1.0 if self.duration is None else self.duration, self.rate)


@dataclass
class Found:
    """A device as it was found at one point.

    Attributes:
        model, parameters, drive: of one world.
        x: [N, 3] positions [m]. angles: [C + Q] continuous hinge angles [rad], creases first: at rest, or at the end.
        motion: its frames, or None. equilibrium: or where the search for it stopped, or None.
        failure: why it was not found; "" if it was. time: of the drive [s]; None: at its end.
    """

    model: Model = field(repr=False)
    parameters: Parameters = field(repr=False)
    drive: Drive = field(repr=False)
    x: np.ndarray = field(repr=False)
    angles: np.ndarray
    motion: Trajectory | None = field(default=None, repr=False)
    equilibrium: Equilibrium | None = field(default=None, repr=False)
    failure: str = ""
    time: float | None = None

    @property
    def creases(self) -> np.ndarray:
        """Fold angles of the creases [C] [rad], valley positive."""
        return self.angles[: len(self.model.creases)]

    def angle(self, crease: int | str) -> float:
        """Fold angle of a crease [rad] by its number or name; the mean of those that share a name.

        Raises:
            InputError: there is no such crease.
        """
        names = [self.model.name("crease", c) for c in range(len(self.model.creases))]
        own = [c for c, n in enumerate(names) if crease in (c, n)]
        if not own:
            raise InputError(
                f"there is no such crease{nearest(str(crease), names)}",
                field="crease",
                value=crease,
                allowed=", ".join(dict.fromkeys(names)),
            )
        return float(np.mean(self.angles[own]))

    def mass(self) -> float:
        """Of everything [kg]."""
        return float(self.parameters["body", "mass"].sum() or self.parameters["inertia", "mass"].sum())

    def reactions(self) -> np.ndarray:
        """[N, 3] forces that supports exert on held axes [N], of what is at rest: minus all other forces there.

        Raises:
            InputError: rigid panels, which share them.
        """
        if self.model.panels == "rigid":
            raise InputError("rigid panels share their supports", field="panels", value="rigid", allowed="elastic")
        start = State.at_rest(self.model, position=self.x)
        start.angles = self.angles[:, None].copy()
        batch = Batch(self.model, self.parameters, self.drive, start, threads=1)
        force = batch.total_force(lasting(self.drive) if self.time is None else self.time)[:, 0]
        return np.where(self.model.free > 0, 0.0, -force)

    def moved(self, axis: str = "x") -> float:
        """How far the centre of mass came along an axis, "x", "y" or "z" [m]."""
        if axis not in ("x", "y", "z"):
            raise InputError("there is no such axis", field="axis", value=axis, allowed="x, y, z")
        mass = self.parameters["inertia", "mass"]
        start = self.model.position if self.motion is None else self.motion.x[0, :, 0]
        return float((mass * (self.x - start)).sum(axis=0)["xyz".index(axis)] / mass.sum())

    def stride(self, axis: str = "x") -> float:
        """Stride of a periodic gait [m per cycle]: mean way of the centre of mass along an axis, once it is steady.

        A cycle is the period of the drive, so that strides at different frequencies compare. The first two cycles do
        not count where more than three are whole. nan where the drive has no period, or no cycle is whole.

        Raises:
            InputError: there is no such axis; the device is at rest, which has no gait.
        """
        if axis not in ("x", "y", "z"):
            raise InputError("there is no such axis", field="axis", value=axis, allowed="x, y, z")
        if self.motion is None:
            raise InputError("what is at rest has no stride", field="way", value=None, allowed="Way(duration=...)")
        lasts = period(self.drive)
        each = np.zeros((0, 3)) if lasts is None else advances(self.motion, lasts)
        return summary(each[:, "xyz".index(axis)])["mean"] if len(each) else float("nan")


Measure = Callable[[Found], float]


def angle(crease: int | str) -> Measure:
    """The measure that is the fold angle of a crease [rad]."""
    return _in("rad", lambda found: found.angle(crease))


def moved(axis: str = "x") -> Measure:
    """The measure that is the way of the centre of mass along an axis [m]."""
    return _in("m", lambda found: found.moved(axis))


def stride(axis: str = "x") -> Measure:
    """The measure that is the stride of a periodic gait along an axis [m per cycle], see `Found.stride`."""
    return _in("m", lambda found: found.stride(axis))


def _in(unit: str, measure: Measure) -> Measure:
    """A measure that knows its unit, so that a target of another kind is refused."""
    measure.unit = unit  # pyright: ignore[reportFunctionMemberAccess]
    return measure


def unit_of(measure: Measure) -> str:
    """SI unit of a measure; "SI" for any, where nobody stated it."""
    return getattr(measure, "unit", ANY)


def number(build: Build, value: Any, name: str) -> Any:
    """A value of an argument of `build` in SI; words stay words, where the argument has one as its default.

    Raises:
        InputError: a quantity of another kind than the argument's default, true or false for a number.
    """
    try:
        stated = inspect.signature(build).parameters.get(name)
    except (TypeError, ValueError):  # built in
        stated = None
    default, unit = valued(stated.default) if stated is not None else (None, ANY)
    if isinstance(default, float) and isinstance(value, (str, bool, np.bool_)):
        return float(converted(value, unit, name))
    if isinstance(value, str):
        try:
            return float(converted(value, ANY, name))
        except InputError:
            return value
    return value.item() if isinstance(value, np.generic) else value


@dataclass(frozen=True)
class Device:
    """A device at one point, before it is found."""

    model: Model
    parameters: Parameters
    drive: Drive

    def touching(self) -> "Device":
        """The device with contact between panels of which nothing was stated."""
        return Device(*engaged(self.model, self.parameters), self.drive)


def at(build: Build, point: Point) -> Device:
    """The device at a point; other arguments of `build` have their defaults, quantities as numbers.

    Raises:
        InputError: an argument that `build` has not, a `build` that returns something else.
    """
    signature = inspect.signature(build)
    try:
        signature.bind(**point)
    except TypeError as e:
        raise InputError(f"build() does not take this point ({e})", field="unknowns", value=dict(point)) from None
    others = {n: valued(p.default) for n, p in signature.parameters.items() if isinstance(p.default, str)}
    given = {**{n: Quantity(v, unit) for n, (v, unit) in others.items() if isinstance(v, float)}, **point}
    model, parameters, drive, *_ = built(build(**given), getattr(build, "__module__", None) or "build")
    return Device(model, parameters, drive)


def find(build: Build, points: Sequence[Point], way: Way | None = None) -> list[Found]:
    """The device at every point, in their order. Motions of devices of the same topology are one batch of worlds.

    Raises:
        InputError: what `build`, `simulate` and `equilibrium` refuse.
    """
    return found([at(build, p) for p in points], way or Way())


def found(devices: Sequence[Device], way: Way) -> list[Found]:
    """See `find`."""
    if way.duration is None:
        return [_at_rest(d, way) for d in devices]
    out: list[Found | None] = [None] * len(devices)
    groups: dict[str, list[int]] = {}
    for k, d in enumerate(devices):
        groups.setdefault(_alike(d), []).append(k)
    for group in groups.values():
        for first in range(0, len(group), TOGETHER):
            part = group[first : first + TOGETHER]
            for k, one in zip(part, _moving([devices[k] for k in part], way), strict=True):
                out[k] = one
    return [f for f in out if f is not None]


def _at_rest(d: Device, way: Way) -> Found:
    end = lasting(d.drive) if way.time is None else way.time
    state, rest = None, None
    for time in end * np.arange(1, way.follow + 1) / way.follow:
        rest = equilibrium(d.model, d.parameters, d.drive, time=float(time), state=state)
        if not rest.converged:
            break
        state = rest.state
    assert rest is not None
    failure = "" if rest.converged else rest.message
    d = d.touching() if rest.touching else d
    return Found(d.model, d.parameters, d.drive, rest.x, rest.angles, equilibrium=rest, failure=failure, time=end)


def _alike(d: Device) -> str:
    """Digest of what worlds of one batch must share: all of the model but positions, and the instants of the drive.

    Shells keep their reference shape, magnets that act on each other their neighbours, and grips the places of their
    nodes, in the model.
    """
    h = hashlib.sha256()
    fixed = any(get(e).family in SHELLS or get(e).interacts for e in d.model.laws) or bool(len(d.model.grips))
    for f in fields(d.model):
        if f.name != "position" or fixed:
            value = getattr(d.model, f.name)
            h.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())
    for name, s in d.drive.signals.items():
        h.update(name.encode() + (b"" if s.times is None else s.times.tobytes()))
        h.update(b"smooth" * (s.slopes is not None))
    h.update(d.drive.fingerprint)
    return h.hexdigest()


def _moving(devices: Sequence[Device], way: Way) -> list[Found]:
    """Motions of devices that are alike, as worlds of one batch."""
    model = devices[0].model
    parameters = Parameters.join([d.parameters for d in devices])
    drive = _joined([d.drive for d in devices])
    state, dt = None, way.dt
    if any(not np.array_equal(d.model.position, model.position) for d in devices):
        state = State.join([State.at_rest(d.model) for d in devices])
        steps = [stable_step(d.model, d.parameters).dt for d in devices]
        if dt is None and np.isfinite(steps[0]):
            dt = min([*steps, stable_step(model, parameters).dt])
    elif parameters.worlds == 1 and drive.worlds == 1:
        devices = [devices[0]] * len(devices)
    assert way.duration is not None
    motion = simulate(
        model, parameters, drive, duration=way.duration, rate=way.rate, dt=dt, state=state, threads=way.threads
    )
    if "touch" in motion.model.laws and "touch" not in model.laws:
        devices = [d.touching() for d in devices]
    worlds = motion.x.shape[2]
    return [_one(motion, d, w % worlds) for w, d in enumerate(devices)]


def _joined(drives: Sequence[Drive]) -> Drive:
    """The drives of several worlds, sampled at the same instants, as one."""

    def together(values: list) -> Any:
        same = all(np.array_equal(v, values[0]) for v in values[1:])
        return values[0] if same else np.array([float(v) for v in values])

    out = {}
    for name, first in drives[0].signals.items():
        signals = [d.signals[name] for d in drives]
        waves = {n: together([getattr(s, n) for s in signals]) for n in ("offset", "amplitude", "frequency", "phase")}
        values = first.values
        if values is not None:
            each = [np.asarray(s.values) for s in signals]
            values = each[0] if all(np.array_equal(v, each[0]) for v in each[1:]) else np.stack(each, axis=1)
        scale = together([s.scale for s in signals])
        out[name] = Signal(**waves, times=first.times, values=values, scale=scale)
        if first.slopes is not None:  # of a path
            slopes = np.stack([np.asarray(s.slopes) for s in signals], axis=1)
            out[name] = replace(out[name], slopes=slopes if np.ndim(np.asarray(values)) == 2 else slopes[:, 0])
    return drives[0].replace(**out)


def _one(motion: Trajectory, d: Device, w: int) -> Found:
    """One world of a motion."""
    by_world = {n: {k: v[:, [w]] for k, v in getattr(motion, n).items()} for n in ("energies", "work")}
    own = replace(
        motion,
        model=d.model,
        parameters=d.parameters,
        drive=d.drive,
        x=motion.x[:, :, [w]],
        v=motion.v[:, :, [w]],
        angles=motion.angles[:, :, [w]],
        gaps=motion.gaps[:, :, [w]],
        contact_forces=motion.contact_forces[:, :, [w]],
        grip_wrenches=None if motion.grip_wrenches is None else motion.grip_wrenches[:, :, [w]],
        failures=[replace(f, world=0) for f in motion.failures if f.world == w],
        state=motion.state.select(np.array([w])),
        energy_error=None if motion.energy_error is None else motion.energy_error[[w]],
        **by_world,
    )
    failure = str(own.failures[0]) if own.failures else ""
    return Found(
        d.model,
        d.parameters,
        d.drive,
        own.x[-1, :, 0],
        own.angles[-1, :, 0],
        motion=own,
        failure=failure,
        time=float(own.times[-1]),
    )
