"""Sweeps in the frequency domain: one design on thousands to millions of plants at once.

A design and a spread come in; rms values, stability and M_s of every case go out as an
xarray.Dataset (`frequency_sweep`) or as columns for given rows (`FrequencyEngine`).
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .dataset import ATTRIBUTE, case_of, coordinates_of, law_of, spread_of
    from .design_rows import SIGNS, DesignRows, SolvedRows, of_signs
    from .dual_loop import dual_figures
    from .frequency import FrequencyEngine, frequency_sweep
    from .metrics import METRICS
    from .numbers import at_rest, columns_of
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
