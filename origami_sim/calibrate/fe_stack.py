"""Fold of a notched dielectric-elastomer stack by finite elements: the Maxwell stress as an active stress.

A block of elastomer layers with a passive tape below; the tape is thinner over the notch. The field across the layers
enters as the energy at fixed voltage, - eps/2 J |F^-T E0|^2 per reference volume, which is the full Maxwell stress and
includes the thinning (Suo 2010, Acta Mech. Solida Sin. 23, 549). Fringe fields and the passive frame are left out; an
electrode narrower than the strip scales the stress (`active`). Elements, ends and solution as in `fe`.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from origami_sim.calibrate.fe import Rubber, _graded, _Section, _skfem
from origami_sim.calibrate.result import Calibration, Quantity
from origami_sim.errors import InputError
from origami_sim.physics.materials import EPS0

ELASTOMER = Rubber(2 * 1.4999 * 73.7e3, 0.4999)
"""VHB F9473PC: small-strain shear modulus 73.7 kPa of the seed paper's Ogden constants."""

TAPE = Rubber(1.6e9, 0.3)
"""Magic tape of the seed paper."""


@dataclass(frozen=True)
class Stack:
    """Section of a notched stack.

    Attributes:
        layers: elastomer layers. layer_thickness: of each, at rest [m]. elastomer, tape: materials.
        permittivity: relative, of the elastomer. tape_thickness: of one tape layer [m].
        notch: length with `notch_layers` of tape [m]; arms have `arm_layers`. arm: meshed length of each arm [m].
        active: electroded share of the width [-].
    """

    notch: float
    layers: int = 6
    layer_thickness: float = 272.8e-6
    elastomer: Rubber = ELASTOMER
    tape: Rubber = TAPE
    permittivity: float = 4.7
    tape_thickness: float = 62e-6
    notch_layers: int = 1
    arm_layers: int = 5
    arm: float = 8e-3
    active: float = 15 / 19

    def __post_init__(self):
        for name in ("notch", "layer_thickness", "permittivity", "tape_thickness"):
            value = getattr(self, name)
            if not (value > 0 and math.isfinite(value)):
                raise InputError("a stack needs positive dimensions", field=name, value=value, allowed="> 0")
        if not self.arm >= 0 or not 0 < self.active <= 1:
            raise InputError("not a stack", field="arm, active", value=(self.arm, self.active), allowed=">= 0, 0 to 1")
        if not (self.layers >= 1 and 1 <= self.notch_layers <= self.arm_layers):
            raise InputError(
                "the notch keeps some tape, and not more than the arms",
                field="notch_layers",
                value=self.notch_layers,
                allowed=f"1 to {self.arm_layers}",
            )

    @property
    def height(self) -> float:
        """Of the elastomer [m]."""
        return self.layers * self.layer_thickness


class _StackSection(_Section):
    """Half section x >= 0; the tape lies below y = 0, so that the field folds towards it (negative angles)."""

    def __init__(self, stack: Stack, fineness: int):
        skfem = _skfem(fineness)
        edge, end = stack.notch / 2, stack.notch / 2 + stack.arm
        finest = stack.height / 8
        x = _graded(0.0, edge, finest, at_start=False, largest=stack.height / 2)
        if stack.arm > 0:
            x = np.append(x, _graded(edge, end, finest, at_start=True, largest=stack.height / 2)[1:])
        thin, thick = stack.notch_layers * stack.tape_thickness, stack.arm_layers * stack.tape_thickness
        low = [-thick] if stack.arm > 0 and thick > thin else []
        y = np.append([*low, -thin], np.linspace(0, stack.height, 7))
        for _ in range(fineness - 1):
            x, y = (np.sort(np.append(a, (a[1:] + a[:-1]) / 2)) for a in (x, y))
        mesh = skfem.MeshQuad.init_tensor(x, y)
        centre = mesh.p[:, mesh.t].mean(axis=1)
        gone = (centre[0] < edge) & (centre[1] < -thin)
        if gone.any():
            mesh = mesh.remove_elements(np.flatnonzero(gone))
            centre = mesh.p[:, mesh.t].mean(axis=1)
        self.rigid = False
        self.soft = centre[1] > 0
        self._shape(mesh, [stack.elastomer if s else stack.tape for s in self.soft])
        self._constrain(edge, end)


@dataclass(frozen=True)
class Fold:
    """Free fold of a stack against voltage.

    Attributes:
        voltage: (n,) [V]. turn: (n,) angle between the ends of the meshed section, towards the tape [rad].
        notch: (n,) share of the notch: the turn less the arms' own bending [rad]. curvature: (n,) of the arms [1/m].
    """

    voltage: np.ndarray
    turn: np.ndarray
    notch: np.ndarray
    curvature: np.ndarray


def free_turn(stack: Stack, voltages: Sequence[float] | np.ndarray, *, fineness: int = 1) -> np.ndarray:
    """(n,) angle between the free ends of the section at rising voltages [rad].

    Raises:
        InputError: voltages that fall or are not finite, scikit-fem missing, no equilibrium (pull-in).
    """
    volts = np.asarray(voltages, float)
    if not np.isfinite(volts).all() or (volts < 0).any() or (np.diff(volts) <= 0).any():
        raise InputError("voltages must rise from zero", field="voltages", allowed="volts")
    section = _StackSection(stack, fineness)
    q, angle, out = section._start(), 0.0, []
    stiffness = section.slope() * 2  # dM / d(half angle)
    for v in volts:
        field = v / stack.layer_thickness
        section.electric = np.where(section.soft, stack.active * stack.permittivity * EPS0 * field**2, 0.0)[:, None]
        found = section._increment(angle, 0.0, q)
        last = None
        for _ in range(30):
            if found is None:
                raise InputError("no equilibrium of the stack found", field="voltage", value=float(v), allowed="less")
            q, moment = found
            if last is not None and moment != last[1]:
                stiffness = (moment - last[1]) / (angle - last[0])
            step = -moment / stiffness
            if abs(step) < 1e-7:
                break
            last = (angle, moment)
            step = float(np.clip(step, -0.06, 0.06))
            found = section._increment(angle, step, q)
            angle += step
        out.append(-2 * angle)
    return np.array(out)


def fold(stack: Stack, voltages: Sequence[float] | np.ndarray, *, fineness: int = 1) -> Fold:
    """Fold angle of a notched stack, separated into the notch and the bending of the arms."""
    turn = free_turn(stack, voltages, fineness=fineness)
    length = 4 * stack.height
    bare = replace(stack, notch=length, notch_layers=stack.arm_layers, arm=0.0)
    curvature = free_turn(bare, voltages, fineness=fineness) / length
    return Fold(np.asarray(voltages, float), turn, turn - 2 * stack.arm * curvature, curvature)


def stiffness(stack: Stack, *, fineness: int = 1) -> float:
    """Stiffness of the notch per width without a field, the arms' bending taken off [N/rad]."""
    length = 4 * stack.height
    bare = replace(stack, notch=length, notch_layers=stack.arm_layers, arm=0.0)
    arms = 2 * stack.arm / (length * _StackSection(bare, fineness).slope())
    return 1 / (1 / _StackSection(stack, fineness).slope() - arms)


def stack_calibration(stack: Stack, width: float, voltage: float, *, command: str, fineness: int = 2) -> Calibration:
    """A calibration file's content for a notched stack: stiffness, fold and exponent up to a voltage.

    Args:
        stack: the section. width: along the notch [m]. voltage: the largest [V]. command: re-creates the file.
        fineness: mesh; the interval of each value is its change from the next coarser one, on both sides.
    """
    for name, value in (("width", width), ("voltage", voltage)):
        if not (value > 0 and math.isfinite(value)):
            raise InputError("must be positive", field=name, value=value, allowed="> 0")

    def values(mesh):
        found = fold(stack, np.array([0.25, 0.5, 0.75, 1.0]) * voltage, fineness=mesh)
        bare = replace(stack, notch=4 * stack.height, arm_layers=stack.notch_layers, arm=0.0)
        bend = free_turn(bare, [0.25 * voltage], fineness=mesh)[0] / bare.notch
        return {
            "stiffness": width * stiffness(stack, fineness=mesh),
            "notch_angle": found.notch[-1],
            "exponent": np.polyfit(np.log(found.voltage), np.log(found.notch), 1)[0],
            "arm_curvature": found.curvature[-1],
            "effective_length": found.notch[0] / bend,
        }

    fine, coarse = values(fineness), values(max(fineness - 1, 1))
    words = {
        "stiffness": ("N m/rad", "of the notch without a field"),
        "notch_angle": ("rad", f"fold of the notch at {voltage:g} V"),
        "exponent": ("1", "of the fold against voltage"),
        "arm_curvature": ("1/m", f"of the arms at {voltage:g} V"),
        "effective_length": ("m", "length of a bender with the notch's tape that folds as much"),
    }
    quantities = []
    for name, value in fine.items():
        change = abs(value - coarse[name])
        source = "plane-strain finite elements with Maxwell stress; interval: change from a mesh half as fine"
        interval = (float(value - change), float(value + change))
        quantities.append(Quantity(name, float(value), words[name][0], words[name][1], source, interval))
    for name, value, unit in (("notch", stack.notch, "m"), ("width", width, "m"), ("voltage", voltage, "V")):
        quantities.append(Quantity(name, float(value), unit, "input", "input of this calibration"))
    warning = "electrodes cover the stated share of the width; the passive frame and fringe fields are left out"
    return Calibration("Notched dielectric-elastomer stack", command, tuple(quantities), (warning,))
