"""A magnetic field on a grid, and the curl-free field between its places.

B is minus the gradient of a scalar potential of B-splines of order four. The potential is the one that comes closest
to the splines of order three through the values of the table, in the mean over its box (Helmholtz projection). So the
field has no curl at all, a force is exactly the slope of an energy, and what is left of the table and of the
divergence says how good it is.
"""

import csv
import io
import re
from collections.abc import Callable, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg import eigh

from origami_sim.errors import InputError
from origami_sim.files import read_bytes
from origami_sim.units import unit_factor

LEAST = 4
"""Places along each axis that a table needs: so many has a spline of order three."""

CURL = 0.25
"""Mean misfit of the closest field without curl, over the mean field, at which a table is refused.

Maps with noise or a probe that is turned by a few degrees come to 1 to 5 %, and so do steps of a third of the distance
to a magnet; two axes swapped, or one with the wrong sign, to 52 to 73 % (around a dipole). Half refuses steps of half
the distance, which do for a sketch; double still refuses swapped axes.
"""

_HEAD = re.compile(r"\s*(\w+)\s*\[\s*([^\]]+?)\s*\]\s*")
_COLUMNS = {"x": "length", "y": "length", "z": "length", **dict.fromkeys(("Bx", "By", "Bz"), "flux density")}


class FieldTable:
    """Flux density on a grid of even steps.

    Args:
        x, y, z: places along the axes [m], in even steps. values: [len(x), len(y), len(z), 3] flux density [T].
        file: where it comes from, for errors and design files.

    Attributes:
        x, y, z, values: as given. coefficients: of the potential [T m], three more along each axis than places.

    Raises:
        InputError: fewer than four places along an axis, uneven steps, holes, another shape, a field that sources
            outside the box cannot make.
    """

    def __init__(self, x, y, z, values, *, file: str | Path | None = None):
        self.file = None if file is None else str(file)
        self.x, self.y, self.z = (self._axis(n, a) for n, a in zip("xyz", (x, y, z), strict=True))
        self.values = np.asarray(values, float)
        shape = (*self.shape, 3)
        if self.values.shape != shape:
            raise InputError(
                "a table of a field has three components at every place of its grid",
                file=self.file,
                field="values",
                value=self.values.shape,
                allowed=str(shape),
            )
        holes = np.argwhere(~np.isfinite(self.values).all(axis=-1))
        if len(holes):
            self._hole(*(float(a[i]) for a, i in zip(self.axes, holes[0], strict=True)), count=len(holes))
        self.coefficients = _projected(self.axes, self.values)
        if self.misfit > CURL:
            raise InputError(
                f"the table is no field of magnets and currents outside of it: the closest field without curl misses "
                f"it by {self.misfit:.0%}; an axis may be swapped or have the wrong sign, or the steps are too long",
                file=self.file,
                field="values",
                allowed=f"below {CURL:.0%}",
            )

    def _axis(self, name: str, places) -> np.ndarray:
        a = np.asarray(places, float)
        if a.ndim != 1 or len(a) < LEAST:
            raise InputError(
                "a table of a field needs more places along an axis",
                file=self.file,
                field=name,
                value=a.size,
                allowed=f">= {LEAST}",
            )
        step = (a[-1] - a[0]) / (len(a) - 1)
        if not (step > 0 and np.abs(np.diff(a) - step).max() < 1e-3 * step):
            raise InputError(
                "a table of a field is a grid of even steps",
                file=self.file,
                field=name,
                value=np.round(a[:6], 9).tolist(),
                allowed="a growing row of equal steps; resample it otherwise",
            )
        return np.linspace(a[0], a[-1], len(a))

    def _hole(self, x: float, y: float, z: float, count: int):
        raise InputError(
            f"the table of the field has {count} {'hole' if count == 1 else 'holes'}",
            file=self.file,
            field="values",
            value=f"no number at x = {x:g}, y = {y:g}, z = {z:g} m",
            allowed="a number at every place of the grid",
        )

    @property
    def axes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The places along the three axes [m]."""
        return self.x, self.y, self.z

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of places along the three axes."""
        return len(self.x), len(self.y), len(self.z)

    @property
    def steps(self) -> np.ndarray:
        """Steps along the three axes [m]."""
        return np.array([a[1] - a[0] for a in self.axes])

    def at(self, points) -> tuple[np.ndarray, np.ndarray]:
        """Field [n, 3] [T] and gradient [n, 3, 3] [T/m] at points [n, 3] [m]; nan outside the table."""
        points = np.atleast_2d(np.asarray(points, float))
        low, high = (np.array([a[k] for a in self.axes]) for k in (0, -1))
        inside = np.all((points >= low) & (points <= high), axis=1)
        cells = (np.clip(points, low, high) - low) / self.steps
        first = np.minimum(cells.astype(int), np.array(self.shape) - 2)
        rows = [
            [_weights(c - f, order) / h**order for order in (0, 1, 2)]
            for c, f, h in zip(cells.T, first.T, self.steps, strict=True)
        ]
        window = np.arange(5)
        near = tuple(f[:, None] + window for f in first.T)
        local = self.coefficients[near[0][:, :, None, None], near[1][:, None, :, None], near[2][:, None, None, :]]

        def slope(order: np.ndarray) -> np.ndarray:
            x, y, z = (r[o] for r, o in zip(rows, order, strict=True))
            return (((local @ z[:, None, :, None])[..., 0] @ y[:, :, None])[..., 0] * x).sum(axis=1)

        orders = np.eye(3, dtype=int)
        field = -np.stack([slope(o) for o in orders], axis=1)
        gradient = -np.stack([np.stack([slope(a + b) for b in orders], axis=1) for a in orders], axis=1)
        field[~inside], gradient[~inside] = np.nan, np.nan
        return field, gradient

    @cached_property
    def _at_places(self) -> tuple[np.ndarray, np.ndarray]:
        """Field and divergence at the places of the table."""
        rows = [[_design(a, a, order) for order in (0, 1, 2)] for a in self.axes]

        def slope(order):
            x, y, z = (r[o] for r, o in zip(rows, order, strict=True))
            return np.einsum("ax,by,cz,xyz->abc", x, y, z, self.coefficients, optimize=True)

        orders = np.eye(3, dtype=int)
        field = -np.stack([slope(o) for o in orders], axis=-1)
        return field, -np.sum([slope(2 * o) for o in orders], axis=0)

    @property
    def misfit(self) -> float:
        """By how much the field without curl misses the table's values, both as root mean squares."""
        whole = np.sqrt(np.mean(self.values**2))
        return float(np.sqrt(np.mean((self._at_places[0] - self.values) ** 2)) / whole) if whole else 0.0

    @property
    def divergence(self) -> float:
        """Divergence at the places over one step of the grid, relative to the field, both as root mean squares.

        A field of free space has none, so it is the error of the gradient: between the places of the table of a dipole
        it is 0.36 to 0.45 times as large (steps of 5 to 1.7 mm), and three times the error of a component of the
        gradient, to 2 %.
        """
        whole = np.sqrt(np.mean(self.values**2))
        return float(np.sqrt(np.mean(self._at_places[1] ** 2)) * self.steps.max() / whole) if whole else 0.0

    @cached_property
    def error(self) -> float | None:
        """Estimated largest error between the places over the largest field; None for fewer than 7 along an axis.

        A table of every other place is asked for those left out. The error falls with the fourth power of the steps,
        so a sixteenth of what it misses there is this table's, or its misfit where noise is the larger part.
        """
        if min(self.shape) < 2 * LEAST - 1:
            return None
        cut = [2 * ((n - 1) // 2) + 1 for n in self.shape]
        kept = self.values[: cut[0], : cut[1], : cut[2]]
        axes = [a[:c] for a, c in zip(self.axes, cut, strict=True)]
        coarse = object.__new__(FieldTable)
        coarse.file, (coarse.x, coarse.y, coarse.z) = None, (a[::2] for a in axes)
        coarse.values = kept[::2, ::2, ::2]
        coarse.coefficients = _projected(coarse.axes, coarse.values)
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        largest = np.linalg.norm(self.values, axis=-1).max()
        off = np.linalg.norm(coarse.at(points)[0] - kept.reshape(-1, 3), axis=1).max() / (largest or 1.0)
        return float(
            max(off / 16.0, np.linalg.norm(self._at_places[0] - self.values, axis=-1).max() / (largest or 1.0))
        )

    @classmethod
    def sampled(cls, field: Callable[[np.ndarray], np.ndarray], x, y, z) -> "FieldTable":
        """The table of a function of places [n, 3] [m] that gives the flux density there [n, 3] [T].

        Of a Magpylib source: `FieldTable.sampled(source.getB, x, y, z)`.
        """
        axes = [np.asarray(a, float) for a in (x, y, z)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        values = np.asarray(field(points.reshape(-1, 3)), float).reshape(points.shape)
        return cls(axes[0], axes[1], axes[2], values)

    @classmethod
    def read(cls, path: str | Path) -> "FieldTable":
        """A table in a file.

        A CSV file has a row for each place, in any order, below the names and units of its columns:
        `x [mm], y [mm], z [mm], Bx [mT], By [mT], Bz [mT]`. An npz file has the arrays x, y, z (m) and B (T), and may
        state other units in texts `length_unit` and `field_unit`.

        Raises:
            InputError: no such file, a column or unit that is missing or unknown, and what the table refuses.
        """
        path = Path(path)
        return _read_npz(cls, path) if path.suffix.lower() == ".npz" else _read_csv(cls, path)

    def write(self, path: str | Path) -> Path:
        """Writes the table as a CSV (or npz) file, which is then its file; returns the path."""
        path = Path(path)
        if path.suffix.lower() == ".npz":
            np.savez(path, x=self.x, y=self.y, z=self.z, B=self.values)
        else:
            points = np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1)
            rows = np.concatenate([points, self.values], axis=-1).reshape(-1, 6)
            head = "x [m],y [m],z [m],Bx [T],By [T],Bz [T]"
            np.savetxt(path, rows, fmt="%.17g", delimiter=",", header=head, comments="")
        self.file = str(path)
        return path


def _read_npz(cls, path: Path) -> FieldTable:
    try:
        with np.load(path, allow_pickle=False) as data:
            given = {n: data[n] for n in data.files}
    except (OSError, ValueError) as e:
        raise InputError(f"cannot be read ({e})", file=path) from None
    for name in ("x", "y", "z", "B"):
        if name not in given:
            raise InputError("lacks an array", file=path, field=name, allowed="x, y, z, B")
    length, field = (str(given.get(n, u)) for n, u in (("length_unit", "m"), ("field_unit", "T")))
    by = unit_factor(length, dimension="length", file=path, field="length_unit")
    to = unit_factor(field, dimension="flux density", file=path, field="field_unit")
    return cls(*(by * given[n] for n in "xyz"), to * given["B"], file=path)


def _read_csv(cls, path: Path) -> FieldTable:
    try:
        stream = io.StringIO(read_bytes(path).decode("utf-8-sig"), newline="")
        head, *rows = [r for r in csv.reader(stream) if any(c.strip() for c in r)] or [[]]
    except (UnicodeDecodeError, csv.Error) as e:
        raise InputError(f"is no CSV file ({e})", file=path) from None
    found = {}
    for place, text in enumerate(head):
        match = _HEAD.fullmatch(text)
        name = match[1] if match else text.strip()
        if name in _COLUMNS:
            unit = match[2] if match else None
            if unit is None:
                raise InputError("a column needs its unit", file=path, field=name, value=text, allowed=f"{name} [...]")
            found[name] = place, unit_factor(unit, dimension=_COLUMNS[name], file=path, field=name)
    for name in _COLUMNS:
        if name not in found:
            raise InputError(
                "lacks a column", file=path, field=name, allowed="x [mm], y [mm], z [mm], Bx [mT], By [mT], Bz [mT]"
            )
    columns = np.full((len(rows), 6), np.nan)
    for n, row in enumerate(rows):
        for k, (place, factor) in enumerate(found[c] for c in _COLUMNS):
            try:
                columns[n, k] = factor * float(row[place]) if place < len(row) and row[place].strip() else np.nan
            except ValueError:
                raise InputError(
                    "not a number", file=path, field=f"row {n + 2}, {list(_COLUMNS)[k]}", value=row[place]
                ) from None
    return _gridded(cls, columns, path)


def _gridded(cls, columns: np.ndarray, path: Path) -> FieldTable:
    """The table of rows x, y, z, Bx, By, Bz in any order."""
    if not len(columns):
        raise InputError("a table of a field needs rows", file=path, allowed=f">= {LEAST} places along each axis")
    if not np.isfinite(columns[:, :3]).all():
        row = int(np.argmin(np.isfinite(columns[:, :3]).all(axis=1)))
        raise InputError("a row has no place", file=path, field=f"row {row + 2}", allowed="numbers for x, y and z")
    axes, index = [], []
    for a in columns[:, :3].T:
        close = 1e-6 * (np.ptp(a) or 1.0)  # the same place, written with other digits
        order = np.argsort(a, kind="stable")
        group = np.concatenate([[0], np.cumsum(np.diff(a[order]) > close)]) if len(a) else np.zeros(0)
        where = np.empty(len(a), int)
        where[order] = group
        axes.append(np.array([a[where == k].mean() for k in range(int(group.max(initial=-1)) + 1)]))
        index.append(where)
    values = np.full((*(len(a) for a in axes), 3), np.nan)
    taken = np.zeros(values.shape[:3], int)
    if taken.size > 8 * max(len(columns), 1):
        raise InputError(
            "the rows are no grid: most of its places are missing",
            file=path,
            field="x, y, z",
            value=f"{len(columns)} rows",
            allowed=f"{' x '.join(str(len(a)) for a in axes)} rows, one for every place",
        )
    np.add.at(taken, tuple(index), 1)
    if np.any(taken > 1):
        x, y, z = (a[i] for a, i in zip(axes, np.argwhere(taken > 1)[0], strict=True))
        raise InputError("a place has two rows", file=path, field="x, y, z", value=f"({x:g}, {y:g}, {z:g}) m")
    values[tuple(index)] = columns[:, 3:]
    return cls(*axes, values, file=path)


# the potential --------------------------------------------------------------------------------------------------------


def _weights(t: np.ndarray, derivative: int) -> np.ndarray:
    """[n, 5] of the five B-splines of order four that reach a cell at parts t [n] of it, or of their derivatives."""
    powers = _POWERS.copy()
    for _ in range(derivative):
        powers = np.pad(powers[:, 1:] * np.arange(1, 5), ((0, 0), (0, 1)))
    return t[:, None] ** np.arange(5) @ powers.T


_POWERS = (
    np.array([[1, -4, 6, -4, 1], [11, -12, -6, 12, -4], [11, 12, -6, -12, 6], [1, 4, 6, 4, -4], [0, 0, 0, 0, 1]]) / 24.0
)
"""Coefficients of the powers 0 to 4 in each of them."""


def _design(places: np.ndarray, at: np.ndarray, derivative: int) -> np.ndarray:
    """[n, coefficients] of the B-splines of an axis, which go on beyond its ends, or of their derivatives."""
    knots = places[0] + (places[1] - places[0]) * np.arange(-4, len(places) + 4)
    spline = BSpline(knots, np.eye(len(places) + 3), 4)
    return spline.derivative(derivative)(at) if derivative else spline(at)


def _projected(axes: Sequence[np.ndarray], values: np.ndarray) -> np.ndarray:
    """Coefficients of the potential of which the gradient is closest to minus the splines through the values.

    The normal equations are a sum over the axes of products of one-dimensional matrices, and are solved in the
    generalised eigenvectors of these.
    """
    node, weight = np.polynomial.legendre.leggauss(5)  # exact for products of order four
    mass, slopes, modes, levels = [], [], [], []
    for a in axes:
        step = a[1] - a[0]
        at = (a[:-1, None] + 0.5 * step * (1 + node)).ravel()
        w = np.tile(0.5 * step * weight, len(a) - 1)[:, None]
        value, slope = _design(a, at, 0), _design(a, at, 1)
        table = make_interp_spline(a, np.eye(len(a)), 3)(at)
        level, mode = eigh(slope.T @ (w * slope), value.T @ (w * value))
        mass.append(value.T @ (w * table))
        slopes.append(slope.T @ (w * table))
        modes.append(mode)
        levels.append(np.maximum(level, 0.0))
    right = 0.0
    for k in range(3):
        parts = [modes[d].T @ (slopes[d] if d == k else mass[d]) for d in range(3)]
        right = right - np.einsum("ia,jb,kc,abc->ijk", *parts, values[..., k], optimize=True)
    total = levels[0][:, None, None] + levels[1][:, None] + levels[2]
    flat = total < 1e-9 * total.max()  # the constant, which has no gradient
    solved = np.where(flat, 0.0, right / np.where(flat, 1.0, total))
    return np.einsum("ai,bj,ck,ijk->abc", *modes, solved, optimize=True)
