"""Sweeps in the frequency domain: one design on thousands to millions of plants at once.

    design + Spread -> rows of numbers -> chunks -> rms values, stability, M_s -> xarray.Dataset

`synth.sweeps.frequency.frequency_sweep` is the way in.
"""
