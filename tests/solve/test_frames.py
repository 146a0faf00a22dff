"""Durations and rates that nobody can mean are refused, each in a sentence, before anything is computed."""

import numpy as np
import pytest

from origami_sim import Drive, Sheet, ramp, read_design, simulate, strip, write_design
from origami_sim.device.device import device_module
from origami_sim.device.scene import scene_settings
from origami_sim.errors import InputError
from origami_sim.explore import Way
from origami_sim.solve.motion.frames import check_memory, physical_memory
from origami_sim.view.film import Film
from origami_sim.view.moving import moving_picture

FLAP = """
from origami_sim import Sheet, strip
DURATION = 1.0
def build(width=0.02):
    return Sheet(strip([0.01, 0.02], width), thickness=1e-3, material="pdms").crease(stiffness=2e-3).fix(panels=[0])
"""


def flap():
    return Sheet(strip([0.01, 0.02], 0.02), thickness=1e-3, material="pdms").crease(stiffness=2e-3).fix(panels=[0])


@pytest.mark.parametrize("motion", ["dynamic", "quasistatic"])
@pytest.mark.parametrize(
    ("rate", "said"), [(-5.0, "'rate', value -5"), (0.0, "'rate', value 0"), (1e12, "GB of memory")]
)
def test_a_device_refuses_a_rate_that_is_none(tmp_path, motion, rate, said):
    file = tmp_path / "flap.py"
    file.write_text(FLAP)
    module = device_module(str(file))
    settings = scene_settings(module).replace(rate=rate).with_motion(motion, None)
    with pytest.raises(InputError, match=said):
        module.run(settings)


def test_more_frames_than_there_is_memory_for_are_refused_with_the_rate_that_finds_room():
    model, parameters = flap().build()
    with pytest.raises(InputError, match="GB of memory"):
        simulate(model, parameters, duration=1e6, rate=1e6)
    frame = 24.0 * len(model.position) * (3 + len(model.laws))
    check_memory(model, 1, 10.0, 60.0, memory=601 * frame)
    with pytest.raises(InputError, match="up to 30 frames per second"):
        check_memory(model, 1, 10.0, 60.0, memory=300 * frame)
    assert physical_memory() > 1e8


@pytest.mark.parametrize("value", [-1.0, 0.0, np.inf, np.nan])
def test_rates_of_sweeps_designs_and_films_are_positive(tmp_path, value):
    sheet = flap()
    with pytest.raises(InputError, match="rate"):
        Way(duration=1.0, rate=value)
    with pytest.raises(InputError, match=r"run\.rate"):
        write_design(tmp_path / "flap.toml", sheet, rate=value)
    motion = simulate(*sheet.build(), duration=0.05)
    with pytest.raises(InputError, match="rate"):
        moving_picture(Film(motion), rate=value)


def test_a_design_file_states_no_negative_rate(tmp_path):
    file = write_design(tmp_path / "flap.toml", flap())
    file.write_text(file.read_text().replace("rate = 60", "rate = -60"))
    with pytest.raises(InputError, match=r"flap\.toml.*run\.rate.*-60"):
        read_design(file)


@pytest.mark.parametrize("duration", [-1.0, 0.0, np.inf, np.nan])
def test_a_ramp_takes_a_time(duration):
    with pytest.raises(InputError, match="a ramp needs a positive duration"):
        Drive(field=(0, 0, ramp(0.1, duration)))
