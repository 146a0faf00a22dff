"""Diagnosis: where simulation and recordings differ, which physics was left out, and how sure that is."""

from origami_sim.diagnose.diagnose import Options, diagnose
from origami_sim.diagnose.diagnosis import EXIT, VERDICTS, Diagnosis
from origami_sim.diagnose.hypothesis import Free, Subject, factor

__all__ = ["EXIT", "VERDICTS", "Diagnosis", "Free", "Options", "Subject", "diagnose", "factor"]
