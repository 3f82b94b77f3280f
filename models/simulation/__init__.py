"""Simulation in time: the closed loop as one recursion, compiled and run."""
