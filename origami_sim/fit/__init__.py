"""The estimator: least squares of any `Predictor`, noise, and evidence."""
