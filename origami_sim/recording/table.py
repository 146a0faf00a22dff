"""The table of a recording, CSV or Parquet: the needed columns as numbers, and where each row stands in the file."""

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv
import pyarrow.parquet as pa_parquet

from origami_sim.errors import InputError

LARGEST_NUMBER = 1e100
"""A cell beyond this magnitude is damaged, not measured."""

SEPARATORS = (",", ";", "\t")
"""What may stand between the cells of a CSV file; decimal commas are understood beside the other two."""

ENCODINGS = ("utf-8", "cp1252")
"""Of headers: a spreadsheet on Windows writes the degree sign in the second."""

PREAMBLE = 100
"""Lines in which the header is sought: instruments and laboratories write notes above it."""

MISSING = ["", "nan", "NaN", "NAN", "NA", "N/A", "null", "NULL"]
"""Cells that mean that a value is missing."""


@dataclass(frozen=True, eq=False)
class Table:
    """Needed columns of a file.

    Attributes:
        file: the file.
        numbers: (n,) numbers by column; nan where a cell is empty.
        labels: (n,) cells by column, for the columns to select rows by.
        rows: (n,) row of the file, counted from 0 after the header.
        lines: place in words of a row of the file.
        unit: unit of lengths that the file itself states ("px" for pixels), or None.
        clock: column that holds the times [s] by the file's own account, or None.
        frame: column that numbers the frames, or None.
    """

    file: Path
    numbers: dict[str, np.ndarray]
    labels: dict[str, np.ndarray]
    rows: np.ndarray
    lines: Callable[[int], str]
    unit: str | None = None
    clock: str | None = None
    frame: str | None = None

    def position(self, row: int) -> str:
        """Where row `row` of this table stands in the file, e.g. 'line 2'."""
        return self.lines(int(self.rows[row]))

    def stack(self, columns: Sequence[str]) -> np.ndarray:
        """(n,) for one column, (n, d) for several."""
        return np.column_stack([self.numbers[c] for c in columns]) if len(columns) > 1 else self.numbers[columns[0]]

    def select(self, wanted: Mapping[str, Any]) -> "Table":
        """The rows whose columns have the wanted values."""
        keep = np.ones(len(self.rows), dtype=bool)
        for column, value in wanted.items():
            present = [_plain(label) for label in dict.fromkeys(self.labels[column].tolist())]
            keep &= np.array([_plain(label) == _plain(value) for label in self.labels[column].tolist()], dtype=bool)
            if not keep.any():
                shown = ", ".join(repr(label) for label in present[:12]) + (", ..." if len(present) > 12 else "")
                raise InputError(
                    "no row has the selected value",
                    file=self.file,
                    field=f"select.{column}",
                    value=value,
                    allowed=shown,
                )
        return replace(
            self,
            numbers={name: column[keep] for name, column in self.numbers.items()},
            labels={name: column[keep] for name, column in self.labels.items()},
            rows=self.rows[keep],
        )

    def averaged(self, groups: np.ndarray) -> "Table":
        """One row for each group of neighbouring rows: the mean of what they measured, else what the first says.

        Args:
            groups: (n,) number of the group of each row, rising by one.
        """
        first = np.flatnonzero(np.diff(groups, prepend=-1))
        count = np.diff(np.append(first, len(groups)))
        return replace(
            self,
            numbers={name: np.add.reduceat(column, first) / count for name, column in self.numbers.items()},
            labels={name: column[first] for name, column in self.labels.items()},
            rows=self.rows[first],
        )

    def require(self, columns: Sequence[str]):
        """Raises InputError where one of these columns is missing."""
        for name in columns:
            if name not in self.numbers:
                shown = _some(list(self.numbers))
                raise InputError(f"column '{name}' is missing", file=self.file, field="column", allowed=shown)

    def check_numbers(self) -> "Table":
        """The same table, if every cell is a measurement or missing.

        Raises:
            InputError: a number beyond `LARGEST_NUMBER` in magnitude.
        """
        for name, values in self.numbers.items():
            damaged = np.flatnonzero(np.abs(values) > LARGEST_NUMBER)
            if damaged.size:
                row = int(damaged[0])
                raise InputError(
                    f"the number at {self.position(row)} is no measurement",
                    file=self.file,
                    field=name,
                    value=float(values[row]),
                )
        return self


def _plain(label: object) -> object:
    """A selection label as the number it spells, or else as it is."""
    try:
        return float(label)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return label


def read_table(path: Path, data: bytes, columns: list[str], labels: list[str]) -> Table:
    """Read the needed columns of a CSV or Parquet file; every cell is finite or nan."""
    suffix = path.suffix.lower()
    if suffix in (".csv", ".txt"):
        table = _read_csv(path, data, columns, labels)
    elif suffix == ".parquet":
        table = _read_parquet(path, data, columns, labels)
    else:
        raise InputError(
            "unknown kind of file", file=path, field="suffix", value=suffix, allowed=".csv, .txt, .parquet"
        )
    return table.check_numbers()


def _some(names: list[str]) -> str:
    """The first names, so that a sentence stays one: names of a damaged file may be long and many."""
    shown = ", ".join(name[:40] for name in names[:24])
    return shown + (f", ... ({len(names)} in all)" if len(names) > 24 else "")


def _check_columns(path: Path, wanted: list[str], header: list[str]) -> None:
    for name in wanted:
        if header.count(name) != 1:
            fault = "is missing" if name not in header else "appears more than once"
            raise InputError(f"column '{name}' {fault}", file=path, field="column", allowed=_some(header))


def _read_parquet(path: Path, data: bytes, columns: list[str], labels: list[str]) -> Table:
    try:
        source = pa_parquet.ParquetFile(pa.BufferReader(data))
        _check_columns(path, columns + labels, list(source.schema_arrow.names))
        table = source.read(columns=list(dict.fromkeys(columns + labels)))
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"is no readable Parquet file: {first_line(error)}", file=path) from error
    numbers = {}
    for name in columns:
        kind = table[name].type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            raise InputError("the column is not numeric", file=path, field=name, value=str(kind))
        numbers[name] = np.asarray(table[name].to_numpy(), dtype=float)
    return Table(
        file=path,
        numbers=numbers,
        labels={name: np.array(table[name].to_pylist(), dtype=object) for name in labels},
        rows=np.arange(table.num_rows),
        lines=lambda row: f"row {row + 1}",
    )


def _read_csv(path: Path, data: bytes, columns: list[str], labels: list[str]) -> Table:
    header, header_line, separator, body = _split_header(path, data, [*columns, *labels])
    _check_columns(path, columns + labels, header)
    decimal = "," if separator != "," and b"." not in body[:10_000] else "."
    try:
        parsed = pa_csv.read_csv(
            pa.BufferReader(body if body.strip() else b"\n"),
            read_options=pa_csv.ReadOptions(column_names=[str(k) for k in range(len(header))], use_threads=False),
            parse_options=pa_csv.ParseOptions(delimiter=separator),
            convert_options=pa_csv.ConvertOptions(
                include_columns=[str(header.index(name)) for name in dict.fromkeys(columns + labels)],
                column_types={str(header.index(name)): pa.string() for name in labels}
                | {str(header.index(name)): pa.float64() for name in columns},
                null_values=MISSING,
                decimal_point=decimal,
            ),
        )
        numbers = {name: np.array(parsed[str(header.index(name))].to_numpy(), dtype=float) for name in columns}
        texts = {name: np.array(parsed[str(header.index(name))].to_pylist(), dtype=object) for name in labels}
    except (pa.ArrowException, UnicodeDecodeError, OSError):
        numbers, texts = _parse_cells(path, body, header, header_line, columns, labels, separator, decimal)
    return Table(
        file=path,
        numbers=numbers,
        labels=texts,
        rows=np.arange(len(numbers[columns[0]])),
        lines=lambda row: f"line {data_lines(body, header_line)[row]}",
    )


def _split_header(path: Path, data: bytes, wanted: Sequence[str]) -> tuple[list[str], int, str, bytes]:
    """Column names, the line number of the header, its separator, and the bytes after it.

    The header is the first line that names all wanted columns, with or without a '#' before them; what stands above it
    is skipped. Where no line does, it is the first one that is no comment.
    """
    parts = data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n", PREAMBLE)
    lines = [(k, line) for k, line in enumerate(parts[:PREAMBLE], start=1) if line.strip()]
    if not lines:
        raise InputError("the file is empty", file=path)
    for comment in (b"", b"# "):
        for number, line in lines:
            for separator, encoding in product(SEPARATORS, ENCODINGS):
                names = _names(line.lstrip(comment), separator, encoding)
                if set(wanted) <= set(names):
                    return names, number, separator, b"\n".join(parts[number:])
    number, line = next((one for one in lines if not one[1].startswith(b"#")), lines[0])
    separator = max(SEPARATORS, key=lambda mark: line.count(mark.encode()))
    names = _names(line, separator)
    if not names:
        raise InputError(f"the header in line {number} is not UTF-8 text with commas", file=path)
    return names, number, separator, b"\n".join(parts[number:])


def _names(line: bytes, separator: str, encoding: str = ENCODINGS[0]) -> list[str]:
    """Cells of a line; none of one that is no text."""
    try:
        return [name.strip() for name in next(csv.reader([line.decode(encoding)], delimiter=separator), [])]
    except (UnicodeDecodeError, csv.Error):
        return []


def data_lines(body: bytes, header_line: int) -> list[int]:
    """Line number of every data row: empty lines are no rows."""
    return [header_line + k for k, line in enumerate(body.split(b"\n"), start=1) if line]


def _parse_cells(
    path: Path,
    body: bytes,
    header: list[str],
    header_line: int,
    columns: list[str],
    labels: list[str],
    separator: str,
    decimal: str,
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Parse cell by cell what the fast reader refused: names the line of the first fault, or returns the numbers."""
    numbers: dict[str, list[float]] = {name: [] for name in columns}
    texts: dict[str, list[str]] = {name: [] for name in labels}
    for number, line in zip(data_lines(body, header_line), filter(None, body.split(b"\n")), strict=True):
        try:
            cells = next(csv.reader([line.decode("utf-8")], delimiter=separator), [])
        except (UnicodeDecodeError, csv.Error) as error:
            raise InputError(f"line {number} is not UTF-8 text with commas", file=path) from error
        if len(cells) != len(header):
            raise InputError(f"line {number} has {len(cells)} cells but the header has {len(header)}", file=path)
        for name in columns:
            cell = cells[header.index(name)].strip()
            try:
                if "_" in cell:
                    raise ValueError
                numbers[name].append(np.nan if cell in MISSING else float(cell.replace(decimal, ".")))
            except ValueError:
                raise InputError(f"line {number} holds no number", file=path, field=name, value=cell) from None
        for name in labels:
            texts[name].append(cells[header.index(name)])
    return (
        {name: np.array(column, dtype=float) for name, column in numbers.items()},
        {name: np.array(column, dtype=object) for name, column in texts.items()},
    )


def first_line(error: Exception) -> str:
    """The first line of an error of another library."""
    return (str(error).splitlines() or [type(error).__name__])[0]
