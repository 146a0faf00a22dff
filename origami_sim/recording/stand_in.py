"""A stand-in for the measured double pendulum, for tests and demonstrations where the recording is not at hand."""

import io
from dataclasses import replace
from pathlib import Path

import numpy as np

from origami_sim.errors import InputError
from origami_sim.files import write_text
from origami_sim.recording.rigid_pendulum import PUBLISHED_DOUBLE, simulate_double_pendulum

ENCODER_STEP = 1.57e-4
"""Angle of one encoder count [rad]."""


def stand_in_double_pendulum(
    path_csv: str | Path, *, duration: float = 20.0, rate_hz: float = 1000.0, seed: int = 0, dry_friction: float = 4e-4
) -> Path:
    """Write a CSV with the columns of the real recording: time_s, theta1_rad, theta2_rad (from upright, hanging = pi).

    The motion is that of rigid arms with the published parameters plus a dry friction in hinge 2 that the nominal
    model (viscous only) lacks. Readings are rounded to encoder counts. The seed draws the initial state (near that of
    the recording) and the encoder zeros; equal arguments give equal bytes. The file appears whole or not at all.

    Args:
        path_csv: file to write; its folder must exist.
        duration: length [s].
        rate_hz: frames per second [1/s].
        seed: seed of the initial state and encoder zeros.
        dry_friction: concealed dry friction moment of hinge 2 [N m]; 0 gives a null case.

    Returns:
        The path written.
    """
    if not (duration > 0.0 and rate_hz > 0.0 and duration * rate_hz >= 2.0):
        raise InputError("a stand-in needs at least 3 frames", field="duration", value=duration)
    path = Path(path_csv)
    times = np.arange(int(np.floor(duration * rate_hz + 1e-9)) + 1) / rate_hz
    states = simulate_double_pendulum(replace(PUBLISHED_DOUBLE, dry2=dry_friction), stand_in_start(seed), times)
    zeros = np.random.default_rng([seed, 1]).uniform(0.0, ENCODER_STEP, size=2)
    angles = np.round((states[:, :2] - zeros) / ENCODER_STEP) * ENCODER_STEP + zeros

    table, header = io.StringIO(), "time_s,theta1_rad,theta2_rad"
    rows = np.column_stack([times, angles])
    np.savetxt(table, rows, fmt=["%.6f", "%.8f", "%.8f"], delimiter=",", header=header, comments="")
    return write_text(path, table.getvalue())


def stand_in_start(seed: int) -> np.ndarray:
    """(4,) true initial state [theta1, theta2, w1, w2] of the stand-in with this seed [rad, rad/s]."""
    return np.random.default_rng([seed, 0]).normal([2.6, 3.5, 7.8, -1.5], [0.05, 0.05, 0.3, 0.3])


def write_stand_in_sidecar(path_csv: str | Path) -> Path:
    """Writes the sidecar of a stand-in beside it, with what an experimenter would know; returns its path."""
    return write_text(Path(path_csv).with_suffix(".toml"), _SIDECAR)


_SIDECAR = """\
# Made by `origami-sim demo`: rigid arms in an independent integration, with something that the model lacks.
name = "stand_in"
description = "free swing of a two-hinge chain; angles are absolute, from the upright vertical (hanging still is pi)"
source = "origami_sim.recording.stand_in"

[time]
column = "time_s"
unit = "s"

[channels.theta1]
column = "theta1_rad"
kind = "panel_angle"
unit = "rad"
panel = "arm1"

[channels.theta2]
column = "theta2_rad"
kind = "panel_angle"
unit = "rad"
panel = "arm2"

[scene]
name = "pendulum_chain"

[priors]  # how well the numbers of the model are known; what is not named is taken as exact
mass_1 = "1 %"
mass_2 = "1 %"
viscosity_1 = "20 %"
viscosity_2 = "20 %"
"""
