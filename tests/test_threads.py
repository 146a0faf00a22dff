"""Jobs that cores share: in their order, on any number of threads."""

import multiprocessing
import os
import signal
from functools import partial
from threading import Barrier

import numpy as np
import pytest

import origami_sim.threads as threads_module
from origami_sim.threads import FORKS, default_threads, in_step, leads, shared, side_by_side, told


@pytest.mark.parametrize("threads", [None, 1, 2, 7])
def test_results_come_in_the_order_of_the_jobs(threads):
    assert side_by_side([partial(pow, 2, k) for k in range(5)], threads) == [1, 2, 4, 8, 16]
    assert side_by_side([], threads) == [] and default_threads() >= 1


@pytest.mark.skipif(not FORKS, reason="no forks here")
def test_jobs_run_at_once_in_processes():
    """Each waits for the other."""
    meet = multiprocessing.get_context("fork").Barrier(2, timeout=30.0)

    def job() -> int:
        meet.wait()
        return os.getpid()

    assert len({*side_by_side([job, job], 2), os.getpid()}) == 2


@pytest.mark.skipif(not FORKS, reason="no forks here")
def test_a_copy_that_is_ended_says_nothing():
    """What the process does when it is told to end is not a copy's to do."""
    meet = multiprocessing.get_context("fork").Barrier(2, timeout=30.0)

    def when_told_to_end() -> tuple[int, bool]:
        meet.wait()
        return os.getpid(), signal.getsignal(signal.SIGTERM) == signal.SIG_DFL

    before = signal.signal(signal.SIGTERM, lambda *_: print("interrupted"))
    try:
        found = dict(side_by_side([when_told_to_end] * 2, 2))
    finally:
        signal.signal(signal.SIGTERM, before)
    assert found.pop(os.getpid()) is False and list(found.values()) == [True]


@pytest.mark.skipif(not FORKS, reason="no forks here")
def test_what_a_killed_process_owes_is_done_here():
    mine = os.getpid()

    def job() -> int:
        if os.getpid() != mine:
            os.kill(os.getpid(), signal.SIGKILL)
        return os.getpid()

    assert side_by_side([job, job, job], 3) == [mine] * 3


@pytest.mark.skipif(not FORKS, reason="no forks here")
def test_a_worker_of_a_pool_does_its_jobs_itself():
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert len(set(pool.apply(_pids))) == 1


def _pids() -> list[int]:
    return side_by_side([os.getpid, os.getpid], 2)


def test_without_forks_threads_run_at_once(monkeypatch):
    monkeypatch.setattr(threads_module, "FORKS", False)
    meet = Barrier(2, timeout=10.0)
    assert sorted(side_by_side([meet.wait, meet.wait], 2)) == [0, 1]


@pytest.mark.parametrize("threads", [1, 2])
def test_a_job_that_fails_is_heard_of(threads):
    with pytest.raises(ZeroDivisionError):
        side_by_side([partial(divmod, 1, 0), partial(divmod, 1, 1)], threads)


# in step -------------------------------------------------------------------------------------------------------------

in_threes = pytest.mark.skipif(not FORKS, reason="no forks here")


@in_threes
def test_processes_in_step_know_what_each_made():
    """A sum that needs what all did, and a second round that needs the first."""
    meet = multiprocessing.get_context("fork").Barrier(3, timeout=30.0)

    def square(n: int) -> tuple[int, int]:
        if n < 3:
            meet.wait()
        return os.getpid(), n * n

    def work() -> tuple[set[int], int]:
        made = side_by_side([partial(square, n) for n in range(9)], None)
        total = sum(v for _, v in made)
        return {pid for pid, _ in made}, sum(shared([partial(pow, total, k) for k in range(3)]))

    pids, total = in_step(work, 3)
    assert len(pids) == 3 and total == 1 + 204 + 204**2
    assert shared([os.getpid] * 3) == [os.getpid()] * 3 and in_step(os.getpid, 1) == os.getpid()


@in_threes
def test_large_results_come_whole():
    def work() -> float:
        made = [shared([partial(np.full, 10**6, float(n + r)) for n in range(4)]) for r in range(4)]
        return sum(float(part.sum()) for each in made for part in each)

    assert in_step(work, 3) == 1e6 * sum(n + r for n in range(4) for r in range(4))


@in_threes
def test_one_process_leads(tmp_path):
    """What is to happen once happens once; what depends on the process is told by the one that leads."""

    def work() -> tuple[int, list[bool], list[int]]:
        if leads():
            (tmp_path / str(os.getpid())).touch()
        within = shared([leads] * 6)  # a job is done by one process alone
        return told(os.getpid), within, shared([os.getpid] * 6, led=2)[-2:]

    assert in_step(work, 3) == (os.getpid(), [True] * 6, [os.getpid()] * 2)
    assert [f.name for f in tmp_path.iterdir()] == [str(os.getpid())]


@in_threes
def test_within_a_job_nothing_is_shared():
    def job() -> bool:
        return {*side_by_side([os.getpid] * 3, 3), told(os.getpid), in_step(os.getpid, 3)} == {os.getpid()}

    assert in_step(lambda: shared([job] * 6), 3) == [True] * 6


@in_threes
@pytest.mark.parametrize("fault", ["another way", "killed", "ends", "raises"])
def test_a_copy_that_goes_another_way_is_left_behind(fault):
    mine = os.getpid()

    def work() -> list[int]:
        first = shared([partial(pow, 2, n) for n in range(5)])
        if os.getpid() != mine:
            if fault == "another way":
                shared([os.getpid] * 2)
            elif fault == "killed":
                os.kill(os.getpid(), signal.SIGKILL)
            elif fault == "raises":
                raise ValueError
            return first
        return [*first, *shared([partial(pow, 3, n) for n in range(5)]), told(partial(pow, 5, 2))]

    assert in_step(work, 3) == [*(2**n for n in range(5)), *(3**n for n in range(5)), 25]


@in_threes
def test_what_cannot_be_pickled_each_makes_itself():
    assert [f() for f in in_step(lambda: shared([lambda n=n: lambda: n for n in range(3)]), 2)] == [0, 1, 2]


@in_threes
def test_all_hear_of_a_job_that_fails():
    def work() -> list[int]:
        try:
            shared([partial(divmod, 1, n) for n in (1, 0, 2)])
        except ZeroDivisionError:
            return shared([partial(pow, 2, n) for n in range(4)])
        return []

    assert in_step(work, 2) == [1, 2, 4, 8]


@in_threes
def test_no_copy_outlives_the_work():
    with pytest.raises(KeyError):
        in_step(lambda: {}[shared([os.getpid] * 3)[0]], 3)
    assert not multiprocessing.active_children()
