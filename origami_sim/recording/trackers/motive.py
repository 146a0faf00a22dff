"""OptiTrack Motive CSV: a line of settings, header rows Type, Name, ID (Parent), quantity, and X Y Z W; then frames.

Length unit, frame rates and the order of the axes are options of the export: the unit is read from `Length Units`, each
coordinate from the label over its own column. Motive's world has y up unless exported otherwise, and the file does not
say so: state `axes` in the sidecar. Points are named as in the file; where a marker stands under several types, as
`<type>/<name>`. Rotations are offered as columns `<name>.rx` ..., scores of no point.
"""

from pathlib import Path

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.table import Table
from origami_sim.recording.trackers._text import export, head, header, numbers, once

FORMAT = "motive"
UNITS = {"Meters": "m", "Centimeters": "cm", "Millimeters": "mm"}
LONGEST_HEADER = 12


def matches(path: Path, data: bytes) -> bool:
    """Whether the first line states the version of the format."""
    return head(data, 1)[0][:1] == ["Format Version"]


def read(path: Path, data: bytes) -> Table:
    """Columns `time` [s], `frame`, and `<point>.x`, `.y`, `.z` in the unit of the file; see the head of this file."""
    first = head(data, LONGEST_HEADER)
    count = next((k for k, row in enumerate(first, start=1) if row[:1] == ["Frame"]), 0)
    if not count or first[0][:1] != ["Format Version"]:
        raise InputError(
            "the header is not that of Motive", file=path, field="header", allowed="Format Version, ... up to Frame"
        )
    rows, body = header(path, data, count)
    settings = dict(zip(rows[0][::2], rows[0][1::2], strict=False))
    stated = settings.get("Length Units", "")
    if stated not in UNITS:
        raise InputError("unknown unit", file=path, field="Length Units", value=stated, allowed=", ".join(UNITS))
    axes, width = rows[-1], len(rows[-1])
    if axes[1:2] != ["Time (Seconds)"]:
        raise InputError("the second column is not the time", file=path, field="Time (Seconds)", value=axes[1:2])
    labelled = {row[1]: row + [""] * (width - len(row)) for row in rows[1:-1] if len(row) > 1 and row[1]}
    quantities = rows[-2] + [""] * (width - len(rows[-2]))
    if "Name" not in labelled:
        raise InputError("no header row 'Name'", file=path, field="header")
    names, types = labelled["Name"], labelled.get("Type", [""] * width)
    kinds: dict[str, set[str]] = {}
    for k in range(2, width):
        kinds.setdefault(names[k], set()).add(types[k])
    values = numbers(path, body, width, count)
    columns: dict[str, np.ndarray] = {"frame": values[0], "time": values[1]}
    for k in range(2, width):
        point = names[k] if len(kinds[names[k]]) == 1 else f"{types[k]}/{names[k]}"
        axis = axes[k].lower()
        if quantities[k] == "Position" and axis in ("x", "y", "z"):
            once(path, columns, f"{point}.{axis}", values[k])
        elif quantities[k] == "Rotation" and axis in ("x", "y", "z", "w"):
            once(path, columns, f"{point}.r{axis}", values[k])
    return export(path, columns, body, count, unit=UNITS[stated], clock="time", frame="frame")
