"""One crease between two stiff panels, as it is clamped in a torque test: M = K (theta - theta0).

    python -m origami_sim.scenes.crease_coupon

Curves of moment against prescribed angle, or of moment in time at a held angle, are diagnosed on it:

    origami-sim diagnose unit075.csv --model crease_coupon

A strip that is pulled is one crease too: with its displacement u over the gauge length L as the angle and its force F
times L as the moment (a lever of length L turns by u / L), K is the force per strain times L.
"""

import numpy as np

from origami_sim.design.build import Sheet
from origami_sim.device.scene import Outcome, Progress, Settings, follow, motion_of
from origami_sim.drive import Drive
from origami_sim.model import Model, Parameters, dihedral_angles
from origami_sim.pattern import strip

CALIBRATION = "crease_coupon"


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    """A held panel, a crease, and a panel that is rigid beside it."""
    sheet = Sheet(
        strip([s.length, s.length], s.width), thickness=s.thickness, density=s.density, triangulation="diagonal"
    )
    # rigid beside the crease's order of magnitude, so that a fit of its stiffness leaves the panels alone
    sheet.fix(panels=[0]).panel([0, 1], rigidity=1e3 * 10 ** np.floor(np.log10(s.stiffness)))
    sheet.crease(stiffness=s.stiffness, rest_angle=s.rest_angle, loss_time=s.loss_time).name("crease", ["hinge"])
    model, parameters = sheet.build()
    return model, parameters, Drive()


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    """The moment along a turn of the free panel, and its swing back from the flat state."""
    model, parameters, drive = build(s)
    angles = np.radians(np.linspace(-90, 90, 13))
    moments = s.stiffness * (angles - s.rest_angle)
    rest, notes = follow(model, parameters, [drive], lambda x: dihedral_angles(x, model.creases)[0])
    motion = motion_of(s, model, parameters, drive, duration=1.0, rate=60, progress=progress)
    return Outcome(
        motion,
        {"moment": {"angle_deg": np.degrees(angles), "moment_mNm": 1e3 * moments}},
        summary=[*notes, f"without moment the crease rests at {np.degrees(rest[0]).item():.2f} deg"],
        numbers={"rest_deg": float(np.degrees(rest[0]).item())},
    )


if __name__ == "__main__":
    from origami_sim.commands.cli import main

    main(["run", "crease_coupon"])
