"""Atomic writing of small files."""

import os
import tempfile
from pathlib import Path

from ..errors import InputError


def write_atomic(path, data: bytes) -> None:
    """Write `data` to `path` so that a reader sees the old or the new file, never half of one.

    Raises `InputError` if the folder is missing or not writable.
    """
    path = Path(path)
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name + ".", suffix=".tmp")
    except OSError as error:
        raise InputError(f"cannot write the file ({error.strerror})", file=path) from None
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(temporary, 0o666 & ~umask)
        os.replace(temporary, path)
    except OSError as error:
        os.unlink(temporary)
        raise InputError(f"cannot write the file ({error.strerror})", file=path) from None
    except BaseException:
        os.unlink(temporary)
        raise
