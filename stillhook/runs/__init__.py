"""Runs in time as figures, words and files, and `simulate`."""
