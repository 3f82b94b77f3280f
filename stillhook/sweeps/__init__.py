"""Sweeps at the face: figures, engines, stores and `stillhook sweep`.

What is varied stands in `models.spread`, the vectorised frequency-domain engine in
`synth.sweeps`; here are what runs thousands of time-domain cases, keeps them on disk, and shows
what came of it.
"""
