"""Devices as files: scenes with their calibrations, and Python or design files of one's own."""
