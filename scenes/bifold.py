"""Bi-fold: strips of dielectric and magnetic elastomer; a magnetic field folds the sheet about its y crease.

    python -m origami_sim.scenes.bifold

Strips run along y in the order DE | MAE | DE | MAE | DE; the edges x = 0 and x = side are clamped, the second free to
slide along x, as in the paper's magnetic case. A voltage acts on the crease along x through the dielectric strips.
"""

import numpy as np

from origami_sim.build import Sheet
from origami_sim.drive import Drive, ramp
from origami_sim.errors import InputError
from origami_sim.materials import layered_rigidity
from origami_sim.model import Model, Parameters
from origami_sim.pattern.assemble import assemble
from origami_sim.scene import Outcome, Progress, Settings, follow
from origami_sim.solve.dynamics import simulate

CALIBRATION = "bifold"
FIELDS = 2.67 * np.array([0.025, 0.05, 0.075, 0.1])
REFERENCE = np.array([10.9, 19.4, 25.3, 29.4])
"""Fold angle [deg] at FIELDS: independent beam solution for the default calibration; good to a factor of two."""


def columns(s: Settings) -> tuple[np.ndarray, np.ndarray]:
    """Cell borders along x [m] and the material of each cell: 0 dielectric, +1 and -1 magnetic by poling."""
    if abs(3 * s.de_width + 2 * s.mae_width - s.side) > 1e-9:
        raise InputError(
            "the strips do not fill the sheet",
            file=s.file,
            field="mae_width",
            value=s.mae_width,
            allowed="3 de_width + 2 mae_width = side",
        )
    x, kind, n = [0.0], [], round(s.cells)
    for width, k in ((s.de_width, 0), (s.mae_width, 1), (s.de_width, 0), (s.mae_width, -1), (s.de_width, 0)):
        cells = 2 * n if k == 0 and len(kind) == 2 * n else n  # the middle strip needs a border at the crease
        x += list(x[-1] + width * (np.arange(cells) + 1) / cells)
        kind += [k] * cells
    return np.array(x), np.array(kind)


def build(s: Settings) -> tuple[Model, Parameters, Drive]:
    x, kind = columns(s)
    rim = s.side / 10
    xs = np.concatenate([[-rim], x, [s.side + rim]])  # one clamped cell beyond either edge
    ys = np.array([-s.side / 2, 0.0, s.side / 2])
    n = len(xs)
    vertices = [(a, b, 0.0) for b in ys for a in xs]
    faces = [(r * n + c, r * n + c + 1, (r + 1) * n + c + 1, (r + 1) * n + c) for r in (0, 1) for c in range(n - 1)]
    pattern = assemble(vertices, faces)
    cells = len(kind)
    inner = [(r, c) for r in (0, 1) for c in range(1, n - 2)]

    factor = 1 - s.poisson**2
    modulus = np.where(kind == 0, s.de_modulus, s.mae_modulus)
    full = np.array(
        [
            layered_rigidity(
                [(s.underlayer_thickness, s.underlayer_modulus / factor), (s.active_thickness, e / factor)]
            )
            for e in modulus
        ]
    )
    notched = np.array(
        [
            layered_rigidity([(s.notch_thickness, s.underlayer_modulus / factor), (s.active_thickness, e / factor)])
            for e in modulus
        ]
    )

    sheet = Sheet(
        pattern,
        thickness=s.underlayer_thickness + s.active_thickness,
        modulus=s.underlayer_modulus,
        density=s.underlayer_density,
        triangulation="center",
        membrane_damping=0.05,
    )
    areal = s.underlayer_thickness * s.underlayer_density + s.active_thickness * np.where(
        kind == 0, s.de_density, s.mae_density
    )
    for r, c in inner:
        panel = r * (n - 1) + c
        sheet.density[panel] = areal[c - 1] / sheet.thickness[panel]
        sheet.panel(panel, rigidity=full[c - 1])
        if kind[c - 1]:
            volume = s.active_thickness * (x[c] - x[c - 1]) * s.side / 2
            sheet.magnetise(panel, remanence=s.remanence, volume=volume, poling=(kind[c - 1], 0, 0))
    sheet.fix(panels=[0, n - 1]).fix(panels=[n - 2, 2 * n - 3], axes="yz")

    # creases: each stands for the sheet between the middles of its two cells, thinner within the notch
    middle = int(np.argmin(np.abs(x - s.side / 2)))
    stiffness = np.zeros(len(sheet.mesh.creases))
    along_x = []
    for k, (_, j, kk, _) in enumerate(sheet.mesh.creases):
        a, b = pattern.vertices[j], pattern.vertices[kk]
        if abs(a[0] - b[0]) < 1e-12:  # a crease along y
            at = int(np.argmin(np.abs(x - a[0])))
            compliance = 0.0
            for cell, length in (
                (at - 1, x[at] - x[at - 1] if at else 0),
                (at, x[at + 1] - x[at] if at < cells else 0),
            ):
                if 0 <= cell < cells:
                    notch = min(s.notch_length / 2, length / 2) if at == middle else 0.0
                    compliance += (length / 2 - notch) / full[cell] + notch / notched[cell]
            stiffness[k] = s.side / 2 / compliance
        else:  # the crease along x, one piece per column
            cell = int(np.clip(np.searchsorted(x, 0.5 * (a[0] + b[0])) - 1, 0, cells - 1))
            compliance = (s.side / 2 - s.notch_length) / full[cell] + s.notch_length / notched[cell]
            stiffness[k] = abs(b[0] - a[0]) / compliance
            if kind[cell] == 0 and 0 < 0.5 * (a[0] + b[0]) < s.side:
                along_x.append((k, cell, abs(b[0] - a[0])))
    sheet.crease(stiffness=stiffness, rest_angle=0.0, loss_time=s.loss_time)
    neutral = _neutral_axis(s)
    for k, _, width in along_x:
        sheet.set(
            "maxwell_stress",
            [k],
            permittivity=s.permittivity,
            layer_thickness=s.active_thickness,
            layers=1.0,
            lever=s.notch_thickness + s.active_thickness / 2 - neutral,
            width=width,
            constraint=1.0,
            side=-1.0,
        )
    sheet.set("mass_damping", decay_rate=s.decay_rate)
    model, parameters = sheet.build()
    return model, parameters, Drive(field=(0, 0, ramp(s.field, 1.0)), voltage=ramp(s.voltage, 1.0))


def _neutral_axis(s: Settings) -> float:
    """Neutral axis of the notched sheet above its underside [m]."""
    a, b = s.underlayer_modulus * s.notch_thickness, s.de_modulus * s.active_thickness
    return (a * s.notch_thickness / 2 + b * (s.notch_thickness + s.active_thickness / 2)) / (a + b)


def fold_angle(model: Model, x: np.ndarray, side: float) -> float:
    """Rise of the middle over half the side, as an angle [rad]; x [N, 3]."""
    middle = np.isclose(model.position[:, 0], side / 2) & np.isclose(np.abs(model.position[:, 1]), side / 2)
    return float(np.arctan(x[middle, 2].mean() / (side / 2)))


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    model, parameters, drive = build(s)
    drives = [Drive(field=(0, 0, b), voltage=s.voltage) for b in FIELDS]
    angles, notes = follow(model, parameters, drives, lambda x: fold_angle(model, x, s.side))
    motion = simulate(model, parameters, drive, duration=1.5, rate=60, progress=progress)
    final = np.degrees(fold_angle(model, motion.x[-1, :, 0], s.side))
    return Outcome(
        motion,
        {"fold_angle": {"field_mT": FIELDS * 1e3, "angle_deg": np.degrees(angles), "reference_deg": REFERENCE}},
        summary=[
            *notes,
            f"dynamics end at {final:.2f} deg in {s.field * 1e3:.0f} mT; the reference is good to a factor of two",
        ],
        numbers={"angle_deg": float(final)},
    )


if __name__ == "__main__":
    from origami_sim.cli import main

    main(["run", "bifold"])
