"""The page that a diagnosis leaves: what was found first, and behind it, folded, the plot for every claim.

It is drawn from the plain data of a `Diagnosis` alone and carries them (compressed) behind a link, so that every number
in it can be checked: `read_report`. One file, no network.
"""

from origami_sim.report.page.document import page, read_report, write_report
from origami_sim.report.page.geometry import geometry_of

__all__ = ["geometry_of", "page", "read_report", "write_report"]
