"""Predictions of what was recorded of devices in grips: in time by fold angles, by load step with forces."""

import numpy as np
import pytest
from observation.test_grip_channels import puller, written
from solve.test_grips import chain, flap

from origami_sim import Drive, equilibrium, read_recording, series, simulate
from origami_sim.errors import InputError
from origami_sim.hypotheses.hypothesis import Hypothesis
from origami_sim.hypotheses.subject import subject_of
from origami_sim.predict.bars import BarRollouts
from origami_sim.predict.curves import Static
from origami_sim.predict.rigid import RigidRollouts

SIDECAR = """
[time]
column = "time_s"
unit = "s"
[channels.fold]
column = "fold"
kind = "crease_angle"
unit = "rad"
crease = 0
noise = 1e-4
[drive.grip_base]
column = "z"
unit = "mm"
"""


def shaken(folder, model, parameters):
    """A recording of a flap on a shaken base, without noise."""
    times = np.linspace(0.0, 0.5, 251)
    travel = 1.5e-3 * np.sin(2 * np.pi * (3 * times + 8 * times**2)) * np.clip(times / 0.1, 0, 1) ** 2
    drive = Drive(grips={"base": series(times, travel, smooth=True)})
    run = simulate(model, parameters, drive, duration=0.5, rate=500)
    rows = zip(times, run.creases[:, 0, 0], 1e3 * travel, strict=True)
    text = "\n".join(["time_s,fold,z", *(f"{t:.6f},{a:.12g},{z:.12g}" for t, a, z in rows)])
    (folder / "shaken.csv").write_text(text + "\n")
    (folder / "shaken.toml").write_text(SIDECAR)
    return read_recording(folder / "shaken.csv")


@pytest.mark.parametrize("segment", [None, 0.1])
def test_a_shaken_flap_is_predicted_from_any_frame(tmp_path, segment):
    model, parameters = flap("rigid", damping=8e-3)
    recording = shaken(tmp_path, model, parameters)
    forward = RigidRollouts(subject_of((model, parameters, Drive())), [recording], segment=segment, threads=1)
    count = len(forward.blocks)
    assert count == 1 if segment is None else count > 3
    start = np.zeros((count, 2))
    for _ in range(3):  # the start of every segment is fitted
        moves = np.array([[0.0, 0.0], [1e-5, 0.0], [0.0, 1e-5]])
        found = forward.predict(Hypothesis(), np.zeros((3, 0)), start + moves[:, None])
        left = []
        for k, (block, p) in enumerate(zip(forward.blocks, found, strict=True)):
            by = (p[1:] - p[0]).reshape(2, -1).T / 1e-5
            gap = (block.values - p[0]).ravel()
            left.append(np.abs(gap).max())
            start[k] += np.linalg.lstsq(by, gap, rcond=None)[0]
    assert max(left) < 5e-6 and np.ptp(recording.channels["fold"].values) > 0.05


def test_force_displacement_curves_are_predicted_by_load_step(tmp_path):
    model, parameters = puller().build()
    travel = np.linspace(0.0, 6e-4, 9)
    force = np.array([-equilibrium(model, parameters, Drive(grips={"head": s})).reactions[:8, 0].sum() for s in travel])
    recording = written(tmp_path, travel, force)
    forward = Static(subject_of((model, parameters, Drive())), [recording], threads=1)
    found = np.concatenate([p[0, :, 0] for p in forward.predict(Hypothesis(), np.zeros((1, 0)))])
    assert np.ptp(force) > 1e-3
    np.testing.assert_allclose(found, force, atol=1e-6 * np.abs(force).max())


def test_what_a_diagnosis_does_not_follow_is_refused(tmp_path):
    model, parameters = flap("rigid", damping=8e-3)
    recording = shaken(tmp_path, model, parameters)
    with pytest.raises(InputError, match="does not follow bars of devices in grips that move"):
        BarRollouts(subject_of((*flap("elastic"), Drive())), [recording], threads=1)
    text = SIDECAR.replace("crease_angle", "panel_angle").replace("crease = 0", "panel = 1")
    (tmp_path / "shaken.toml").write_text(text)
    with pytest.raises(InputError, match="does not follow what a camera sees"):
        RigidRollouts(subject_of((model, parameters, Drive())), [read_recording(tmp_path / "shaken.csv")], threads=1)
    (tmp_path / "shaken.toml").write_text(SIDECAR.replace("grip_base", "grip_left"))
    with pytest.raises(InputError, match="does not follow several supports"):
        RigidRollouts(subject_of((*chain(), Drive())), [read_recording(tmp_path / "shaken.csv")], threads=1)
