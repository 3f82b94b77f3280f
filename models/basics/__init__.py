"""Foundations that every room stands on: errors, files, signals, units, quadrature, intervals.

Arrays, numbers and texts go in and come out; nothing here knows of a vessel, a winch or a case.
"""

from typing import TYPE_CHECKING

from .lazy import lazy_face

if TYPE_CHECKING:
    from .arrays import BoolArray as BoolArray
    from .arrays import ComplexArray as ComplexArray
    from .arrays import FloatArray as FloatArray
    from .arrays import IndexArray as IndexArray
    from .checks import InputError as InputError
    from .checks import PhysicsWarning as PhysicsWarning
    from .checks import SolverError as SolverError
    from .checks import StillhookError as StillhookError
    from .checks import SynthesisError as SynthesisError
    from .checks import ascending_fault as ascending_fault
    from .checks import check_ascending as check_ascending
    from .checks import check_finite as check_finite
    from .checks import check_range as check_range
    from .checks import check_seed as check_seed
    from .checks import range_text as range_text
    from .checks import read_only as read_only
    from .files import GZIP as GZIP
    from .files import cache_folder as cache_folder
    from .files import read_bytes as read_bytes
    from .files import read_text as read_text
    from .files import reason as reason
    from .files import replace_atomically as replace_atomically
    from .files import write_text_atomically as write_text_atomically
    from .hdf5_check import check_hdf5 as check_hdf5
    from .intervals import FallTime as FallTime
    from .intervals import Interval as Interval
    from .intervals import Share as Share
    from .intervals import fall_time as fall_time
    from .intervals import mean_interval as mean_interval
    from .intervals import share as share
    from .metrics import THREE_HOURS as THREE_HOURS
    from .metrics import SpectrumStatistics as SpectrumStatistics
    from .metrics import most_probable_maximum as most_probable_maximum
    from .metrics import peak_factor as peak_factor
    from .metrics import spectrum_statistics as spectrum_statistics
    from .metrics import zero_crossing_period as zero_crossing_period
    from .panels import FrequencyAxis as FrequencyAxis
    from .panels import cut_panels as cut_panels
    from .panels import longest_panel as longest_panel
    from .quadrature import Quadrature as Quadrature
    from .quadrature import SpectralDensity as SpectralDensity
    from .quadrature import adaptive_nodes as adaptive_nodes
    from .quadrature import spectral_nodes as spectral_nodes
    from .riccati import balanced_truncation as balanced_truncation
    from .riccati import solve_discrete_lyapunov as solve_discrete_lyapunov
    from .riccati import solve_discrete_riccati as solve_discrete_riccati
    from .riccati import solve_lyapunov as solve_lyapunov
    from .riccati import solve_riccati as solve_riccati
    from .signals import White as White
    from .signals import pick as pick
    from .signals import signal_delays as signal_delays
    from .signals import signal_names as signal_names
    from .signals import signal_rates as signal_rates
    from .threads import one_thread as one_thread
    from .units import KINDS as KINDS
    from .units import parse_quantity as parse_quantity
    from .units import read_quantity as read_quantity
    from .units import units_of as units_of
    from .water import GRAVITY as GRAVITY
    from .water import SEA_WATER_DENSITY as SEA_WATER_DENSITY
    from .water import wave_frequency as wave_frequency
    from .water import wave_number as wave_number
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
