"""What a fit leaves is told from noise, and from noise that a tracker has coloured."""

import numpy as np
import pytest
from test_curves import MOMENT_NOISE, REST, K, coupon, torque

from origami_sim.diagnose import diagnose


@pytest.mark.parametrize(("waves", "word"), [(0.0, "ADEQUATE"), (1.5, "UNKNOWN")])
def test_waves_in_a_torque_curve_are_real(waves, word):
    """No law of the catalogue makes a moment that waves with the angle; it is 1.5 times the noise."""
    amplitude = np.sqrt(2.0) * waves * MOMENT_NOISE
    found = diagnose(coupon(), [torque(lambda q: K * (q - REST) + amplitude * np.sin(8.0 * q))])
    assert found.verdict == word
