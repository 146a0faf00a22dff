"""Jobs that cores share: in their order, on any number of threads."""

import multiprocessing
import os
import signal
from functools import partial
from threading import Barrier

import pytest

import origami_sim.threads as threads_module
from origami_sim.threads import FORKS, default_threads, side_by_side


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

    here, there = side_by_side([job, job], 2)
    assert here == os.getpid() != there


@pytest.mark.skipif(not FORKS, reason="no forks here")
def test_a_copy_that_is_ended_says_nothing():
    """What the process does when it is told to end is not a copy's to do."""
    before = signal.signal(signal.SIGTERM, lambda *_: print("interrupted"))
    try:
        here, there = side_by_side([_when_told_to_end] * 2, 2)
    finally:
        signal.signal(signal.SIGTERM, before)
    assert not here and there


def _when_told_to_end() -> bool:
    return signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


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
