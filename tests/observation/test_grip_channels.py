"""Grips in recordings: a column that moves one, a load cell or a torque sensor that reads what it exerts."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from origami_sim import (
    Drive,
    Sheet,
    equilibrium,
    load_run,
    quasistatic,
    ramp,
    read_design,
    read_recording,
    save_run,
    series,
    simulate,
    sine,
    strip,
    write_design,
)  # fmt: skip
from origami_sim.errors import InputError
from origami_sim.observation.compare import compare
from origami_sim.observation.doubts import far_driven
from origami_sim.observation.observe import check_scene, follow, observe, observe_equilibria
from origami_sim.recording import applied_drive
from origami_sim.recording.recording import Channel, DriveChannel, Recording


def puller(panels="elastic"):
    """A folded strip between a clamp and the crosshead of a test machine."""
    pattern = strip([0.01] * 5, 0.01)
    at = np.round(pattern.vertices[:, 0] / 0.01).astype(int)
    pattern.vertices[:, 2] = np.array([0.0, 0.0, 0.004, 0.001, 0.0, 0.0])[at]
    sheet = Sheet(pattern, thickness=3e-4, material="pdms", panels=panels).crease(stiffness=2e-4, loss_time=1e-3)
    return sheet.touch(False).fix(panels=[0]).grip("head", panels=[4], direction=(1, 0, 0))


SIDECAR = """
{time}
[channels.cell]
column = "force_mN"
kind = "force"
unit = "mN"
grip = "head"
noise = 0.01
[drive.grip_head]
column = "travel_mm"
unit = "mm"
"""


def written(folder, travel, force, times=None):
    """A recording of a test machine, by load step or in time."""
    rows = zip(*([times] if times is not None else []), 1e3 * travel, 1e3 * force, strict=True)
    header = "time_s," * (times is not None) + "travel_mm,force_mN"
    text = "\n".join([header, *(",".join(f"{v:.12g}" for v in row) for row in rows)])
    (folder / "pull.csv").write_text(text + "\n")
    clock = '[time]\ncolumn = "time_s"\nunit = "s"' if times is not None else ""
    (folder / "pull.toml").write_text(SIDECAR.format(time=clock))
    return read_recording(folder / "pull.csv")


@pytest.mark.parametrize("panels", ["elastic", "rigid"])
def test_force_displacement_curve_of_a_test_machine_is_observed_along_equilibria(tmp_path, panels):
    model, parameters = puller(panels).build()
    travel = np.linspace(0.0, 6e-4, 7)
    true = [equilibrium(model, parameters, Drive(grips={"head": s})) for s in travel]
    energy = np.array([e.energy for e in true])
    slope = CubicSpline(travel, energy)(travel, 1)
    recording = written(tmp_path, travel, slope)
    assert not check_scene(recording, model)
    found = follow(model, parameters, recording)
    force = observe_equilibria(model, parameters, found, recording)["cell"]
    np.testing.assert_allclose(force[1:-1], slope[1:-1], atol=2e-3 * slope.max())
    run = quasistatic(model, parameters, Drive(grips={"head": ramp(6e-4, 1.0)}), np.linspace(0, 1, 7))
    np.testing.assert_allclose(force, run.grip_load("head")[:, 0], rtol=1e-5, atol=1e-7)


def test_a_column_shakes_a_device_and_its_force_is_compared(tmp_path):
    model, parameters = puller().build()
    times = np.linspace(0.0, 0.2, 101)
    travel = 3e-4 * np.sin(2 * np.pi * 10 * times) ** 2
    run = simulate(model, parameters, Drive(grips={"head": series(times, travel, smooth=True)}), duration=0.2, rate=500)
    recording = written(tmp_path, travel, run.grip_load("head")[:, 0], times)
    drive = applied_drive(recording)
    again = simulate(model, parameters, drive, duration=0.2, rate=500)
    np.testing.assert_allclose(again.x, run.x, atol=1e-9)
    read = observe(again, recording)["cell"]
    np.testing.assert_allclose(read, run.grip_load("head")[:, 0], atol=1e-5)
    assert compare(recording, observe(again, recording)).first_channel is None


def test_moments_are_those_of_shafts(tmp_path):
    sheet = puller()
    sheet = Sheet(sheet.pattern, thickness=3e-4, material="pdms").crease(stiffness=2e-4).touch(False).fix(panels=[0])
    model, parameters = sheet.grip("shaft", panels=[4], axis=(0, 1, 0), point=(0.04, 0, 0)).build()
    times = np.linspace(0.0, 0.1, 51)
    run = simulate(model, parameters, Drive(turns={"shaft": sine("5 deg", "10 Hz")}), duration=0.1, rate=500)
    (tmp_path / "twist.csv").write_text(
        "time_s,turn,torque\n" + "\n".join(f"{t},{5 * np.sin(20 * np.pi * t)},0" for t in times) + "\n"
    )
    side = SIDECAR.format(time='[time]\ncolumn = "time_s"\nunit = "s"').replace("force_mN", "torque")
    side = side.replace('"force"', '"moment"').replace('"mN"', '"mN m"').replace("head", "shaft")
    (tmp_path / "twist.toml").write_text(side.replace("grip_shaft", "turn_shaft").replace("travel_mm", "turn").replace(
        '"mm"', '"deg"'))  # fmt: skip
    recording = read_recording(tmp_path / "twist.csv")
    assert not check_scene(recording, model)
    np.testing.assert_allclose(observe(run, recording)["cell"], run.grip_load("shaft")[:, 0], rtol=1e-12)


def test_what_a_channel_cannot_read_of_a_grip_is_refused(tmp_path):
    model, parameters = puller().build()
    times = np.linspace(0.0, 0.1, 11)
    recording = written(tmp_path, 0 * times, times, times)
    text = (tmp_path / "pull.toml").read_text()

    def reread(old, new):
        (tmp_path / "pull.toml").write_text(text.replace(old, new))
        return read_recording(tmp_path / "pull.csv")

    with pytest.raises(InputError, match="the model has no such grip"):
        check_scene(reread('grip = "head"', 'grip = "foot"'), model)
    with pytest.raises(InputError, match="only for a force"):
        reread('kind = "force"\nunit = "mN"', 'kind = "crease_angle"\nunit = "rad"')
    moment = reread('kind = "force"\nunit = "mN"', 'kind = "moment"\nunit = "mN m"')
    with pytest.raises(InputError, match="that moves along a direction gives a force"):
        check_scene(moment, model)
    with pytest.raises(InputError, match="unit"):
        reread('unit = "mm"', 'unit = "deg"')
    run = simulate(model, parameters, Drive(grips={"head": sine("0.1 mm", "5 Hz")}), duration=0.1)
    node = int(np.flatnonzero(model.grips == 0)[0])
    by_node = reread('grip = "head"', f"node = {node}\ndirection = [1.0, 0.0, 0.0]")
    with pytest.raises(InputError, match="the force of supports that move is that of a grip"):
        observe(run, by_node)
    assert recording.channels["cell"].attachment == {"grip": "head"}


def test_runs_and_designs_keep_their_grips(tmp_path):
    sheet = puller()
    model, parameters = sheet.build()
    drive = Drive(grips={"head": ramp("0.3 mm", "20 ms", smooth=True)})
    run = simulate(model, parameters, drive, duration=0.05, rate=200)
    save_run(tmp_path / "run", run, scene="pull", replay=True)
    back = load_run(tmp_path / "run").trajectory
    np.testing.assert_array_equal(back.grip_load("head"), run.grip_load("head"))
    np.testing.assert_array_equal(back.energy_balance(), run.energy_balance())
    assert back.model.hash == model.hash
    for source in (sheet, (model, parameters)):
        write_design(tmp_path / "pull.toml", source, drive, duration=0.05, rate=200)
        design = read_design(tmp_path / "pull.toml")
        built = design.sheet.build() if isinstance(source, Sheet) else design.source
        again = simulate(*built, design.drive, duration=0.05, rate=200)
        np.testing.assert_allclose(again.x, run.x, atol=1e-12)
    run.plot()


def test_the_path_of_a_grip_is_held_against_that_of_the_device():
    """What is said of drives in other units reads paths, which are smooth, like any drive."""
    times = np.arange(20) / 100.0
    path = DriveChannel("turn_motor", 0.2 * np.sin(10.0 * times), "rad", False)
    fold = Channel("fold", "crease_angle", np.zeros(20), "rad", 1e-3, {"crease": 0})
    recording = Recording("turned", times, {"fold": fold}, {"turn_motor": path})
    assert not far_driven(recording, Drive(turns={"motor": 0.1}))
    assert "turn_motor" in far_driven(recording, Drive(turns={"motor": 1e-5}))[0].lower()
