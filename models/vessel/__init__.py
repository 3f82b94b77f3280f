"""Vessels from files: six complex RAOs over frequency and heading, in one convention.

    RAO file (CSV, WAMIT, OrcaFlex, Capytaine, MSS, ShipX) -> read_raos -> VesselRaos -> the hook

Each reader turns what its program writes into the project's convention, and nothing after it has
to know another one: z up; x forward, y to port; angles by the right hand rule; time factor
e^{+i omega t}; headings are where the waves travel towards, 0 following, 180 deg head sea.
"""

from __future__ import annotations

from .raos import MODES, VesselRaos

__all__ = ["MODES", "VesselRaos", "bundled_vessels", "read_raos", "write_raos"]


def __getattr__(name: str) -> object:
    # The readers are imported when one is asked for: a case without a vessel file needs none.
    if name in {"bundled_vessels", "read_raos", "write_raos"}:
        from .readers import files

        return getattr(files, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
