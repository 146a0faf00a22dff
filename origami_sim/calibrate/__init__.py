"""Calibration: parameters from measured curves (`experiment`) and from finite elements (`fe`), with their intervals."""
