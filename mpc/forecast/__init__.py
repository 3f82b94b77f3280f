"""Forecasts of the hook's motion."""
