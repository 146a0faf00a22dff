"""Work that the cores of the machine share."""

import multiprocessing
import os
import signal
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection
from typing import TypeVar

T = TypeVar("T")

FORKS = sys.platform == "linux"
"""Whether a process may be copied while it runs: elsewhere system libraries do not outlive it."""


def default_threads() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def side_by_side(
    jobs: Sequence[Callable[[], T]], threads: int | None, progress: Callable[[float], None] | None = None
) -> list[T]:
    """What jobs return, in their order, made on so many cores (default: all) by this process and by copies of it.

    Copies (forks) share the interpreter's work too, not only that of kernels; each costs some 0.1 s of processor time,
    for pages that both write. Jobs have to be pure: what a copy changes is lost, but for what it returns, which has to
    be picklable. What a copy does not deliver (it was killed, or out of memory) this process does itself. Without forks
    threads do the jobs; in a worker of a pool they are done one after the other.

    Args:
        progress: called with the part of this process' own jobs that is done.
    """
    done = progress or (lambda part: None)
    count = min(threads or default_threads(), len(jobs))
    if count <= 1 or multiprocessing.current_process().daemon:  # which may have no copies
        return list(_one_by_one(jobs, done))
    if not FORKS:
        with ThreadPoolExecutor(count) as pool:
            return [made.result() for made in [pool.submit(job) for job in jobs]]
    context = multiprocessing.get_context("fork")
    shares = [range(k, len(jobs), count) for k in range(count)]
    found: dict[int, T] = {}
    copies = []
    try:
        for share in shares[1:]:
            here, there = context.Pipe(duplex=False)
            copy = context.Process(target=_deliver, args=(there, [jobs[n] for n in share]), daemon=True)
            with warnings.catch_warnings():  # threads of libraries wait for work, and hold no lock meanwhile
                warnings.simplefilter("ignore", DeprecationWarning)
                copy.start()
            there.close()
            copies.append((copy, here, share))
        found = dict(zip(shares[0], _one_by_one([jobs[n] for n in shares[0]], done), strict=True))
        for _, here, share in copies:
            try:
                found.update(zip(share, here.recv(), strict=True))
            except EOFError:
                found.update({n: jobs[n]() for n in share})
    finally:
        for copy, here, _ in copies:
            here.close()
            copy.terminate()
            copy.join()
    return [found[n] for n in range(len(jobs))]


def _one_by_one(jobs: Sequence[Callable[[], T]], done: Callable[[float], None]) -> Iterator[T]:
    for n, job in enumerate(jobs):
        yield job()
        done((n + 1) / len(jobs))


def _deliver(there: Connection, jobs: Sequence[Callable[[], T]]) -> None:
    """What a copy does: its share of the jobs; what goes wrong, goes wrong again where it is reported."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that was copied hears it, and ends its copies
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # which it does at once, whatever that process would do
    try:
        there.send([job() for job in jobs])
    except Exception:
        os._exit(1)
    os._exit(0)  # what libraries would do at an exit is not a copy's to do
