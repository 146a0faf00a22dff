"""Work that the cores of the machine share."""

import mmap
import multiprocessing
import os
import pickle
import signal
import struct
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection
from typing import TypeVar

T = TypeVar("T")

FORKS = sys.platform == "linux"
"""Whether a process may be copied while it runs: elsewhere system libraries do not outlive it."""

TOKEN = struct.Struct("ii")
"""What says that a job is to be done: the number of a round, and that of the job, or NO_MORE."""

NO_MORE = -1

COPIES = 8
"""Processes in step where nobody states how many: each holds the memory of a whole diagnosis.

Of 61 s of a double chain each process does 12.6 s itself. By that alone half as many take 1.3 times as long, and twice
as many 0.84 times; only two were timed.
"""


def default_threads() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def in_step(work: Callable[[], T], threads: int | None) -> T:
    """What work returns, done by this process in step with copies of it (forks), on so many cores (default: `COPIES`).

    All do the same work, each for itself, but for jobs that they share (`side_by_side`): of these each does some, and
    is told what the others made (single program, multiple data; Darema 2001). So a copy is made once, and has at hand
    all that a job needs. What is to happen once, such as writing a file, is for the process that `leads`.

    Work has to go the same way in all of them: by what it is given, what jobs return and what is `told`, never by a
    clock. A copy that goes another way, fails or is killed ends the sharing; this process then does all jobs itself.
    """
    count = threads or min(default_threads(), COPIES)
    if count <= 1 or not _may_share():
        return work()
    with _led(work, count):
        return work()


def leads() -> bool:
    """Whether this process is to do what happens once, such as writing a file: no other does the same, or it leads."""
    return _team is None or _busy or _team.rank == 0


def sharing() -> int:
    """Processes that share what comes next, this one among them."""
    return 1 if _team is None or _busy else len(_team.boards)


def told(make: Callable[[], T]) -> T:
    """What the process that leads makes, known to all that go in step with it; it has to be picklable."""
    return make() if _team is None or _busy else _team.share([make], 0, lambda part: None)[0]


def side_by_side(
    jobs: Sequence[Callable[[], T]], threads: int | None, progress: Callable[[float], None] | None = None
) -> list[T]:
    """What jobs return, in their order, made on so many cores (default: all) by this process and those in step with it.

    Where there are none (`in_step`), they are made for these jobs, at some 0.1 s of processor time each. Jobs have to
    be pure: what a copy changes is lost, but for what it returns, which has to be picklable. What a copy does not
    deliver (it was killed, or out of memory) this process does itself. Without forks threads do the jobs; within a job,
    and in a worker of a pool, they are done one after the other.

    Args:
        progress: called with the part of the jobs that others have not to wait for any more.
    """
    done = progress or (lambda part: None)
    if _team is not None and not _busy and jobs:
        return _team.share(jobs, len(jobs), done)
    count = min(threads or default_threads(), len(jobs))
    if count > 1 and _may_share():
        return in_step(lambda: shared(jobs, done), count)
    if count > 1 and not FORKS and not _busy:
        with ThreadPoolExecutor(count) as pool:
            return [made.result() for made in [pool.submit(job) for job in jobs]]
    return shared(jobs, done)


def shared(
    jobs: Sequence[Callable[[], T]], progress: Callable[[float], None] | None = None, *, led: int = 0
) -> list[T]:
    """What jobs return that are too short for copies of their own: as `side_by_side`, if processes go in step.

    Args:
        led: so many of them, the last ones, are for the process that `leads`, which does them first.
    """
    done = progress or (lambda part: None)
    if _team is not None and not _busy and len(jobs) > 1:
        return _team.share(jobs, len(jobs) - led, done)
    out = []
    for n, job in enumerate(jobs):
        out.append(job())
        done((n + 1) / len(jobs))
    return out


@contextmanager
def in_turn() -> Iterator[None]:
    """Processes in step do one after the other what the next ones then find done, such as compiling a kernel."""
    if _team is None:
        yield
        return
    import fcntl  # where processes fork

    file = _team.boards[0][0]
    fcntl.lockf(file, fcntl.LOCK_EX)  # falls with its process
    try:
        yield
    finally:
        fcntl.lockf(file, fcntl.LOCK_UN)


class Team:
    """Processes that go in step.

    Args:
        rank: of this process; the first leads. lines: from the one that leads to each other, or the other way round.
        tokens: ends of a pipe of jobs that nobody has taken. boards: two files in memory for each process, in turns:
            what it made stays there until all have read it.
    """

    def __init__(self, rank: int, lines: list[Connection], tokens: tuple[int, int], boards: list[tuple[int, int]]):
        self.rank, self.lines, self.tokens, self.boards, self.round = rank, lines, tokens, boards, 0

    def share(self, jobs: Sequence[Callable[[], T]], free: int, done: Callable[[float], None]) -> list[T]:
        """What jobs return; the first `free` of them each process may do, the others are for that which leads."""
        self.round += 1
        mine = self._mine(jobs, free, done)
        found = mine | self._others((len(jobs), free), self._shown(mine))
        # what was lost, failed or cannot be pickled each process does itself, and hears of what goes wrong
        return [found[n] if n in found else job() for n, job in enumerate(jobs)]

    def _mine(self, jobs: Sequence[Callable[[], T]], free: int, done: Callable[[float], None]) -> dict[int, T]:
        """What jobs return that this process took; those that fail are left out."""
        if self.rank == 0:
            order = [*range(free), *[NO_MORE] * len(self.boards)]
            os.write(self.tokens[1], b"".join(TOKEN.pack(self.round, n) for n in order))
        out: dict[int, T] = {}
        with _at_work():
            for n in range(free, len(jobs)) if self.rank == 0 else ():
                out.update(_made(jobs[n], n))
            while (n := self._taken()) != NO_MORE:
                out.update(_made(jobs[n], n))
                if self.rank == 0:
                    done((n + 1) / len(jobs))
        return out

    def _taken(self) -> int:
        token = os.read(self.tokens[0], TOKEN.size)
        number, n = TOKEN.unpack(token) if token else (-1, -1)
        return n if number == self.round else _out_of_step()

    def _shown(self, made: dict) -> int:
        """Shows the others what this process made; its size in bytes, or 0 if that cannot be pickled or kept."""
        try:
            with open(self.boards[self.rank][self.round % 2], "r+b", closefd=False) as board:
                board.seek(0)
                pickle.dump(made, board, pickle.HIGHEST_PROTOCOL)
                return board.tell()
        except Exception:
            return 0

    def _others(self, kind: tuple[int, int], size: int) -> dict:
        """What the others made, once all are done; the one that leads goes on alone if one of them is gone."""
        try:
            if self.rank == 0:
                said = [line.recv() for line in self.lines]
                if any(own != (self.round, kind) for own, _ in said):
                    raise EOFError
                sizes = [size, *(s for _, s in said)]
                for line in self.lines:
                    line.send(sizes)
            else:
                self.lines[0].send(((self.round, kind), size))
                sizes = self.lines[0].recv()
        except (EOFError, OSError):
            if self.rank:
                _out_of_step()
            _disband()
            return {}
        out: dict = {}
        for rank, (boards, length) in enumerate(zip(self.boards, sizes, strict=True)):
            if rank != self.rank and length:
                with mmap.mmap(boards[self.round % 2], length, access=mmap.ACCESS_READ) as board:
                    out.update(pickle.loads(board))
        return out


_team: Team | None = None  # of this process
_busy = False  # whether it does a job


def _may_share() -> bool:
    return FORKS and _team is None and not _busy and not multiprocessing.current_process().daemon


@contextmanager
def _at_work() -> Iterator[None]:
    global _busy
    _busy = True
    try:
        yield
    finally:
        _busy = False


def _made(job: Callable[[], T], n: int) -> dict[int, T]:
    try:
        return {n: job()}
    except Exception:
        return {}


def _disband() -> None:
    global _team
    _team = None


@contextmanager
def _led(work: Callable[[], object], count: int) -> Iterator[None]:
    """This process leads so many, itself among them, until the end."""
    global _team
    context = multiprocessing.get_context("fork")
    tokens = os.pipe()
    boards = [(os.memfd_create("even"), os.memfd_create("odd")) for _ in range(count)]
    lines, copies = [], []
    try:
        for rank in range(1, count):
            here, there = context.Pipe()
            lines.append(here)
            team = Team(rank, [there], tokens, boards)
            copy = context.Process(target=_follow, args=(work, team, lines), daemon=True)
            with warnings.catch_warnings():  # threads of libraries wait for work, and hold no lock meanwhile
                warnings.simplefilter("ignore", DeprecationWarning)
                copy.start()
            there.close()
            copies.append(copy)
        _team = Team(0, lines, tokens, boards)
        yield
    finally:
        _team = None
        for copy in copies:
            copy.kill()
            copy.join()
        for line in lines:
            line.close()
        for file in (*tokens, *(f for pair in boards for f in pair)):
            os.close(file)


def _follow(work: Callable[[], object], team: Team, others: list[Connection]) -> None:
    """What a copy does: the same work, without a word, until it ends or the one that leads is gone."""
    global _team
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process that was copied hears it, and ends its copies
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # which it does at once, whatever that process would do
    silence = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silence, 1)
    os.dup2(silence, 2)
    for line in others:  # so that all hear when the one that leads is gone
        line.close()
    os.close(team.tokens[1])
    _team = team
    try:
        work()
    finally:
        os._exit(0)  # what libraries would do at an exit is not a copy's to do


def _out_of_step():
    """Ends a copy that has gone another way than the process that leads, which then does what it owes."""
    os._exit(1)
