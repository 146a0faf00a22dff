"""Work that the cores of the machine share."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

T = TypeVar("T")


def default_threads() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def side_by_side(jobs: Sequence[Callable[[], T]], threads: int | None) -> list[T]:
    """What jobs return, in their order, made by so many threads (default: all cores).

    Jobs run at once as far as they leave the interpreter: in kernels, and in numpy over long arrays.
    """
    count = min(threads or default_threads(), len(jobs))
    if count <= 1:
        return [job() for job in jobs]
    with ThreadPoolExecutor(count) as pool:
        return [made.result() for made in [pool.submit(job) for job in jobs]]
