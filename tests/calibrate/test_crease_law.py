"""What `origami-sim calibrate` writes is the crease of a device or of a scene as it stands."""

import numpy as np
import pytest

from origami_sim import Sheet, equilibrium, read_design, strip, write_design
from origami_sim.calibrate.command import build
from origami_sim.calibrate.result import write_calibration
from origami_sim.commands.cli import main
from origami_sim.device.scene import scene_module, scene_settings
from origami_sim.errors import InputError


@pytest.fixture
def curve(tmp_path):
    """A crease that stiffens, M = 2 mN m/rad (t - 0.4) + 1 mN m/rad^3 (t - 0.4)^3, measured without noise."""
    angle = np.linspace(-1.0, 2.0, 200)
    moment = 2.0 * (angle - 0.4) + (angle - 0.4) ** 3
    rows = [f"{np.degrees(a):.9f},{m:.9f}" for a, m in zip(angle, moment, strict=True)]
    file = tmp_path / "curve.csv"
    file.write_text("\n".join(["angle_deg,torque", *rows]))

    def written(name, *options):
        done = build(["crease", str(file), "--angle-unit", "deg", "--moment-unit", "mN m", *options])
        return write_calibration(tmp_path / name, done.calibration)

    return written


def held(file, **how):
    sheet = Sheet(strip([0.01, 0.02, 0.02], 0.02), thickness=1e-3, material="pdms").fix(panels=[0])
    return sheet.crease_law(file, **how)


def test_a_measured_curve_is_the_law_of_creases(curve, tmp_path):
    sheet = held(curve("law.toml"))
    found = equilibrium(*sheet.build())
    assert found.converged and found.angles[:2] == pytest.approx([0.4, 0.4], abs=1e-9)
    written = write_design(tmp_path / "design.toml", sheet)
    (tmp_path / "law.toml").unlink()  # a design remembers the numbers
    again = equilibrium(*read_design(written).sheet.build())
    assert again.angles[:2] == pytest.approx(found.angles[:2], abs=1e-9)


def test_creases_of_another_law_stay_beside_it(curve):
    model, parameters = held(curve("law.toml"), creases=[1]).crease([0], stiffness=1e-3, rest_angle=0.1).build()
    found = equilibrium(model, parameters)
    assert found.angles[:2] == pytest.approx([0.1, 0.4], abs=1e-9)


def test_a_line_has_its_stiffness_and_a_loss(curve):
    model, parameters = held(curve("line.toml", "--linear", "--within=10,35"), loss_time="10 ms").build()
    stiffness = parameters["crease", "stiffness"][:, 0]
    assert stiffness == pytest.approx(2e-3, rel=0.02)
    assert parameters["crease_viscosity", "viscosity"][:, 0] == pytest.approx(0.01 * stiffness)
    assert "crease_table" not in model.effects


def test_a_scene_takes_what_it_has_a_setting_for(curve):
    module = scene_module("crease_coupon")
    settings = scene_settings(module, curve("law.toml"))
    assert settings.stiffness == pytest.approx(2e-3, rel=1e-6) and settings.rest_angle == pytest.approx(0.4, abs=1e-9)
    assert settings.thickness == scene_settings(module).thickness
    with pytest.raises(InputError, match=r"nothing that was calibrated.*crease_law"):
        scene_settings(scene_module("falling_ball"), curve("law.toml"))


def test_a_file_that_is_no_crease_is_refused(tmp_path):
    file = tmp_path / "other.toml"
    entry = '[{}]\nvalue = 1.0\nunit = "{}"\nsource = "x"\nmeaning = "x"\n'
    for text, said in (
        (entry.format("gap", "m"), "says nothing of a crease"),
        (entry.format("stiffness", "N/m"), "stiffness.unit"),
        (entry.format("resisting_moment_00", "N m"), "not whole"),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=said):
            held(file)


def test_the_command_says_how_its_file_is_used(curve, tmp_path, capsys):
    curve("law.toml")
    with pytest.raises(SystemExit):
        main(["calibrate", "crease", str(tmp_path / "curve.csv"), "--angle-unit", "deg", "--moment-unit", "mN m",
              "--out", str(tmp_path / "crease.toml")])  # fmt: skip
    assert f"sheet.crease_law('{tmp_path / 'crease.toml'}')" in capsys.readouterr().out
