"""DeepLabCut CSV: three header rows (scorer, bodyparts, coords), or four with `individuals`; x, y (z), likelihood.

Points are `<bodypart>` or, with several individuals, `<individual>/<bodypart>`; lengths are pixels, rows count down
from the upper edge of the image; the first column numbers the frames of the video. The file does not tell the rate.
"""

from pathlib import Path

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.table import Table
from origami_sim.recording.trackers._text import export, head, header, numbers, once

FORMAT = "deeplabcut"
LEVELS = ("scorer", "individuals", "bodyparts", "coords")


def matches(path: Path, data: bytes) -> bool:
    """Whether the first column of the first rows names the levels of the header."""
    return [row[0] for row in head(data, 3) if row][:2] in (["scorer", "bodyparts"], ["scorer", "individuals"])


def read(path: Path, data: bytes) -> Table:
    """Columns `frame`, and `<point>.x`, `.y` [px], `.score` by point; see the head of this file."""
    count = 4 if [row[0] for row in head(data, 4) if row][1:2] == ["individuals"] else 3
    rows, body = header(path, data, count)
    levels = {row[0]: row[1:] for row in rows if row}
    wanted = [level for level in LEVELS if count == 4 or level != "individuals"]
    width = max(map(len, levels.values()), default=0)
    if list(levels) != wanted or any(len(names) != width for names in levels.values()) or not width:
        raise InputError(
            "the header is not that of DeepLabCut", file=path, field="header", allowed=f"rows {', '.join(wanted)}"
        )
    values = numbers(path, body, width + 1, count)
    columns: dict[str, np.ndarray] = {"frame": values[0]}
    animals = levels.get("individuals", [""] * width)
    for animal, part, coordinate, column in zip(
        animals, levels["bodyparts"], levels["coords"], values[1:], strict=True
    ):
        axis = "score" if coordinate == "likelihood" else coordinate
        once(path, columns, f"{animal}/{part}.{axis}" if animal else f"{part}.{axis}", column)
    return export(path, columns, body, count, unit="px", frame="frame")
