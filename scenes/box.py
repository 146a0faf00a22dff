"""Folded box: four magnetic flaps on a silicone cross close in a vertical field.

python -m origami_sim.scenes.box
"""

import numpy as np

from origami_sim.calibrate.result import table
from origami_sim.design.build import Sheet
from origami_sim.device.scene import Outcome, Progress, Settings, follow, is_reference, motion_of, read_calibration
from origami_sim.drive import Drive, Signal, ramp, sine
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.pattern import Pattern
from origami_sim.pattern.assemble import assemble
from origami_sim.physics.materials import bridge_stiffness

CALIBRATION = "box"
FIELDS = np.array([0.010, 0.020, 0.050, 0.100, 0.150, 0.200])
REFERENCE = np.array([20.4, 38.6, 62.0, 74.0, 78.8, 81.4])
"""Flap angle [deg] at FIELDS: independent lumped solution for the default calibration."""

OUTWARD = np.array([(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, -1, 0)], float)
SIDES = ("+x", "+y", "-x", "-y")


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
    sheet.fix(panels=[0]).name("panel", ["base", *(f"flap {n}" for n in SIDES)])
    middles = sheet.mesh.vertices[sheet.mesh.creases[:, 1:3]].mean(axis=1)
    sheet.name("crease", [f"hinge {SIDES[k]}" for k in np.argmax(middles @ OUTWARD.T, axis=1)])
    if s.crease_law == "finite_elements":
        law = bridge_law(s)
        sheet.set("crease_table", **law)
        sheet.set("crease_viscosity", viscosity=s.loss_time * slope_at_rest(law))
    else:
        stiffness = bridge_stiffness(
            s.modulus, s.patch_width, s.thickness, s.gap, poisson=s.poisson, end_correction=s.end_correction
        )
        sheet.crease(stiffness=stiffness, rest_angle=0.0, loss_time=s.loss_time)
    if s.gravity:
        sheet.gravity((0, 0, -s.gravity))
    sheet.on("crease_stop")
    if s.touch == "on" or (s.touch == "auto" and closed(s) < np.pi / 2):
        sheet.touch(friction=s.touch_friction)
    elif s.touch == "off":
        sheet.touch(False)
    model, parameters = sheet.build()
    return model, parameters, drive(s)


def closed(s: Settings) -> float:
    """Angle at which neighbouring patches meet, each with borders rounded by half of its thickness [rad]; inf: never.

    By symmetry two upright edges meet in the diagonal of the base, next to the hinges: what is left of half of the base
    beside the middle of a patch's edge, base / 2 + low cos(a) - lift sin(a) - side, is then r sqrt(2).
    """
    r, lift = 0.5 * s.patch_thickness, 0.5 * (s.thickness + s.patch_thickness)
    low, side = 0.5 * s.gap + r, 0.5 * s.patch_width - r
    share = (side + np.sqrt(2) * r - 0.5 * s.base) / np.hypot(low, lift)
    return float(np.arccos(share) - np.arctan2(lift, low)) if abs(share) <= 1 else np.inf


def bridge_law(s: Settings) -> dict:
    """Parameters of the crease table that finite elements give for the bridge, over this crease's width.

    Raises:
        InputError: the stored law is for another bridge.
    """
    law = read_calibration("crease_bridge")
    for name in ("gap", "thickness", "modulus", "poisson", "patch_thickness"):
        if not np.isclose(law[name].value, s[name].value, rtol=1e-6):
            raise InputError(
                "the finite-element law is for another bridge (origami-sim calibrate bridge makes one)",
                file=s.file,
                field=name,
                value=s[name].value,
                allowed=f"{law[name].value:g} {law[name].unit}",
            )
    moments = table(law, "resisting_moment") * s.patch_width / law.width
    return {"angle_min": law.angle_min, "angle_max": law.angle_max, "resisting_moment": moments[None, None]}


def slope_at_rest(law: dict) -> float:
    """Stiffness of a crease table in its middle, where it is flat [N m/rad]."""
    moments = law["resisting_moment"][0, 0]
    middle, step = len(moments) // 2, (law["angle_max"] - law["angle_min"]) / (len(moments) - 1)
    return float((moments[middle + 1] - moments[middle - 1]) / (2 * step))


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
    motion = motion_of(s, model, parameters, signals, duration=3.0, rate=60, progress=progress)
    final = np.degrees(inclination(motion.x[-1, :, 0], pattern(s).faces))
    table, numbers = {"field_mT": FIELDS * 1e3, "flap_deg": statics.mean(1)}, {"flap_deg": float(final.mean())}
    if is_reference(s, CALIBRATION, besides={"field"}):
        difference = statics.mean(1) - REFERENCE
        table |= {"reference_deg": REFERENCE, "difference_deg": difference}
        numbers["largest_difference_deg"] = float(np.abs(difference).max())
    table["spread_deg"] = np.ptp(statics, axis=1)
    return Outcome(
        motion,
        {"flap_angle": {**table}},
        summary=[
            *notes,
            f"dynamics end at {final.mean():.2f} deg, driven to {s.field * 1e3:.0f} mT "
            f"(four flaps within {np.ptp(final):.2g} deg)",
        ],
        numbers=numbers,
    )


if __name__ == "__main__":
    from origami_sim.commands.cli import main

    main(["run", "box"])
