"""The estimator, usable by itself: what the data of a recording are worth."""

from origami_sim.fit.noise import Burst, Noise, infer, noise_of, portmanteau

__all__ = ["Burst", "Noise", "infer", "noise_of", "portmanteau"]
