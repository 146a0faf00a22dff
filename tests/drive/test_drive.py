"""Signals and drives as data, and as the kernels see them."""

import math

import numpy as np
import pytest
from effects.kit import make_model, quiet, start

from origami_sim.drive import Drive, Signal, ramp, series, sine
from origami_sim.errors import InputError
from origami_sim.solve.batch import Batch


def test_signal_is_offset_plus_wave_plus_series():
    s = Signal(offset=1.0, amplitude=2.0, frequency=0.5, phase=0.3, times=[0, 1, 3], values=[0, 1, -1], scale=10.0)
    t = np.array([0.0, 0.5, 2.0, 3.0])
    assert s(t) == pytest.approx(1 + 2 * np.sin(math.pi * t + 0.3) + 10 * np.array([0, 0.5, 0, -1]), abs=1e-14)


def test_ramp_goes_from_start_to_final_and_stays():
    assert ramp(3.0, 2.0, start=1.0)(np.array([0.0, 1.0, 2.0, 100.0])) == pytest.approx([1, 2, 3, 3])
    assert ramp(np.array([1.0, 2.0]), 1.0)(0.5) == pytest.approx([0.5, 1.0])
    with pytest.raises(InputError, match="duration"):
        ramp(1.0, 0.0)


@pytest.mark.parametrize(
    "options, words",
    [
        ({"times": [0, 1]}, ["both"]),
        ({"offset": float("nan")}, ["offset", "finite"]),
        ({"amplitude": np.array([1, np.inf])}, ["amplitude", "finite"]),
        ({"times": [0, 1], "values": [0, 1, 2]}, ["values", "(2,)"]),
        ({"times": [0.0], "values": [1.0]}, ["two times"]),
        ({"times": [0, 1, 1], "values": [0, 1, 2]}, ["sample 2", "increase"]),
        ({"times": [0, 2, 1], "values": [0, 1, 2]}, ["sample 2", "1.0"]),
        ({"times": [0, 1], "values": [0, np.nan]}, ["values", "finite"]),
        ({"times": [0, np.nan], "values": [0, 1]}, ["times"]),
    ],
)
def test_wrong_signals_are_named(options, words):
    with pytest.raises(InputError) as e:
        Signal(**options)
    for word in words:
        assert word in str(e.value)


def test_drive_names_its_channels_and_checks_their_number():
    d = Drive(field=(0.1, 0, sine(0.2, 1.0)), voltage=[1.0, 2.0])
    assert d["voltage_1"](0.0) == 2.0
    assert d.field(0.25) == pytest.approx([0.1, 0, 0.2])
    with pytest.raises(InputError, match="three components"):
        Drive(field=(0.0, 1.0))
    with pytest.raises(InputError, match="3 x 3"):
        Drive(gradient=[[0, 0, 0]])


def test_a_drive_that_ends_early_is_named():
    d = Drive(load=series([0, 2.0], [0, 1]), voltage=series([0, 1.0], [0, 1]))
    assert d.end == 1.0 and Drive().end == math.inf
    d.require(1.0)
    with pytest.raises(InputError, match=r"voltage_0.*1.0.*1\.5 s"):
        d.require(1.5)


def test_kernels_see_the_same_signal_as_python():
    """The load as a force on a node: wave, ramp and two series with different knots, two worlds."""
    rng = np.random.default_rng(1)
    times = np.sort(rng.uniform(0, 5, 12))
    signal = Signal(
        offset=np.array([0.3, -0.1]),
        amplitude=np.array([1.0, 0.0]),
        frequency=0.7,
        phase=1.1,
        times=times,
        values=rng.normal(size=12),
        scale=np.array([1.0, -2.0]),
    )
    model = make_model([[0.0, 0, 0]])
    p = quiet(model, {("load", "force_x"): 1.0})
    batch = Batch(model, p, Drive(load=signal, voltage=series([0, 2.2, 7], [0, 1, 0])), start(model, 2))
    for t in [0.0, *rng.uniform(0, 6, 20), *times]:
        assert batch.total_force(t)[0, :, 0] == pytest.approx(signal(t), abs=1e-13)
