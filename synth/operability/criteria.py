"""Criteria of an operation: limits of drive and rope, and how still the load must be.

A `Criterion` is a limit of `synth.limits.signal_limits` that can be looked at in many sea states at
once: variances come as arrays, one entry for each sea state, and so does the verdict.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from models.basics import BoolArray, FloatArray, InputError, check_range, parse_quantity
from models.case import Case
from models.plant import LinearPlant

from ..limits import PAYLOAD, Continuous, Limit, Minimum, Peak, Rms, drive_limits

_BROKEN = 10.0  # excess of what is broken beyond measure


@dataclass(frozen=True, kw_only=True, eq=False)
class SeaMoments:
    """Variances m0 and second moments m2 of outputs in r sea states, each (r,)."""

    m0: Mapping[str, FloatArray]
    m2: Mapping[str, FloatArray]

    def sigma(self, output: str) -> FloatArray:
        """Return the standard deviation of an output (r,)."""
        return np.asarray(np.sqrt(self.m0[output]))

    def peak(self, output: str, duration: float) -> FloatArray:
        """Return the most probable maximum in `duration` [s] without the mean (r,).

        As `models.basics.metrics.peak_factor`, sigma sqrt(2 ln(T/T_z)), held at one sigma.
        """
        m0, m2 = self.m0[output], self.m2[output]
        still = (m0 <= 0.0) | (m2 <= 0.0)
        crossings = duration / (2.0 * math.pi) * np.sqrt(m2 / np.where(still, 1.0, m0))
        k = np.sqrt(np.maximum(2.0 * np.log(np.where(still, 1.0, crossings)), 1.0))
        return np.asarray(k * np.sqrt(m0), dtype=np.float64)


@dataclass(frozen=True, kw_only=True)
class Criterion:
    """One limit of an operation.

    Attributes
    ----------
    name
        As reports and data sets call it.
    limit
        The limit; None for stability, which is kept or not.
    shown
        Factor from the limit's own value to the one that people ask for: 4 from an rms to a
        significant double amplitude.
    """

    name: str
    limit: Limit | None
    shown: float = 1.0

    @property
    def bound(self) -> float:
        """The bound as it was asked for [`unit`]."""
        return self.shown * self.limit.bound if self.limit is not None else math.nan

    @property
    def unit(self) -> str:
        """Unit of the bound."""
        return self.limit.unit if self.limit is not None else ""

    @property
    def outputs(self) -> tuple[str, ...]:
        """The signals whose variances it needs."""
        return self.limit.outputs if self.limit is not None else ()

    def value(self, moments: SeaMoments) -> FloatArray:
        """Return what is compared with the bound, in its unit (r,)."""
        if self.limit is None:
            raise InputError("operability: stability has no value")
        return self.shown * _measure(self.limit, moments)

    def excess(self, moments: SeaMoments, stationary: BoolArray) -> FloatArray:
        """Return by how much the limit is broken, relative; at most 0 where it is kept (r,).

        Parameters
        ----------
        moments
            Of the outputs.
        stationary
            Where there is a stationary motion at all (r,).
        """
        if self.limit is None:
            return np.where(stationary, -1.0, 1.0)
        value = _measure(self.limit, moments)
        if isinstance(self.limit, Minimum):
            raw = (self.limit.bound - value) / abs(self.limit.static)
        else:
            raw = value / self.limit.bound - 1.0
        # Finite, as a root finder takes differences of it.
        kept = stationary & np.isfinite(raw)
        return np.where(kept, np.minimum(raw, _BROKEN), _BROKEN)


STABILITY = Criterion(name="stability", limit=None)


def payload_criteria(
    case: Case,
    *,
    rms: float | str | None = None,
    significant: float | str | None = None,
    maximum: float | str | None = None,
    speed: float | str | None = None,
) -> tuple[Criterion, ...]:
    """Return how still the payload must be held, as criteria.

    Parameters
    ----------
    case
        The case, for its exposure time.
    rms, significant, maximum
        Largest standard deviation, significant double amplitude (4 sigma) and most probable
        maximum amplitude of the payload's motion in the case's exposure time: in metres, or text
        with a unit.
    speed
        Largest most probable maximum of the payload's velocity, in m/s or text with a unit.

    Raises
    ------
    InputError
        If a value is not above zero, or has another unit.
    """
    time = case.limits.exposure_time

    def read(name: str, value: float | str, kind: str, unit: str) -> float:
        try:
            number = parse_quantity(value, kind)
        except (ValueError, TypeError) as error:
            raise InputError(f"operability: {name}: {error}") from None
        return check_range("operability", name, number, low=0.0, unit=unit, open_low=True)

    found: list[Criterion] = []
    for end, value, shown in (("rms", rms, 1.0), ("significant", significant, 4.0)):
        if value is not None:
            bound = read(f"payload_{end}", value, "length", "m") / shown
            limit = Rms(bound=bound, output=PAYLOAD, unit="m", name=f"payload.{end}")
            found.append(Criterion(name=limit.name, limit=limit, shown=shown))
    for end, value, output, kind, unit in (
        ("max", maximum, PAYLOAD, "length", "m"),
        ("speed", speed, "payload.velocity", "speed", "m/s"),
    ):
        if value is not None:
            bound, name = read(f"payload_{end}", value, kind, unit), f"payload.{end}"
            peak = Peak(bound=bound, output=output, duration=time, unit=unit, name=name)
            found.append(Criterion(name=name, limit=peak))
    return tuple(found)


def case_criteria(case: Case, plant: LinearPlant) -> tuple[Criterion, ...]:
    """Return the limits of motor, drive and rope of a case, whether it enforces them or not.

    A rope without a stated least tension must not go slack at the drum: its bound is zero.

    Parameters
    ----------
    case
        The case.
    plant
        Its plant, for the static values.
    """
    # A load at rest that breaks a limit is no error here: the limiting H_s is then zero.
    limits = list(drive_limits(case.variant({"limits.drive": "report"}), plant))
    if not any(isinstance(limit, Minimum) for limit in limits):
        limits.append(
            Minimum(
                bound=0.0,
                output="rope.tension",
                static=plant.static["rope.tension"],
                duration=case.limits.exposure_time,
                unit="N",
            )
        )
    return tuple(Criterion(name=limit.name, limit=limit) for limit in limits)


def outputs_of(criteria: Sequence[Criterion]) -> tuple[str, ...]:
    """Return the signals that criteria need, each once."""
    return tuple(dict.fromkeys(output for c in criteria for output in c.outputs))


def _measure(limit: Limit, moments: SeaMoments) -> FloatArray:
    if isinstance(limit, Continuous):  # its own measure is for one sea state
        return np.asarray(np.hypot(limit.static, moments.sigma(limit.output)))
    # All that the limit asks of the loop is `sigma` and `peak`.
    return np.asarray(limit.measure(moments))  # type: ignore[arg-type]
