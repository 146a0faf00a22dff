"""Tracker (Open Source Physics) text export: the name of the track, then `t x y ...`, then rows.

Several tracks in one file begin with `#multi:`, and each name stands over its first column. The delimiter (tab, comma,
semicolon, blanks) is that of the line of names; decimal commas are understood where the delimiter is another. Columns
are `<track>.<name>`, e.g. `mass A.x`; lengths are in the unit of Tracker's calibration stick, which the file does not
tell, and y points up.
"""

from pathlib import Path

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.table import MISSING, Table
from origami_sim.recording.trackers._text import number_of, once, plain

FORMAT = "tracker"


def matches(path: Path, data: bytes) -> bool:
    """Whether there is a `#multi:` line, or a name alone on its line above columns that begin with t."""
    lines = [line for line in plain(data).decode("utf-8", errors="replace").split("\n")[:6] if line.strip()]
    if not lines or lines[0].startswith(("#multi:", "multi:")):
        return bool(lines)
    if len(lines) < 3:
        return False
    names = _split(lines[1], _delimiter(lines[1]))
    alone = len([cell for cell in _split(lines[0], _delimiter(lines[1])) if cell]) <= 1 or not _delimiter(lines[1])
    return alone and names[0] == "t" and len(names) > 1 and not _is_number(lines[0])


def read(path: Path, data: bytes) -> Table:
    """Columns `time` [s] and `<track>.<column>` in the file's own units; see the head of this file."""
    try:
        text = plain(data).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError("the file is not UTF-8 text", file=path) from error
    lines = [(number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip()]
    multi = bool(lines) and lines[0][1].startswith(("#multi:", "multi:"))
    lines = lines[1:] if multi else lines
    if len(lines) < 2:
        raise InputError("the file has no track", file=path)
    delimiter = _delimiter(lines[1][1])
    names = _split(lines[1][1], delimiter)
    while names and not names[-1]:
        names.pop()
    if not names or names[0] != "t" or len(set(names)) < 2:
        raise InputError(
            "the header is not that of Tracker", file=path, field="header", value=names[:4], allowed="t, x, y, ..."
        )
    over = _split(lines[0][1], delimiter) if multi else [lines[0][1].strip(" \t,;#")]
    tracks, name = [""] * len(names), ""
    for k in range(1, len(names)):
        cell = over[k] if multi and k < len(over) else ("" if multi else over[0])
        name = tracks[k] = cell or name
    if "" in tracks[1:]:
        raise InputError("a column stands under no track", file=path, field=names[tracks.index("", 1)])
    swap = delimiter != "," and "." not in "".join(line for _, line in lines[2:20])
    rows = [_row(path, number, line, delimiter, names, swap) for number, line in lines[2:]]
    values = np.array(rows, dtype=float).reshape(len(rows), len(names))
    columns: dict[str, np.ndarray] = {"time": values[:, 0].copy()}
    for k in range(1, len(names)):
        once(path, columns, f"{tracks[k]}.{names[k]}", values[:, k].copy())
    numbers = [number for number, _ in lines[2:]]
    return Table(
        file=path,
        numbers=columns,
        labels={},
        rows=np.arange(len(rows)),
        lines=lambda row: f"line {numbers[row]}",
        clock="time",
    )


def _row(path: Path, number: int, line: str, delimiter: str | None, names: list[str], swap: bool) -> list[float]:
    cells = _split(line.replace(",", ".") if swap else line, delimiter)
    if any(cells[len(names) :]):
        raise InputError(f"line {number} has {len(cells)} cells but the header has {len(names)}", file=path)
    cells += [MISSING[0]] * (len(names) - len(cells))
    return [number_of(path, number, cell, name) for cell, name in zip(cells, names, strict=False)]


def _delimiter(line: str) -> str | None:
    return next((mark for mark in ("\t", ";", ",") if mark in line), None)


def _split(line: str, delimiter: str | None) -> list[str]:
    return [cell.strip().strip('"') for cell in (line.split(delimiter) if delimiter else line.split())] or [""]


def _is_number(text: str) -> bool:
    try:
        float(text.strip().replace(",", "."))
    except ValueError:
        return False
    return True
