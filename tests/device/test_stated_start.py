"""Where a motion beside a recording begins."""

import numpy as np
import pytest

from origami_sim import Drive, Sheet, strip
from origami_sim.device.begun import begun, filmed, state_of
from origami_sim.device.device import device_module
from origami_sim.device.scene import scene_settings
from origami_sim.errors import InputError
from origami_sim.model.articulation import Articulation
from origami_sim.observation.compare import compare
from origami_sim.observation.observe import observe
from origami_sim.recording import Channel, DriveChannel, Recording
from origami_sim.recording.stated import Start
from origami_sim.solve.motion.dynamics import simulate

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
def test_a_device_that_markers_show_begins_where_they_are_or_at_the_angles_that_are_stated(stated):
    sheet = Sheet(strip([0.02, 0.03], 0.02), thickness=1e-3, panels="rigid").crease(stiffness=1e-3)
    model, parameters = sheet.name("crease", ["hinge"]).fix(panels=[0]).build()
    arm = Articulation(model)
    x = arm.positions(arm.moved(arm.reference(), np.array([[0.3]])))[5, 0]
    marker = Channel("m", "marker", np.tile(x, (20, 1)), "m", 1e-5, {"node": 5})
    start = Start(state="released", angles={"hinge": 0.4}, sd=0.01) if stated else None
    found = begun(model, parameters, Drive(), Recording("film", np.arange(20.0), {"m": marker}, start=start))
    assert found is not None and found.angles[0, 0] == pytest.approx(0.4 if stated else 0.3, abs=1e-9)
    assert np.allclose(found.v, 0.0, atol=1e-9)


@pytest.mark.parametrize("seen_by", ["angle", "marker"])
@pytest.mark.parametrize("rate", [60, 240])
def test_an_exact_recording_of_a_swing_does_not_part(tmp_path, rate, seen_by):
    """Its start is read from noisy frames: what these tell of the rate alone is off by some times what shows."""
    (tmp_path / "flap.py").write_text(FLAP.replace("20 mT", "0 mT"))
    module = device_module(str(tmp_path / "flap.py"))
    model, parameters, drive = module.build(settings := scene_settings(module))
    arm, rng = Articulation(model), np.random.default_rng(3)
    for phase in (0.0, 2.0):
        pose = arm.moved(arm.reference(), np.array([[0.3 * np.cos(phase) - 0.2]]))
        start = state_of(model, pose, np.array([[8.0 * np.sin(phase)]]))
        film = simulate(model, parameters, drive, duration=1.0, rate=rate, state=start)
        values, noise = (film.creases[:, 0, 0], 1e-3) if seen_by == "angle" else (film.x[:, 5, 0], 1e-4)
        kind, unit, of = ("crease_angle", "rad", {"crease": 0}) if seen_by == "angle" else ("marker", "m", {"node": 5})
        noisy = Channel("c", kind, values + noise * rng.normal(size=values.shape), unit, noise, of)
        recording = Recording("film", film.times, {"c": noisy})
        found = compare(recording, observe(module.replicate(settings, recording)[0], recording), threshold=4.0)
        assert found.first_time is None and found.channels["c"].rmse < 1.2 * noise


def test_a_walker_at_rest_begins_where_it_was_seen():
    """Where on the ground a device stands is no matter of its equilibrium, but of the recording."""
    sheet = Sheet(strip([0.03, 0.04], 0.02), thickness="1 mm", panels="rigid").crease(stiffness="2 mN m/rad")
    sheet.mass([0, 1], "2 g").feet([0, 1, 4, 5], height="4 mm").gravity().ground(friction=0.25)
    model, parameters = sheet.build()
    markers = {
        f"m{n}": Channel(
            f"m{n}", "marker", np.tile(model.position[n] + (2e-3, 1e-3, 0.0), (20, 1)), "m", 1e-4, {"node": n}
        )
        for n in (0, 1, 4, 5)
    }
    film = Recording("film", np.arange(20.0), markers, start=Start("equilibrium"))
    found = begun(model, parameters, Drive(), film)
    assert found is not None and np.allclose(found.x[[0, 1, 4, 5], 0, :2].mean(axis=0), (0.037, 0.001), atol=1e-4)


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


def test_a_plain_number_has_the_unit_that_its_meaning_states(tmp_path):
    said = "stiffness: of the hinge [N m/rad]. gap: between [mm]. rub: a share."
    meaning = f'    """A flap.\n\n    Args:\n        {said}\n    """\n'
    stated = FLAP.replace('stiffness="2 mN m/rad"):\n', "stiffness=2e-3, gap=1.0, rub=0.3):\n" + meaning)
    (tmp_path / "flap.py").write_text(stated)
    settings = scene_settings(device_module(str(tmp_path / "flap.py")))
    assert [settings[n].unit for n in ("stiffness", "gap", "rub")] == ["N m/rad", "SI", "SI"]
    assert settings.override(["stiffness=3 mN m/rad"]).stiffness == pytest.approx(3e-3)


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
