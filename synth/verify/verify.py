"""Verification of a winch's design: everything it claims, computed again by other code.

    design -> design plant, plant of twice the rope masses, distributed rope -> Verification

A design is made on a lumped rope with Pade models guarding its stability.  Here it has to stand
on the exact delays and on more rope than it was designed on: the winding number on the
distributed rope, eigenvalues on twice the masses, margins by root finding, variances by other
quadrature, by a Lyapunov equation and on the distributed rope.  What its own rope masses do is
a closed form here where there is one, without states or modes, but for poles and that equation,
which take the plant's matrices.  Nothing of the loop, the limits,
the question, the search or the design is used.  `verify_tuning` does the same for
`synth.design.tune` on any linear plant.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np

from models.basics import ComplexArray, FloatArray, SolverError, one_thread
from models.hook import HookMotion
from models.plant import (
    MAX_MASSES,
    LinearPlant,
    PlantData,
    PlantResponse,
    fit_shaping_filter,
)
from models.sensing import (
    LOAD,
    SAMPLE_TIME,
    SwitchingNoise,
    UnitError,
    sensed_line_at,
    sensed_plant,
    sensed_spectra,
)

from .claims import DesignClaims
from .demands import PAYLOAD, VELOCITY, Demand, case_demands, switching_losses
from .integrals import integrate, panels
from .recheck import (
    TIGHT,
    CheckedLoop,
    closed_poles,
    looked_at,
    pade_order,
    pole_check,
    roots_near,
    winding_check,
    winding_of_plant,
)
from .recompute import HOOK, LawMatrices, Source, imaginary, lyapunov_variances, moments
from .verification import Check, Verification, agreement, bounded
from .winding import count_unstable

_GAINS = ("a", "a1", "a2")
_TORQUE, _SPEED, _DRAG = "motor.torque", "motor.speed", "payload.force"
_UNDAMPED = 1e-5  # a rope damped less than this has modes without end on the axis
_MARGINAL = 1e-9  # growth over the size of the fastest pole that is none
_DECAY = 1e-7  # slowest decay that counts as stable [1/s]: a time constant of four months
_RMS = 1e-6  # rms by another quadrature
_TIME = 1e-3  # rms by a Lyapunov equation, with a Pade model for the delay
_ROPE = 2e-3  # what the distributed rope may differ by from the lumped one of an accepted design
_BROKEN_ROPE = 0.02  # ... and of one that breaks a limit, whose loop may be nearly unstable
_MODAL_MASSES = 20  # of the rope on which a one-spring design is looked at for information
_SEA_ORDER = 4  # of the sea in the time domain: a rough fit will do, as both sides see it
_HELD_RMS = 1e-8  # of the integrals with the drum held
_HELD_MODES = 40  # of the rope with the drum held
_ROPE_PER_DECADE = 200  # first points of the contour on a rope with modes that no mark tells of


@one_thread()
def verify_design(design: DesignClaims) -> Verification:
    """Check the design of a winch by code that the optimiser did not use.

    The verification is `ok` only if the loop is stable on every model and every claim was met.
    """
    winch = _Winch(design)
    steps = {
        "stability": winch.stability,
        "calm": winch.in_a_calm,
        "parameters": winch.parameters,
        "margins": lambda: winch.coarse.margin_checks(design.margins),
        "limits": lambda: winch.coarse.limit_checks(design, by="case", on="design"),
        "payload_rms": winch.spectral,
        "shares": winch.shares,
        "payload_rms.time": winch.time_domain,
        "rope": winch.on_the_rope,
        "before": winch.before,
        "rope modes": winch.rope_modes,
    }
    return looked_at(steps, f" on {winch.yardstick_name}: stable with the exact delay")


@dataclass(frozen=True, eq=False)
class _Winch:
    """A design on its plants."""

    design: DesignClaims
    _loops: dict[tuple[int, bool], CheckedLoop] = field(default_factory=dict)

    @cached_property
    def data(self) -> PlantData:
        return PlantData.from_case(self.design.case)

    @cached_property
    def hook(self) -> HookMotion:
        return HookMotion.from_case(self.design.sea_case, warn=False)  # they have been warned

    @cached_property
    def source(self) -> Source:
        return Source(
            name=HOOK, density=self.hook.density, band=self.hook.band, splits=self.hook.splits
        )

    @cached_property
    def sources(self) -> list[Source]:
        """The sea, and the errors of the sensors that the controller hears."""
        heard = set(self.design.controller.measurements)
        found = [self.source]
        for name, spectrum in sensed_spectra(self.design.sea_case, self.hook).items():
            if isinstance(spectrum, SwitchingNoise):
                source = Source(name=name, density=spectrum.density, band=spectrum.band)
                found.append(source)
                continue
            unit = name == "mru.error" and "mru.heave" in heard
            if name == HOOK or not (unit or name.removesuffix("_noise") in heard):
                continue
            # Noise is that of samples, which carry it up to pi/T.
            density = getattr(spectrum, "density", spectrum)
            own = spectrum if isinstance(spectrum, UnitError) else None
            low = min(1e-5 / SAMPLE_TIME, own.lowest if own is not None else math.inf)
            source = Source(name=name, density=density, band=(low, math.pi / SAMPLE_TIME))
            found.append(source if own is None else replace(source, splits=own.splits))
        return found

    def _signed(self, loop: CheckedLoop) -> CheckedLoop:
        """Return a loop with what it is for each sign of the reference unit's errors."""
        unit, names = self.design.case.sensors.mru, [source.name for source in loop.sources]
        if unit is None or "mru.error" not in names or not (unit.gain_error or unit.phase_error):
            return loop
        without = unit.model_copy(update={"gain_error": 0.0, "phase_error": 0.0})
        rest = UnitError(unit=without, hook=self.hook)
        sources = [
            replace(one, density=rest) if one.name == "mru.error" else one for one in self.sources
        ]
        shown = [
            1.0 + complex(gain * unit.gain_error, phase * unit.phase_error)
            for gain in (1.0, -1.0)
            for phase in (1.0, -1.0)
        ]
        return replace(loop, rest=sources, signs=shown)

    @property
    def more_masses(self) -> int:
        if self.data.lumping == "thesis":
            return self.design.masses  # the case says that the rope is a spring
        return min(2 * self.design.masses, MAX_MASSES)

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

    def _lumped(self, masses: int, *, rubbing: bool) -> CheckedLoop:
        """Return the loop on some rope masses, with friction of losses that switch or without."""
        key, design = (masses, rubbing), self.design
        if key not in self._loops:
            if rubbing or not design.friction:
                drag, friction = design.drag, design.friction
                plant = sensed_plant(design.case, masses=masses, drag=drag, friction=friction)
                plant = plant.select(measurements=design.controller.measurements)
            else:
                plant = self._lumped(masses, rubbing=True).plant
                plant = plant.with_element(_SPEED, LOAD, design.friction)
            self._loops[key] = CheckedLoop.of(plant, design.controller, self.sources, {}, ())
        return self._loops[key]

    def _line(
        self, friction: float, masses: int, s: ComplexArray, disturbances: Sequence[str]
    ) -> PlantResponse:
        return sensed_line_at(
            self.design.case,
            s,
            drag=self.design.drag,
            friction=friction,
            data=self.data,
            measurements=self.design.controller.measurements,
            disturbances=disturbances,
            masses=masses,
        )

    @cached_property
    def coarse_plant(self) -> LinearPlant:
        """The design's plant."""
        return self._lumped(self.design.masses, rubbing=bool(self.design.friction)).plant

    def _loop(self, masses: int, own: Iterable[str], *, rope: bool) -> CheckedLoop:
        """Return the loop on some rope masses, or on the rope itself, without losses beside it."""
        found: CheckedLoop | None = None
        # A lumped rope is a closed form too, unless a tip is in series with its end alone.
        uniform = math.isinf(self.data.tip_stiffness) or self.data.damping_law == "hysteretic"
        waves = self.distributed and masses > 1 and uniform
        for friction in (0.0, self.design.friction) if self.design.friction else (0.0,):
            lumped = self._lumped(masses, rubbing=bool(friction))
            found = replace(lumped, demands=self.demands, own=own, still=found)
            if rope or waves:
                line = partial(self._line, friction, 0 if rope else masses)
                found = replace(found, exact=line)
            if rope:
                # A mode with hardly any damping is narrower than its place on masses is off by.
                begins = np.concatenate([found.marks, self.data.damped_modes(_HELD_MODES)])
                near = roots_near(partial(_near_pole, found), begins[begins.imag > 0.0])
                found = replace(found, marks=np.concatenate([found.marks, near]))
        assert found is not None
        return self._signed(found)

    @cached_property
    def coarse(self) -> CheckedLoop:
        """The loop on the design's plant."""
        own = {PAYLOAD, VELOCITY, _SPEED, *self.design.shares}
        return self._loop(self.design.masses, own, rope=False)

    @cached_property
    def fine(self) -> CheckedLoop:
        """The loop on the distributed rope, or on the best there is in its place."""
        return self._loop(self.more_masses, [PAYLOAD], rope=self.distributed)

    @cached_property
    def demands(self) -> dict[str, Demand]:
        design = self.design
        found = case_demands(design.case, self.data, self.coarse_plant, design.masses)
        # Who does not hear the payload cannot keep it from drifting with the ship.
        deaf = not any(name.startswith("payload.") for name in design.controller.measurements)
        return {
            name: replace(demand, enforced=False)
            if (deaf and demand.kind == "low_frequency") or (demand.drive and not design.drive_kept)
            else demand
            for name, demand in found.items()
        }

    def stability(self) -> list[Check]:
        found = self._stability(self.fine, self.coarse)
        if self.fine.still is not None and self.coarse.still is not None:
            still = self._stability(self.fine.still, self.coarse.still)
            found += [replace(one, name=f"{one.name} without losses") for one in still]
        return found

    def _stability(self, on_rope: CheckedLoop, own: CheckedLoop) -> list[Check]:
        plant = on_rope.plant
        if self.distributed:
            # The rope is damped, so its open loop has no pole right of the axis; the lumped
            # one has the same integrators, and would show an unstable drive.
            poles = on_rope.open_poles
            winding = count_unstable(
                on_rope.difference,
                poles=poles[(np.abs(poles) == 0.0) | (poles.real > 0.0)],
                marks=on_rope.marks,
                per_decade=_ROPE_PER_DECADE,
            )
        else:
            winding = winding_of_plant(plant, on_rope.law, on_rope.marks)
        spring = self.data.lumping == "thesis"
        coarse, fine = (
            "the one spring" if spring else f"a rope of {masses} masses"
            for masses in (self.design.masses, self.more_masses)
        )
        return [
            winding_check(winding, self.yardstick_name),
            pole_check("poles", plant, on_rope.closed_poles, fine, _DECAY),
            pole_check("poles.design", own.plant, own.closed_poles, coarse, _DECAY),
        ]

    def in_a_calm(self) -> list[Check]:
        """Return the check of the poles without drag, which in small motion there is none of."""
        if self.design.case.payload.fixed_drag is not None or self.data.quadratic_drag == 0.0:
            return []
        plant = self._lumped(self.more_masses, rubbing=False).plant
        plant = plant.with_element(VELOCITY, _DRAG, self.design.drag)
        fastest = float(np.abs(self.fine.marks).max())
        on = f"a rope of {self.more_masses} masses, without drag"
        check = pole_check(
            "poles.calm", plant, closed_poles(plant, self.fine.law), on, -_MARGINAL * fastest
        )
        # What is told to swing may do so.
        return [replace(check, counts=self.design.ok)]

    def parameters(self) -> list[Check]:
        """Return the check that the thesis's gains make the controller: u = -A (a P'' + ..)."""
        given = self.design.parameters
        if set(given) != {"A", *_GAINS}:
            return []
        wanted = np.array([-given["A"] * given[name] for name in _GAINS])
        law = LawMatrices.of(self.design.controller, self.coarse.plant)
        apart = float(np.abs(law.D[0] - wanted).max(initial=0.0)) if not law.A.size else math.inf
        size = float(np.abs(wanted).max())
        note = "largest entry of the feedback, and by how much it is another"
        return [agreement("parameters", size, size + apart, TIGHT, note)]

    def spectral(self) -> list[Check]:
        rms = self.coarse.rms(PAYLOAD)
        fixed = self.design.case.payload.fixed_drag
        drag, note = fixed, "[N s/m], given"
        if drag is None:
            drag = self.data.quadratic_drag * math.sqrt(8.0 / math.pi) * self.coarse.rms(VELOCITY)
            note = "[N s/m], q sqrt(8/pi) sigma of the payload's velocity"
        # The slope of least square error of a switch, tanh(omega) at its steepest.
        torque, checks = switching_losses(self.design.case).get(_TORQUE, 0.0), []
        if torque > 0.0 or self.design.friction != 0.0:
            found = torque / math.sqrt(1.0 + 0.5 * math.pi * self.coarse.rms(_SPEED) ** 2)
            slope = "[N m s/rad], sqrt(2/pi) Delta over sigma of the motor's speed"
            checks.append(agreement("friction", self.design.friction, found, TIGHT, slope))
        return [
            *checks,
            agreement("payload_rms", self.design.payload_rms, rms, _RMS, "[m] by other quadrature"),
            agreement("drag", self.design.drag, drag, TIGHT, note),
        ]

    def shares(self) -> list[Check]:
        """Return the checks that the shares of each signal are all there and add up."""
        checks, losses = [], switching_losses(self.design.case)
        for signal, parts in self.design.shares.items():
            claimed = math.sqrt(sum(rms**2 for rms in parts.values()))
            found = math.hypot(self.coarse.rms(signal), losses.get(signal, 0.0))
            note = f"root of the sum of squares of {', '.join(parts)}"
            checks.append(agreement(f"shares.{signal}", claimed, found, TIGHT, note))
        return checks

    def time_domain(self) -> list[Check]:
        """Return the check by a Lyapunov equation with a fitted sea.

        Spectral integral and Lyapunov equation see the same fitted sea, so their difference is
        that of frequency and time domain, not that of the fit.
        """
        plant, law = self.coarse.plant, self.coarse.law
        filtered = fit_shaping_filter(self.hook.density, self.hook.band, _SEA_ORDER)
        rational = plant.without_delays(pade_order(plant))
        by_time = lyapunov_variances(rational, law, {HOOK: filtered})[PAYLOAD]
        source = Source(name=HOOK, density=filtered.density, band=None)
        loop = replace(self.coarse, marks=np.concatenate([self.coarse.marks, filtered.poles]))
        by_frequency = moments(loop, [PAYLOAD], [source], orders=(0,), rtol=1e-6)[PAYLOAD][0]
        whole = moments(loop, [PAYLOAD], [self.source], orders=(0,), rtol=1e-6)[PAYLOAD][0]
        fit = math.sqrt(by_frequency / whole) - 1.0
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
        on, near = f"on {self.yardstick_name}", _ROPE if self.design.ok else _BROKEN_ROPE
        rms = self.fine.rms(PAYLOAD)
        checks = [agreement("payload_rms.rope", self.design.payload_rms, rms, near, f"[m] {on}")]
        for name, demand in self.demands.items():
            use = self.design.limits.get(name)
            if use is None or not demand.enforced:
                continue
            value = self.fine.measured(demand)
            # What the lumped rope keeps may not be broken here; what it breaks, not much more.
            bound = (min if demand.at_least else max)(demand.bound, use.value)
            checks.append(bounded(f"rope.{name}", bound, value, near, on, at_least=demand.at_least))
        return checks

    def before(self) -> list[Check]:
        """Return the checks of what the design compares itself with."""
        design, drag = self.design, self.design.drag_before
        hook, m0, m2 = held_moments(self.data, self.source, drag)
        needed = design.case.payload.fixed_drag
        if needed is None:
            needed = self.data.quadratic_drag * math.sqrt(8.0 / math.pi * m2)
        note, claimed = "[m] with the drum held", design.payload_rms_before
        return [
            agreement("hook_rms", design.hook_rms, math.sqrt(hook), _RMS, "[m]"),
            agreement("payload_rms_before", claimed, math.sqrt(m0), _RMS, note),
            agreement("drag_before", drag, needed, TIGHT, "[N s/m]"),
        ]

    def rope_modes(self) -> list[Check]:
        """Return what a one-spring design does on a rope with its axial modes."""
        if self.data.lumping != "thesis" or self.data.mass_per_length == 0.0:
            return []
        data = replace(self.data, lumping="distributed", masses=None)
        plant = sensed_plant(
            data,
            masses=_MODAL_MASSES,
            drag=self.design.drag,
            friction=self.design.friction,
            sensors=self.design.case.sensors,
        )
        plant = plant.select(measurements=self.design.controller.measurements)
        law = LawMatrices.of(self.design.controller, plant)
        check = pole_check(
            "rope modes", plant, closed_poles(plant, law), f"a rope of {_MODAL_MASSES} masses", 0.0
        )
        note = check.note
        if not check.ok:
            note = (
                f"on a rope with its axial modes these gains are unstable (growth rate "
                f"{check.found:.3g} 1/s): all figures belong to the one-spring model of the case"
            )
        return [replace(check, note=note, counts=False)]


def _near_pole(loop: CheckedLoop, s: ComplexArray) -> ComplexArray:
    """Return (1 + L)/L, which vanishes where 1 + L does and is smooth where L has a pole."""
    difference = loop.difference(s)
    return np.asarray(difference / (difference - 1.0))


def held_moments(data: PlantData, source: Source, drag: float) -> tuple[float, float, float]:
    """Return m0 of the hook [m^2], and m0 and m2 [m^2/s^2] of the payload with the drum held.

    Displacement and tension go up from the payload by transfer matrices: slings (1, 1/k), hook
    block (m s^2, 1), rope and the crane's tip (1, 1/k).

    The source is the hook's motion; the drag coefficient is in N s/m.  Where nothing damps a mode
    among the waves the payload's are infinite.
    """
    if source.band is None:
        raise SolverError("verification: the hook's motion has no band")
    modes = data.axial_modes(_HELD_MODES)
    slow, gains, times = data.branches

    def stretching(s: ComplexArray) -> ComplexArray:
        """Return EA(s)/EA: a branch's s tau / (1 + s tau) is one less 1 / (1 + s tau)."""
        if data.damping_law == "hysteretic":
            late = (gains / (1.0 + s[:, None] * times)).sum(axis=1)
            return np.asarray(slow + gains.sum() - late)
        return 1.0 + s * data.damping_time

    decay = 0.5 * data.damping_time * modes**2
    if data.damping_law == "hysteretic":
        there = stretching(imaginary(modes))
        modes = modes * np.sqrt(there.real)
        decay = 0.5 * modes * there.imag / there.real
    # The payload hardly moves in the higher modes, so drag only damps the first.
    load = data.payload_mass + data.block_mass
    load += data.rope_mass if data.lumping == "thesis" else 0.0
    decay[0] += 0.5 * drag / load

    low, high = source.band
    if np.any((decay == 0.0) & (modes > low) & (modes < high)):
        ends = panels(low, high, source.splits, np.zeros(0, dtype=complex))
        (hook,) = integrate(lambda omega: source.density(omega)[None], ends, rtol=_HELD_RMS)
        return float(hook), math.inf, math.inf

    def densities(omega: FloatArray) -> FloatArray:
        s = imaginary(omega)
        stretch = stretching(s)
        spring = data.stiffness * stretch
        tension = data.payload_mass * s**2 + drag * s
        moving = 1.0 + tension / data.sling_stiffness
        tension = tension + data.block_mass * s**2 * moving
        if data.one_spring:
            tension = tension + data.rope_mass * s**2 * moving
            moving = moving + tension / spring
        else:
            speed = math.sqrt(data.axial_stiffness / data.mass_per_length)
            gamma = s * data.rope_length / (speed * np.sqrt(stretch))
            along, across = np.cosh(gamma), np.sinh(gamma) / gamma
            moving, tension = (
                moving * along + tension * across / spring,
                tension * along + moving * across * gamma**2 * spring,
            )
        hook = source.density(omega)
        moved = np.abs(moving + tension / data.tip_stiffness) ** -2 * hook
        return np.stack([hook, moved, omega**2 * moved])

    edges = panels(*source.band, source.splits, -decay + 1j * modes)
    hook, m0, m2 = integrate(densities, edges, rtol=_HELD_RMS)
    return float(hook), float(m0), float(m2)
