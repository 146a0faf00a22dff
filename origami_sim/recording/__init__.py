"""Recordings of real objects: read, lint, noise, initial states, and an independent stand-in."""

from origami_sim.recording.axes import Axes, mistaken_axes
from origami_sim.recording.camera import Camera
from origami_sim.recording.dataset import DataSet, read_dataset
from origami_sim.recording.drives import applied_drive, by_component, recorded_signals
from origami_sim.recording.initial_state import AngleEstimate, initial_angles
from origami_sim.recording.lint import Series, lint, lint_report
from origami_sim.recording.noise import NoiseReport, noise_report
from origami_sim.recording.reader import read_recording
from origami_sim.recording.recording import Channel, DriveChannel, Recording, estimate_noise
from origami_sim.recording.rigid_pendulum import DoublePendulum, double_pendulum_rhs, simulate_double_pendulum
from origami_sim.recording.stand_in import stand_in_double_pendulum
from origami_sim.recording.stated import Gravity, Start

__all__ = [
    "AngleEstimate",
    "Axes",
    "Camera",
    "Channel",
    "DataSet",
    "DoublePendulum",
    "DriveChannel",
    "Gravity",
    "NoiseReport",
    "Recording",
    "Series",
    "Start",
    "applied_drive",
    "by_component",
    "double_pendulum_rhs",
    "estimate_noise",
    "initial_angles",
    "lint",
    "lint_report",
    "mistaken_axes",
    "noise_report",
    "read_dataset",
    "read_recording",
    "recorded_signals",
    "simulate_double_pendulum",
    "stand_in_double_pendulum",
]
