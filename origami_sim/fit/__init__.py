"""The estimator: numbers with priors, suspects, noise, least squares of any `Predictor`, and evidence."""
