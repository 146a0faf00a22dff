"""SLEAP analysis CSV: `track, frame_idx, instance.score, <node>.x, <node>.y, <node>.score`, a row per track and frame.

Points are `<node>` where the file has one track, and `<track>/<node>` else. Lengths are pixels, rows count down from
the upper edge of the image. Frames in which nothing was found have no row: they become missing values.
"""

from pathlib import Path

import numpy as np

from origami_sim.errors import InputError
from origami_sim.recording.table import Table
from origami_sim.recording.trackers._text import head, header, numbers

FORMAT = "sleap"
LARGEST_GRID = 10_000_000
"""Frames beyond this mean that the frame numbers are damaged."""


def matches(path: Path, data: bytes) -> bool:
    """Whether the first columns are those of an analysis file."""
    return head(data, 1)[0][:2] == ["track", "frame_idx"]


def read(path: Path, data: bytes) -> Table:
    """Columns `frame`, and `<point>.x`, `.y` [px], `.score` by point; see the head of this file."""
    rows, body = header(path, data, 1)
    names = rows[0]
    if names[:2] != ["track", "frame_idx"] or len(set(names)) != len(names):
        raise InputError(
            "the header is not that of a SLEAP analysis", file=path, field="header", allowed="track, frame_idx, ..."
        )
    tracks, frames, *values = numbers(path, body, len(names), 1, text=(0,))
    if len(frames) == 0:
        raise InputError("the file has no rows", file=path)
    if not np.all(np.isfinite(frames) & (frames == np.round(frames))):
        raise InputError("a frame number is missing or no whole number", file=path, field="frame_idx")
    first, last = int(frames.min()), int(frames.max())
    if last - first >= LARGEST_GRID:
        raise InputError("the frame numbers are damaged", file=path, field="frame_idx", value=last)
    places = (frames - first).astype(int)
    columns = {"frame": np.arange(first, last + 1, dtype=float)}
    labels = np.array([label or "" for label in tracks], dtype=object)
    found = list(dict.fromkeys(labels.tolist()))
    for label in found:
        mine = np.flatnonzero(labels == label)
        spots, counts = np.unique(places[mine], return_counts=True)
        if counts.max() > 1:
            twice = int(spots[counts > 1][0]) + first
            raise InputError(
                f"the track '{label}' stands twice in one frame: export tracked instances",
                file=path,
                field="frame_idx",
                value=twice,
            )
        for name, column in zip(names[2:], values, strict=True):
            spread = np.full(last - first + 1, np.nan)
            spread[places[mine]] = column[mine]
            columns[f"{label}/{name}" if len(found) > 1 else name] = spread
    return Table(
        file=path,
        numbers=columns,
        labels={},
        rows=np.arange(last - first + 1),
        lines=lambda row: f"frame {first + row}",
        unit="px",
        frame="frame",
    )
