"""Recordings of real objects: read, lint, noise, initial states, and an independent stand-in."""

from origami_sim.recording.initial_state import AngleEstimate, initial_angles
from origami_sim.recording.lint import Series, lint
from origami_sim.recording.reader import read_recording
from origami_sim.recording.recording import Channel, DriveChannel, Recording, estimate_noise
from origami_sim.recording.rigid_pendulum import DoublePendulum, double_pendulum_rhs, simulate_double_pendulum
from origami_sim.recording.stand_in import stand_in_double_pendulum

__all__ = [
    "AngleEstimate",
    "Channel",
    "DoublePendulum",
    "DriveChannel",
    "Recording",
    "Series",
    "double_pendulum_rhs",
    "estimate_noise",
    "initial_angles",
    "lint",
    "read_recording",
    "simulate_double_pendulum",
    "stand_in_double_pendulum",
]
