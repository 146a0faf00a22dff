"""Where a motion beside a recording begins."""

import numpy as np
import pytest

from origami_sim import Drive, Sheet, strip
from origami_sim.device.begun import begun, filmed
from origami_sim.device.device import device_module
from origami_sim.device.scene import scene_settings
from origami_sim.errors import InputError
from origami_sim.recording import Channel, DriveChannel, Recording
from origami_sim.recording.stated import Start

FLAP = """
from origami_sim import Drive, Sheet, sine, strip

def build(stiffness="2 mN m/rad"):
    sheet = Sheet(strip([0.01, 0.03], 0.02), thickness="1 mm", panels="rigid")
    sheet.body(1, mass="3 g", centre=(0.025, 0, 0), inertia=(1e-7, 2.25e-7, 3.25e-7))
    sheet.magnetise(1, remanence=0.1, volume=6.3e-7, poling=(1, 0, 0))
    sheet.crease(stiffness=stiffness, loss_time="4 ms").gravity().fix(panels=[0])
    return sheet, Drive(field=(0, 0, sine("20 mT", "1 Hz")))
"""


def recorded(step: float, field, count: int = 40, **stated) -> Recording:
    """Frames of a flap at regular times in a field along z [T]; its fold angle is zero."""
    times = np.arange(count) * step
    angle = Channel("fold", "crease_angle", np.zeros(count), "rad", 1e-3, {"crease": 0})
    drive = {"field_z": DriveChannel("field_z", np.full(count, field), "T", False)}
    return Recording("film", times, {"fold": angle}, drive, **stated)


@pytest.fixture
def flap(tmp_path):
    (tmp_path / "flap.py").write_text(FLAP)
    module = device_module(str(tmp_path / "flap.py"))
    return module, scene_settings(module)


@pytest.mark.parametrize("stated", [True, False])
def test_a_device_that_markers_show_begins_at_the_angles_that_are_stated(stated):
    sheet = Sheet(strip([0.02, 0.03], 0.02), thickness=1e-3, panels="rigid").crease(stiffness=1e-3)
    model, parameters = sheet.name("crease", ["hinge"]).fix(panels=[0]).build()
    marker = Channel("m", "marker", np.zeros((3, 3)), "m", 1e-4, {"panel": 1})
    start = Start(state="released", angles={"hinge": 0.4}, sd=0.01) if stated else None
    found = begun(model, parameters, Drive(), Recording("film", np.arange(3.0), {"m": marker}, start=start))
    if not stated:
        assert found is None
    else:
        assert found is not None and found.angles[0, 0] == pytest.approx(0.4, abs=1e-15) and not np.any(found.v)


@pytest.mark.parametrize("motion", ["dynamic", "quasistatic"])
@pytest.mark.parametrize("step", [4.0, 1.2, 0.4])
def test_a_simulation_has_frames_where_a_slow_recording_has_them(flap, step, motion):
    recording = recorded(step, 0.0, motion=motion, start=Start("equilibrium"))
    film, used = flap[0].replicate(flap[1], recording)
    assert np.allclose(film.times[: len(recording.times)], recording.times, atol=1e-9) and used.motion == motion


@pytest.mark.parametrize(
    ("rate", "digits", "frames"), [(120, 4, 120), (30000 / 1001, 9, 30000 / 1001), (0.25, 3, 0.25)]
)
def test_frames_a_second_are_whole_where_a_clock_rounds(rate, digits, frames):
    times = np.round(np.arange(200) / rate, digits)
    assert filmed(Recording("film", times, {}))[1] == pytest.approx(frames, rel=1e-6)


@pytest.mark.parametrize("motion", ["dynamic", "quasistatic"])
def test_a_drive_that_was_recorded_as_nothing_is_none(flap, motion):
    """The device's own field would swing it; and what rests in the field of the first frame does not move in it."""
    for field in (0.0, 5e-3):
        film, _ = flap[0].replicate(flap[1], recorded(0.02, field, motion=motion, start=Start("equilibrium")))
        assert np.ptp(film.creases[:, 0, 0]) < 1e-4
    moved, _ = flap[0].replicate(flap[1], recorded(0.02, 0.0, start=Start("moving")))
    assert np.ptp(moved.creases[:, 0, 0]) > 0.1, "flat is no equilibrium under gravity"


def test_a_walker_begins_in_the_equilibrium_that_is_stated():
    sheet = Sheet(strip([0.03, 0.04], 0.02), thickness="1 mm", panels="rigid").crease(stiffness="2 mN m/rad")
    sheet.mass([0, 1], "2 g").feet([0, 1, 4, 5], height="4 mm").gravity().ground(friction=0.25)
    model, parameters = sheet.build()
    film = Recording("film", np.arange(3.0), {}, start=Start("equilibrium"))
    found = begun(model, parameters, Drive(), film)
    assert found is not None and found.angles[0, 0] > 0.05 and not np.any(found.v)


def test_an_equilibrium_that_does_not_exist_is_refused():
    sheet = Sheet(strip([0.03, 0.04], 0.02), thickness="1 mm", panels="rigid").crease(stiffness="2 mN m/rad")
    model, parameters = sheet.mass([0, 1], "2 g").gravity().build()  # it falls
    with pytest.raises(InputError, match="no equilibrium in the drive of the first frame"):
        begun(model, parameters, Drive(), Recording("film", np.arange(3.0), {}, start=Start("equilibrium")))
