"""Units: every factor to SI, put together from the definitions of the symbols in the unit's name."""

import math

import pytest

from origami_sim.quantities import converted, parsed
from origami_sim.units import UNITS, si_unit, unit_factor

PREFIXES = {"": 1.0, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6, "G": 1e9}
SYMBOLS = {
    **dict.fromkeys(("m", "s", "N", "T", "V", "A", "Pa", "K", "Hz", "rad", "1"), 1.0),
    "g": 1e-3,  # SI counts in kilograms
    "G": 1e-4,  # a gauss is a maxwell (1e-8 Wb) per square centimetre
    "min": 60.0,
    "deg": math.pi / 180,
    "rev": 2 * math.pi,
    "g0": 9.80665,  # third general conference on weights and measures, 1901
    "%": 0.01,
    "in": 0.0254,  # international yard and pound, 1959
    "h": 3600.0,
}


def symbol(text: str) -> float:
    """Factor of one symbol with its prefix and power, "mm^2"."""
    name, _, power = text.partition("^")
    if name in SYMBOLS:
        return SYMBOLS[name] ** int(power or 1)
    return (PREFIXES[name[0]] * SYMBOLS[name[1:]]) ** int(power or 1)


def defined(unit: str) -> float:
    """Factor of a unit; what follows a stroke divides, symbol by symbol."""
    above, _, below = unit.partition("/")
    return math.prod(map(symbol, above.split())) / math.prod(map(symbol, below.split()))


@pytest.mark.parametrize(("dimension", "unit"), [(d, u) for d, group in UNITS.items() for u in group])
def test_every_unit_is_what_its_name_says(dimension, unit):
    assert unit_factor(unit, dimension=dimension) == pytest.approx(defined(unit), rel=1e-12)


@pytest.mark.parametrize(
    ("written", "unit"),
    [("µm", "um"), ("μm", "um"), ("mN·m/rad", "mN m/rad"), ("mNm/rad", "mN m/rad"), ("°", "deg"), ("m/s²", "m/s^2"),
     ("N*m", "N m"), ("Nmm", "N mm"), ("kgm^2", "kg m^2")],
)  # fmt: skip
def test_other_spellings(written, unit):
    assert unit_factor(written) == unit_factor(unit) and si_unit(written) == si_unit(unit)
    assert parsed(f"3{written}") == pytest.approx(3 * unit_factor(unit))


def test_units_of_magnetic_fields_against_each_other():
    """The earth's field, 0.5 gauss, is 50 microtesla; a gradient of 10 gauss per centimetre is 0.1 T/m, or mT/mm."""
    gauss, micro = unit_factor("G", dimension="flux density"), unit_factor("uT", dimension="flux density")
    assert 0.5 * gauss == pytest.approx(50 * micro)
    assert converted("2000 G", "T", "field") == pytest.approx(0.2)
    assert converted("0.1 mT/mm", "T/m", "gradient") == pytest.approx(10 * gauss / 1e-2)
