"""Sea and vessel, as sections of the case file: what moves the hook.

A section only holds the data; the spectra are computed from it in `models.sea.sea`, the motion of
the hook in `models.hook.hook`.
"""

from __future__ import annotations
