"""Exports: a controller, or the plant, as others run it: C, FMU, structured text, state space.

A design, a case or a controller comes in; folders go out that need nothing of Stillhook, each with
a README and the proof that it is the law that was simulated.
"""
