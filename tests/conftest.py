"""Fixtures shared by the tests of effects and solvers."""

import os

import pytest
import warp as wp

from origami_sim.commands import cli

LONG = (
    "test_diagnoses.py",
    "test_rigid_catalogue.py",
    "test_catalogue.py",
    "test_search.py",
    "test_command.py",
    "test_slow.py",
    "test_crawler.py",
    "test_unlisted.py",
    "test_keeping.py",
    "test_timestep.py",
    "test_notebooks.py",
    "test_markers.py",
)
"""Files that take longest: those that share the cores begin with them, so that none waits for another at the end."""


def pytest_configure(config: pytest.Config) -> None:
    """Gives each worker cores of its own: diagnoses in step would wait for those of other workers."""
    worker = getattr(config, "workerinput", None)
    if worker is None or not hasattr(os, "sched_setaffinity"):
        return
    number, count = int(worker["workerid"].removeprefix("gw")), worker["workercount"]
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[number::count] or os.sched_getaffinity(0))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Puts long files first; `--no-loadscope-reorder` keeps that order."""

    def rank(item: pytest.Item) -> int:
        return LONG.index(item.path.name) if item.path.name in LONG else len(LONG)

    items.sort(key=rank)


@pytest.fixture(scope="session")
def cuda():
    """A CUDA device, or a skip that says why there is none."""
    if not wp.is_cuda_available():
        pytest.skip("no CUDA device here: rollouts on the GPU are not compared with the CPU's")
    return "cuda:0"


@pytest.fixture
def call(capfd, tmp_path, monkeypatch):
    """Runs a command line in an empty folder: (exit code, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments) -> tuple[int, str, str]:
        capfd.readouterr()
        with pytest.raises(SystemExit) as e:
            cli.main([str(a) for a in arguments])
        return e.value.code, *capfd.readouterr()

    return run
