"""The hook's motion: spectra, numbers and time series from vessel and sea."""
