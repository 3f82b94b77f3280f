"""Predictive control: a winch that acts on what is about to happen, within its motor's limits.

    sensors --> estimator, forecast of the hook's motion --> quadratic programme --> drive command

`LinearMPC` is a controller for the simulator and for a drive; `clairvoyant` is what nobody could do
better on a record.  `Programme`, `KalmanFilter` and `PredictiveController` take any linear plant.
The package builds on `models` alone.
"""

from typing import TYPE_CHECKING

from models.basics.lazy import lazy_face

if TYPE_CHECKING:
    from .programme import Constraint, KalmanFilter, Plan, PredictiveController, Programme
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
