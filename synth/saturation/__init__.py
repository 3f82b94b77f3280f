"""Limit cycles of a loop whose motor saturates, by describing functions.

A case and a controller come in (`TorqueLoop`); amplitudes and frequencies at which the loop would
swing by itself within its torque limits go out (`limit_cycles`).
"""
