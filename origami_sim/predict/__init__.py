"""Predictors: what a hypothesis makes of recordings, by rollouts of bars or rigid panels, curves and slow motions."""
