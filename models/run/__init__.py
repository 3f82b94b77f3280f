"""One run in time: its series, statistics, extremes and files.

Samples come in while a simulation runs (`Accumulator`); a `Run` goes out, with statistics of every
sample, extremes over seeds, and functions that write it to files.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .extremes import FEWEST_MAXIMA, ExtremeEstimate, extreme_over_seeds
    from .files import attributes, to_xarray, write_csv, write_netcdf, write_parquet
    from .metrics import Summary
    from .run import Event, Run, Timings
    from .statistics import Accumulator
    from .summary import ERROR, NamedQuantity
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
