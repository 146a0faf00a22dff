"""Noise of a recorder as a fit shows it, told from a device that moves as fast as a recorder's filter."""

import numpy as np

from origami_sim.fit.least_squares import Fit
from origami_sim.fit.predictor import Predictor
from origami_sim.fit.recorder import beyond_motion, fast_noise, joined

MISREAD = 2.0
"""Factor up to which a level that is read where no motion reaches may be too low for the filter of a recorder.

It is 0.8 to 1.1 of the truth for averages over 3 to 9 frames, 0.63 for a median and an average together. With half of
it no filter explains more than is read, with double the ring of a flap passes for noise of four times its level.
"""


def recorder_noise(forward: Predictor, f: Fit) -> np.ndarray:
    """(D,) standard deviations of the noise of a recorder that may average over frames, as a fit's residuals show it.

    Where no filter explains `fast_noise` beside what is read where no motion reaches, noise is what was read.
    """
    noise, level = forward.blocks[0].noise, fast_noise(forward, f).copy()
    odd = np.flatnonzero(level > MISREAD * noise).tolist()
    if not odd:
        return level
    each = (joined(forward, f), [forward.blocks[b].values for b in f.blocks])  # a prediction may be rough, too
    read = np.min([[n.deviation for n in beyond_motion(forward, w, odd)] for w in each], axis=0)
    level[odd] = np.where(level[odd] > MISREAD * read, np.maximum(read, noise[odd]), level[odd])
    return level
