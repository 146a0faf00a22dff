"""Units of recordings: those of everything else."""

from origami_sim.units import UNITS, quantity, si_unit, unit_factor, with_prefix

__all__ = ["UNITS", "quantity", "si_unit", "unit_factor", "with_prefix"]
