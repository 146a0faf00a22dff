"""Calibration: parameters from measured curves (`experiment`) and from finite elements (`fe`), with their intervals."""

from origami_sim.calibrate.result import Calibration, Quantity, read_result, write_calibration

__all__ = ["Calibration", "Quantity", "read_result", "write_calibration"]
