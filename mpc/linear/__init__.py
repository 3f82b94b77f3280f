"""Predictive control with the linear plant, as one quadratic programme a sample."""
