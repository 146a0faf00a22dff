"""Sweeps: a device at every point of a grid, in batches, resumable, on one machine or on a Dask cluster."""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from origami_sim.errors import InputError
from origami_sim.explore.found import TOGETHER, Build, Device, Measure, Way, at, found, number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROWS = "points.jsonl"

MOST = 100_000
"""Points of a sweep. This many take minutes at 1 ms each, of the smallest devices, and 0.2 GB; half would refuse a grid
of 17 values of four settings, double only waits longer."""


@dataclass(repr=False)
class Sweep:
    """A table of points and what was measured there.

    Attributes:
        columns: inputs and measures by name [SI], one value per point; nan where a device was not found.
        inputs, measures: names of the columns. failures: number of the point -> why it was not found.
        computed: how many points were computed now, and not found in the folder.
    """

    columns: dict[str, np.ndarray]
    inputs: tuple[str, ...]
    measures: tuple[str, ...]
    failures: dict[int, str] = field(default_factory=dict)
    computed: int = 0

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def point(self, row: int) -> dict[str, Any]:
        """The inputs of a row, for `build`."""
        return {n: self.columns[n][row].item() for n in self.inputs}

    def pareto(self, *measures: str) -> np.ndarray:
        """Rows that no other row beats in all measures, by the first one.

        Args:
            measures: of these or of the inputs, the smaller the better; "-angle": the larger the better.

        Raises:
            InputError: no such measure or number.
        """
        values = np.stack([self._toward(m) for m in measures], axis=1)
        known = np.all(np.isfinite(values), axis=1)
        beaten = [
            np.any(np.all(values[known] <= v, axis=1) & np.any(values[known] < v, axis=1)) if ok else True
            for v, ok in zip(values, known, strict=True)
        ]
        front = np.flatnonzero(~np.array(beaten))
        return front[np.argsort(values[front, 0], kind="stable")]

    def __repr__(self) -> str:
        from origami_sim.view.findings import sweep_line  # only who looks pays for it

        return sweep_line(self)

    def _repr_html_(self) -> str:
        from origami_sim.view.findings import sweep_html

        return sweep_html(self)

    def plot(self) -> "Figure":
        """Every measure over the first input, a line for each combination of the others."""
        from origami_sim.view.findings import plot_sweep

        return plot_sweep(self)

    def draw(self, path: str | Path, x: str, y: str) -> Path:
        """A picture of all points and of the Pareto front of two measures, as `pareto` takes them."""
        from matplotlib.figure import Figure

        front = self.pareto(x, y)
        a, b = (self.columns[n.lstrip("-")] for n in (x, y))
        figure = Figure(figsize=(6.5, 4.5), layout="constrained")
        ax = figure.subplots()
        ax.plot(a, b, "o", color="#9aa7b5", ms=5, label=f"{len(self)} designs")
        ax.plot(a[front], b[front], "o-", color="#c8342b", ms=6, label=f"Pareto front, {len(front)} designs")
        better = [f"{n.lstrip('-')} ({'larger' if n[0] == '-' else 'smaller'} is better)" for n in (x, y)]
        ax.set(xlabel=better[0], ylabel=better[1])
        ax.legend(frameon=False)
        ax.grid(alpha=0.3)
        path = Path(path)
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=140)
        return path

    def _toward(self, measure: str) -> np.ndarray:
        name = measure.lstrip("-")
        known = [n for n in (*self.measures, *self.inputs) if np.issubdtype(self.columns[n].dtype, np.number)]
        if name not in known:
            raise InputError("there is no such measure", field="measure", value=name, allowed=", ".join(known))
        return -self.columns[name] if measure.startswith("-") else self.columns[name]


def sweep(
    build: Build,
    grid: Mapping[str, Sequence] | Sequence[Mapping[str, Any]],
    measures: Mapping[str, Measure],
    *,
    way: Way | None = None,
    folder: str | Path | None = None,
    client: Any = None,
    progress: Callable[[float], None] | None = None,
) -> Sweep:
    """Finds a device at every point of a grid and measures it there.

    Devices of one topology are worlds of one batch, whatever their geometry, numbers and drive.

    Args:
        grid: values of each argument of `build`, numbers or quantities, of which all combinations are taken; or the
            points themselves.
        measures: by name.
        folder: keeps every batch as it is done; the same sweep goes on from there. A point is computed again when its
            device, its drive, `way` or a measure has changed.
        client: a `distributed.Client`; batches then run on its workers, which need this package and `build`.
        progress: called with the fraction done.

    Raises:
        InputError: no points, no measures, points of different names, what `build` refuses.
    """
    how, points = way or Way(), points_of(build, grid)
    if not measures:
        raise InputError("a sweep needs a measure", field="measures", allowed="{name: function of Found}")
    kept = _Kept(folder)
    rows: list[dict[str, Any] | None] = [None] * len(points)
    todo: list[int] = []
    keys = [_key(build, p, measures, how) if folder is not None else str(k) for k, p in enumerate(points)]
    for k, key in enumerate(keys):
        rows[k] = kept.rows.get(key)
        if rows[k] is None:
            todo.append(k)
    parts = [todo[i : i + TOGETHER] for i in range(0, len(todo), TOGETHER)]
    tasks = [(build, [points[k] for k in part], dict(measures), how) for part in parts]
    results = map(_measured, tasks) if client is None else _mapped(client, tasks)
    for n, (part, measured) in enumerate(zip(parts, results, strict=True), 1):
        for k, row in zip(part, measured, strict=True):
            rows[k] = row
        kept.add({keys[k]: rows[k] for k in part})
        if progress:
            progress(n / len(parts))
    done = [r for r in rows if r is not None]
    columns = {n: np.array([p[n] for p in points]) for n in points[0]}
    columns |= {n: np.array([r["values"][n] for r in done], float) for n in measures}
    failures = {k: r["failure"] for k, r in enumerate(done) if r["failure"]}
    return Sweep(columns, tuple(points[0]), tuple(measures), failures, len(todo))


def points_of(build: Build, grid: Mapping[str, Sequence] | Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Values of the arguments at each point of a grid, or of a list of points.

    Raises:
        InputError: too many points, or a value that its argument does not take.
    """
    if isinstance(grid, Mapping):
        count = prod(len(np.atleast_1d(np.asarray(given, object))) for given in grid.values())
        if count > MOST:
            raise InputError("a sweep of too many points", field="grid", value=count, allowed=f"up to {MOST}")
        values = {
            n: [number(build, v, n) for v in np.atleast_1d(np.asarray(given, object))] for n, given in grid.items()
        }
        points = [dict(zip(values, p, strict=True)) for p in product(*values.values())] if values else []
    else:
        points = [{n: number(build, v, n) for n, v in p.items()} for p in grid]
    if not points or not points[0]:
        raise InputError("a sweep needs points", field="grid", allowed="{name: [values]}, or a list of points")
    for p in points:
        if set(p) != set(points[0]):
            raise InputError("points state different numbers", field="grid", value=list(p), allowed=list(points[0]))
    return points


def _measured(task: tuple[Build, list[dict[str, Any]], Mapping[str, Measure], Way]) -> list[dict[str, Any]]:
    """One batch of points."""
    build, points, measures, way = task
    out = []
    for f in found([at(build, p) for p in points], way):
        values = {n: float("nan") if f.failure else float(m(f)) for n, m in measures.items()}
        out.append({"values": values, "failure": f.failure})
    return out


def _mapped(client: Any, tasks: list) -> Any:
    """The batches on the workers of a Dask cluster, as they are asked for."""
    futures = client.map(_measured, tasks, pure=False)
    return (f.result() for f in futures)


def _key(build: Build, point: Mapping[str, Any], measures: Mapping[str, Measure], way: Way) -> str:
    """Digest of everything that a row depends on."""
    d: Device = at(build, point)
    h = hashlib.sha256(f"{d.model.hash} {d.parameters.hash} {way}".encode())
    for name, s in d.drive.signals.items():
        h.update(name.encode() + repr(s).encode())
        for samples in (s.times, s.values):
            h.update(b"" if samples is None else np.asarray(samples).tobytes())
    h.update(d.drive.fingerprint)
    for name, m in measures.items():
        code = getattr(m, "__code__", None)
        inside = [c.cell_contents for c in getattr(m, "__closure__", None) or ()]
        h.update(f"{name} {code.co_code.hex() if code else m} {code.co_consts if code else ''} {inside}".encode())
    return h.hexdigest()[:24]


class _Kept:
    """Rows in a folder, one a line, each written whole; a line that an interruption has cut is computed again."""

    def __init__(self, folder: str | Path | None):
        self.path = None if folder is None else Path(folder) / ROWS
        self.rows: dict[str, dict[str, Any]] = {}
        if self.path is not None and self.path.is_file():
            for line in self.path.read_bytes().splitlines():
                try:
                    entry = json.loads(line)
                    self.rows[entry["key"]] = dict(entry["row"])
                except (ValueError, KeyError, TypeError, RecursionError):
                    continue

    def add(self, rows: Mapping[str, Any]) -> None:
        if self.path is None:
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as f:
            f.write("".join(json.dumps({"key": k, "row": r}) + "\n" for k, r in rows.items()))
