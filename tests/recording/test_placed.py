"""Magnets and coils that a sidecar places around the recorded device."""

import numpy as np
import pytest

from origami_sim import Drive, Sheet, magnet, series, simulate, strip
from origami_sim.device.device import device_module
from origami_sim.device.scene import scene_settings
from origami_sim.errors import InputError
from origami_sim.predict.drives import drive_of
from origami_sim.recording import applied_drive, read_recording
from origami_sim.recording.dataset import _equal_drives
from origami_sim.solve.kernels.sources import field_at

SIDECAR = """
[time]
column = "t"
[channels.a]
column = "a"
kind = "crease_angle"
unit = "rad"
crease = 0
noise = 1e-3
"""
MAGNET = 'magnet = { remanence = "1.2 T", radius = "5 mm", length = "10 mm", position = [0.012, 0.005, %s] }\n'
DEVICE = """
from origami_sim import Drive, Sheet, dipole, strip


def build():
    sheet = Sheet(strip([0.01, 0.01], 0.01), thickness="1 mm", triangulation="center", panels="rigid").fix(panels=[0])
    sheet.crease(stiffness="0.1 mN m/rad", loss_time="5 ms")
    sheet.magnetise(1, remanence="0.1 T", volume="100 mm^3", poling=(1, 0, 0)).on("field_gradient")
    return sheet, Drive(sources=[dipole("9 A m^2", position=(0, 0, -1.0))])
"""
TIMES = 5.0 + np.arange(31) / 60.0
HEIGHT = -0.09 + 0.1 * (TIMES - 5.0)


def recorded(folder, sources, angle=None):
    """A recording with a column of heights [mm] that begins at 5 s."""
    rows = zip(TIMES, np.zeros(31) if angle is None else angle, 1e3 * HEIGHT, strict=True)
    (folder / "a.csv").write_text("t,a,z\n" + "".join(f"{t:.6f},{a:.9f},{z:.6f}\n" for t, a, z in rows))
    (folder / "a.toml").write_text(SIDECAR + sources)
    return read_recording(folder / "a.csv")


def test_a_measured_path_is_seen_from_the_first_frame(tmp_path):
    r = recorded(tmp_path, "[[drive.sources]]\n" + MAGNET % '{ column = "z", unit = "mm" }')
    path = series([0.0, 9.0], [-0.09, 0.81])
    truth = Drive(sources=[magnet(1.2, radius=0.005, length=0.01, position=(0.012, 0.005, path))])
    for found in (applied_drive(r), drive_of(r, Drive())):
        for t in (0.0, 0.2, 0.5):
            assert field_at(found, [[0, 0, 0.01]], t)[0] == pytest.approx(
                field_at(truth, [[0, 0, 0.01]], t)[0], rel=1e-6
            )
    assert applied_drive(r).end > 0.5 + 1 / 60  # the last place is held: a run may end after the last frame


def test_waves_are_on_the_clock_of_the_recording(tmp_path):
    stated = "{ times = [5, 5.25, 6], values = ['-90 mm', '-65 mm', '10 mm'] }"
    r = recorded(tmp_path, "[[drive.sources]]\n" + MAGNET % stated)
    assert applied_drive(r)["source_0_z"](0.25) == pytest.approx(-0.065)
    wave = recorded(tmp_path, "[[drive.sources]]\ncoil = { current = { sine = 2, frequency = 0.3 }, radius = 0.1 }\n")
    assert applied_drive(wave)["source_0_strength"](0.2) == pytest.approx(2 * np.sin(2 * np.pi * 0.3 * 5.2))


def test_a_window_keeps_the_clock(tmp_path):
    r = recorded(tmp_path, "[[drive.sources]]\n" + MAGNET % '{ column = "z", unit = "mm" }')
    part = r.window(5.2, 5.4)
    assert applied_drive(part)["source_0_z"](0.0) == pytest.approx(np.interp(part.times[0], TIMES, HEIGHT))


def test_they_take_the_place_of_those_of_the_device(tmp_path):
    (tmp_path / "flap.py").write_text(DEVICE)
    module = device_module(str(tmp_path / "flap.py"))
    path = series([0.0, 9.0], [-0.09, 0.81])
    drive = Drive(sources=[magnet(1.2, radius=0.005, length=0.01, position=(0.012, 0.005, path))])
    settings = scene_settings(module)
    model, parameters, own = module.build(settings)
    truth = simulate(model, parameters, drive, duration=0.5, rate=60)
    r = recorded(tmp_path, "[[drive.sources]]\n" + MAGNET % '{ column = "z", unit = "mm" }', truth.creases[:, 0, 0])
    motion, _ = module.replicate(settings, r)
    assert np.ptp(truth.creases[:, 0, 0]) > 0.01
    assert motion.creases[:, 0, 0] == pytest.approx(truth.creases[:, 0, 0], abs=1e-6)
    assert [kind for kind, _ in drive_of(r, own).placed] == ["magnet"]
    assert [kind for kind, _ in drive_of(recorded(tmp_path, ""), own).placed] == ["dipole"]


@pytest.mark.parametrize(
    ("sources", "equal"),
    [
        ("[[drive.sources]]\n" + MAGNET % '{ column = "z", unit = "mm" }', True),
        ("[[drive.sources]]\n" + MAGNET % '{ column = "z", unit = "cm" }', False),
        ("[[drive.sources]]\n" + MAGNET % "0", False),
        (2 * ("[[drive.sources]]\n" + MAGNET % '{ column = "z", unit = "mm" }'), False),
        ("", False),
    ],
)
def test_recordings_with_other_magnets_were_driven_otherwise(tmp_path, sources, equal):
    one = recorded(tmp_path, "[[drive.sources]]\n" + MAGNET % '{ column = "z", unit = "mm" }')
    assert _equal_drives(one, recorded(tmp_path, sources)) is equal


def test_curves_hold_them_at_each_step(tmp_path):
    (tmp_path / "a.csv").write_text("a,z\n0,-90\n0.1,-80\n0.2,-70\n")
    untimed = SIDECAR.replace('[time]\ncolumn = "t"\n', "")
    (tmp_path / "a.toml").write_text(untimed + "[[drive.sources]]\n" + MAGNET % '{ column = "z", unit = "mm" }')
    r = read_recording(tmp_path / "a.csv")
    assert [float(np.ravel(applied_drive(r, step=k)["source_0_z"](0.0))[0]) for k in range(3)] == pytest.approx(
        [-0.09, -0.08, -0.07]
    )


def test_a_model_without_magnets_in_a_gradient_says_so(tmp_path):
    r = recorded(tmp_path, "[[drive.sources]]\n" + MAGNET % "0")
    sheet = Sheet(strip([0.01, 0.01], 0.01), thickness="1 mm").fix(panels=[0]).crease(stiffness=1e-3, loss_time=3e-3)
    with pytest.raises(InputError, match="sources"):
        simulate(*sheet.build(), applied_drive(r), duration=0.1)


@pytest.mark.parametrize(
    ("sources", "words"),
    [
        ("[drive]\nsources = 3\n", "sources are a list"),
        ("[[drive.sources]]\nmagnets = {}\n", "'magnet' is near"),
        ("[[drive.sources]]\n" + MAGNET % '{ column = "zz", unit = "mm" }', "zz"),
        ("[[drive.sources]]\n" + MAGNET % '{ column = "z", unit = "mT" }', "another unit.*a unit of m"),
        ("[[drive.sources]]\n" + MAGNET % '{ column = "z", units = "mm" }', "is no column"),
        ("[[drive.sources]]\n" + MAGNET % '{ column = "z", unit = "cubit" }', "unit.*cubit"),
        ("[[drive.sources]]\n" + MAGNET % '"3 mT"', "wrong unit.*position.*mT"),
        ("[[drive.sources]]\n" + MAGNET % "{ ramp = 1, duration = 1, start = 'x' }", "'x'"),
        ("[[drive.sources]]\n" + MAGNET % "{ times = [5.1, 9], values = [0, 1] }", "does not cover the recording"),
        ("[[drive.sources]]\ntable = { file = 'none.csv' }\n", "none.csv"),
    ],
)
def test_bad_sources_are_one_sentence(tmp_path, sources, words):
    with pytest.raises(InputError, match=words) as e:
        recorded(tmp_path, sources)
    assert "\n" not in str(e.value) and str(tmp_path) in str(e.value)


def test_a_hole_in_a_path_is_named(tmp_path):
    recorded(tmp_path, "[[drive.sources]]\n" + MAGNET % '{ column = "z", unit = "mm" }')
    text = (tmp_path / "a.csv").read_text().splitlines()
    text[4] = text[4].rpartition(",")[0] + ","
    (tmp_path / "a.csv").write_text("\n".join(text) + "\n")
    with pytest.raises(InputError, match=r"misses a value|'z'"):
        read_recording(tmp_path / "a.csv")
