"""FOLD 1.2 as JSON: parse, pick a frame with its inheritance, and read typed arrays out of it."""

import json
import math

import numpy as np

from ..errors import InputError

OLD_SPELLINGS = {"edges_foldAngles": "edges_foldAngle"}
"""Keys of older FOLD files and what they are called now."""


def parse_json(data: bytes, *, file=None) -> dict:
    """Return the JSON object in `data`; raise `InputError` for malformed JSON, NaN or Infinity, or another value."""

    def refuse(constant):
        raise InputError("number that JSON does not have", file=file, value=constant, allowed="finite numbers or null")

    try:
        document = json.loads(data.decode("utf-8-sig"), parse_constant=refuse)
    except InputError:
        raise
    except RecursionError:
        raise InputError("malformed JSON: nested too deeply", file=file) from None
    except ValueError as error:
        raise InputError(f"malformed JSON: {error}", file=file) from None
    if not isinstance(document, dict):
        raise InputError("not a FOLD file: the top level is not a JSON object", file=file, value=brief(document))
    return document


def brief(value):
    """Return `value` fit for an error sentence: short scalars as they are, the rest by its kind."""
    if isinstance(value, str):
        return value if len(value) <= 60 else value[:57] + "..."
    if value is None or isinstance(value, (bool, float)):
        return value
    if isinstance(value, int):
        return value if abs(value) < 10**20 else "a huge integer"
    return {"list": "a list", "dict": "an object"}.get(type(value).__name__, type(value).__name__)


def resolve_frame(document, number, *, file=None) -> dict:
    """Return the keys of one frame with those it inherits.

    Args:
        document: the parsed file.
        number: 0 for the key frame at the top level, k for the k-th of `file_frames`.
        file: named in errors.

    Raises:
        InputError: no such frame, or a broken or circular `frame_parent`.
    """
    if number == 0:
        return _modern({key: value for key, value in document.items() if not key.startswith("file_")})
    frames = document.get("file_frames", [])
    if not isinstance(frames, list):
        raise InputError("not a list", file=file, field="file_frames", value=brief(frames))
    chain: list[int] = []
    merged: dict = {}
    while True:
        allowed = f"0 to {len(frames)}"
        if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number <= len(frames):
            field = "frame_parent" if chain else "frame"
            raise InputError("no such frame", file=file, field=field, value=brief(number), allowed=allowed)
        if number in chain:
            raise InputError(
                "frames inherit from each other in a circle", file=file, field="frame_parent", value=number
            )
        chain.append(number)
        if number == 0:
            return resolve_frame(document, 0) | merged
        frame = frames[number - 1]
        if not isinstance(frame, dict):
            raise InputError(
                "frame is not an object", file=file, field=f"file_frames[{number - 1}]", value=brief(frame)
            )
        merged = _modern(frame) | merged
        if frame.get("frame_inherit") is not True:
            return merged
        number = frame.get("frame_parent", 0)


def main_frame(document, *, file=None) -> int:
    """Return which frame to fold: the key frame, unless it has no vertices, or shows the folded form while another one
    is the crease pattern."""
    key = resolve_frame(document, 0, file=file)
    if key.get("vertices_coords") and "foldedForm" not in _classes(key):
        return 0
    frames = document.get("file_frames")
    for number in range(1, len(frames) + 1 if isinstance(frames, list) else 1):
        try:
            keys = resolve_frame(document, number, file=file)
        except InputError:  # a broken frame that nobody asked for
            continue
        if keys.get("vertices_coords") and (not key.get("vertices_coords") or "creasePattern" in _classes(keys)):
            return number
    return 0


def _classes(keys) -> list:
    classes = keys.get("frame_classes")
    return classes if isinstance(classes, list) else []


def _modern(frame) -> dict:
    renamed = dict(frame)
    for old, new in OLD_SPELLINGS.items():
        if old in renamed and new not in renamed:
            renamed[new] = renamed.pop(old)
    return renamed


class Frame:
    """Typed, checked access to the arrays of one frame; every complaint names the file, the field and the value."""

    def __init__(self, keys: dict, file=None):
        self.keys, self.file = keys, file

    def rows(self, field, count=None) -> list | None:
        """Return the list under `field`, or None if absent; `count` is the length it must have."""
        rows = self.keys.get(field)
        if rows is None:
            return None
        if not isinstance(rows, list):
            raise InputError("not a list", file=self.file, field=field, value=brief(rows), allowed="a JSON list")
        if count is not None and len(rows) != count:
            raise InputError(
                "wrong array length", file=self.file, field=field, value=len(rows), allowed=f"{count} entries"
            )
        return rows

    def number(self, value, field) -> float:
        """Return a JSON number as a finite float."""
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            try:
                number = float(value)
            except OverflowError:
                number = math.inf
            if math.isfinite(number):
                return number
        raise InputError(
            "not a finite number", file=self.file, field=field, value=brief(value), allowed="finite numbers"
        )

    def numbers(self, field, count, low, high, allowed, *, open_low=False) -> np.ndarray | None:
        """Return [count] floats with null as nan, or None if absent; all within [low, high] (low excluded if open)."""
        rows = self.rows(field, count)
        if rows is None:
            return None
        values = np.full(count, np.nan)
        for n, row in enumerate(rows):
            if row is None:
                continue
            values[n] = self.number(row, f"{field}[{n}]")
            if not low <= values[n] <= high or (open_low and values[n] == low):
                raise InputError("out of range", file=self.file, field=f"{field}[{n}]", value=row, allowed=allowed)
        return values

    def coordinates(self) -> np.ndarray:
        """Return `vertices_coords` as [V, 3] in the unit of the frame, 2D ones padded with z = 0."""
        rows = self.rows("vertices_coords")
        if not rows:
            raise InputError(
                "vertices missing", file=self.file, field="vertices_coords", allowed="[x, y] or [x, y, z] lists"
            )
        points = np.zeros((len(rows), 3))
        for v, row in enumerate(rows):
            field = f"vertices_coords[{v}]"
            if not isinstance(row, list) or len(row) not in (2, 3):
                raise InputError("not a point", file=self.file, field=field, value=brief(row), allowed="2 or 3 numbers")
            points[v, : len(row)] = [self.number(x, field) for x in row]
        return points

    def loops(self, field, *, size=None) -> list[tuple[int, ...]] | None:
        """Return lists of vertex indices (each of `size`, if given), or None if absent."""
        rows = self.rows(field)
        if rows is None:
            return None
        loops = []
        for n, row in enumerate(rows):
            name = f"{field}[{n}]"
            allowed = f"a list of {size or 'vertex'} indices"
            if not isinstance(row, list) or (size is not None and len(row) != size):
                raise InputError("bad entry", file=self.file, field=name, value=brief(row), allowed=allowed)
            for v in row:
                if isinstance(v, bool) or not isinstance(v, int):
                    raise InputError("not an index", file=self.file, field=name, value=brief(v), allowed=allowed)
                if not 0 <= v < len(self.keys["vertices_coords"]):
                    top = len(self.keys["vertices_coords"]) - 1
                    raise InputError(
                        "index out of range", file=self.file, field=name, value=brief(v), allowed=f"0 to {top}"
                    )
            loops.append(tuple(row))
        return loops

    def choices(self, field, count, choices) -> list[str] | None:
        """Return [count] strings out of `choices`, or None if absent."""
        rows = self.rows(field, count)
        for n, row in enumerate(rows or ()):
            if not isinstance(row, str) or row not in choices:
                raise InputError(
                    "unknown letter", file=self.file, field=f"{field}[{n}]", value=brief(row), allowed=" ".join(choices)
                )
        return rows

    def names(self, field, count) -> list[str | None] | None:
        """Return [count] strings or None entries, or None if absent."""
        rows = self.rows(field, count)
        for n, row in enumerate(rows or ()):
            if row is not None and not isinstance(row, str):
                raise InputError(
                    "not a name", file=self.file, field=f"{field}[{n}]", value=brief(row), allowed="a string or null"
                )
        return rows
