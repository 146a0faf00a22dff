"""Jobs that cores share: in their order, on any number of threads."""

from functools import partial
from threading import Barrier

import pytest

from origami_sim.threads import default_threads, side_by_side


@pytest.mark.parametrize("threads", [None, 1, 2, 7])
def test_results_come_in_the_order_of_the_jobs(threads):
    assert side_by_side([partial(pow, 2, k) for k in range(5)], threads) == [1, 2, 4, 8, 16]
    assert side_by_side([], threads) == [] and default_threads() >= 1


def test_jobs_run_at_once():
    """Each waits for the other."""
    meet = Barrier(2, timeout=10.0)
    assert sorted(side_by_side([meet.wait, meet.wait], 2)) == [0, 1]


@pytest.mark.parametrize("threads", [1, 2])
def test_a_job_that_fails_is_heard_of(threads):
    with pytest.raises(ZeroDivisionError):
        side_by_side([partial(divmod, 1, 0), partial(divmod, 1, 1)], threads)
