"""A swinging arm with a dry friction that its scene lacks, written as a recording, and the command line."""

from pathlib import Path

import numpy as np
import pytest

from origami_sim.commands import cli
from origami_sim.device.scene import scene_module, scene_settings
from origami_sim.solve.motion.dynamics import simulate

FRICTION, NOISE = 1.0e-3, 5e-4
QUICK = ("--suspects", "crease_friction,crease_quadratic_damping,air_drag")
"""The truth is among them; fewer suspects make the tests quick."""

T = np.arange(60) / 60.0
WAVE = 3.0 + 0.3 * np.cos(9.0 * T) + 1e-3 * np.random.default_rng(3).normal(size=60)

SIDECAR = """\
name = "swing"
[time]
column = "time_s"
unit = "s"
[channels.theta1]
column = "theta1_rad"
kind = "panel_angle"
unit = "rad"
panel = "arm1"
[scene]
name = "pendulum_chain"
overrides = { mass_2 = 0.0, membrane_stiffness = 1e4 }
[priors]
mass_1 = "1 %"
viscosity_1 = 5e-5
"""


def single() -> tuple:
    """Module and settings of a single arm, released at rest."""
    module = scene_module("pendulum_chain")
    s = scene_settings(module).replace(mass_2=0.0, membrane_stiffness=1e4, angle_1=2.4, rate_1=0.0)
    return module, s


def swing(folder: Path, duration: float = 8.0) -> Path:
    """A recording of the arm with a dry friction that the scene lacks, and with noise."""
    module, s = single()
    model, parameters, drive = module.build(s)
    rich = model.with_effects("crease_friction")
    real = parameters.for_model(rich).set("crease_friction", "friction_moment", FRICTION)
    motion = simulate(rich, real, drive, duration=duration, rate=120, state=module.start(s, rich))
    angle = module.arm_angles(motion, s)[:, 0] + NOISE * np.random.default_rng(1).normal(size=len(motion.times))
    return table(folder / "swing.csv", motion.times, {"theta1_rad": angle})


def table(path: Path, times, columns: dict, sidecar: str = SIDECAR) -> Path:
    """A CSV file with its sidecar."""
    rows = zip(times, *columns.values(), strict=True)
    text = ["time_s," + ",".join(columns), *(",".join("" if v != v else f"{v:.9g}" for v in row) for row in rows)]
    path.write_text("\n".join(text) + "\n")
    path.with_suffix(".toml").write_text(sidecar)
    return path


def main(*arguments) -> int:
    with pytest.raises(SystemExit) as e:
        cli.main([str(a) for a in arguments])
    return int(e.value.code or 0)


def recorded_drive(name: str, values, unit: str = "T", *, constant: bool = False):
    """A recording of nothing but this drive."""
    from origami_sim.recording import DriveChannel, Recording

    return Recording("r", np.arange(20) / 10, {}, {name: DriveChannel(name, np.array(values), unit, constant)})
