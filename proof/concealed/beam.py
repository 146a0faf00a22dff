"""Continuous beams: quasi-static curves of a magnetic cantilever and of a dielectric bender.

The cantilever is an elastica, m' = -couple(theta), theta' = curvature(m), by collocation at Gauss-Legendre points.
The bender is bent by a voltage alone, so that its curvature is the same along the electrode: that of least enthalpy of
the section, slice by slice, found by Newton's method on the enthalpy itself. Neither has hinges, cells or tables.
"""

import functools
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from laws import Concealed, Law

MU0 = 4e-7 * math.pi
EPS0 = 8.8541878128e-12
STRUCTURES = ("mae_cantilever", "de_bender")
CELLS = 16
"""Hinges of the scene that is diagnosed."""

BEND_HALF = 0.2
"""Field at which half of the stiffening is reached [T]."""


@dataclass(frozen=True)
class Beam:
    """What the effects change of a beam; strengths are in the numbers of the catalogue where it has them.

    Attributes:
        cubic: moment over the cube of the turn of one cell [N m/rad^3]. offset: moment that acts without load [N m],
            towards +z.
        compliance: of the dipoles [1/T]. stiffening: relative, in a strong field. tilt: of the field [rad].
        stray: field (x, z) without command [T]. loop: half width of the field's hysteresis [T].
        saturation: of the field [1/T]. taper: relative difference of stiffness from root to tip. clamp: turn of the
            root per moment [rad/(N m)]. play: of the root, to either side [rad]. zero: voltage without command [V].
            threshold: voltage that does nothing [V]. scale: relative error of lengths.
    """

    cubic: float = 0.0
    offset: float = 0.0
    compliance: float = 0.0
    stiffening: float = 0.0
    tilt: float = 0.0
    stray: tuple[float, float] = (0.0, 0.0)
    loop: float = 0.0
    saturation: float = 0.0
    taper: float = 0.0
    clamp: float = 0.0
    play: float = 0.0
    zero: float = 0.0
    threshold: float = 0.0
    scale: float = 0.0


BOTH: dict[str, Concealed] = {
    "stiffening": Concealed(Law, ("crease_stiffening",), "all creases", 0.1, number="cubic_stiffness"),
    "rest_angle": Concealed(
        Law, ("crease_offset", "crease_swelling"), "all creases", 0.02, signed=True, number="offset_moment"
    ),
    "length_scale": Concealed(Law, ("length_scale",), "", 0.01, False, True, 0.3, number="length_scale"),
}
INSIDE: dict[str, dict[str, Concealed]] = {
    "mae_cantilever": {
        **BOTH,
        "taper": Concealed(Law, ("crease_taper",), "all creases", 0.2, False, True, 1.5, number="taper"),
        "misalignment": Concealed(Law, ("field_misalignment",), "", 0.05, False, True, 0.7),
        "field_offset": Concealed(Law, ("field_offset",), "", 1e-3, False, False, 0.1),
        "field_hysteresis": Concealed(
            Law, ("field_hysteresis",), "", 1e-3, False, False, 0.05, number="coercive_field"
        ),
        "compliant_dipoles": Concealed(
            Law, ("magnetic_compliance",), "all panels", 0.5, False, False, 8.0, number="dipole_compliance"
        ),
        "field_stiffening": Concealed(
            Law, ("field_stiffening",), "all creases", 0.1, False, False, 8.0, number="field_gain"
        ),
    },
    "de_bender": {
        **BOTH,
        "voltage_offset": Concealed(Law, ("voltage_offset",), "", 50.0, False, True, 1e3, number="voltage_offset"),
    },
}
"""Mechanisms that the catalogue has, by structure."""

OUTSIDE: dict[str, dict[str, Concealed]] = {
    "mae_cantilever": {
        "saturation": Concealed(Law, (), "", 2.0, False),
        "clamp_play": Concealed(Law, (), "", 0.01, False, False, 0.3),
    },
    "de_bender": {"threshold": Concealed(Law, (), "", 200.0, False, False, 2e3)},
}
"""Mechanisms that it has not."""


# --- objects


def draw(structure: str, rng: np.random.Generator) -> dict:
    """A beam with drawn dimensions: a scene with its settings, what is known of them, and load levels."""
    vary = lambda spread: float(rng.uniform(1 - spread, 1 + spread))  # noqa: E731
    o: dict = {"structure": structure, "scene": structure}
    if structure == "mae_cantilever":
        length, thickness = 0.0305 * vary(0.1), 0.0028 * vary(0.1)
        s = {"length": length, "width": 0.00525, "thickness": thickness, "cells": float(CELLS), "gravity": 0.0}
        s |= {"modulus": 0.9e6 * vary(0.2), "remanence": 0.12 * vary(0.15), "misalignment": 0.0}
        o["priors"] = {"modulus": 0.05 * s["modulus"], "remanence": 0.03 * s["remanence"]}
        # the load at which the tip turns by some 50 to 70 degrees
        level = rng.uniform(4.0, 8.0) * MU0 * s["modulus"] / 12 / s["remanence"] * (thickness / length) ** 2
        up = np.linspace(0.0, 1.0, 9)
        loop = np.concatenate([up, up[-2::-1], -up[1:], -up[-2::-1]])
        o["recordings"] = [{"levels": (a * level * loop).tolist()} for a in (1.0, 0.5)]
    else:
        s = {"length": 0.06 * vary(0.1), "width": 0.019, "electrode_width": 0.015, "tape_layers": 1.0}
        s |= {"electrode_length": s["length"] - 0.005, "layers": float(rng.integers(4, 7)), "hinges": float(CELLS)}
        s |= {"tape_modulus": 1.6e9 * vary(0.2), "permittivity": 4.7 * vary(0.1), "orientation": "weightless"}
        o["priors"] = {"tape_modulus": 0.05 * s["tape_modulus"], "permittivity": 0.03 * s["permittivity"]}
        level = 4000.0 * vary(0.1)
        up = np.linspace(0.0, 1.0, 13)
        loop = np.concatenate([up, up[-2::-1]])
        o["recordings"] = [{"levels": (a * level * loop).tolist()} for a in (1.0, 0.6)]
    o["settings"] = s
    o["noise"] = float(np.exp(rng.uniform(np.log(4e-5), np.log(1.5e-4))))  # [m]: a camera's pixel is some 0.1 mm
    return o


class BeamCase:
    """A beam with its true common factors; effects are entries {mechanism, strength, place, extra}.

    The signature of effects is the difference that they make to the curves, in standard deviations of the noise, after
    projecting out what the uncertain numbers (within what is known of them) can take up.
    """

    def __init__(self, o: dict, factors: dict[str, float]):
        self.o, self.factors = o, factors
        self.settings = {**o["settings"], **{n: o["settings"][n] * f for n, f in factors.items()}}
        self._sigma = float(np.hypot(o["noise"], o["noise"] / 2 / np.sqrt(12)))
        self._tangent: np.ndarray | None = None
        self._about: tuple = ()

    def scale(self, place: int) -> float:
        """What the strengths of elastic effects are measured in: the stiffness of one cell [N m/rad]."""
        s = self.settings
        if self.o["structure"] == "mae_cantilever":
            return s["modulus"] * s["width"] * s["thickness"] ** 3 / 12 / (s["length"] / CELLS)
        step = 0.1
        energy = [enthalpy(self.settings, k, 0.0, Beam(), self.cell)[1] for k in (-step, 0.0, step)]
        return (energy[0] - 2 * energy[1] + energy[2]) / step**2 / self.cell

    @property
    def cell(self) -> float:
        """Length of one hinge of the diagnosed scene [m]: the catalogue's numbers are by hinge."""
        s = self.settings
        return (s["length"] if self.o["structure"] == "mae_cantilever" else s["electrode_length"]) / CELLS

    def curves(self, entries: list[dict], **factors) -> list[np.ndarray]:
        """Tip (x, z) [m] less that of the first load step, (n, 2) for every recording."""
        beam = entered(entries)
        s = {**self.settings, **{n: self.settings[n] * f for n, f in factors.items()}}
        tip = cantilever if self.o["structure"] == "mae_cantilever" else bender
        out = []
        for r in self.o["recordings"]:
            x = tip(s, np.array(r["levels"]), beam, self.cell)
            out.append((x - x[0]) * (1 + beam.scale))
        return out

    def signature(self, entries: list[dict], *, fresh: bool = False) -> np.ndarray:
        """The projected difference that effects make; `fresh`: find anew what the numbers can take up."""
        concealed = self._whitened(self.curves(entries))
        if fresh or self._tangent is None:
            base = self._whitened(self.curves(entries))
            columns = [
                (self._whitened(self.curves(entries, **{n: 1.001})) - base) / 1e-3 * spread / self.o["settings"][n]
                for n, spread in self.o["priors"].items()
            ]
            self._tangent = np.stack(columns, axis=1)
        d, t = concealed - self._whitened(self.curves([])), self._tangent
        x = np.linalg.solve(t.T @ t + np.eye(t.shape[1]), t.T @ d)
        out = np.concatenate([d - t @ x, -x])
        if fresh or not self._about:
            self._about = entries, out
        return out

    def beside(self, other: dict) -> np.ndarray:
        """The signature of another, small effect, about the curves for which signatures were last found afresh."""
        entries, mine = self._about
        return self.signature([*entries, other]) - mine

    def _whitened(self, curves: list[np.ndarray]) -> np.ndarray:
        return np.concatenate([c.ravel() for c in curves]) / self._sigma

    # --- what nobody lists

    def nuisances(self, rng: np.random.Generator) -> list[dict]:
        """A thickness that varies along the beam, a clamp that gives way, a ruler that is off."""
        stiff = self.scale(0) / CELLS
        return [
            {"mechanism": "taper", "strength": float(0.03 * rng.normal()), "place": 0, "extra": {}},
            {"mechanism": "clamp", "strength": float(0.01 * rng.uniform() / stiff), "place": 0, "extra": {}},
            {"mechanism": "length_scale", "strength": float(3e-3 * rng.normal()), "place": 0, "extra": {}},
        ]

    # --- recordings

    def tracker(self, rng: np.random.Generator) -> dict:
        """A camera's habits; a curve of few points does not tell its noise, so that it is stated."""
        return {"noise": self.o["noise"], "quantum": self.o["noise"] / 2, "stated": self._sigma}

    def write(self, folder: Path, entries: list[dict], tracker: dict, rng: np.random.Generator, first: int = 1) -> None:
        """The curves, numbered from `first` on."""
        magnetic = self.o["structure"] == "mae_cantilever"
        for n, (r, curve) in enumerate(zip(self.o["recordings"], self.curves(entries), strict=True)):
            name = f"recording{first + n}"
            values = curve + tracker["noise"] * rng.normal(size=curve.shape)
            values = np.round(values / tracker["quantum"]) * tracker["quantum"]
            head = "field_T" if magnetic else "voltage_V"
            lines = [f"{head},tip_x_m,tip_z_m"]
            lines += [f"{b:.9g},{x:.9g},{z:.9g}" for b, (x, z) in zip(r["levels"], values, strict=True)]
            (folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
            text = [f'name = "{name}"']
            for axis, along in (("x", "[1.0, 0.0, 0.0]"), ("z", "[0.0, 0.0, 1.0]")):
                text += [f"[channels.tip_{axis}]", f'column = "tip_{axis}_m"', 'kind = "tip_displacement"']
                text += ['unit = "m"', f"node = {self.tip}", f"direction = {along}", f"noise = {tracker['stated']:.6g}"]
            text += ["[drive.field]" if magnetic else "[drive.voltage]", f'column = "{head}"']
            text += ['unit = "T"', "direction = [0.0, 0.0, 1.0]"] if magnetic else ['unit = "V"']
            (folder / f"{name}.toml").write_text("\n".join(text) + "\n")

    @property
    def tip(self) -> int:
        """Node at the tip of the scene: two nodes per station, the last pair."""
        panels = CELLS + 1 if self.o["structure"] == "mae_cantilever" else CELLS + 2
        return 2 * (panels + 1) - 1

    def known(self) -> dict:
        """What an experimenter knows of the object."""
        return {k: self.o[k] for k in ("structure", "scene", "settings", "priors")}


FIELDS = {
    "stiffening": "cubic",
    "rest_angle": "offset",
    "compliant_dipoles": "compliance",
    "field_stiffening": "stiffening",
    "misalignment": "tilt",
    "field_hysteresis": "loop",
    "saturation": "saturation",
    "taper": "taper",
    "clamp": "clamp",
    "clamp_play": "play",
    "voltage_offset": "zero",
    "threshold": "threshold",
    "length_scale": "scale",
}


def entered(entries: list[dict]) -> Beam:
    """The beam with some effects; what stands twice adds up."""
    beam = Beam()
    for e in entries:
        if e["mechanism"] == "field_offset":
            angle = e["extra"]["angle"]
            beam = replace(beam, stray=(e["strength"] * math.cos(angle), e["strength"] * math.sin(angle)))
            continue
        name = FIELDS[e["mechanism"]]
        beam = replace(beam, **{name: getattr(beam, name) + e["strength"]})
    return beam


# --- the magnetic cantilever


def reaching(levels: np.ndarray, beam: Beam) -> np.ndarray:
    """Field (n, 2) along x and z that reaches the beam at the commanded levels along z [T]."""
    b = np.array(levels, float)
    if beam.loop:
        last = 0.0
        for n, level in enumerate(levels):
            last = b[n] = min(max(last, level - beam.loop), level + beam.loop)
    if beam.saturation:
        b = np.tanh(beam.saturation * b) / beam.saturation
    return np.stack([b * math.sin(beam.tilt) + beam.stray[0], b * math.cos(beam.tilt) + beam.stray[1]], axis=1)


LOOSE = 0.01
"""Moment that turns a loose clamp over, as a part of that which turns the beam by one radian."""

NODES = 16
"""Gauss-Legendre points along the beam."""


@functools.cache
def _quadrature() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points and weights on 0 to 1, and the matrix (points, points) of integrals from 0 up to each point."""
    at, share = np.polynomial.legendre.leggauss(NODES)
    wave = np.polynomial.legendre.legvander(at, NODES - 1)
    summed = [np.polynomial.legendre.legint(one, lbnd=-1) for one in np.eye(NODES)]
    whole = np.stack([np.polynomial.legendre.legval(at, c) for c in summed], axis=1)
    return 0.5 * (1 + at), 0.5 * share, 0.5 * np.linalg.solve(wave.T, whole.T).T


def cantilever(s: dict, levels: np.ndarray, beam: Beam, cell: float) -> np.ndarray:
    """Tip (n, 2) in x and z [m] of the elastica at each level.

    The moment is the sum of the couples beyond, the angle that of the curvatures before: of the angles at the points,
    Newton's method finds those that agree, at half the load first.

    Raises:
        RuntimeError: it finds none.
    """
    at, share, before = _quadrature()
    beyond = share - before
    fields, back = np.unique(reaching(levels, beam), axis=0, return_inverse=True)
    length, stiff = s["length"], s["modulus"] * s["width"] * s["thickness"] ** 3 / 12
    magnet = length * s["remanence"] / MU0 * s["width"] * s["thickness"]  # moment of the whole beam [A m2]
    bent = float(stiff) / length  # moment by which it turns by one [N m]
    square = (fields**2).sum(axis=1, keepdims=True)
    stiff = stiff * (1 + beam.stiffening * square / (square + BEND_HALF**2)) * (1 + beam.taper * (at - 0.5))
    cubic = beam.cubic * cell**3
    angle = np.zeros((len(fields), NODES))
    for part in (0.5, 1.0):
        bx, bz = (part * fields).T[:, :, None]
        for _ in range(50):
            along, across = bx * np.cos(angle) + bz * np.sin(angle), bz * np.cos(angle) - bx * np.sin(angle)
            couple = magnet * across * (1 - beam.compliance * along)
            turned = -magnet * (along * (1 - beam.compliance * along) + beam.compliance * across**2)
            k = curvature(couple @ beyond.T + part * beam.offset, stiff, cubic)
            held = (couple @ share)[:, None]
            turned_over = np.tanh(held / (LOOSE * bent))  # the clamp has turned as far as it goes, either way
            gap = angle - beam.clamp * held - beam.play * turned_over - length * k @ before.T
            softness = 1 / (stiff + 3 * cubic * k**2)
            gives = beam.clamp + beam.play * (1 - turned_over**2) / (LOOSE * bent)
            by = gives[:, :, None] * share + length * before @ (softness[:, :, None] * beyond)
            step = np.linalg.solve(np.eye(NODES) - by * turned[:, None, :], gap[:, :, None])[:, :, 0]
            angle = angle - np.clip(step, -0.5, 0.5)
            if np.abs(step).max() < 1e-10:
                break
        else:
            raise RuntimeError(f"no elastica in {np.abs(levels).max():g} T")
    tip = length * np.stack([np.cos(angle) @ share, np.sin(angle) @ share], axis=1)
    return tip[back.ravel()]


def curvature(moment: np.ndarray, stiff: np.ndarray, cubic: float) -> np.ndarray:
    """Curvature k [1/m] of stiff k + cubic k^3 = moment: the one real root (cubic is not negative)."""
    if cubic == 0.0:
        return moment / stiff
    r = np.sqrt(3 * cubic / stiff)
    return 2 / r * np.sinh(np.arcsinh(1.5 * moment / stiff * r) / 3)


# --- the dielectric bender

OGDEN = ((8580.0, 1.293), (84300.0, 2.3252), (-23300.0, 2.561))
LAYER, TAPE, POISSON = 272.8e-6, 62e-6, 0.3
SLICES = 9
"""Slices of the stack's height over which the energy is summed (Gauss-Legendre)."""


def bender(s: dict, levels: np.ndarray, beam: Beam, cell: float) -> np.ndarray:
    """Tip (n, 2) in x and z [m]: the electrode bends downwards, the bare end only by what acts without voltage."""
    names = ("width", "electrode_width", "layers", "tape_layers", "tape_modulus", "permittivity")
    fixed, passive = tuple((n, s[n]) for n in names), Beam(cubic=beam.cubic, offset=beam.offset)
    at = (np.arange(400) + 0.5) / 400
    out = []
    for v in levels:
        v = v + beam.zero
        v = math.sqrt(max(v * v - beam.threshold**2, 0.0))
        k = _curvature(fixed, v, passive, cell)
        # thickness that varies along the strip spreads the same turn unevenly; the end turns with the clamp
        turn = k * s["electrode_length"]
        share = 1 / (1 + beam.taper * (at - 0.5))
        stiff = s["tape_modulus"] * s["width"] * TAPE**3  # what a clamp's turn is measured against
        root = beam.clamp * stiff * k
        angle = root + turn * (np.cumsum(share) - share / 2) / 400  # in the middle of each piece
        bare = (
            root
            + turn * share.mean()
            + _curvature(fixed, 0.0, passive, cell) * (s["length"] - s["electrode_length"]) * at
        )
        parts = (s["electrode_length"], angle), (s["length"] - s["electrode_length"], bare)
        x, z = (sum(part * np.mean(wave(a)) for part, a in parts) for wave in (np.cos, np.sin))
        out.append((x, -z))
    return np.array(out)


@functools.lru_cache(maxsize=4096)
def _curvature(settings: tuple, voltage: float, beam: Beam, cell: float) -> float:
    """Curvature of least enthalpy [1/m], by Newton's method on central differences."""
    s, k, step = dict(settings), 0.0, 0.02
    for _ in range(40):
        low, mid, high = (enthalpy(s, k + d, voltage, beam, cell)[1] for d in (-step, 0.0, step))
        move = -(high - low) / 2 * step / (high - 2 * mid + low)
        k += float(np.clip(move, -10.0, 10.0))
        if abs(move) < 1e-7:
            break
    return k


def enthalpy(s: dict, k: float, voltage: float, beam: Beam, cell: float) -> tuple[float, float]:
    """Strain of the tape's middle, and enthalpy per length [J/m] at a curvature, with that strain at its best.

    The stack (incompressible, plane strain: stretches l, 1, 1/l) stands on a tape in plane strain. The area of every
    slice stays what it was, so that bending by k turns a slice at height z above the tape into one of stretch
    sqrt(root^2 + 2 k z), root being that of its lower face. Layers of thickness t hold eps (l V / t)^2 / 2 per volume.
    """
    height = round(s["layers"]) * LAYER
    tape = s["tape_layers"] * TAPE
    film = s["tape_modulus"] / (1 - POISSON**2) * tape
    at, share = np.polynomial.legendre.leggauss(SLICES)
    z, share = 0.5 * height * (1 + at), 0.5 * height * share
    pressure = EPS0 * s["permittivity"] * (voltage / LAYER) ** 2 * s["electrode_width"]

    def total(e: float) -> float:
        square = (1 + e + k * tape / 2) ** 2 + 2 * k * z
        elastic = sum(mu / a * (square ** (a / 2) + square ** (-a / 2) - 2) for mu, a in OGDEN)
        stack = float(share @ (s["width"] * elastic - 0.5 * pressure * (square - 1)))
        return stack + s["width"] * 0.5 * film * (e**2 + (k * tape) ** 2 / 12)

    e, step = 0.0, 1e-4
    for _ in range(30):
        low, mid, high = total(e - step), total(e), total(e + step)
        move = -(high - low) / 2 * step / (high - 2 * mid + low)
        e += move
        if abs(move) < 1e-12:
            break
    extra = 0.25 * beam.cubic * cell**3 * k**4 + beam.offset * k  # which bends towards +z, k away from it
    return e, total(e) + extra
