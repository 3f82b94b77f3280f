"""Foundations that every room stands on: errors, files, signals, units, quadrature, intervals.

Arrays, numbers and texts go in and come out; nothing here knows of a vessel, a winch or a case.
"""

from typing import TYPE_CHECKING

from .lazy import lazy_face

if TYPE_CHECKING:
    from .arrays import BoolArray, ComplexArray, FloatArray, IndexArray
    from .checks import (
        InputError,
        PhysicsWarning,
        ReadOnlyArrays,
        SolverError,
        StillhookError,
        SynthesisError,
        ascending_fault,
        check_ascending,
        check_choice,
        check_finite,
        check_range,
        check_seed,
        digits_apart,
        how_to_install,
        range_text,
        read_only,
    )
    from .files import (
        GZIP,
        binary_name,
        cache_folder,
        check_file,
        file_stamp,
        keep_latest,
        read_bytes,
        read_text,
        reason,
        replace_atomically,
        stl_facets,
        write_text_atomically,
    )
    from .hdf5_check import check_hdf5
    from .intervals import (
        FallTime,
        Interval,
        Share,
        fall_time,
        mean_interval,
        pooled_interval,
        share,
    )
    from .metrics import (
        THREE_HOURS,
        SpectrumStatistics,
        attenuation,
        exceedance_probability,
        fractile_factor,
        most_probable_maximum,
        peak_factor,
        residual_text,
        spectrum_statistics,
        zero_crossing_period,
    )
    from .panels import FrequencyAxis, cut_panels, longest_panel
    from .progress import show_by_default, shows_progress, unshown
    from .quadrature import Quadrature, SpectralDensity, adaptive_nodes, spectral_nodes
    from .riccati import (
        balanced_truncation,
        solve_discrete_lyapunov,
        solve_discrete_riccati,
        solve_lyapunov,
        solve_riccati,
        truncation_of_roots,
    )
    from .signals import LONGEST_DELAY, White, pick, signal_delays, signal_names, signal_rates
    from .threads import one_thread
    from .units import KINDS, parse_quantity, read_quantity, units_of
    from .water import GRAVITY, SEA_WATER_DENSITY, wave_frequency, wave_number
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
