"""One run in time: its series, statistics, extremes and files.

Samples come in while a simulation runs (`Accumulator`); a `Run` goes out, with statistics of every
sample, extremes over seeds, and functions that write it to files.
"""

from typing import TYPE_CHECKING

from ..basics.lazy import lazy_face

if TYPE_CHECKING:
    from .extremes import FEWEST_MAXIMA as FEWEST_MAXIMA
    from .extremes import ExtremeEstimate as ExtremeEstimate
    from .extremes import extreme_over_seeds as extreme_over_seeds
    from .files import attributes as attributes
    from .files import to_xarray as to_xarray
    from .files import write_csv as write_csv
    from .files import write_netcdf as write_netcdf
    from .files import write_parquet as write_parquet
    from .metrics import Summary as Summary
    from .run import Event as Event
    from .run import Run as Run
    from .run import Timings as Timings
    from .statistics import Accumulator as Accumulator
    from .summary import ERROR as ERROR
    from .summary import NamedQuantity as NamedQuantity
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
