"""Dielectric-elastomer bender: six electroded layers on adhesive tape, which a voltage bends.

    python -m origami_sim.scenes.de_bender

The strip is a chain of panels; a hinge in the middle of each of the equal parts of a segment stands for that part. The
stack lies on the tape and, getting longer under voltage, bends the strip down, away from itself.

The section of a hinge, of layers on tape, is that of `origami_sim.design.dielectric`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from origami_sim.design.beams import along_strip, as_beam
from origami_sim.design.build import Sheet
from origami_sim.design.dielectric import Stack
from origami_sim.device.scene import Outcome, Progress, Settings, follow, is_reference, motion_of
from origami_sim.drive import Drive, Signal, ramp, sine
from origami_sim.errors import InputError
from origami_sim.model import Model, Parameters
from origami_sim.pattern import strip

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


def section(s: Settings, tape_layers: float) -> Stack:
    """The section with so many layers of tape."""
    mu = (s.ogden_mu_1, s.ogden_mu_2, s.ogden_mu_3)
    alpha = (s.ogden_alpha_1, s.ogden_alpha_2, s.ogden_alpha_3)
    plane = s.tape_modulus / (1 - s.tape_poisson**2)
    return Stack(round(s.layers), s.layer_thickness, tape_layers * s.tape_thickness, plane, mu, alpha)


@dataclass(frozen=True)
class Segment:
    """A stretch of the strip [m] with so many hinges and tape layers, under the electrode or not.

    Its hinges bend as if it were `longer` by that factor.
    """

    length: float
    hinges: int
    tape_layers: float
    electrode: bool
    longer: float = 1.0


def chain(s: Settings, segments: Sequence[Segment]) -> tuple[Model, Parameters, Drive]:
    """The strip along x, held by its first panel, with its root at x = 0."""
    part = np.concatenate([np.full(g.hinges, g.length / g.hinges) for g in segments])
    owner = [g for g in segments for _ in range(g.hinges)]
    sections = {g.tape_layers: section(s, g.tape_layers) for g in segments}
    at = [sections[g.tape_layers] for g in owner]
    lengths = np.concatenate([[part[0] / 2], (part[1:] + part[:-1]) / 2, [part[-1] / 2]])
    thick = np.array([a.film + a.height for a in at])
    areal = np.array([s.tape_density * a.film + s.density * a.height + s.grease for a in at])
    halves = np.concatenate([[0.0], areal * part / 2, [0.0]])  # mass of half a part on either side of a hinge
    mass = np.concatenate([[halves[1]], halves[1:-2] + halves[2:-1], [halves[-2]]]) / lengths

    mean = float(thick.mean())
    sheet = Sheet(
        strip(list(lengths), s.width),
        thickness=mean,
        modulus=s.membrane_stiffness / mean,
        density=s.density,
        triangulation="diagonal",
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
    sheet.name("crease", along_strip(sheet, "hinge"))
    for g in dict.fromkeys(owner):
        hinges = [h for h, o in enumerate(owner) if o == g]
        sheet.electrode(
            order[hinges],
            layers=round(s.layers),
            layer_thickness=s.layer_thickness,
            ogden=(sections[g.tape_layers].mu, sections[g.tape_layers].alpha),
            permittivity=s.permittivity * s.pressure_share,
            film_thickness=g.tape_layers * s.tape_thickness,
            film_modulus=s.tape_modulus,
            film_poisson=s.tape_poisson,
            notch=g.longer * part[hinges],
            width=s.width,
            electrode_width=s.electrode_width if g.electrode else 0.0,
            thinning=s.thinning,
            section=s.section,
            rest_angle=g.longer * s.natural_curvature * part[hinges],
            loss_time=s.loss_time,
            reach=CURVATURE,
        )
    sheet.set("mass_damping", decay_rate=s.decay_rate)
    gx, gz = {"weightless": (0, 0), "hanging": (1, 0), "lifting": (0, 1)}[s.orientation]
    sheet.gravity((gx * s.gravity, 0, gz * s.gravity))
    model, parameters = sheet.build()
    as_beam(model, parameters, s.membrane_stiffness * s.width)
    return model, parameters, drive(s)


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
    areal = s.tape_density * at.film + s.density * at.height + s.grease
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
    from origami_sim.commands.cli import main

    main(["run", "de_bender"])
