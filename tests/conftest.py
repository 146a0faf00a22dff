"""Fixtures shared by the tests of effects and solvers."""

import pytest
import warp as wp


@pytest.fixture(scope="session")
def cuda():
    """A CUDA device, or a skip that says why there is none."""
    if not wp.is_cuda_available():
        pytest.skip("no CUDA device here: rollouts on the GPU are not compared with the CPU's")
    return "cuda:0"
