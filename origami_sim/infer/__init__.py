"""Inference: the posterior over sets of effects, from a refitted model and signatures."""
