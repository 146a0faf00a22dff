"""One magnetic panel on one crease: k (theta - theta0) = (Br V / mu0) B cos(theta).

python -m origami_sim.scenes.mae_crease
"""

import numpy as np

from origami_sim.design.build import Sheet
from origami_sim.device.scene import Outcome, Progress, Settings, follow, motion_of
from origami_sim.drive import Drive, ramp
from origami_sim.model import Model, Parameters, dihedral_angles
from origami_sim.pattern import strip

CALIBRATION = "mae_crease"


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    """A held panel, a crease, and a magnetic panel that is rigid beside the crease."""
    sheet = Sheet(
        strip([s.length / 2, s.length], s.width),
        thickness=s.thickness,
        material="mae",
        density=s.density,
        triangulation="center",
    )
    # rigid beside the crease's order of magnitude, so that a fit of its stiffness leaves the panels alone
    sheet.fix(panels=[0]).panel([0, 1], rigidity=1e5 * 10 ** np.floor(np.log10(s.stiffness)))
    sheet.crease(stiffness=s.stiffness, rest_angle=0.0, loss_time=s.loss_time).name("crease", ["hinge"])
    sheet.magnetise(1, remanence=s.remanence, volume=s.length * s.width * s.thickness, poling=(1, 0, 0))
    model, parameters = sheet.build()
    return model, parameters, Drive(field=(0, 0, ramp(s.field, 1.0)))


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    model, parameters, drive = build(s)
    fields = np.linspace(0, s.field, 11)[1:]
    drives = [Drive(field=(0, 0, b)) for b in fields]
    angles, notes = follow(model, parameters, drives, lambda x: dihedral_angles(x, model.creases)[0])
    angles = np.degrees(angles)
    motion = motion_of(s, model, parameters, drive, duration=2.0, rate=60, progress=progress)
    final = float(np.degrees(motion.creases[-1, 0, 0]))
    return Outcome(
        motion,
        {"fold_angle": {"field_mT": fields * 1e3, "angle_deg": angles}},
        summary=[
            *notes,
            f"{angles[-1]:.4f} deg in {s.field * 1e3:.0f} mT by statics, {final:.4f} deg at the end of the motion",
        ],
        numbers={"angle_deg": float(angles[-1]), "dynamic_angle_deg": final},
    )


if __name__ == "__main__":
    from origami_sim.commands.cli import main

    main(["run", "mae_crease"])
