"""Foundations that every room stands on: errors, files, signals, units, quadrature, intervals."""
