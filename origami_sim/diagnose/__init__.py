"""Questions asked of the estimator."""
from origami_sim.fit.hypothesis import Free, Hypothesis, Subject, Suspect, factor
