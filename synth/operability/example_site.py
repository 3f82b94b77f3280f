"""A scatter diagram of our own, to try things with: no site on earth, nobody's measurements.

Significant heights are Weibull distributed with a scale for each month, peak periods lognormal
about a mean that grows with H_s: the forms of the joint environmental model of DNV-RP-C205 (3.6.3),
with round numbers that make a northern open-sea site with rough winters.  Real work needs the
diagram of the real site.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import ndtr

from models.sea import Scatter

EXAMPLE = "example"
"""The name by which the command line knows the diagram."""

_SCALES = (3.0, 2.8, 2.5, 2.0, 1.6, 1.4, 1.3, 1.4, 1.8, 2.3, 2.6, 2.9)  # of H_s by month [m]
_DAYS = (31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31)
_SHAPE = 1.5  # of the Weibull distribution [-]
_HEIGHTS = np.arange(0.0, 12.5, 0.5)  # edges of the classes [m]
_PERIODS = np.arange(3.0, 20.5, 1.0)  # [s]
_LEAST = 1e-6  # share of a month below which a class is left out


def example_scatter() -> Scatter:
    """Return the diagram: classes of 0.5 m and 1 s at their centres, for each month."""
    heights, periods, shares, months = [], [], [], []
    centres = 0.5 * (_HEIGHTS[:-1] + _HEIGHTS[1:])
    for month, (scale, days) in enumerate(zip(_SCALES, _DAYS, strict=True), start=1):
        below = 1.0 - np.exp(-((_HEIGHTS / scale) ** _SHAPE))
        for height, share in zip(centres, np.diff(below), strict=True):
            # Mean of the logarithm of T_p, and its spread, which narrows as the sea grows.
            mean = math.log(6.0 + 1.3 * float(height) ** 0.8)
            spread = 0.12 + 0.14 * math.exp(-0.35 * float(height))
            within = np.diff(ndtr((np.log(_PERIODS) - mean) / spread))
            for period, part in zip(0.5 * (_PERIODS[:-1] + _PERIODS[1:]), within, strict=True):
                if share * part > _LEAST:
                    heights.append(float(height))
                    periods.append(float(period))
                    shares.append(float(share * part * days))
                    months.append(month)
    return Scatter(
        significant_height=np.array(heights),
        peak_period=np.array(periods),
        occurrence=np.array(shares),
        month=np.array(months),
        source="made-up example site",
    )
