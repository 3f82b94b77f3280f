"""Verification of a winch's design: everything it claims, computed again by other code.

    design -> design plant, plant of twice the rope masses, distributed rope -> Verification

A design is made on a lumped rope with Pade models guarding its stability.  Here it has to stand
on the exact delay and on more rope than it was designed on: the winding number on the
distributed rope, eigenvalues on twice the masses, margins by root finding, variances by other
quadrature, by a Lyapunov equation and on the distributed rope.  Nothing of the loop, the limits,
the question, the search or the design is used.  `verify_tuning` does the same for
`synth.design.tune` on any linear plant.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from models.basics import ComplexArray, FloatArray, SolverError, one_thread
from models.hook import HookMotion
from models.plant import (
    MAX_MASSES,
    LinearPlant,
    PlantData,
    build_plant,
    fit_shaping_filter,
    fixed_top_modes,
    line_response_at,
)
from models.sensing import sensed_plant

from .claims import DesignClaims, GainClaims, StructureClaims, TuningClaims
from .demands import HOOK, PAYLOAD, VELOCITY, Demand, case_demands, limit_demand
from .integrals import integrate, panels
from .nyquist import CurveMargins
from .recheck import (
    PADE,
    TIGHT,
    closed_loop_marks,
    guarded,
    limit_check,
    loop_margins,
    margin_checks,
    pole_check,
    winding_check,
    winding_of_plant,
)
from .recompute import LawMatrices, Loop, Source, imaginary, lyapunov_variances, moments
from .tuning_check import verify_tuning
from .verification import Check, Verification, agreement, bounded, failure
from .winding import count_unstable, open_loop_poles

_UNDAMPED = 1e-5  # a rope damped less than this has modes without end on the axis
_DECAY = 1e-7  # slowest decay that counts as stable [1/s]: a time constant of four months
_RMS = 1e-6  # rms by another quadrature
_TIME = 1e-3  # rms by a Lyapunov equation, with a Pade model for the delay
_ROPE = 0.02  # what the distributed rope may differ by from the lumped one
_MODAL_MASSES = 20  # of the rope on which a one-spring design is looked at for information
_HELD_RMS = 1e-8  # of the integrals with the drum held
_HELD_MODES = 40  # of the rope with the drum held
_ROPE_PER_DECADE = 200  # first points of the contour on a rope with modes that no mark tells of


@one_thread()
def verify_design(design: GainClaims) -> Verification:
    """Check the gains of a winch by code that the optimiser did not use.

    Parameters
    ----------
    design
        The design, with its claims.

    Returns
    -------
    Verification
        `ok` only if the loop is stable on every model and every claim was met.
    """
    loop = _WinchLoop(design)
    checks = guarded("stability", loop.stability)
    if not all(check.ok for check in checks):
        return Verification.of(checks, "")
    checks += guarded("margins", loop.margins)
    checks += guarded("limits", loop.limits)
    checks += guarded("payload_rms", loop.spectral)
    checks += guarded("payload_rms.time", loop.time_domain)
    checks += guarded("rope", loop.on_the_rope)
    checks += guarded("before", loop.before)
    checks += guarded("rope modes", loop.rope_modes)
    praise = (
        f"verified on {loop.yardstick_name}: stable with the exact delay, "
        f"{sum(check.counts for check in checks)} checks passed"
    )
    return Verification.of(checks, praise)


@one_thread()
def verify_structure(design: StructureClaims) -> Verification:
    """Check a structure's design by code that the optimiser did not use.

    Parameters
    ----------
    design
        The design, with its claims.

    Returns
    -------
    Verification
        `ok` only if the loop is stable on its plant and on one of twice the rope masses, its
        sensitivity keeps its bound there too, and every claim was met.
    """
    tuning = design.tuning()
    first = verify_tuning(tuning)
    checks = list(first.checks)
    if not first.ok and all(check.name != "cost" for check in checks):
        return first  # not stable on its own plant
    modal = design.case.rope.lumping != "thesis"
    more = min(2 * design.masses, MAX_MASSES)
    if modal and more > design.masses:
        checks += guarded("rope", lambda: _on_more_rope(design, tuning, more))
    checks += guarded("claims", lambda: _parts_and_before(design))
    on = f"and on a rope of {more} masses" if modal else "on the one spring"
    counted = sum(check.counts for check in checks)
    return Verification.of(
        checks, f"verified: stable with the exact delays {on}, {counted} checks passed"
    )


@dataclass(frozen=True, eq=False)
class _WinchLoop:
    """A design on its plants."""

    design: GainClaims

    @cached_property
    def data(self) -> PlantData:
        return PlantData.from_case(self.design.case)

    @cached_property
    def hook(self) -> HookMotion:
        return HookMotion.from_case(self.design.sea_case, warn=False)  # they have been warned

    @cached_property
    def source(self) -> Source:
        return _source(self.hook)

    @cached_property
    def plant(self) -> LinearPlant:
        """The plant of the design."""
        return build_plant(self.data, self.design.masses).linearise(drag=self.design.drag)

    @property
    def more_masses(self) -> int:
        if self.data.lumping == "thesis":
            return self.design.masses  # the case says that the rope is a spring
        return min(2 * self.design.masses, MAX_MASSES)

    @cached_property
    def fine_plant(self) -> LinearPlant:
        """The plant of twice the masses."""
        return build_plant(self.data, self.more_masses).linearise(drag=self.design.drag)

    @property
    def distributed(self) -> bool:
        return self.data.lumping != "thesis" and self.data.damping_ratio >= _UNDAMPED

    @property
    def yardstick_name(self) -> str:
        if self.distributed:
            return "the distributed rope"
        if self.data.lumping == "thesis":
            return "the case's own one-spring rope"
        return f"a rope of {self.more_masses} masses (undamped, so its modes have no end)"

    @cached_property
    def law(self) -> LawMatrices:
        """The feedback u = -A (a P'' + a1 P' + a2 P)."""
        gains = self.design.gains
        row = [-gains["A"] * gains[name] for name in ("a", "a1", "a2")]
        return LawMatrices(
            A=np.zeros((0, 0)), B=np.zeros((0, 3)), C=np.zeros((1, 0)), D=np.array([row])
        )

    @cached_property
    def loop(self) -> Loop:
        """The loop on the design's plant."""
        marks = closed_loop_marks(self.plant, self.law)
        return Loop(plant=self.plant.response_at, law=self.law, marks=marks)

    @cached_property
    def fine_loop(self) -> Loop:
        """The loop on the distributed rope, or on the best there is in its place."""
        marks = closed_loop_marks(self.fine_plant, self.law)
        if not self.distributed:
            return Loop(plant=self.fine_plant.response_at, law=self.law, marks=marks)
        return Loop(
            plant=lambda s: line_response_at(self.data, s, drag=self.design.drag),
            law=self.law,
            marks=marks,
        )

    @cached_property
    def curve_margins(self) -> CurveMargins:
        """Margins on the design's plant."""
        return loop_margins(self.loop)

    @cached_property
    def demands(self) -> dict[str, Demand]:
        return case_demands(self.design.case, self.data, self.plant, self.design.masses)

    @cached_property
    def coarse_moments(self) -> dict[str, tuple[float, ...]]:
        """Return m0 and m2 on the design's plant of everything that a claim is about."""
        return self._moments(self.loop)

    def _moments(self, loop: Loop) -> dict[str, tuple[float, ...]]:
        drive = [name for demand in self.demands.values() for name in demand.orders]
        return moments(loop, sorted({PAYLOAD, VELOCITY, *drive}), [self.source])

    def stability(self) -> list[Check]:
        if self.distributed:
            # The rope is damped, so its open loop has no pole right of the axis; the lumped
            # one has the same integrators, and would show an unstable drive.
            poles = open_loop_poles(self.fine_plant.A)
            winding = count_unstable(
                self.fine_loop.difference,
                poles=poles[(np.abs(poles) == 0.0) | (poles.real > 0.0)],
                marks=self.fine_loop.marks,
                per_decade=_ROPE_PER_DECADE,
            )
        else:
            winding = winding_of_plant(self.fine_plant, self.law, self.fine_loop.marks)
        spring = self.data.lumping == "thesis"
        coarse, fine = (
            "the one spring" if spring else f"a rope of {masses} masses"
            for masses in (self.design.masses, self.more_masses)
        )
        return [
            winding_check(winding, self.yardstick_name),
            pole_check("poles", self.fine_plant, self.law, fine, _DECAY),
            pole_check("poles.design", self.plant, self.law, coarse, _DECAY),
        ]

    def margins(self) -> list[Check]:
        return margin_checks(self.design.margins, self.curve_margins)

    def limits(self) -> list[Check]:
        """Return a check of each limit that the case states, and of strangers."""
        claims = self.design.limits
        checks = []
        for name, demand in self.demands.items():
            if name not in claims:
                checks.append(failure(f"limits.{name}", "the case states it, the design does not"))
                continue
            use = claims[name]
            value = demand.measured(self.loop, self.curve_margins, self.coarse_moments)
            check = limit_check(demand, use.value, value)
            note = ""
            if not math.isclose(use.bound, demand.bound, rel_tol=1e-9):
                note = f"the bound is {use.bound:.6g} but the case says {demand.bound:.6g}"
            elif use.enforced != demand.enforced:
                note = "the case says otherwise whether it is enforced"
            elif self.design.ok and demand.enforced and not demand.kept(value, TIGHT):
                note = f"the design counts as good but breaks the bound {demand.bound:.6g}"
            checks.append(replace(check, ok=False, note=note) if note else check)
        for name in sorted(set(claims) - set(self.demands)):
            checks.append(failure(f"limits.{name}", "the case has no such limit"))
        return checks

    def spectral(self) -> list[Check]:
        rms = math.sqrt(self.coarse_moments[PAYLOAD][0])
        fixed = self.design.case.payload.fixed_drag
        drag, note = fixed, "[N s/m], given"
        if drag is None:
            sigma = math.sqrt(self.coarse_moments[VELOCITY][0])
            drag = self.data.quadratic_drag * math.sqrt(8.0 / math.pi) * sigma
            note = "[N s/m], q sqrt(8/pi) sigma of the payload's velocity"
        return [
            agreement("payload_rms", self.design.payload_rms, rms, _RMS, "[m] by quad_vec"),
            agreement("drag", self.design.drag, drag, TIGHT, note),
        ]

    def time_domain(self) -> list[Check]:
        """Return the check by a Lyapunov equation with a fitted sea.

        Spectral integral and Lyapunov equation see the same fitted sea, so their difference is
        that of frequency and time domain, not that of the fit.
        """
        filtered = fit_shaping_filter(self.hook.density, self.hook.band)
        rational = self.plant.without_delays(PADE)
        by_time = lyapunov_variances(rational, self.law, {HOOK: filtered})[PAYLOAD]
        source = Source(name=HOOK, density=filtered.density, band=None)
        loop = replace(self.loop, marks=np.concatenate([self.loop.marks, filtered.poles]))
        by_frequency = moments(loop, [PAYLOAD], [source], orders=(0,), rtol=1e-6)[PAYLOAD][0]
        fit = math.sqrt(by_frequency) / self.design.payload_rms - 1.0
        note = (
            f"[m] Lyapunov equation against spectral integral, the sea as a filter of order "
            f"{filtered.order} that fits to {100.0 * filtered.shape_error:.1f} % (L1), "
            f"{100.0 * filtered.variance_error:+.2f} % in the hook's variance and "
            f"{100.0 * fit:+.2f} % in the payload's rms"
        )
        pair = math.sqrt(by_frequency), math.sqrt(max(by_time, 0.0))
        return [agreement("payload_rms.time", *pair, _TIME, note)]

    def on_the_rope(self) -> list[Check]:
        """Return the checks of rms and enforced limits on the rope as it is."""
        if self.data.lumping == "thesis":
            return []  # the one spring is all the rope there is
        found, margins = self._moments(self.fine_loop), loop_margins(self.fine_loop)
        on = f"on {self.yardstick_name}"
        rms = math.sqrt(found[PAYLOAD][0])
        checks = [agreement("payload_rms.rope", self.design.payload_rms, rms, _ROPE, f"[m] {on}")]
        for name, demand in self.demands.items():
            use = self.design.limits.get(name)
            if use is None or not demand.enforced:
                continue
            value = demand.measured(self.fine_loop, margins, found)
            # What the lumped rope keeps may not be broken here; what it breaks, not much more.
            bound = (min if demand.at_least else max)(demand.bound, use.value)
            checks.append(
                bounded(f"rope.{name}", bound, value, _ROPE, on, at_least=demand.at_least)
            )
        return checks

    def before(self) -> list[Check]:
        """Return the checks of what the design compares itself with."""
        held = HeldDrum(data=self.data, source=self.source)
        drag = self.design.drag_before
        m0, m2 = held.moments(drag)
        needed = self.design.case.payload.fixed_drag
        if needed is None:
            needed = self.data.quadratic_drag * math.sqrt(8.0 / math.pi * m2)
        return [
            *_uncompensated(self.design, held, math.sqrt(m0)),
            agreement("drag_before", drag, needed, TIGHT, "[N s/m]"),
        ]

    def rope_modes(self) -> list[Check]:
        """Return what a one-spring design does on a rope with its axial modes."""
        if self.data.lumping != "thesis" or self.data.mass_per_length == 0.0:
            return []
        data = replace(self.data, lumping="distributed", masses=None)
        plant = build_plant(data, _MODAL_MASSES).linearise(drag=self.design.drag)
        check = pole_check("rope modes", plant, self.law, f"a rope of {_MODAL_MASSES} masses", 0.0)
        note = check.note
        if not check.ok:
            note = (
                f"on a rope with its axial modes these gains are unstable (growth rate "
                f"{check.found:.3g} 1/s): all figures belong to the one-spring model of the case"
            )
        return [replace(check, note=note, counts=False)]


def _source(hook: HookMotion) -> Source:
    return Source(name=HOOK, density=hook.density, band=hook.band, splits=hook.splits)


def _uncompensated(design: DesignClaims, held: HeldDrum, before: float) -> list[Check]:
    """Return the checks of the hook's motion and of the payload's with the drum held."""
    hook, note = math.sqrt(held.hook_variance()), "[m] with the drum held"
    return [
        agreement("hook_rms", design.hook_rms, hook, _RMS, "[m]"),
        agreement("payload_rms_before", design.payload_rms_before, before, _RMS, note),
    ]


def _parts_and_before(design: StructureClaims) -> list[Check]:
    """Return the checks of what a structure's design says besides the answer itself."""
    fixed = design.case.payload.fixed_drag
    total = math.sqrt(sum(rms**2 for rms in design.parts.values()))
    hook = HookMotion.from_case(design.case, warn=False)
    held = HeldDrum(data=PlantData.from_case(design.case), source=_source(hook))
    checks = [
        agreement("parts", design.payload_rms, total, TIGHT, "[m], root of the sum of squares"),
        *_uncompensated(design, held, math.sqrt(held.moments(design.drag_before)[0])),
    ]
    if fixed is not None:
        checks.append(agreement("drag", design.drag, fixed, TIGHT, "[N s/m], given"))
    return checks


def _on_more_rope(design: StructureClaims, tuning: TuningClaims, masses: int) -> list[Check]:
    """Return the checks of stability, M_s and rms on other rope masses, drag as designed."""
    assert tuning.controller is not None
    plant = sensed_plant(design.case, masses=masses, drag=design.drag)
    plant = plant.select(measurements=design.measurements)
    law = LawMatrices.of(tuning.controller, plant)
    marks = closed_loop_marks(plant, law)
    on = f"a rope of {masses} masses"
    checks = [
        winding_check(winding_of_plant(plant, law, marks), on),
        pole_check("poles", plant, law, on, _DECAY),
    ]
    checks = [replace(check, name=f"rope.{check.name}") for check in checks]
    if not all(check.ok for check in checks):
        return checks
    loop = Loop(plant=plant.response_at, law=law, marks=marks)
    for limit in tuning.problem.limits:
        if limit_demand(limit).kind == "max_sensitivity":
            found = loop_margins(loop).max_sensitivity
            bound = max(limit.bound, design.limits[limit.name].value)
            checks.append(bounded(f"rope.{limit.name}", bound, found, _ROPE, f"on {on}"))
    sources, delay = tuning.problem.disturbances, max(plant.delays, default=0.0)
    variance = moments(loop, [PAYLOAD], sources, orders=(0,), delay=delay)[PAYLOAD][0]
    rms = agreement(
        "rope.payload_rms", design.payload_rms, math.sqrt(variance), _ROPE, f"[m] on {on}"
    )
    return [*checks, rms]


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldDrum:
    """Rope and payload with the drum held.

    Attributes
    ----------
    data
        The plant's numbers.
    source
        The hook's motion.
    """

    data: PlantData
    source: Source

    def hook_variance(self) -> float:
        """Return the variance of the hook's motion [m^2]."""
        return float(self._integral(np.ones_like, np.zeros(0, dtype=np.complex128))[0])

    def moments(self, drag: float) -> tuple[float, float]:
        """Return m0 [m^2] and m2 [m^2/s^2] of the payload's motion for a drag C [N s/m]."""

        def gain(omega: FloatArray) -> FloatArray:
            return np.asarray(np.abs(self.transfer(imaginary(omega), drag)) ** 2)

        m0, m2 = self._integral(gain, self._poles(drag))
        return float(m0), float(m2)

    def transfer(self, s: ComplexArray, drag: float) -> ComplexArray:
        """Return P/Z, (k,): 1/(cosh gamma + D l sinh(gamma)/gamma), or that of one spring."""
        data = self.data
        stretch = 1.0 + s * data.damping_time
        if data.lumping == "thesis" or data.mass_per_length == 0.0:
            spring = data.stiffness * stretch
            return np.asarray(spring / (self._mass * s**2 + drag * s + spring))
        load = (data.payload_mass * s**2 + drag * s) / (data.stiffness * stretch)
        speed = math.sqrt(data.axial_stiffness / data.mass_per_length)
        gamma = s * data.rope_length / (speed * np.sqrt(stretch))
        return np.asarray(1.0 / (np.cosh(gamma) + load * np.sinh(gamma) / gamma))

    @property
    def _mass(self) -> float:
        """Moving mass of the one-spring model [kg]."""
        rope = self.data.rope_mass if self.data.lumping == "thesis" else 0.0
        return self.data.payload_mass + rope

    def _poles(self, drag: float) -> ComplexArray:
        """Return about where the poles are [1/s], the upper half."""
        data = self.data
        if data.lumping == "thesis" or data.mass_per_length == 0.0:
            modes = np.array([math.sqrt(data.stiffness / self._mass)])
        else:
            rope = (data.axial_stiffness, data.rope_length, data.mass_per_length)
            modes = fixed_top_modes(*rope, data.payload_mass, _HELD_MODES)
        # The payload hardly moves in the higher modes, so drag only damps the first.
        decay = 0.5 * data.damping_time * modes**2
        decay[0] += 0.5 * drag / self._mass
        return np.asarray(-decay + 1j * modes, dtype=np.complex128)

    def _integral(
        self, gain: Callable[[FloatArray], FloatArray], poles: ComplexArray
    ) -> FloatArray:
        """Return the integrals of gain (k,) times the hook's density, and times omega^2."""
        if self.source.band is None:
            raise SolverError("verification: the hook's motion has no band")
        low, high = self.source.band

        def density(omega: FloatArray) -> FloatArray:
            spectrum = gain(omega) * self.source.density(omega)
            return np.stack([spectrum, omega**2 * spectrum])

        return integrate(density, panels(low, high, self.source.splits, poles), rtol=_HELD_RMS)
