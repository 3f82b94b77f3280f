"""Predictive control of any linear plant, sample by sample: `PredictiveController`.

    signals --> KalmanFilter --> state, constants --> Programme --> first inputs

It is a controller as any other, but for its signals, which are those of its plant.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from models.basics import InputError
from models.sensing import HEARD, Measurement

from .filter import KalmanFilter
from .programme import Plan, Programme

_OWNER = "predictive controller"
_BLIND = 1.0  # without any signal [s]


class PredictiveController:
    """A programme and a filter, with the `step` of `models.sensing.Controller`.

    Where the programme has no answer (a hard limit on an output that cannot be kept, or no time
    left) it gives what it would give without limits, within those of the inputs; or the command of
    a `fallback` of the same sample time, which hears all samples.

    Parameters
    ----------
    programme, kalman
        Both of the same plant and period.  Constants of the filter are taken to last.
    name
        What it is called.
    fallback
        Who commands where the programme has no answer.

    Attributes
    ----------
    plan
        The last plan; None before the first.
    status
        What the last step was, of `models.sensing.STATUSES`.

    Raises
    ------
    InputError
        If programme, filter and fallback do not fit each other.
    """

    def __init__(
        self,
        programme: Programme,
        kalman: KalmanFilter,
        *,
        name: str = "predictive",
        fallback: Any = None,
    ) -> None:
        ours, theirs = programme.plant, kalman.plant
        for what in ("states", "inputs", "disturbances"):
            if getattr(ours, what) != getattr(theirs, what):
                raise InputError(
                    f"{_OWNER}: programme and filter must have the same {what}, got "
                    f"{', '.join(getattr(ours, what))} and {', '.join(getattr(theirs, what))}"
                )
        periods = {"filter": kalman.period}
        if fallback is not None:
            periods["fallback"] = fallback.sample_time
        for who, period in periods.items():
            if not math.isclose(period, programme.period):
                raise InputError(
                    f"{_OWNER}: {who} must have the sample time {programme.period:g} s, got "
                    f"{period:g} s"
                )
        self.programme, self.kalman, self.name = programme, kalman, name
        self.sample_time, self._fallback = programme.period, fallback
        self.reset()

    def reset(self) -> None:
        """Forget every earlier signal."""
        self.kalman.reset()
        self.programme.qp.reset()
        if self._fallback is not None:
            self._fallback.reset()
        p = self.programme
        self.plan: Plan | None = None
        self._inputs = {name: p.rest.get(name, 0.0) for name in p.inputs}
        self._told: dict[str, npt.ArrayLike] = {}
        self.status = "engaged"

    def step(self, signals: Mapping[str, Any] | Measurement, time: float) -> Any:
        """Return the command: a number, or an array (nu,) for a plant of several inputs.

        Parameters
        ----------
        signals
            By name: the measurements, of which those that are absent or not finite were not heard;
            disturbances and each ``reference of`` an output or input, as numbers or with what is to
            come (`Programme.solve`), which stay as they were last told; inputs, where something
            else has acted over the last sample than was commanded.  Others are not looked at.
        time
            Time [s].
        """
        if isinstance(signals, Measurement):
            shown: Mapping[str, Any] = dict(zip(HEARD, signals.values.tolist(), strict=True))
        else:
            shown = signals
        p, plant = self.programme, self.kalman.plant
        for name in p.inputs:
            applied = shown.get(name, math.nan)
            if math.isfinite(float(applied)):
                self._inputs[name] = float(applied)
        for name in (*p.disturbances, *(f"reference of {name}" for name in p.references)):
            value = np.asarray(shown.get(name, math.nan), dtype=np.float64)
            if value.size and np.isfinite(value).all():
                self._told[name] = value
        known = {name: self._told[name] for name in p.disturbances if name in self._told}
        state = self.kalman.step(
            {name: float(shown[name]) for name in plant.measurements if name in shown},
            self._inputs,
            {name: float(np.ravel(value)[0]) for name, value in known.items()},
        )
        offsets = {}
        for name, more in self.kalman.constants.items():
            if name in p.inputs:
                offsets[name] = more
            else:
                known[name] = np.asarray(known.get(name, p.rest.get(name, 0.0))) + more
        plan = self.plan = p.solve(
            state,
            previous=self._inputs,
            references={
                name: self._told[told]
                for name in p.references
                if (told := f"reference of {name}") in self._told
            },
            disturbances=known,
            offsets=offsets,
        )
        other = math.nan if self._fallback is None else self._fallback.step(signals, time)
        count = len(p.inputs)
        moves = plan.solved.v[:count]
        self.status = "limited" if plan.solved.multipliers.any() else "engaged"
        if self.kalman.blind * self.sample_time > _BLIND:
            self.status = "blind"
        if not plan.ok:
            self.status = "fallback"
            moves = np.clip(p.law @ plan.question[0], p.low[:count], p.high[:count])
        command = np.array([p.rest.get(name, 0.0) for name in p.inputs]) + moves * p.horizon.units
        if not plan.ok and np.isfinite(other).all():
            command = np.ravel(other)
        self._inputs = dict(zip(p.inputs, command.tolist(), strict=True))
        return float(command[0]) if count == 1 else command
