"""Magnets, coils and tables around a recorded device, as its sidecar states them."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from origami_sim.drive import Drive, Signal, held_to, series
from origami_sim.drive.drive_file import read_signal, read_sources, stated_in
from origami_sim.drive.sources import Source
from origami_sim.errors import InputError
from origami_sim.recording.recording import Recording
from origami_sim.recording.table import Table
from origami_sim.units import si_unit, unit_factor


def columns_of(stated: Any) -> Iterator[str]:
    """Columns that `{ column = "..." }` names anywhere in what a sidecar states."""
    left = [stated]
    while left:  # a file may nest deeper than calls can
        part = left.pop()
        if isinstance(part, dict):
            if isinstance(part.get("column"), str):
                yield part["column"]
            part = list(part.values())
        if isinstance(part, list):
            left += reversed(part)


def placed_sources(stated: Any, table: Table, times: np.ndarray, path: Path) -> tuple[Source, ...]:
    """The sources, on the recording's clock.

    Args:
        stated: the list of the sidecar. table, times: of the recording [s]. path: the sidecar.

    Raises:
        InputError: what `read_sources` refuses, a column of another unit or with holes, or a wave that does not cover
            the recording.
    """

    def read(value: Any, unit: str, field: str, path: Path) -> Any:
        if isinstance(value, dict) and "column" in value:
            return _measured(value, unit, field, table, times, path)
        signal = read_signal(value, unit, field, path)
        if not isinstance(signal, Signal) or signal.times is None or signal.values is None:
            return signal
        own = spanning(signal.times, times)
        if own[0] > times[0] or own[-1] < times[-1]:
            raise InputError(
                "does not cover the recording",
                file=path,
                field=field,
                value=[float(own[0]), float(own[-1])],
                allowed=f"samples from {times[0]:g} s to {times[-1]:g} s",
            )
        own, values = _lasting(own, signal.values)
        return replace(signal, times=own, values=values)

    with stated_in(path, "cannot be stated so", "drive.sources"):
        return read_sources(stated, path, read=read)


def _measured(value: dict[str, Any], unit: str, field: str, table: Table, times: np.ndarray, path: Path) -> Signal:
    """A number that was measured for every frame."""
    column, given = value["column"], value.get("unit", unit)
    allowed = f'{{ column = "...", unit = "..." }}, with a unit of {unit}'
    if set(value) - {"column", "unit"} or not isinstance(column, str) or not isinstance(given, str):
        raise InputError("is no column", file=path, field=field, value=value, allowed=allowed)
    factor = 1.0 if given == unit else unit_factor(given, file=path, field=field)
    if given != unit and si_unit(given) != unit:
        raise InputError("the column has another unit", file=path, field=field, value=given, allowed=allowed)
    values = table.stack([column]) * factor
    lost = np.flatnonzero(~np.isfinite(values))
    if lost.size:
        place = table.position(int(lost[0]))
        raise InputError(f"the column misses a value at {place}", file=table.file, field=column)
    return series(*_lasting(times, values))


def _lasting(times: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Samples with the last one held for as long again: a run may end after the last frame."""
    return held_to(2 * times[-1] - times[0], times, values)


def spanning(own: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Times (m,) of a drive, from and to a recording's first and last where only a clock's rounding parts them [s]."""
    out, rounding = np.array(own, float), 1e-9 * np.max(np.abs(times[[0, -1]]))
    for end in (0, -1):
        if abs(out[end] - times[end]) <= rounding:
            out[end] = times[end]
    return out


def surrounded(drive: Drive, recording: Recording) -> Drive:
    """The drive with the sources that a recording states in place of its own, from the first frame on."""
    if not recording.sources:
        return drive
    return drive.with_sources([s.seen_from(float(recording.times[0])) for s in recording.sources])
