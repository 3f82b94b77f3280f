"""Seas: spectra and their parts, spreading over headings, records of buoys, scatter diagrams.

`models.sea.sea.SeaSpectrum` is the sea of a case; the rooms here hold what it is made of.
"""
