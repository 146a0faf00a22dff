"""The estimator: numbers with priors, what a hypothesis predicts, least squares and evidence."""
