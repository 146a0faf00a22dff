"""How warp is set up, once, before the first kernel is defined: quiet, and without adjoints."""

import ctypes
import os
import sys

import warp

warp.config.log_level = warp.LOG_ERROR
warp.config.enable_backward = False


def _start_without_driver():
    """Starts warp on a machine without an NVIDIA driver, which its native part would report on standard error."""
    try:
        ctypes.CDLL("libcuda.so.1")
    except OSError:
        kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
        try:
            os.dup2(nowhere, 2)
            warp.init()
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            os.close(nowhere)


if sys.platform == "linux":
    _start_without_driver()
