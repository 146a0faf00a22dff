"""Calibration: parameters from measured curves (`experiment`), finite elements (`fe`) and papers (`stated`)."""
