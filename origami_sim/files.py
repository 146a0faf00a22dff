"""Files: reading what anybody may have made (regular, of a sane size, TOML that is no trap), and writing as a whole."""

import os
import stat
import tomllib
from pathlib import Path
from typing import Any

from origami_sim.errors import InputError

PATTERNS = (".svg", ".fold", ".dxf", ".cp", ".opx", ".obj", ".stl")
"""Suffixes of crease patterns."""

LARGEST = 4 * 1024**3
"""Bytes of a file that is read whole: eight hours of fifty markers at 100 Hz as text; double may exceed memory."""

LARGEST_TOML = 4 * 1024**2
"""Bytes of a TOML file. A calibration has 20 kB; this much takes 4 s to parse, and a list of digits 6 s."""

DEEPEST = 100
"""Tables within tables of a TOML file; ours have four. Python's parser gives up at about a thousand."""


def read_bytes(path: str | Path, largest: int = LARGEST) -> bytes:
    """The content of a regular file.

    Raises:
        InputError: no such file, one that cannot be read, a folder, a device, a pipe or a socket (reading one may never
            end), more than `largest` bytes.
    """
    file = Path(path)
    try:
        # opening a pipe would wait for a writer, so what it is is asked first
        kind = os.stat(file)
        if not stat.S_ISREG(kind.st_mode):
            what = "a folder" if stat.S_ISDIR(kind.st_mode) else "a device, a pipe or a socket"
            raise InputError(f"cannot be read: it is {what}", file=file, allowed="a file")
        if kind.st_size > largest:
            raise InputError(
                "is too large to be read", file=file, value=f"{kind.st_size} bytes", allowed=f"up to {largest} bytes"
            )
        return file.read_bytes()
    except MemoryError:
        raise InputError("is too large for the memory of this machine", file=file) from None
    except (OSError, ValueError) as error:  # ValueError: a null byte in the path
        if isinstance(error, InputError):
            raise
        raise InputError(f"cannot be read: {getattr(error, 'strerror', None) or error}", file=file) from None


def read_toml(path: str | Path) -> dict[str, Any]:
    """The content of a TOML file.

    Raises:
        InputError: whatever `read_bytes` refuses, what is no TOML, tables nested beyond `DEEPEST`, integers
            beyond the 64 bits that TOML has.
    """
    file = Path(path)
    data = read_bytes(file, LARGEST_TOML)
    deep = InputError("is nested too deeply", file=file, allowed=f"up to {DEEPEST} tables within each other")
    # dotted keys take a time that grows with the square of their length
    if any(line.count(b".") > DEEPEST for line in _keys(data)):
        raise deep
    try:
        tree = tomllib.loads(data.decode("utf-8"))
    except RecursionError:
        raise deep from None
    except ValueError as error:  # malformed, not UTF-8, a number of ten thousand digits
        raise InputError(f"is no valid TOML ({error})", file=file) from None
    todo: list[Any] = [tree]
    while todo:
        value = todo.pop()
        if isinstance(value, dict | list):
            todo += value.values() if isinstance(value, dict) else value
        elif isinstance(value, int) and abs(value) >= 2**63:  # Python has larger ones, which are no float
            raise InputError("holds an integer beyond 64 bits", file=file, value=str(value))
    return tree


def write_text(path: str | Path, text: str) -> Path:
    """Writes a text file as a whole or not at all, in a folder that is made if need be.

    Raises:
        OSError: it cannot be written; what stood there before is still there.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}.partial")
    try:
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    return path


def _keys(data: bytes):
    """What could be the key or the table of each line: up to the sign of equality or a blank."""
    for line in data.splitlines():
        start = line.lstrip()
        if start[:1] == b"[" or b"=" in start:
            yield start.lstrip(b"[ ").split(b"=", 1)[0].split(b" ", 1)[0]
