"""What is wrong with a recording is said before a comparison of it, by the command as by a diagnosis."""

import json

import numpy as np
import pytest

BENDER = '''
from origami_sim import Drive, Sheet, ramp, strip

DURATION = "0.1 s"

def build(voltage="1 kV", modulus="4.8 GPa", factor=4.7):
    """A flap on a dielectric hinge.

    Args:
        voltage: at the end of the ramp.
    """
    sheet = Sheet(strip(["15 mm", "25 mm"], "15 mm"), thickness="0.5 mm", panels="rigid")
    sheet.electrode(layers=4, layer_thickness="100 um", permittivity=factor, notch="4 mm", film="pet",
                    film_modulus=modulus, film_thickness="20 um", side=1, loss_time="2 ms")
    sheet.gravity((9.80665, 0, 0)).fix(panels=[0]).name("crease", ["hinge"])
    return sheet, Drive(voltage=ramp(voltage, 0.1))
'''

SIDECAR = """
name = "bent"
start = "equilibrium"
time = { column = "t", unit = "s" }
[channels.angle]
column = "deg"
kind = "crease_angle"
unit = "deg"
noise = "0.1 deg"
crease = "hinge"
[drive.voltage]
column = "kV"
unit = "kV"
[priors]
modulus = "5 %"
"""


@pytest.fixture
def bent(tmp_path):
    """Writes a recording of 0.3 s of a voltage that is raised to 1 kV, with what is to be otherwise."""

    def write(old: str = "", new: str = "", *, times: float = 1.0, volts: float = 1.0) -> str:
        (tmp_path / "bender.py").write_text(BENDER)
        (tmp_path / "bent.toml").write_text(SIDECAR.replace(old, new, 1) if old else SIDECAR)
        t = np.arange(31) / 100
        rows = np.column_stack([times * t, volts * np.minimum(t / 0.1, 1.0), np.minimum(50.0 * t, 5.0)])
        np.savetxt(tmp_path / "bent.csv", rows, delimiter=",", header="t,kV,deg", comments="")
        return "bent.csv"

    return write


def compared(call, recording, *more):
    return call("compare", recording, "--model", "bender.py", *more)


def test_all_frames_are_compared_unless_told_otherwise(call, bent):
    """However long the device's own motion is shown."""
    code, out, err = compared(call, bent())
    assert (code, err) == (0, "") and "compared from t = 0.000 s to t = 0.300 s: 31 of 31 frames" in out
    assert "11 of 31 frames" in compared(call, bent(), "--duration", "0.1")[1]


def test_a_window_of_one_frame_is_refused_with_what_may_be_wrong(call, bent):
    code, out, err = compared(call, bent(times=1000.0), "--duration", "5")
    assert (code, out) == (2, "") and err.count("\n") == 1
    assert "5 s of the recording hold 1 of its frames, which are 10 s apart (field '--duration', value 5.0)" in err
    assert "unit = 'ms' under [time]" in err


@pytest.mark.parametrize(
    "old, new, said",
    [
        ("[drive.voltage]", "[drive.voltages]", "no such drive (field 'drive.voltages')"),
        ("modulus", "modulos", "a prior is for a number of the model (field 'priors', value 'modulos')"),
        ('"5 %"', '"5"', "a text without a unit (field 'priors.modulus', value '5'); allowed: '5 Pa', '5 %'"),
        ('"5 %"', '"-5 %"', "not a standard deviation (field 'priors.modulus'"),
    ],
)
def test_what_a_diagnosis_refuses_in_a_sidecar_a_comparison_refuses(call, bent, old, new, said):
    recording = bent(old, new)
    for command in ("compare", "diagnose"):
        code, _, err = call(command, recording, "--model", "bender.py")
        assert code == 2 and err.startswith("origami-sim: bent.toml: ") and said in err and err.count("\n") == 1


def test_a_drive_that_nobody_states_is_noted(call, bent):
    silent = bent('[drive.voltage]\ncolumn = "kV"\nunit = "kV"\n', "")
    _, out, _ = compared(call, silent)
    assert "note: 'bent' states no voltage_0: the scene's own is assumed (voltage_0 up to 1.0 kV).\ncompared" in out


def test_priors_of_the_command_line_may_be_plain_numbers_and_those_of_a_table_too(call, bent):
    for stated, more in (('"5 %"', ["--prior", "modulus=2e8"]), ("2e8", [])):
        recording = bent('"5 %"', stated)
        code, out, err = call("diagnose", recording, "--model", "bender.py", "--suspects", "voltage_gain", *more)
        assert code >= 10 and "bent" in out, err


def test_a_simulation_that_goes_unstable_is_no_fit(call, bent, tmp_path):
    """Volts that are read as kilovolts."""
    recording = bent(volts=1000.0)
    code, out, err = compared(call, recording)
    first, check, *_ = err.splitlines()
    assert code == 3 and "went unstable at t = " in first and "nothing is compared" in first
    assert check == (
        "origami-sim: check the units of the drive: voltage_0 comes to 1.0 MV in the recording, "
        "1.0 kV in the device's own drive"
    )
    assert "fit" not in out and out.endswith("1.0 kV in the device's own drive: is its unit right?\n")
    assert (tmp_path / "runs" / "compare" / "replay.rrd").is_file()
    code, out, _ = compared(call, recording, "--json")
    assert code == 3 and json.loads(out)["failures"][0].startswith("world 0 went unstable at t = ")


def test_plain_numbers_are_listed_without_a_unit(call, bent):
    bent()
    _, out, _ = call("run", "bender.py", "--settings")
    assert "factor = 4.7\n" in out and "voltage = 1000 V\n" in out
