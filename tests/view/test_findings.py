"""What findings show: a line, a card with a picture, a plot."""

import numpy as np
import pytest

from origami_sim import miura
from origami_sim.explore.sweep import Sweep
from origami_sim.folding import fold
from origami_sim.observation.compare import compare
from origami_sim.recording import read_recording, stand_in_double_pendulum
from origami_sim.recording.stand_in import write_stand_in_sidecar


@pytest.fixture
def recording(tmp_path):
    file = stand_in_double_pendulum(tmp_path / "chain.csv", duration=0.2)
    write_stand_in_sidecar(file)
    return read_recording(file)


def shown(finding, line: str):
    """The card of a finding whose line has some words."""
    assert line in repr(finding) and "\n" not in repr(finding)
    page = finding._repr_html_()
    assert page.startswith(f"<div><b>{type(finding).__name__}</b>") and "base64,iVBOR" in page
    assert finding.plot().axes
    return page


def test_a_comparison(recording):
    off = {n: c.values + 0.01 * (np.arange(len(c.values)) > 100) for n, c in recording.channels.items()}
    page = shown(compare(recording, off), "part at t = 0.101 s")
    assert "theta2" in page
    assert repr(recording) == "<Recording stand_in: 201 frames, 0 to 0.2; theta1, theta2>"


def test_a_folding():
    page = shown(fold(miura(2, 2, 0.02, 0.02, 1.0, target_angle=2.0)), "folds to within 0.01 deg")
    assert "creases fold to within" in page


def test_a_sweep():
    columns = {"gap": np.repeat([1e-3, 2e-3, 3e-3], 5), "field": np.tile(np.arange(5.0), 3), "fold": np.arange(15.0)}
    table = Sweep(columns, ("gap", "field"), ("fold",), {3: "no equilibrium"})
    page = shown(table, "15 points of gap, field; fold; 1 not found")
    assert "15 rows in all" in page and len(table.plot().axes[0].lines) == 5
