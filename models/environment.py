"""Sea and vessel, as sections of the case file: what moves the hook.

A section only holds the data; the spectra are computed from it in `models.sea`, the motion of the
hook in `models.hook`.
"""

from __future__ import annotations

from .sea_section import Sea, SeaPart
from .vessel_section import HeaveRAO, Vessel

__all__ = ["HeaveRAO", "Sea", "SeaPart", "Vessel"]
