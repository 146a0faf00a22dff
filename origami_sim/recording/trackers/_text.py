"""What the text exports share: lines, header rows, and numbers that know their line."""

import csv
import re
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv

from origami_sim.errors import InputError
from origami_sim.recording.table import MISSING, Table, data_lines


def plain(data: bytes) -> bytes:
    """The bytes without a byte order mark, with lines that end in a newline only."""
    return data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")


def head(data: bytes, count: int) -> list[list[str]]:
    """Cells of the first lines, for detection: never raises."""
    lines = plain(data).decode("utf-8", errors="replace").split("\n")[:count]
    rows = []
    for line in lines:
        try:
            rows += [[cell.strip() for cell in row] for row in csv.reader([line.replace("\0", "")])]
        except csv.Error:  # a cell of a megabyte: no header of any format
            rows.append([])
    return rows or [[]]


def header(path: Path, data: bytes, count: int) -> tuple[list[list[str]], bytes]:
    """Cells of the first `count` lines, and the bytes after them."""
    parts = plain(data).split(b"\n", count)
    rows = []
    for number, line in enumerate(parts[:count], start=1):
        try:
            rows.append([cell.strip() for cell in next(csv.reader([line.decode("utf-8")]), [])])
        except (UnicodeDecodeError, csv.Error) as error:
            raise InputError(f"line {number} is not UTF-8 text with commas", file=path) from error
    return rows, parts[count] if len(parts) > count else b""


def numbers(path: Path, body: bytes, count: int, header_lines: int, text: tuple[int, ...] = ()) -> list[np.ndarray]:
    """Columns of a body of comma separated numbers: (n,) each, nan where empty; the columns in `text` as they stand.

    Raises:
        InputError: a cell that is no number, a row of another length; with its line.
    """
    names = [str(k) for k in range(count)]
    if not body.strip():
        return [np.zeros(0) for _ in names]
    try:
        parsed = pa_csv.read_csv(
            pa.BufferReader(body),
            read_options=pa_csv.ReadOptions(column_names=names, use_threads=False),
            convert_options=pa_csv.ConvertOptions(
                column_types={n: pa.string() if int(n) in text else pa.float64() for n in names}, null_values=MISSING
            ),
        )
        return [
            np.array(parsed[n].to_pylist(), dtype=object) if int(n) in text else np.array(parsed[n].to_numpy(), float)
            for n in names
        ]
    except (pa.ArrowException, UnicodeDecodeError, OSError):
        lines = zip(data_lines(body, header_lines), filter(None, body.split(b"\n")), strict=True)
        rows = [cells(path, number, line, count, text) for number, line in lines]
        return [np.array(c, dtype=object if k in text else float) for k, c in enumerate(zip(*rows, strict=True))]


def cells(path: Path, number: int, line: bytes, count: int, text: tuple[int, ...]) -> list:
    """One row as numbers (and texts), cell by cell."""
    try:
        row = next(csv.reader([line.decode("utf-8")]), [])
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"line {number} is not UTF-8 text with commas", file=path) from error
    if len(row) != count:
        raise InputError(f"line {number} has {len(row)} cells but the header has {count}", file=path)
    return [cell if k in text else number_of(path, number, cell, f"column {k + 1}") for k, cell in enumerate(row)]


def number_of(path: Path, line: int, cell: str, field: str) -> float:
    """The number in a cell, nan where it is empty."""
    cell = cell.strip()
    if cell in MISSING:
        return np.nan
    if not re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", cell):
        raise InputError(f"line {line} holds no number", file=path, field=field, value=cell)
    return float(cell)


def export(
    path: Path,
    columns: dict[str, np.ndarray],
    body: bytes,
    header_lines: int,
    *,
    unit: str | None,
    clock: str | None = None,
    frame: str | None = None,
) -> Table:
    """The table of a text export whose rows stand in `body`."""
    size = len(next(iter(columns.values())))
    return Table(
        file=path,
        numbers=columns,
        labels={},
        rows=np.arange(size),
        lines=lambda row: f"line {data_lines(body, header_lines)[row]}",
        unit=unit,
        clock=clock,
        frame=frame,
    )


def once(path: Path, columns: dict[str, np.ndarray], name: str, values: np.ndarray):
    """Adds a column whose name must be new."""
    if name in columns:
        raise InputError(f"column '{name}' appears more than once", file=path, field="column")
    columns[name] = values
