"""Folded box: four magnetic flaps on a silicone cross close in a vertical field.

python -m origami_sim.scenes.box
"""

import numpy as np

from origami_sim.build import Sheet
from origami_sim.drive import Drive, Signal, ramp, sine
from origami_sim.materials import bridge_stiffness
from origami_sim.model import Model, Parameters
from origami_sim.pattern import Pattern
from origami_sim.pattern.assemble import assemble
from origami_sim.scene import Outcome, Progress, Settings, follow
from origami_sim.solve.dynamics import simulate

CALIBRATION = "box"
FIELDS = np.array([0.010, 0.020, 0.050, 0.100, 0.150, 0.200])
REFERENCE = np.array([20.4, 38.6, 62.0, 74.0, 78.8, 81.4])
"""Flap angle [deg] at FIELDS: independent lumped solution for the default calibration."""

OUTWARD = np.array([(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)], float)


def pattern(s: Settings) -> Pattern:
    """A square base and four flaps as wide as their patches; hinge lines in the middle of the gaps."""
    half, w, reach = s.base / 2, s.patch_width / 2, s.gap / 2 + s.patch_length
    vertices, base, flaps = [], [], []
    for out in OUTWARD:
        along = np.cross((0, 0, 1), out)
        corner = half * (out - along)
        a, b = half * out - w * along, half * out + w * along
        k = len(vertices)
        vertices += [corner, a, b, b + reach * out, a + reach * out]
        base += [k, k + 1, k + 2]
        flaps.append((k + 1, k + 4, k + 3, k + 2))
    return assemble(vertices, [tuple(base), *flaps])


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    """The box with its base held, and its drive."""
    sheet = Sheet(pattern(s), thickness=s.thickness, modulus=s.modulus, density=s.density, triangulation="center")
    for k, out in enumerate(OUTWARD):
        size = (s.patch_length, s.patch_width) if out[0] else (s.patch_width, s.patch_length)
        centre = (s.base / 2 + s.gap / 2 + s.patch_length / 2) * out
        sheet.patch(
            k + 1,
            thickness=s.patch_thickness,
            size=size,
            centre=centre,
            poling=out,
            remanence=s.remanence,
            density=s.patch_density,
        )
        sheet.panel(k + 1, rigidity=s.flap_stiffening * sheet.rigidity(k + 1))
    sheet.fix(panels=[0])
    stiffness = bridge_stiffness(
        s.modulus, s.patch_width, s.thickness, s.gap, poisson=s.poisson, end_correction=s.end_correction
    )
    sheet.crease(stiffness=stiffness, rest_angle=0.0, loss_time=s.loss_time)
    if s.gravity:
        sheet.gravity((0, 0, -s.gravity))
    sheet.on("crease_stop")
    model, parameters = sheet.build()
    return model, parameters, drive(s)


def drive(s: Settings) -> Drive:
    vertical: Signal = ramp(s.field, 2.0) if s.mode == "ramp" else sine(s.field, s.frequency)
    return Drive(field=(0, 0, vertical))


def inclination(x: np.ndarray, faces: list[tuple[int, ...]]) -> np.ndarray:
    """Inclination of the four flaps from crease to tip, as a camera sees it [rad]; x [N, 3]."""
    out = []
    for a, d, c, b in faces[1:]:
        along = 0.5 * (x[c] + x[d] - x[a] - x[b])
        out.append(np.arctan2(along[2], np.hypot(along[0], along[1])))
    return np.array(out)


def flap_angles(s: Settings, fields: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Equilibrium inclinations of the four flaps [rad], [field, flap], followed up from zero field; and what failed."""
    model, parameters, _ = build(s)
    faces = pattern(s).faces
    return follow(model, parameters, [Drive(field=(0, 0, b)) for b in fields], lambda x: inclination(x, faces))


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    """The table of angle against field by statics, and the motion for the replay."""
    angles, notes = flap_angles(s, FIELDS)
    statics = np.degrees(angles)
    model, parameters, signals = build(s)
    motion = simulate(model, parameters, signals, duration=3.0, rate=60, progress=progress)
    final = np.degrees(inclination(motion.x[-1, :, 0], pattern(s).faces))
    table = {
        "field_mT": FIELDS * 1e3,
        "flap_deg": statics.mean(1),
        "reference_deg": REFERENCE,
        "difference_deg": statics.mean(1) - REFERENCE,
        "spread_deg": np.ptp(statics, axis=1),
    }
    return Outcome(
        motion,
        {"flap_angle": table},
        summary=[
            *notes,
            f"dynamics end at {final.mean():.2f} deg, driven to {s.field * 1e3:.0f} mT "
            f"(four flaps within {np.ptp(final):.2g} deg)",
        ],
        numbers={
            "flap_deg": float(final.mean()),
            "largest_difference_deg": float(np.abs(table["difference_deg"]).max()),
        },
    )


if __name__ == "__main__":
    from origami_sim.cli import main

    main(["run", "box"])
