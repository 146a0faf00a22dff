"""Materials of active origami, and the stiffness of layered panels and of elastomer bridges."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from origami_sim.errors import InputError
from origami_sim.quantities import converted

MU0 = 1.25663706212e-6
"""Permeability of free space [T m/A]."""

EPS0 = 8.8541878128e-12
"""Permittivity of free space [F/m]."""

G = 9.80665
"""Standard gravity [m/s^2]."""

MEMBRANE_POISSON = 1.0 / 3.0
"""The only Poisson's ratio that bars along triangle edges reproduce in shear."""


@dataclass(frozen=True)
class Material:
    """Small-strain constants.

    Attributes:
        modulus: Young's modulus [Pa]. density: [kg/m^3]. poisson: Poisson's ratio [-].
        remanence: remanent flux density of the poled material [T]. source: where the numbers come from.
        yield_stress: at which it keeps a bend [Pa]; 0: elastic, or not known.
    """

    name: str
    modulus: float
    density: float
    poisson: float
    remanence: float = 0.0
    source: str = ""
    yield_stress: float = 0.0

    @property
    def plane_modulus(self) -> float:
        """E' = E / (1 - nu^2), for bending of wide strips [Pa]."""
        return self.modulus / (1.0 - self.poisson**2)


MATERIALS = {
    m.name: m
    for m in (
        Material(
            "pdms", 1.5e6, 1010.0, 0.49, source="Gelest RTV, specific gravity 1.01 (seed paper); modulus 1.4-1.6 MPa"
        ),
        Material("mae", 0.78e6, 2800.0, 0.49, 0.130, source="seed paper Table 2: 6 (C10 + C01) with 90 and 40 kPa"),
        Material("vhb", 0.19e6, 960.0, 0.49, source="3M F9473PC (seed paper)"),
        Material("tape", 1.6e9, 1063.0, 0.30, source="3M Magic tape, measured in the seed paper"),
        Material(
            "paper", 3.0e9, 800.0, 0.30, source="copier paper, handbook values; yield 10 to 40 MPa by direction and "
            "moisture", yield_stress=20e6,
        ),
        Material(
            "pet", 4.8e9, 1390.0, 0.38, source="polyester film: DuPont Teijin Films, Mylar bulletin H-37232-3 (92A): "
            "modulus 490 kg/mm^2, strength at 5 % elongation 10 kg/mm^2", yield_stress=98e6,
        ),
        Material("aluminium", 69e9, 2700.0, 0.33, source="handbook value"),
    )
}  # fmt: skip
"""Materials by name."""


def material(name: str) -> Material:
    """The material of that name; raises InputError naming the known ones."""
    if name not in MATERIALS:
        raise InputError("unknown material", field="material", value=name, allowed=", ".join(MATERIALS))
    return MATERIALS[name]


def layered_rigidity(layers: Sequence[tuple[float, float]]) -> float:
    """Bending rigidity per width of bonded layers [N m].

    Args:
        layers: (thickness [m], plane-strain modulus [Pa]) from the bottom up.

    The neutral axis is the modulus-weighted mean height; D = sum E'_i (t_i^3 / 12 + t_i (z_i - z_n)^2).
    """
    z, centres = 0.0, []
    for t, _ in layers:
        centres.append(z + t / 2)
        z += t
    stretch = sum(e * t for t, e in layers)
    neutral = sum(e * t * c for (t, e), c in zip(layers, centres, strict=True)) / stretch
    return sum(e * (t**3 / 12 + t * (c - neutral) ** 2) for (t, e), c in zip(layers, centres, strict=True))


def bridge_stiffness(
    modulus: float | str,
    width: float | str,
    thickness: float | str,
    gap: float | str,
    *,
    poisson: float = 0.49,
    end_correction: float = 0.66,
) -> float:
    """Rotational stiffness of an elastomer bridge between two one-sided patches [N m/rad].

    K = E' w h^3 / (12 L*), L* = g + 2 c h: the bridge is longer than the gap because the sheet under the patches
    bends too; c = 0.66 for patches of 0.78 MPa, 0.40 for rigid ones (plane finite elements). Arguments may be
    quantities, "1.5 MPa".
    """
    modulus = float(converted(modulus, "Pa", "modulus"))
    width, thickness = float(converted(width, "m", "width")), float(converted(thickness, "m", "thickness"))
    gap = float(converted(gap, "m", "gap"))
    for name, value in (("modulus", modulus), ("width", width), ("thickness", thickness), ("gap", gap)):
        if not value > 0:
            raise InputError("a bridge needs positive dimensions", field=name, value=value, allowed="> 0")
    return modulus / (1 - poisson**2) * width * thickness**3 / (12 * (gap + 2 * end_correction * thickness))


def yielding_crease(
    modulus: float, yield_stress: float, width: float, thickness: float, length: float, *, poisson: float = 0.0
) -> tuple[float, float]:
    """Stiffness [N m/rad] and fully plastic moment [N m] of a crease that is a short strip of its sheet.

    K = E w h^3 / (12 (1 - nu^2) L) and M = sigma w h^2 / 4 of a rectangle without hardening (Hill 1950, ch. 4).

    Args:
        modulus, yield_stress: of the sheet [Pa]. width: of the crease, along its axis [m].
        thickness: of the sheet [m]. length: of the strip that bends, across the crease [m]: what the fold's radius
            leaves, for a sharp fold by an angle of pi twice to five times the thickness.
    """
    given = {"modulus": modulus, "yield_stress": yield_stress, "width": width, "thickness": thickness, "length": length}
    for name, value in given.items():
        if not value > 0:
            raise InputError("a crease needs positive numbers", field=name, value=value, allowed="> 0")
    stiffness = modulus / (1 - poisson**2) * width * thickness**3 / (12 * length)
    return stiffness, yield_stress * width * thickness**2 / 4


def demagnetising_factors(length: float, width: float, thickness: float) -> tuple[float, float, float]:
    """Demagnetising factors of a rectangular prism along its three edges; they sum to 1 (Aharoni 1998, eq. 1).

    They are means over the prism for an even magnetisation, right for a small susceptibility; of a thin patch of a
    strong one the edges are magnetised less than the middle.
    """
    sides = (length, width, thickness)
    for name, value in zip(("length", "width", "thickness"), sides, strict=True):
        if not value > 0:
            raise InputError("a prism needs positive edges", field=name, value=value, allowed="> 0 m")

    def along(a: float, b: float, c: float) -> float:
        """Along c of a prism 2 a x 2 b x 2 c."""
        ab, bc, ca, abc = math.hypot(a, b), math.hypot(b, c), math.hypot(c, a), math.sqrt(a * a + b * b + c * c)

        def log(root: float, side: float) -> float:  # of (root - side) / (root + side)
            return -2.0 * math.atanh(side / root)

        out = (b * b - c * c) / (2 * b * c) * log(abc, a) + (a * a - c * c) / (2 * a * c) * log(abc, b)
        out += (
            -b / (2 * c) * log(ab, a) - a / (2 * c) * log(ab, b) + c / (2 * a) * log(bc, b) + c / (2 * b) * log(ca, a)
        )
        out += 2 * math.atan(a * b / (c * abc)) + (a**3 + b**3 - 2 * c**3) / (3 * a * b * c)
        out += (a * a + b * b - 2 * c * c) / (3 * a * b * c) * abc + c / (a * b) * (ca + bc)
        return (out - (ab**3 + bc**3 + ca**3) / (3 * a * b * c)) / math.pi

    a, b, c = (s / max(sides) for s in sides)
    return along(b, c, a), along(c, a, b), along(a, b, c)
