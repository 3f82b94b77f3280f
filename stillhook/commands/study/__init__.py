"""Commands that study a design: sweeps, sensitivity, operability, comparison."""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .compare_arguments import add_compare_arguments as add_compare_arguments
    from .operability_arguments import add_operability_arguments as add_operability_arguments
    from .sensitivity_arguments import add_sensitivity_arguments as add_sensitivity_arguments
    from .sweep_arguments import add_sweep_arguments as add_sweep_arguments
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
