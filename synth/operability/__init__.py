"""Operability: in which seas a winch can work, which limit binds, and how much of the year that is.

    design, seas -> limiting H_s for every limit -> contours -> against a scatter diagram

`study.operability` is the door (`sh.operability`).  `systems` are the loops whose motion is looked
at, `responses` their responses with the drag as a variable, `columns` the seas of one period,
`limiting` the search for the limiting H_s, `contour` the answer over period and heading.
"""

from .study import operability

__all__ = ["operability"]
