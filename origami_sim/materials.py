"""Materials of active origami, and the stiffness of layered panels and of elastomer bridges."""

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
    """

    name: str
    modulus: float
    density: float
    poisson: float
    remanence: float = 0.0
    source: str = ""

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
        Material("paper", 3.0e9, 800.0, 0.30, source="copier paper, handbook value"),
        Material("aluminium", 69e9, 2700.0, 0.33, source="handbook value"),
    )
}
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
