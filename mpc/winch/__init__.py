"""The winch as predictive control sees it: model, estimator, weights."""
