"""Calibration from measured curves, in one place: reading, the fits, and what becomes of them.

`curves` reads and checks, `fitting` fits and says what can be known, `crease_curve`, `relaxation`, `ring_down` and
`deflection` hold one kind of test each, `outcome` writes and draws.
"""

from origami_sim.calibrate.crease_curve import TableFit, fit_crease, fit_crease_table, table_basis
from origami_sim.calibrate.curves import read_columns
from origami_sim.calibrate.deflection import fit_deflection
from origami_sim.calibrate.fitting import FLAT, LEVEL, Fit, Parameter, fit, identifiability
from origami_sim.calibrate.outcome import calibration, plot_fit, summary
from origami_sim.calibrate.relaxation import RESOLVED, Hold, PronyFit, fit_prony, read_hold, thinned
from origami_sim.calibrate.ring_down import fit_ring_down

__all__ = [
    "FLAT",
    "LEVEL",
    "RESOLVED",
    "Fit",
    "Hold",
    "Parameter",
    "PronyFit",
    "TableFit",
    "calibration",
    "fit",
    "fit_crease",
    "fit_crease_table",
    "fit_deflection",
    "fit_prony",
    "fit_ring_down",
    "identifiability",
    "plot_fit",
    "read_columns",
    "read_hold",
    "summary",
    "table_basis",
    "thinned",
]
