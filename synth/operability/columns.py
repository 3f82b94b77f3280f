"""Seas of one peak period, in every heading and at any H_s: `SeaColumn`.

case, T_p, headings -> SeaColumn -> densities of all disturbances on nodes, at given H_s
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from models.basics import ComplexArray, FloatArray, InputError, Quadrature, adaptive_nodes
from models.case import Case
from models.hook import HookMotion

from ..loop import Disturbance, disturbances, integration_band
from ..question import HOOK
from .systems import System

_RTOL = 1e-8  # of every variance, as in `synth.loop.assess`
_SAME = 1e-9  # relative, of densities that scale with H_s^2
_HEIGHTS = (0.25, 2.0, 5.0, 14.0)  # at which that is looked at [m]
_FLOOR = 1e-3  # lowest H_s that is looked at [m], and how well the lowest that is defined is known
_SPEEDS = (1e-3, 3e-2, 1.0)  # rms speeds of the payload whose drag the nodes are made for [m/s]


@dataclass(frozen=True, kw_only=True, eq=False)
class SeaColumn:
    """Seas of one peak period."""

    period: float  #: T_p [s].
    headings: tuple[float, ...] | None  #: Headings (h,) [rad], or None where the case knows none.
    cases: tuple[Case, ...]  #: The case in each heading (h,), at its own H_s.
    hooks: tuple[HookMotion, ...]  #: The hook's motion in each (h,).
    scalable: bool  #: Whether the shape of the spectrum stays the same at another H_s.

    def hook(self, index: int, height: float) -> HookMotion:
        """Return the hook's motion in one heading at a significant height [m]."""
        if self.scalable:
            return self.hooks[index].scaled(height)
        return HookMotion.from_case(self.cases[index].replace({"sea.significant_height": height}))

    @cached_property
    def floor(self) -> float:
        """Lowest H_s at which the spectrum is defined [m]: torsethaugen's is not in a flat sea.

        Below it the shape is kept.
        """
        high = self.cases[0].sea.significant_height
        if self.scalable or self._defined(_FLOOR):
            return 0.0
        low = _FLOOR
        while high / low > 1.0 + _FLOOR:
            middle = float(np.sqrt(low * high))
            low, high = (low, middle) if self._defined(middle) else (middle, high)
        return high

    def _defined(self, height: float) -> bool:
        try:
            self.hook(0, height)
        except InputError:
            return False
        return True

    @cached_property
    def sources(self) -> tuple[Disturbance, ...]:
        """The hook's motion in every heading, as disturbances."""
        found: list[Disturbance] = []
        for hook in self.hooks:
            found += disturbances({HOOK: hook}, (HOOK,))
        return tuple(found)

    def nodes(self, system: System) -> Quadrature:
        """Return nodes on which every variance of a system is accurate, for any H_s and drag.

        As `synth.loop.assess.Assessment.quadrature`, for three drag coefficients from that of a
        payload that hardly moves to that of one that moves at metres per second.
        """
        coefficients = self._coefficients(system)
        poles = np.concatenate([_off_axis(system.poles(c)) for c in coefficients])
        low, high, half_line = integration_band([*self.sources, *system.noises], poles)
        splits = {w for s in (*self.sources, *system.noises) for w in s.splits}
        # Each heading counts alike, however little the hook moves in it.
        rms = np.array([hook.displacement.rms for hook in self.hooks])
        scale = np.where(rms > 0.0, 1.0 / np.where(rms > 0.0, rms, 1.0) ** 2, 0.0)

        def integrands(omega: FloatArray) -> FloatArray:
            weights = np.ones_like(omega)
            base = system.responses(Quadrature(omega=omega, weights=weights))
            heave = scale @ np.array([source.density(omega) for source in self.sources])
            shaken = np.array([heave, *(noise.density(omega) for noise in system.noises)])
            rows = [heave[None]]
            for c in coefficients:
                # Losses of usual size: they move no pole far.
                slack = [] if system.loss is None else [system.loss.begin]
                rows.append((base.gains([c, *slack]) * shaken).reshape(-1, omega.size))
            return np.concatenate(rows)

        return adaptive_nodes(
            integrands,
            low,
            high,
            splits=sorted(splits),
            poles=[complex(p) for p in poles],
            rtol=_RTOL,
            half_line=half_line,
        )

    def _coefficients(self, system: System) -> list[float]:
        if system.slope == 0.0:
            return [system.reference]
        low, high = system.stable_range
        wanted = [system.slope * speed for speed in _SPEEDS]
        # A loop on the very edge of stability has a variance without end.
        return sorted({min(max(c, 1.05 * low), 0.95 * high) for c in wanted})


def sea_column(
    case: Case, period: float | None, headings: Sequence[float] | None = None
) -> SeaColumn:
    """Return the seas of one peak period T_p [s], or the case's own; the spectrum keeps its shape.

    Headings [rad] are for a vessel that has them.

    Raises InputError if the sea of the case has no period that could be changed, or the vessel no
    headings.
    """
    # Of seas that nobody has asked for: a contour goes up to where waves break and beyond.
    changed = case.variant({} if period is None else case.sea.peaking_at(period))
    cases = [changed]
    if headings is not None:
        if not has_headings(case):
            raise InputError(
                f"{case.label}: vessel: has no headings, as it is given by the "
                "heave of its hook alone; give raos for a contour over heading"
            )
        cases = [changed.replace({"vessel.heading": float(b)}) for b in headings]
    hooks = [HookMotion.from_case(c) for c in cases]
    return SeaColumn(
        period=period if period is not None else case.sea.spectral_peak_period,
        headings=None if headings is None else tuple(float(b) for b in headings),
        cases=tuple(cases),
        hooks=tuple(hooks),
        scalable=_scales(cases[0], hooks[0]),
    )


def has_headings(case: Case) -> bool:
    """Return whether the vessel of a case is known in more than one heading."""
    return getattr(case.vessel, "raos", None) is not None


def has_period(case: Case) -> bool:
    """Return whether the sea of a case has a period that can be changed."""
    return bool(case.sea.period_field)


def _scales(case: Case, hook: HookMotion) -> bool:
    """Return whether the hook's density grows as H_s^2, as far as some sea states tell."""
    omega = np.linspace(0.5, 3.0, 11) * hook.sea.peak_frequency
    try:
        # Far apart, as a shape may follow the height in steep seas only (`gamma: auto`).
        for height in _HEIGHTS:
            scaled = hook.scaled(height).density(omega)
            rebuilt = HookMotion.from_case(
                case.replace({"sea.significant_height": height})
            ).density(omega)
            if not np.allclose(scaled, rebuilt, rtol=_SAME, atol=0.0):
                return False
    except InputError:
        return False
    return True


def _off_axis(poles: ComplexArray) -> ComplexArray:
    keep = (np.abs(poles.real) > 1e-12 * np.maximum(1.0, np.abs(poles))) & (poles.imag >= 0.0)
    return np.asarray(poles[keep])
