"""Predictive control: a winch that acts on what is about to happen, within its motor's limits.

    sensors --> estimator, forecast of the hook's motion --> quadratic programme --> drive command

`LinearMPC` is a controller for the simulator and for a drive; `clairvoyant` is what nobody could do
better on a record.  The package builds on `models` alone.
"""
