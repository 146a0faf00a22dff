"""Bi-fold: strips of dielectric and magnetic elastomer; a voltage folds the sheet about x, a magnetic field about y.

    python -m origami_sim.scenes.bifold

Strips run along y in the order DE | MAE | DE | MAE | DE on one underlayer, which is notched from below along both
middles. Each strip is cut into parts across, with a hinge in the middle of each part; along the strips a flat on
either side of the notch is one part. A notch has three hinges, on its borders and in its middle, with 1/4, 1/2 and 1/4
of its compliance. Where the curvature of a part is uniform, all of them are exact.

Supports: "x edges", the paper's magnetic case (the edge x = 0 is clamped, the other one may only slide along x); "y
edges", its electric case (both ends of the strips clamped); "y edges sliding" (the same, one end slides along y);
"centre" (the middle is held, all edges are free), in which one run folds about either axis.

A dielectric layer is a thrust chi p t1 w along its strips, at the height of its middle. In a hinge the thrust acts on
the lever to the neutral axis of the section there. Held ends push back along the layer. The hinges must then lie at
their neutral axes, at another height in the notch, so that the push has its lever too ("y edges" only: elsewhere no
axial force passes, and heights are all the same).
"""

from dataclasses import dataclass

import numpy as np

from origami_sim.design.build import Sheet
from origami_sim.device.scene import Outcome, Progress, Settings, follow, is_reference, motion_of
from origami_sim.drive import Drive, series
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.pattern.assemble import assemble
from origami_sim.physics.materials import layered_rigidity
from origami_sim.solve.statics.equilibria import equilibrium

CALIBRATION = "bifold"
FIELDS = 2.67 * np.array([0.025, 0.05, 0.075, 0.1])
REFERENCE = np.array([10.9, 19.4, 25.3, 29.4])
"""Angle about y [deg] at FIELDS, "x edges": beam solution found independently."""

MODULI = np.array([250e6, 500e6, 750e6, 1000e6, 0.25e6, 0.5e6, 1e6])
REFERENCE_ELECTRIC = -np.array([4.5e-3, 2.2e-3, 1.5e-3, 1.1e-3, 1.44, 1.02, 0.68])
"""Angle about x [deg] at 40 kV and t1 = 0.2 mm for underlayers of MODULI [Pa], "y edges sliding": as above. Negative:
between clamps the flats, with the larger lever, bend down and open the notch upwards."""

ELECTRIC = {"voltage": 40e3, "active_thickness": 0.2e-3}
SCHEDULE = np.array([0.0, 0.1, 0.25, 0.35, 0.45, 0.6, 0.7, 0.9])
"""Times of `run` [s]: voltage up, held and down, field up and held, voltage up again, both held."""

COARSE = {"cells": 1.0, "twist": 10.0}
"""Mesh of the motion in `run`: stiff diagonals of narrow panels would take a tenth of the step."""
ANGLES = ("angle_deg", "reference_deg", "held_deg", "sliding_deg", "expected_deg", "about_x_deg", "about_y_deg")


@dataclass(frozen=True)
class Section:
    """Section across all strips, with so much of the underlayer.

    Attributes:
        neutral: neutral axis above the underside of the whole underlayer [m].
        rigidity: bending rigidity per width about it of the dielectric and the magnetic strips [N m].
        lever: middle of the active layer above it [m].
    """

    neutral: float
    rigidity: tuple[float, float]
    lever: float


def section(s: Settings, underlayer: float) -> Section:
    """Plane sections across the strips: all of them share one neutral axis."""
    factor, _ = _constraint(s)
    z, middle = s.underlayer_thickness - underlayer / 2, s.underlayer_thickness + s.active_thickness / 2
    below, t = factor * s.underlayer_modulus * underlayer, s.active_thickness
    above = factor * np.array([s.de_modulus, s.mae_modulus]) * t
    share = np.array([3 * s.de_width, 2 * s.mae_width]) / s.width
    neutral = (below * z + share @ above * middle) / (below + share @ above)
    rigidity = (
        below * (underlayer**2 / 12 + (z - neutral) ** 2) + above * (t**2 / 12 + (middle - neutral) ** 2)
    ).tolist()
    return Section(float(neutral), (rigidity[0], rigidity[1]), float(middle - neutral))


def _constraint(s: Settings) -> tuple[float, float]:
    """Modulus over Young's modulus, and chi, the share of the Maxwell stress that acts along the strip."""
    return (1.0, 0.5) if s.section == "strip" else (1 / (1 - s.poisson**2), 1.0)


@dataclass(frozen=True)
class Parts:
    """The sheet across its strips: stretches of one kind, and hinges.

    Attributes:
        borders: of the stretches, from edge to edge [m]. kind: 0 dielectric, +1 and -1 magnetic by poling.
        underlayer: its thickness [m].
        hinge: place of each hinge [m]. length: of the sheet that it stands for [m]. owner: its stretch.
    """

    borders: np.ndarray
    kind: np.ndarray
    underlayer: np.ndarray
    hinge: np.ndarray
    length: np.ndarray
    owner: np.ndarray

    @property
    def lines(self) -> np.ndarray:
        """Edge, hinges, edge [m]."""
        return np.concatenate([self.borders[:1], self.hinge, self.borders[-1:]])

    def between(self, values: np.ndarray) -> np.ndarray:
        """Integral of a quantity of the stretches from line to line."""
        total = np.concatenate([[0.0], np.cumsum(values * np.diff(self.borders))])
        return np.diff(np.interp(self.lines, self.borders, total))


NOTCH = np.array([-0.5, 0.0, 0.5]), np.array([0.25, 0.5, 0.25])
"""Hinges of a notch: places about its middle and shares, over its length. The same turn and rise as uniform bending."""


def parts(s: Settings) -> Parts:
    """The sheet across; raises InputError if the strips do not fill it or a notch does not fit."""
    if abs(3 * s.de_width + 2 * s.mae_width - s.width) > 1e-9:
        raise InputError(
            "the strips do not fill the sheet",
            file=s.file,
            field="mae_width",
            value=s.mae_width,
            allowed="3 de_width + 2 mae_width = width",
        )
    if not s.notch_length < s.de_width:
        raise InputError(
            "the notch is wider than its strip",
            file=s.file,
            field="notch_length",
            value=s.notch_length,
            allowed=f"< de_width = {s.de_width:g} m",
        )
    if s.notch_thickness > s.underlayer_thickness:
        raise InputError(
            "the notch leaves more than there is",
            file=s.file,
            field="notch_thickness",
            value=s.notch_thickness,
            allowed=f"<= underlayer_thickness = {s.underlayer_thickness:g} m",
        )
    flat, notch, t = (s.de_width - s.notch_length) / 2, s.notch_length, s.underlayer_thickness
    size = np.array([s.de_width, s.mae_width, flat, notch, flat, s.mae_width, s.de_width])
    borders = np.concatenate([[0.0], np.cumsum(size)])
    cells = round(s.cells)
    even = (np.arange(cells) + 0.5) / cells - 0.5, np.full(cells, 1 / cells)
    rules = [NOTCH if k == 3 else even for k in range(7)]
    middle = 0.5 * (borders[1:] + borders[:-1])
    return Parts(
        borders,
        kind=np.array([0, 1, 0, 0, 0, -1, 0]),
        underlayer=np.array([t, t, t, s.notch_thickness, t, t, t]),
        hinge=np.concatenate([c + w * at for c, w, (at, _) in zip(middle, size, rules, strict=True)]),
        length=np.concatenate([w * share for w, (_, share) in zip(size, rules, strict=True)]),
        owner=np.concatenate([np.full(len(at), k) for k, (at, _) in enumerate(rules)]),
    )


def build(s: Settings, *, stepped: bool | None = None) -> tuple[Model, Parameters, Drive]:
    """The sheet with its supports; `stepped` puts the hinges at their neutral axes (default: where ends are held)."""
    across = parts(s)
    full, notched = section(s, s.underlayer_thickness), section(s, s.notch_thickness)
    x, flat = across.lines, (s.side - s.notch_length) / 2
    places, shares = NOTCH
    middle = places * s.notch_length
    y = np.concatenate([[-s.side / 2, (flat - s.side) / 2], middle, [(s.side - flat) / 2, s.side / 2]])
    reach = np.concatenate([[flat], shares * s.notch_length, [flat]])  # that each hinge across stands for
    step = notched.neutral - full.neutral if (s.support == "y edges" if stepped is None else stepped) else 0.0
    n, m = len(x), len(y)
    vertices = [(a, b, step if b in middle else 0.0) for b in y for a in x]
    faces = [
        (r * n + c, r * n + c + 1, (r + 1) * n + c + 1, (r + 1) * n + c) for r in range(m - 1) for c in range(n - 1)
    ]
    pattern = assemble(vertices, faces)

    factor, chi = _constraint(s)
    total = s.underlayer_thickness + s.active_thickness
    active = np.where(across.kind == 0, s.de_modulus, s.mae_modulus)
    own = np.array(  # bending about y: every part about its own neutral axis
        [
            layered_rigidity([(below, s.underlayer_modulus * factor), (s.active_thickness, e * factor)])
            for below, e in zip(across.underlayer, active, strict=True)
        ]
    )
    sheet = Sheet(
        pattern,
        thickness=total,
        modulus=s.underlayer_modulus,
        density=s.underlayer_density,
        triangulation="diagonal",
        membrane_damping=0.05,
    )
    pitch = np.diff(x)
    density = np.where(across.kind == 0, s.de_density, s.mae_density)
    areal = s.underlayer_density * across.underlayer + density * s.active_thickness
    dielectric = across.between(across.kind == 0)
    magnet = across.between(across.kind)
    for r in range(m - 1):
        for c in range(n - 1):
            panel = r * (n - 1) + c
            sheet.density[panel] = across.between(areal)[c] / pitch[c] / total
            # hinges do the bending; a diagonal that bent as well would make the sheet softer than it is
            sheet.panel(panel, rigidity=s.twist * own.max())
            if magnet[c]:
                volume = s.active_thickness * abs(magnet[c]) * (y[r + 1] - y[r])
                sheet.magnetise(panel, remanence=s.remanence, volume=volume, poling=(np.sign(magnet[c]), 0, 0))
    _support(sheet, s.support, n, m)

    # E = V/t of the layer, or V/(t1 + t2) as in Eq. 7: then the layer is but a part of what lies between electrodes
    gap = total if s.electrodes == "sandwich" else s.active_thickness
    stack = {
        "permittivity": s.permittivity,
        "layer_thickness": gap,
        "layers": s.active_thickness / gap,
        "constraint": chi,
    }
    stiffness, names = np.zeros(len(sheet.mesh.creases)), []
    for k, (_, i, j, _) in enumerate(sheet.mesh.creases):
        a, b = sorted((int(i), int(j)))
        row, column = a // n, a % n
        names.append(f"y-crease {column}.{row + 1}" if b - a == n else f"x-crease {row}.{column + 1}")
        if b - a == n:  # along y
            stiffness[k] = own[across.owner[column - 1]] * (y[row + 1] - y[row]) / across.length[column - 1]
            continue
        at = notched if 2 <= row <= 4 else full
        wide = dielectric[column]
        stiffness[k] = (wide * at.rigidity[0] + (pitch[column] - wide) * at.rigidity[1]) / reach[row - 1]
        sheet.set("maxwell_stress", [k], lever=at.lever, width=wide, side=-1.0, **stack)
    sheet.crease(stiffness=stiffness, loss_time=s.loss_time)
    sheet.name("crease", names)
    sheet.on("maxwell_membrane").set("mass_damping", decay_rate=s.decay_rate)
    model, parameters = sheet.build()

    a, b = np.sort(model.bars, axis=1).T
    along = np.flatnonzero(b - a == n)
    wide = 0.5 * (np.append(dielectric, 0.0) + np.append(0.0, dielectric))[a[along] % n]
    # the thrust runs along y: a sloping bar carries its part, the moments of the hinges the rest
    slope = np.diff(y)[a[along] // n] / parameters["bars", "rest_length"][along, 0]
    parameters.set("maxwell_membrane", "width", wide * slope, along)
    for name, value in stack.items():
        parameters.set("maxwell_membrane", name, value, along)
    return model, parameters, _schedule(s)


def _support(sheet: Sheet, support: str, n: int, m: int):
    node = np.arange(n * m).reshape(m, n)
    if support == "centre":
        sheet.fix(nodes=node[:, n // 2], axes="x").fix(nodes=node[m // 2], axes="y")
        sheet.fix(nodes=[node[m // 2, n // 2]])
    elif support == "x edges":
        sheet.fix(nodes=node[:, :2].ravel()).fix(nodes=node[:, -2:].ravel(), axes="yz")
    else:
        sheet.fix(nodes=node[:2].ravel()).fix(nodes=node[-2:].ravel(), axes="xyz" if support == "y edges" else "xz")


def _schedule(s: Settings) -> Drive:
    """Voltage, then field, then both."""
    return Drive(
        field=(0, 0, series(SCHEDULE, [0, 0, 0, 0, 1, 1, 1, 1], scale=s.field)),
        voltage=series(SCHEDULE, [0, 1, 1, 0, 0, 0, 1, 1], scale=s.voltage),
    )


def fold_angles(model: Model, x: np.ndarray) -> np.ndarray:
    """Fold about x and about y [rad]: rise of the middle over the edges, by half the size, as the paper reads it.

    Args:
        x: positions [..., N, 3].

    Returns:
        [..., 2].
    """
    at = model.position[:, :2]
    low, high = at.min(0), at.max(0)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def rise(px, py):
        node = int(np.argmin(np.hypot(at[:, 0] - px, at[:, 1] - py)))
        return x[..., node, 2] - model.position[node, 2]

    top = rise(*middle)
    about_x = top - 0.5 * (rise(middle[0], low[1]) + rise(middle[0], high[1]))
    about_y = top - 0.5 * (rise(low[0], middle[1]) + rise(high[0], middle[1]))
    return np.stack([about_x / half[1], about_y / half[0]], axis=-1)


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    magnetic = s.replace(support="x edges")
    model, parameters, _ = build(magnetic)
    drives = [Drive(field=(0, 0, b)) for b in FIELDS]
    angles, notes = follow(model, parameters, drives, lambda x: fold_angles(model, x)[1])

    held, sliding = [], []
    for modulus in MODULI:
        for support, out in (("y edges", held), ("y edges sliding", sliding)):
            case = s.replace(support=support, underlayer_modulus=modulus, **ELECTRIC)
            model, parameters, _ = build(case)
            found = equilibrium(model, parameters, Drive(voltage=case.voltage))
            out.append(np.degrees(fold_angles(model, found.x)[0]) if found.converged else np.nan)
            if not found.converged:
                notes.append(f"{support}, underlayer of {modulus / 1e6:g} MPa: {found.message}")

    model, parameters, drive = build(s.replace(**COARSE))
    motion = motion_of(s, model, parameters, drive, duration=float(SCHEDULE[-1]), rate=100, progress=progress)
    folds = np.degrees(fold_angles(model, motion.x[:, :, 0]))
    at = {"voltage": SCHEDULE[2], "field": SCHEDULE[5], "both": SCHEDULE[-1]}
    ends = {name: folds[int(np.argmin(np.abs(motion.times - t)))] for name, t in at.items()}
    magnetic_table = {"field_mT": FIELDS * 1e3, "angle_deg": np.degrees(angles)}
    electric = {"underlayer_MPa": MODULI / 1e6, "held_deg": np.array(held), "sliding_deg": np.array(sliding)}
    free = {"support", "field", "voltage"}
    if is_reference(s, CALIBRATION, besides=free):
        magnetic_table["reference_deg"] = REFERENCE
    if is_reference(s, CALIBRATION, besides={*free, "underlayer_modulus", *ELECTRIC}):
        electric["expected_deg"] = REFERENCE_ELECTRIC
    return Outcome(
        motion,
        {
            "fold_angle": {**magnetic_table},
            "electric": {**electric},
            "both_folds": {
                "drive": list(ends),
                "about_x_deg": np.array([e[0] for e in ends.values()]),
                "about_y_deg": np.array([e[1] for e in ends.values()]),
            },
        },
        units={"field_mT": "mT", "underlayer_MPa": "MPa"} | dict.fromkeys(ANGLES, "deg"),
        summary=[
            *notes,
            f"{s.voltage / 1e3:g} kV, {s.field * 1e3:g} mT, support '{s.support}': the rows of the last table",
        ],
        numbers={f"{name}_about_{axis}_deg": float(e[i]) for name, e in ends.items() for i, axis in enumerate("xy")},
    )


if __name__ == "__main__":
    from origami_sim.commands.cli import main

    main(["run", "bifold"])
