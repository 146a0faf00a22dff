"""Exports of tracking programs, one file per program: each is read into the same kind of table.

A reader takes the file and its bytes and returns a `Table` in which the coordinates of a tracked point stand in columns
`<point>.x`, `<point>.y` (and `.z`), with the unit that the file states, its clock and its scores. What the points are
on the object is told by the sidecar, never by the tracker.
"""

from pathlib import Path

from origami_sim.errors import InputError
from origami_sim.recording.table import Table
from origami_sim.recording.trackers import c3d, deeplabcut, motive, sleap, tracker

PROGRAMS = {module.FORMAT: module for module in (motive, deeplabcut, sleap, c3d, tracker)}
"""Readers by name of the format."""

FORMATS = ("table", *PROGRAMS)
"""What a sidecar may state as `format`; "table" is a plain CSV or Parquet file with one header row."""


def detect(path: Path, data: bytes) -> str:
    """The format that the first lines of a file show, "table" where none of the others does."""
    if path.suffix.lower() == ".parquet":
        return "table"
    return next((name for name, module in PROGRAMS.items() if module.matches(path, data[:20_000])), "table")


def read_export(path: Path, data: bytes, form: str, *, likelihood: float | None = None) -> Table:
    """Read an export of a tracking program.

    Args:
        path: the file. data: its bytes.
        form: a key of `PROGRAMS`.
        likelihood: points whose score is below this are missing; None keeps them all.

    Raises:
        InputError: the file is not of that format or damaged, a likelihood for a format that has no scores.
    """
    table = PROGRAMS[form].read(path, data)
    return table if likelihood is None else _drop_unlikely(table, form, likelihood)


def _drop_unlikely(table: Table, form: str, likelihood: float) -> Table:
    scores = {name.removesuffix(".score"): v for name, v in table.numbers.items() if name.endswith(".score")}
    if not scores:
        raise InputError(
            f"the format '{form}' has no scores that could be compared with a likelihood",
            file=table.file,
            field="source.likelihood",
            value=likelihood,
        )
    for point, score in scores.items():
        for axis in "xyz":
            column = table.numbers.get(f"{point}.{axis}")
            if column is not None:
                column[~(score >= likelihood)] = float("nan")  # a missing score is no evidence either
    return table
