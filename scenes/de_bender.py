"""Dielectric-elastomer bender: six electroded layers on adhesive tape, which a voltage bends.

    python -m origami_sim.scenes.de_bender

The strip is a chain of panels; a hinge in the middle of each of the equal parts of a segment stands for that part. The
stack lies on the tape and, getting longer under voltage, bends the strip down, away from itself.

Section, per width: z from the tape's underside, tape of n layers (plane strain, E_t / (1 - nu_t^2)), stack of height H
(Ogden, incompressible, plane strain: small-strain modulus E / (1 - nu^2) = 4 G, G = sum mu_i alpha_i / 2).

- linear: D and the neutral axis z_n of the bonded layers; moment p H a with the lever a = n t_t + H/2 - z_n.
- ogden: exact bending of an incompressible strip. The stretch lambda of a layer at height z above the tape follows from
  constant area, lambda^2 = lambda_0^2 + 2 kappa z (Rivlin 1949), and the passive moment is dU/dkappa of the elastic
  energy at zero axial force. The stack's capacitance eps/t int lambda^2 dz then grows linearly with kappa, so that the
  moment of -C V^2/2 is p H a at every curvature: with thinning layers the law `maxwell_stress` is exact as it stands.
  Without thinning (a true stress p that does not grow, as in a purely mechanical analysis) the moment is the smaller
  p int z / lambda^2 dz; the crease table is divided by that share, as no effect carries it
  (so a weight then meets a section that is up to 6 % too stiff).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from origami_sim.beams import along_strip, as_beam
from origami_sim.build import Sheet
from origami_sim.drive import Drive, Signal, ramp, sine
from origami_sim.effects.crease_table import KNOTS
from origami_sim.errors import InputError
from origami_sim.materials import layered_rigidity
from origami_sim.model import Model, Parameters
from origami_sim.pattern import strip
from origami_sim.scene import Outcome, Progress, Settings, follow, is_reference, motion_of

CALIBRATION = "de_bender"
VOLTAGES = np.array([500.0, 1000.0, 2000.0, 3000.0, 4000.0])
REFERENCE = {
    (1, True): np.array([0.3960, 1.5905, 6.469, 14.975, 27.740]),
    (1, False): np.array([0.3956, 1.5848, 6.376, 14.484, 26.086]),
    (5, True): np.array([0.0451, 0.1806, 0.7228, 1.6277, 2.8974]),
    (5, False): np.array([0.0451, 0.1805, 0.7215, 1.6214, 2.8773]),
}
"""Curvature [1/m] at VOLTAGES of a strip electroded over its whole width, by tape layers and thinning: Ogden section,
plane strain, solved independently."""

REFERENCE_TIP = {
    1: np.array([0.0093, 0.0374, 0.1511, 0.3438, 0.6117]),
    5: np.array([0.0011, 0.0042, 0.0170, 0.0383, 0.0681]),
}
"""Tip displacement over length at VOLTAGES by tape layers, with thinning, electrode 15 of 19 mm wide."""

CURVATURE = 60.0
"""Curvatures up to this [1/m], both ways, lie in the crease tables."""


@dataclass(frozen=True)
class Section:
    """Cross-section of unit width with so many layers of tape.

    Attributes:
        tape, stack: thickness [m]. rigidity: D [N m]. neutral: neutral axis above the tape's underside [m].
        moduli: plane-strain moduli of tape and stack [Pa].
    """

    tape: float
    stack: float
    rigidity: float
    neutral: float
    moduli: tuple[float, float]

    @property
    def lever(self) -> float:
        """Middle of the stack above the neutral axis [m]."""
        return self.tape + self.stack / 2 - self.neutral


def section(s: Settings, tape_layers: float) -> Section:
    """The linear section."""
    mu, alpha = ogden(s)
    shear = 0.5 * float(mu @ alpha)
    if not shear > 0:
        raise InputError(
            "the Ogden constants have no positive shear modulus",
            file=s.file,
            field="ogden_mu_1",
            value=shear,
            allowed="sum of mu alpha > 0",
        )
    tape, stack = tape_layers * s.tape_thickness, round(s.layers) * s.layer_thickness
    moduli = (s.tape_modulus / (1 - s.tape_poisson**2), 4 * shear)
    stiff = moduli[0] * tape, moduli[1] * stack
    neutral = (stiff[0] * tape / 2 + stiff[1] * (tape + stack / 2)) / sum(stiff)
    return Section(tape, stack, layered_rigidity([(tape, moduli[0]), (stack, moduli[1])]), neutral, moduli)


def ogden(s: Settings) -> tuple[np.ndarray, np.ndarray]:
    """mu_i [Pa] and alpha_i of W = sum mu_i / alpha_i (l1^a + l2^a + l3^a - 3)."""
    mu = np.array([s.ogden_mu_1, s.ogden_mu_2, s.ogden_mu_3])
    return mu, np.array([s.ogden_alpha_1, s.ogden_alpha_2, s.ogden_alpha_3])


def passive_moment(s: Settings, at: Section, curvature: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What it takes to bend a section to some curvatures [1/m].

    Returns:
        Moment per width [N]; moment of a true stress p of constant size over p H a [-].
    """
    mu, alpha = (v[:, None, None] for v in ogden(s))
    nodes, weights = np.polynomial.legendre.leggauss(12)
    z, w = 0.5 * at.stack * (1 + nodes), 0.5 * at.stack * weights
    y, v = 0.5 * at.tape * (1 + nodes) - at.neutral, 0.5 * at.tape * weights
    above = at.tape - at.neutral
    k = np.asarray(curvature, float)[:, None]
    strain = np.zeros_like(k)  # at the neutral axis

    def forces(e):
        root = 1 + e + k * above
        square = root**2 + 2 * k * z
        if np.any(square <= 0):
            raise InputError("the stack cannot bend so far", file=s.file, field="layers", value=float(np.abs(k).max()))
        stretch = np.sqrt(square)
        stress = (mu * (stretch**alpha - stretch**-alpha)).sum(0)  # true stress, nothing on the faces
        film = at.moduli[0] * (e + k * y)
        axial = (stress * root / square) @ w + film @ v
        bending = (stress * (root * above + z) / square) @ w + (film * y) @ v
        return axial, bending, ((root * above + z) / square) @ w

    stiffness = at.moduli[0] * at.tape + at.moduli[1] * at.stack
    for _ in range(60):
        step = forces(strain)[0][:, None] / stiffness
        strain = strain - step
        if np.abs(step).max() < 1e-13:
            break
    _, bending, constant = forces(strain)
    return bending, constant / (at.stack * at.lever)


@dataclass(frozen=True)
class Segment:
    """A stretch of the strip [m] with so many hinges and tape layers, under the electrode or not."""

    length: float
    hinges: int
    tape_layers: float
    electrode: bool


def chain(s: Settings, segments: Sequence[Segment]) -> tuple[Model, Parameters, Drive]:
    """The strip along x, held by its first panel, with its root at x = 0."""
    part = np.concatenate([np.full(g.hinges, g.length / g.hinges) for g in segments])
    owner = [g for g in segments for _ in range(g.hinges)]
    sections = {g.tape_layers: section(s, g.tape_layers) for g in segments}
    at = [sections[g.tape_layers] for g in owner]
    lengths = np.concatenate([[part[0] / 2], (part[1:] + part[:-1]) / 2, [part[-1] / 2]])
    thick = np.array([a.tape + a.stack for a in at])
    areal = np.array([s.tape_density * a.tape + s.density * a.stack + s.grease for a in at])
    halves = np.concatenate([[0.0], areal * part / 2, [0.0]])  # mass of half a part on either side of a hinge
    mass = np.concatenate([[halves[1]], halves[1:-2] + halves[2:-1], [halves[-2]]]) / lengths

    mean = float(thick.mean())
    sheet = Sheet(
        strip(list(lengths), s.width),
        thickness=mean,
        modulus=s.membrane_stiffness / mean,
        density=s.density,
        membrane_damping=s.membrane_damping,
    )
    sheet.density[:] = mass / mean
    sheet.fix(panels=[0]).fix(nodes=range(2 * len(lengths) + 2), axes="y")
    # the drive acts within the hinges; only weight and inertia load the panels' diagonals
    largest = np.concatenate(
        [[at[0].rigidity], np.maximum([a.rigidity for a in at[1:]], [a.rigidity for a in at[:-1]]), [at[-1].rigidity]]
    )
    for panel, d in enumerate(largest):
        sheet.panel(panel, rigidity=s.twist * d)
    order = np.argsort(sheet.mesh.vertices[sheet.mesh.creases[:, 1], 0], kind="stable")
    tables = {key: _Table(s, a) for key, a in sections.items()} if s.section == "ogden" else {}
    stiffness, rest = np.zeros(len(order)), np.zeros(len(order))
    rest[order] = s.natural_curvature * part
    sheet.name("crease", along_strip(sheet, "hinge"))
    stack = {
        "permittivity": s.permittivity * s.pressure_share,
        "layer_thickness": s.layer_thickness,
        "layers": float(round(s.layers)),
        "width": s.electrode_width,
        "constraint": 1.0,
        "side": -1.0,
    }
    for h, crease in enumerate(order):
        g, a, length = owner[h], at[h], part[h]
        stiffness[crease] = a.rigidity * s.width / length
        if tables:
            turn = CURVATURE * length
            sheet.set(
                "crease_table",
                [crease],
                angle_min=rest[crease] - turn,
                angle_max=rest[crease] + turn,
                resisting_moment=tables[g.tape_layers].moments(s.thinning)[None, None] * s.width,
            )
        if not g.electrode:
            continue
        sheet.set("maxwell_stress", [crease], lever=a.lever, **stack)
        if s.thinning and not tables:
            sheet.set(
                "thickness_thinning", [crease], first=a.tape - a.neutral, neutral=0.0, hinge_length=length, **stack
            )
    if not tables:
        sheet.crease(stiffness=stiffness, rest_angle=rest)
    sheet.set("crease_viscosity", viscosity=s.loss_time * stiffness).set("mass_damping", decay_rate=s.decay_rate)
    gx, gz = {"weightless": (0, 0), "hanging": (1, 0), "lifting": (0, 1)}[s.orientation]
    sheet.gravity((gx * s.gravity, 0, gz * s.gravity))
    model, parameters = sheet.build()
    as_beam(model, parameters, s.membrane_stiffness * s.width)
    return model, parameters, drive(s)


class _Table:
    """Moments per width [N] at the knots of the crease tables, with and without thinning; angle = -curvature length."""

    def __init__(self, s: Settings, at: Section):
        passive, share = passive_moment(s, at, -np.linspace(-CURVATURE, CURVATURE, KNOTS))
        self._values = {True: -passive, False: -passive / share}

    def moments(self, thinning: bool) -> np.ndarray:
        return self._values[thinning]


def drive(s: Settings) -> Drive:
    wave: Signal = ramp(s.voltage, 1.0) if s.mode == "ramp" else sine(s.voltage, s.frequency)
    return Drive(voltage=wave)


def segments(s: Settings, hinges: float) -> list[Segment]:
    """The electroded length and the bare tip."""
    return [
        Segment(s.electrode_length, round(hinges), s.tape_layers, True),
        Segment(s.length - s.electrode_length, 1, s.tape_layers, False),
    ]


def build(s: Settings, *, hinges: float | None = None) -> tuple[Model, Parameters, Drive]:
    if s.length <= s.electrode_length:
        raise InputError(
            "the strip ends beyond its electrode",
            file=s.file,
            field="length",
            value=s.length,
            allowed=f"> {s.electrode_length:g} m",
        )
    return chain(s, segments(s, hinges or s.hinges))


def inclinations(x: np.ndarray) -> np.ndarray:
    """Angle of every panel below the x axis [rad], root first; x [N, 3]."""
    along = np.diff(x.reshape(-1, 2, 3).mean(axis=1), axis=0)
    return np.unwrap(np.arctan2(-along[:, 2], along[:, 0]))


def tip(x: np.ndarray, length: float) -> float:
    """Displacement of the tip over the length, R/L; x [N, 3]."""
    return float(np.linalg.norm(x[-2:].mean(axis=0) - (length, 0, 0)) / length)


def settle(
    built: tuple[Model, Parameters, Drive], voltages: Sequence[float] | np.ndarray
) -> tuple[np.ndarray, np.ndarray, list[str]]:
    """Equilibrium positions without voltage [N, 3] and at each voltage [V, N, 3], followed up; and what failed."""
    model, parameters, _ = built
    drives = [Drive(voltage=float(v)) for v in (0.0, *voltages)]
    x, notes = follow(model, parameters, drives, lambda x: x)
    return x[0], x[1:], notes


def bend(s: Settings, voltages: Sequence[float] | np.ndarray = VOLTAGES) -> tuple[dict[str, np.ndarray], list[str]]:
    """Mean curvature of the electroded part [1/m] and R/L, by statics; and what failed.

    With gravity the displacement is counted from the shape without voltage.
    """
    rest, shapes, notes = settle(build(s), voltages)
    last = round(s.hinges)
    turn = np.array([inclinations(x)[last] - inclinations(rest)[last] for x in shapes])
    moved = np.array([np.linalg.norm(x[-2:].mean(axis=0) - rest[-2:].mean(axis=0)) for x in shapes])
    return {
        "voltage_kV": np.asarray(voltages) / 1e3,
        "curvature_per_m": turn / s.electrode_length,
        "r_over_l": moved / s.length,
    }, notes


def gravity_number(s: Settings) -> float:
    """w g L^3 / D [-]: how much the weight, if it acts in the bending plane, matters against bending."""
    at = section(s, s.tape_layers)
    areal = s.tape_density * at.tape + s.density * at.stack + s.grease
    return areal * s.gravity * s.length**3 / at.rigidity


def exponent(voltages: np.ndarray, response: np.ndarray) -> float:
    """Exponent of a power law, fitted from 1 kV up; nan with fewer than two points."""
    known = (np.asarray(voltages) >= 1000.0) & (response > 0)
    if known.sum() < 2:
        return float("nan")
    return float(np.polyfit(np.log(np.asarray(voltages)[known]), np.log(response[known]), 1)[0])


def run(s: Settings, progress: Progress | None = None) -> Outcome:
    """Curvature and displacement by statics, and the motion for the replay."""
    voltages = s.voltage * VOLTAGES / VOLTAGES[-1]
    table, notes = bend(s, voltages)
    whole = s.replace(electrode_width=s.width, orientation="weightless")
    (thin, few), (thick, none) = (bend(whole.replace(thinning=on), voltages) for on in (True, False))
    section_table = {
        "voltage_kV": voltages / 1e3,
        "thinning_per_m": thin["curvature_per_m"],
        "constant_t_per_m": thick["curvature_per_m"],
        "excess_percent": 100 * (thin["curvature_per_m"] / thick["curvature_per_m"] - 1),
    }
    free = {"tape_layers", "electrode_width", "orientation", "gravity", "thinning"}
    if (s.tape_layers, True) in REFERENCE and is_reference(s, CALIBRATION, besides=free):
        section_table["reference_thinning_per_m"] = REFERENCE[s.tape_layers, True]
        section_table["reference_constant_t_per_m"] = REFERENCE[s.tape_layers, False]
    known = REFERENCE_TIP.get(s.tape_layers)
    if known is not None and is_reference(s, CALIBRATION, besides={"tape_layers", "gravity"}):
        table["reference_r_over_l"] = known
    model, parameters, signals = build(s, hinges=s.motion_hinges)
    motion = motion_of(s, model, parameters, signals, duration=2.0, rate=60, progress=progress)
    rest, _, _ = settle((model, parameters, signals), [])
    final = float(np.linalg.norm((motion.x[-1, -2:, 0] - rest[-2:]).mean(axis=0)) / s.length)
    power = exponent(voltages, table["curvature_per_m"])
    return Outcome(
        motion,
        {"bending": {**table}, "electrode_over_the_whole_width": section_table},
        units={"voltage_kV": "kV", **{c: "1/m" for c in (*table, *section_table) if c.endswith("_per_m")}},
        summary=[
            *notes,
            *few,
            *none,
            f"R/L = {table['r_over_l'][-1]:.4f} at {s.voltage / 1e3:g} kV by statics, {final:.4f} at the end of the "
            "motion",
            f"curvature goes as the voltage to the power {power:.3f}; thinning adds "
            f"{section_table['excess_percent'][-1]:.2f} % at the largest, without a frame; "
            f"w g L^3 / D = {gravity_number(s):.2f}",
        ],
        numbers={
            "r_over_l": float(table["r_over_l"][-1]),
            "curvature_per_m": float(table["curvature_per_m"][-1]),
            "exponent": power,
            "excess_percent": float(section_table["excess_percent"][-1]),
            "dynamic_r_over_l": final,
            "gravity_number": gravity_number(s),
        },
    )


if __name__ == "__main__":
    from origami_sim.cli import main

    main(["run", "de_bender"])
