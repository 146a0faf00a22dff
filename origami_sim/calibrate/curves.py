"""Measured curves: columns of CSV files in SI, and what a curve must be before anything is fitted to it."""

import csv
import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from origami_sim.errors import InputError
from origami_sim.files import read_bytes
from origami_sim.units import UNITS, unit_factor


def read_columns(path: str | Path, columns: Mapping[str, tuple[str | None, str]]) -> dict[str, np.ndarray]:
    """Columns of a CSV file in SI.

    Args:
        path: the file; its first line names the columns.
        columns: name -> (unit, dimension), the dimension a key of `origami_sim.units.UNITS`; a unit None is refused,
            because a calibration must not guess it.

    Returns:
        (n,) values [SI] by name.

    Raises:
        InputError: no such file or column, a unit that is missing or of another dimension, a cell that is not a number.
    """
    path = Path(path)
    factors = {}
    for name, (unit, dimension) in columns.items():
        if unit is None:
            allowed = ", ".join(UNITS[dimension])
            raise InputError("the unit of a column is not stated", file=path, field=name, allowed=allowed)
        factors[name] = unit_factor(unit, dimension=dimension, file=path, field=name)
    try:
        rows = list(csv.reader(io.StringIO(read_bytes(path).decode("utf-8"), newline="")))
    except (UnicodeDecodeError, csv.Error) as e:
        raise InputError(f"cannot be read ({e})", file=path) from None
    header = [cell.strip() for cell in rows[0]] if rows else []
    out = {}
    for name in columns:
        if name not in header:
            raise InputError("there is no such column", file=path, field=name, allowed=", ".join(header) or "a header")
        k = header.index(name)
        values = []
        for line, row in enumerate(rows[1:], start=2):
            if not row:
                continue
            try:
                values.append(float(row[k]))
            except (ValueError, IndexError):
                cell = row[k] if k < len(row) else ""
                raise InputError(f"line {line} is not a number", file=path, field=name, value=cell) from None
        out[name] = np.array(values) * factors[name]
    return out


def checked_curve(x, y, names: tuple[str, str], fewest: int, *, strict: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """A checked curve, x rising."""
    x, y = np.asarray(x, float), np.asarray(y, float)
    if x.ndim != 1 or x.shape != y.shape:
        raise InputError("a curve has as many values of one kind as of the other", field=names[1], value=y.shape,
                         allowed=f"{x.shape}")  # fmt: skip
    for name, values in zip(names, (x, y), strict=True):
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"point {bad[0] + 1} of the curve is not a finite number", field=name, value=values[bad[0]]
            )
    if len(x) < fewest:
        raise InputError("too few points on the curve", field=names[0], value=len(x), allowed=f"{fewest} or more")
    step = np.diff(x)
    if strict and not ((step > 0).all() or (step < 0).all()):
        way = np.sign(step[step != 0.0][:1])  # of a loop, the whole way is none
        turn = int(np.flatnonzero(step * (way if len(way) else 1.0) <= 0)[0]) + 2
        raise InputError(
            f"the load is not monotone: it turns back or stands at point {turn}",
            field=names[0],
            value=float(x[turn - 1]),
            allowed="one branch, loading or unloading",
        )
    return (x, y) if step[0] > 0 else (x[::-1], y[::-1])
