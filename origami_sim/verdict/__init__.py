"""The verdict: what a posterior over sets of effects says, in probabilities and in words."""
