"""Folding strip: magnetic patches, poled alternately, on a silicone strip fold into an accordion in a vertical field.

    python -m origami_sim.scenes.folding_strip

The strip floats: a uniform field gives couples only, so its centre of mass stays where it is without a support. The
outer patches fold further than the inner ones, since one hinge resists them instead of two. The strip bends in the
x-z plane (y is held, which leaves out the twist).
"""

from collections.abc import Sequence

import numpy as np

from origami_sim.design.beams import along_strip
from origami_sim.design.build import Sheet
from origami_sim.device.scene import Outcome, Progress, Settings, follow, is_reference, motion_of
from origami_sim.drive import Drive, ramp, series, sine
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.pattern import strip
from origami_sim.physics.materials import bridge_stiffness

CALIBRATION = "folding_strip"
SHARES = np.array([0.1, 0.25, 0.5, 1.0])
"""Fields of the table over the field of the calibration."""

REFERENCE_FIELD = 0.2
REFERENCE = {"end_deg": np.array([37.4, 54.7, 66.0, 75.3]), "inner_deg": np.array([5.4, 23.1, 43.3, 61.2])}
"""Angles at SHARES of REFERENCE_FIELD for four patches of the default calibration: rigid patches on lumped hinges."""

TIMES = np.array([0.0, 1.5, 2.0, 3.5, 4.0, 5.5, 6.0, 7.5, 8.0])
CYCLE = np.array([0.0, 1.0, 1.0, 0.0, 0.0, -1.0, -1.0, 0.0, 0.0])
"""Knots [s] of the mode "cycle" and the field there over the field of the calibration."""


def count(s: Settings) -> int:
    """Number of patches; even, since an odd number has a net moment and turns as a whole."""
    n = round(s.patches)
    if n % 2:
        raise InputError(
            "alternately poled patches need an even number",
            file=s.file,
            field="patches",
            value=n,
            allowed="2, 4, 6, ...",
        )
    return n


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    """A chain of panels with hinge lines in the middle of the gaps, centred on the origin."""
    n = count(s)
    lengths = s.patch_length + np.where(np.arange(n) % (n - 1) == 0, 0.5, 1.0) * s.gap
    pattern = strip(list(lengths), s.patch_width)
    sheet = Sheet(
        pattern,
        thickness=s.thickness,
        modulus=s.modulus,
        density=s.density,
        triangulation="center",
        membrane_damping=s.membrane_damping,
    )
    sheet.fix(nodes=range(len(sheet.mesh.vertices)), axes="y")
    pitch = s.patch_length + s.gap
    for k in range(n):
        sheet.patch(
            k,
            thickness=s.patch_thickness,
            size=(s.patch_length, s.patch_width),
            material="mae",
            centre=(k * pitch + s.patch_length / 2, 0, 0),
            poling=(-1.0 if k % 2 else 1.0, 0, 0),
            remanence=s.remanence,
            density=s.patch_density,
        )
        sheet.panel(k, rigidity=s.patch_stiffening * sheet.rigidity(k))
    stiffness = bridge_stiffness(
        s.modulus, s.patch_width, s.thickness, s.gap, poisson=s.poisson, end_correction=s.end_correction
    )
    sheet.crease(stiffness=stiffness, rest_angle=0.0, loss_time=s.loss_time)
    sheet.name("crease", along_strip(sheet, "gap"))
    sheet.on("crease_stop").set("mass_damping", decay_rate=s.decay_rate)
    model, parameters = sheet.build()
    model.position[:, 0] -= lengths.sum() / 2
    return model, parameters, drive(s)


def drive(s: Settings) -> Drive:
    waves = {
        "cycle": series(TIMES, s.field * CYCLE),
        "ramp": ramp(s.field, 1.5),
        "oscillate": sine(s.field, s.frequency),
    }
    return Drive(field=(0, 0, waves[s.mode]))


def inclinations(s: Settings, x: np.ndarray) -> np.ndarray:
    """Angle of every patch above the x axis [rad]; x [N, 3]."""
    middle = x[: 2 * (count(s) + 1)].reshape(-1, 2, 3).mean(axis=1)
    along = np.diff(middle, axis=0)
    return np.arctan2(along[:, 2], along[:, 0])


def fold(s: Settings, fields: Sequence[float] | np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Equilibrium inclinations [rad], [field, patch], each from the shape in the field before it; and what failed."""
    model, parameters, _ = build(s)
    return follow(model, parameters, [Drive(field=(0, 0, b)) for b in fields], lambda x: inclinations(s, x))


def table(s: Settings) -> tuple[dict[str, np.ndarray], list[str]]:
    """Fold angles of the outer and the inner patches against field; and what failed."""
    fields = s.field * SHARES
    angles, notes = fold(s, fields)
    folds = np.degrees(np.abs(angles))
    mean, end = folds.mean(axis=1), folds[:, [0, -1]].mean(axis=1)
    inner = folds[:, 1:-1].mean(axis=1) if count(s) > 2 else end
    out = {"field_mT": fields * 1e3, "end_deg": end, "inner_deg": inner, "ratio": end / inner, "mean_deg": mean}
    if abs(abs(s.field) - REFERENCE_FIELD) < 1e-12 and is_reference(s, CALIBRATION, besides={"field"}):
        out |= {"reference_end_deg": REFERENCE["end_deg"], "reference_inner_deg": REFERENCE["inner_deg"]}
    return out, notes


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    """The table by statics, and the motion for the replay."""
    angles, notes = table(s)
    model, parameters, signals = build(s)
    duration = {"cycle": TIMES[-1], "ramp": 2.5, "oscillate": 4 / s.frequency}[s.mode]
    motion = motion_of(s, model, parameters, signals, duration=duration, rate=60, progress=progress)
    creases = np.degrees(np.abs(motion.creases[:, :, 0]))
    drift = np.linalg.norm(np.ptp(motion.centre_of_mass()[:, 0], axis=0))
    return Outcome(
        motion,
        {"fold_angle": {**angles}},
        summary=[
            *notes,
            f"in {s.field * 1e3:.0f} mT the outer patches stand at {angles['end_deg'][-1]:.1f} deg, the inner ones at "
            f"{angles['inner_deg'][-1]:.1f} deg (ratio {angles['ratio'][0]:.2f} in {angles['field_mT'][0]:.0f} mT, "
            f"{angles['ratio'][-1]:.2f} here)",
            f"in motion the creases fold by up to {creases.max():.1f} deg and end at {creases[-1].max():.2g} deg; "
            f"the centre of mass moves by {drift * 1e6:.2g} um",
        ],
        numbers={
            "end_deg": float(angles["end_deg"][-1]),
            "inner_deg": float(angles["inner_deg"][-1]),
            "ratio_low": float(angles["ratio"][0]),
            "ratio_high": float(angles["ratio"][-1]),
            "left_deg": float(creases[-1].max()),
            "drift_m": float(drift),
        },
    )


if __name__ == "__main__":
    from origami_sim.commands.cli import main

    main(["run", "folding_strip"])
