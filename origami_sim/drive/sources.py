"""Magnets, coils and tables around a device, which make a field that differs from place to place."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from origami_sim.drive.drive import Signal, Value, as_signal
from origami_sim.drive.gridded import FieldTable
from origami_sim.errors import InputError
from origami_sim.quantities import converted

KINDS = ("dipole", "coil", "magnet", "table")
"""Kinds of sources, by the numbers of the kernels."""

NUMBERS = ("strength", "x", "y", "z", "axis_x", "axis_y", "axis_z", "radius", "length")
"""What a source has, each of them a signal in time: moment [A m^2], ampere-turns [A], remanence [T] or a factor of a
table; the place of its middle, or by how much a table is shifted [m]; its direction, of any length; its size [m]."""

STRENGTHS: dict[str, tuple[str, str]] = {
    "dipole": ("moment", "A m^2"),
    "coil": ("current", "A"),
    "magnet": ("remanence", "T"),
    "table": ("factor", "1"),
}
"""Name and unit of the strength of each kind."""

Vector = Sequence[Value]


@dataclass(frozen=True)
class Source:
    """Something that makes a field; made by `dipole`, `coil`, `coil_pair`, `magnet` and `field_table`.

    Attributes:
        kind: one of `KINDS`. numbers: a signal for each of `NUMBERS`. table: of a table.
    """

    kind: str
    numbers: tuple[Signal, ...]
    table: FieldTable | None = None

    def seen_from(self, start: float) -> "Source":
        """The same source on a clock that shows 0 at `start` [s] of this one."""
        return replace(self, numbers=tuple(s.seen_from(start) for s in self.numbers))


def dipole(moment: Value, *, position: Vector = (0, 0, 0), axis: Vector = (0, 0, 1)) -> Source:
    """A point dipole of that moment [A m^2]; what is not round or long is one from three of its sizes on.

    Args:
        position: its place [m]. axis: its direction, of any length. All are numbers, quantities or signals: a path is
            three of them.
    """
    return _source("dipole", moment, position, axis, 0.0, 0.0)


def magnet(
    remanence: Value, *, radius: Value, length: Value, position: Vector = (0, 0, 0), axis: Vector = (0, 0, 1)
) -> Source:
    """A cylinder magnetised along its axis, exactly: a permanent magnet that is fixed, or moves on a path.

    Args:
        remanence: [T]. radius, length: of the cylinder [m]. position: of its middle [m]. axis: from its south to its
            north pole, of any length. All are numbers, quantities or signals in time.
    """
    return _source("magnet", remanence, position, axis, radius, length)


def coil(
    current: Value,
    *,
    radius: Value,
    length: Value = 0.0,
    turns: float = 1,
    position: Vector = (0, 0, 0),
    axis: Vector = (0, 0, 1),
) -> Source:
    """A round coil: a loop, or a winding of one layer of some length.

    Args:
        current: in the wire [A], positive round the axis by the right hand. radius: [m].
        length: of the winding along the axis [m]. turns: number of turns. position: of its middle [m].
        axis: its direction, of any length. All but the turns are numbers, quantities or signals in time.
    """
    if not (np.isfinite(turns) and turns > 0):
        raise InputError("a coil needs turns", field="turns", value=turns, allowed="> 0")
    signal = as_signal(current, "A")
    ampere_turns = Signal(
        np.asarray(signal.offset) * turns,
        np.asarray(signal.amplitude) * turns,
        signal.frequency,
        signal.phase,
        signal.times,
        signal.values,
        np.asarray(signal.scale) * turns,
    )
    return _source("coil", ampere_turns, position, axis, radius, length)


def coil_pair(
    current: Value,
    *,
    radius: float | str,
    distance: float | str | None = None,
    length: Value = 0.0,
    turns: float = 1,
    position: Sequence[float | str] = (0, 0, 0),
    axis: Sequence[float] = (0, 0, 1),
    opposed: bool = False,
) -> tuple[Source, Source]:
    """Two equal coils on one axis.

    Args:
        distance: between their middles [m]; default: the radius (Helmholtz, an even field), or sqrt(3) of it for
            opposed currents (Maxwell, an even gradient).
        opposed: whether the current of the upper one is turned round. The rest as for `coil`; position: of the middle.
    """
    size = float(converted(radius, "m", "radius"))
    apart = size * (math.sqrt(3.0) if opposed else 1.0) if distance is None else converted(distance, "m", "distance")
    middle, along = np.asarray(converted(list(position), "m", "position"), float), _direction(axis)
    given = {"radius": size, "length": length, "turns": turns}
    low, high = (coil(current, position=tuple(middle + s * 0.5 * apart * along), axis=axis, **given) for s in (-1, 1))
    if opposed:
        high = coil(current, position=tuple(middle + 0.5 * apart * along), axis=tuple(-along), **given)
    return low, high


def field_table(table: FieldTable | str | Path, *, factor: Value = 1.0, position: Vector = (0, 0, 0)) -> Source:
    """A field on a grid, such as a measured map or one that was computed by another program.

    Args:
        table: the table, or its file (see `FieldTable.read`). factor: on the table, in time.
        position: by how much it is shifted [m].
    """
    if not isinstance(table, FieldTable):
        table = FieldTable.read(table)
    return _source("table", factor, position, (0, 0, 1), 0.0, 0.0, table)


def _direction(axis: Sequence[float]) -> np.ndarray:
    a = np.asarray(axis, float)
    if a.shape != (3,) or not np.all(np.isfinite(a)) or not np.linalg.norm(a) > 0:
        raise InputError("a source needs a direction", field="axis", value=list(axis), allowed="x, y, z, not all zero")
    return a / np.linalg.norm(a)


def _source(
    kind: str, strength: Value, position: Vector, axis: Vector, radius: Value, length: Value, table=None
) -> Source:
    for name, value in (("position", position), ("axis", axis)):
        if len(value) != 3:
            raise InputError("a place or direction has three components", field=name, value=len(value), allowed="3")
    if not any(isinstance(a, Signal) for a in axis):
        _direction([float(np.max(np.abs(np.asarray(a, float)))) for a in axis])
    word, unit = STRENGTHS[kind]
    given = [(word, strength, unit), *((n, v, "m") for n, v in zip("xyz", position, strict=True))]
    given += [(f"axis_{n}", v, "1") for n, v in zip("xyz", axis, strict=True)]
    given += [("radius", radius, "m"), ("length", length, "m")]
    signals = tuple(as_signal(v, u) if not isinstance(v, str) else as_signal(converted(v, u, n)) for n, v, u in given)
    for name, signal, needed in (
        ("radius", signals[7], kind in ("coil", "magnet")),
        ("length", signals[8], kind == "magnet"),
    ):
        least = _least(signal)
        if (needed and not least > 0) or least < 0:
            raise InputError(f"a {kind} needs a positive size", field=name, value=least, allowed="> 0 m")
    return Source(kind, signals, table)


def _least(s: Signal) -> float:
    """The smallest value of a signal."""
    values = [0.0] if s.values is None else [np.min(np.asarray(s.scale) * np.min(s.values, axis=0)), 0.0]
    low = np.asarray(s.offset) - np.abs(np.asarray(s.amplitude)) + (values[0] if s.values is not None else 0.0)
    return float(np.min(low))


def flattened(sources: Sequence[Any]) -> tuple[Source, ...]:
    """Sources, and those in pairs, one after the other; InputError for what is none."""
    out: list[Source] = []
    for s in sources:
        if isinstance(s, Source):
            out.append(s)
        elif isinstance(s, (list, tuple)):
            out += flattened(s)
        else:
            allowed = "dipole(...), magnet(...), coil(...), coil_pair(...), field_table(...)"
            raise InputError("is no source of a field", field="sources", value=repr(s)[:60], allowed=allowed)
    return tuple(out)
