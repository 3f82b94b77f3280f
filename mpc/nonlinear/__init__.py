"""Predictive control with the nonlinear plant."""
