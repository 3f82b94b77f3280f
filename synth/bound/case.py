r"""Best possible for a case, or beside a design on its own terms: `bound_for`.

    case -> plant with what its controller may hear, spectra of sea and noise, drive limits
    design -> the same with its sensors and drag, and no limit tighter than what it uses
      -> `lqg_bound`: the least of all linear controllers, whatever their margins
      -> `youla_design` -> `high_order`: the best found within the M_s

Everything is put on the side that makes the bound lower: peaks become limits on the rms with the
smallest k = sqrt(2 ln(T/T_z)) that is plausible, limits on power, on the tension at the load and
on the loop's margins are left out, and what a case calls an exact sensor has only a faint, stated
noise.

A design is above its bound by construction: both live on one plant with one linear drag and are
shaken by the same spectra.  So that a direct gain on white noise has a variance, the design's law
stands behind a low-pass far above its loop.  The best found is made on a finer rope, and holds on
one that is finer still.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from models.basics import (
    ComplexArray,
    FloatArray,
    InputError,
    SolverError,
    SynthesisError,
    White,
    check_range,
    one_thread,
    pick,
    shows_progress,
)
from models.case import Case
from models.hook import HookMotion
from models.plant import MAX_MASSES, LinearPlant, PlantData
from models.sensing import (
    ENCODER,
    MEASURED,
    SET_POINT,
    SwitchingNoise,
    aboard,
    sensed_line_at,
    sensed_plant,
    sensed_spectra,
)

from ..limits import LOWER_TENSION, Continuous, Limit, LowFrequency, Minimum, Peak, Rms, RollOff
from ..loop import Assessment, Disturbance, LinearController, Margins, disturbances
from ..question import PAYLOAD, DesignQuestion, pose
from ..structures import series
from .bode_integral import BodeEstimate, bode_estimate
from .bound import Bound, lqg_bound
from .dual import with_input_outputs
from .high_order import SPARE, HighOrder, high_order
from .truth import controller_rms
from .youla import Truth, gain_disk, youla_design

_FAINT = 1e-3  # noise of an exact sensor, see `bound_for`
_LONGER = 2.0  # T_z of any signal over that of the hook, at most
_PROPER = 1e4  # corner of the low-pass before a direct gain [rad/s]
_SIGNALS = ("acceleration", "velocity", "displacement")
_SAMPLE = 0.01  # of the faint noise [s]
_SHAKEN = "payload.force"
_FORCE = 0.1  # of the faint noise, on the payload
_MRU = ("mru.heave", "mru.heave_rate")
_FINE = 24  # rope masses on which the best found is made, if the bound has no more
_SLOWEST = 1e-2  # of the losses' remnant [rad/s]
_TIGHTER = 0.98  # of a disk of S, for what the truncation moves
_NUMBERS, _FEWEST, _MOST = 120, 12, 24  # free numbers of Q, and its functions a measurement


class _Judged(Protocol):
    """What of a design the best possible is told beside, see `synth.design.Design`."""

    @property
    def sea_case(self) -> Case: ...
    @property
    def controller(self) -> LinearController: ...
    @property
    def margins(self) -> Margins | None: ...
    @property
    def masses(self) -> int: ...
    @property
    def drag(self) -> float: ...
    @property
    def friction(self) -> float: ...


@dataclass(frozen=True, kw_only=True, eq=False)
class BestPossible:
    """What linear controllers can do in a case at all, and what was found within an M_s."""

    case: Case  #: The case, in the sea of the figures.
    free: Bound  #: The lower bound: no linear controller does better, whatever its margins.
    #: The sensors that tell of payload or ship and that the case calls exact: with these the bound
    #: hangs on the faint noise, and means little.
    exact: tuple[str, ...]
    #: M_s of the best found: the case's limit, or the design's own where it is more.
    max_sensitivity: float
    #: The design's controller, and its payload rms on these terms [m]: with the noise of all
    #: sensors that it hears, a faint one where they are exact; None without a design.
    own: HighOrder | None = None
    #: What Bode's integral says of the design's loop; None without one.
    bode: BodeEstimate | None = None
    terms: _Terms = field(repr=False)

    @property
    def rms(self) -> float | None:
        """The design's payload rms on these terms [m]; None without a design."""
        return None if self.own is None else self.own.rms

    @property
    def factor(self) -> float:
        """The design's rms over the bound; infinite without one."""
        return self.rms / self.free.value if self.rms and self.free.value > 0.0 else math.inf

    @property
    def meaningful(self) -> bool:
        """Whether the bound is more than a consequence of the faint noise."""
        return not self.exact and 0.0 < self.free.value < math.inf

    @cached_property
    def free_sensitivity(self) -> float:
        """M_s of the LQG controller that comes next to the bound, with the exact delays."""
        return Assessment(self.free.plant, self.free.controller, ()).max_sensitivity

    @cached_property
    def found(self) -> HighOrder | str:
        """The best found within the M_s, of high order or the design itself; or why there is none.

        Other margins than M_s are not imposed.  It holds on a finer rope than its own.
        """
        own = self.own
        try:
            made = _high_order(self.terms, self.max_sensitivity, begin=self.free.multipliers)
        except (SynthesisError, SolverError) as error:
            return own or str(error)
        return own if own is not None and own.rms <= made.rms else made

    @property
    def is_own(self) -> bool:
        """Whether the best found is the design itself."""
        return self.found is self.own

    @property
    def sentences(self) -> tuple[str, ...]:
        """What it says, in words: of the bound, of the best found, of the design."""
        least = f"{1e3 * self.free.value:.3g} mm"
        if not self.free.feasible:
            return ("no linear controller keeps the limits",)
        said = [
            f"no linear controller does better than {least} whatever its margins "
            f"(its LQG has M_s {self.free_sensitivity:.2g})"
        ]
        if self.free.value == 0.0:
            said = ["nothing is known of the best: the models of sea and delays miss too much"]
        found = self.found
        if isinstance(found, str):
            said.append(f"none found within M_s {self.max_sensitivity:.3g}: {found}")
        elif self.is_own:
            said.append(
                f"the best found at M_s {self.max_sensitivity:.3g} is the design "
                f"itself: {1e3 * found.rms:.3g} mm"
            )
        else:
            m = found.margins
            said.append(
                f"the best found at M_s {self.max_sensitivity:.3g} with order "
                f"{found.order}: {1e3 * found.rms:.3g} mm (gain x {m.gain_down:.2g} to "
                f"{m.most_gain}, phase {math.degrees(m.phase):.0f} deg, delay "
                f"{1e3 * m.delay:.0f} ms)"
            )
        if self.rms is not None:
            times = [f"{self.factor:.3g} times the bound"]
            if not self.is_own and isinstance(found, HighOrder):
                times.append(f"{self.rms / found.rms:.3g} times the best found")
            said.append(f"the design leaves {1e3 * self.rms:.3g} mm, {' and '.join(times)}")
        return tuple(said)

    def __str__(self) -> str:
        """Return a small tree."""
        first, *more = self.sentences
        lines = [f"Best possible: {first}", *(f"├ {text}" for text in more)]
        if self.exact:
            lines.append(f"├ it means little: {', '.join(self.exact)} exact")
        if str(self.bode or ""):
            lines.append(f"├ {self.bode}")
        for name, limit in self.free.limits.items():
            lines.append(
                f"├ {name} at the bound: {100.0 * self.free.rms[name] / limit:.1f} % of "
                f"{limit:.4g} rms"
            )
        lines += [f"├ {text}" for text in (f"duality gap {self.free.gap:.1e}", *self.terms.said)]
        lines[-1] = "└" + lines[-1][1:]
        return "\n".join(lines)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Terms:
    """The terms on which controllers are compared."""

    #: The case and its hook motion.
    case: Case
    hook: HookMotion
    heard: tuple[str, ...]  #: What a controller hears.
    #: Rope masses of the bound's plant; linear drag coefficient [N s/m]; friction of losses [N m
    #: s/rad].
    masses: int
    drag: float
    friction: float
    faint: float  #: See `bound_for`.
    limits: Mapping[str, float]  #: On the rms of outputs, by name.
    said: tuple[str, ...]  #: Remarks.

    def plant(self, masses: int) -> LinearPlant:
        """Return the plant on so many rope masses."""
        found = sensed_plant(self.case, masses=masses, drag=self.drag, friction=self.friction)
        return found.select(measurements=self.heard)

    def line(self, omega: FloatArray) -> ComplexArray:
        """Return what is heard of the command on the distributed rope, (k, ny)."""
        found = sensed_line_at(self.case, 1j * omega, drag=self.drag, friction=self.friction)
        return found.select(measurements=self.heard).yu[:, :, 0]

    def shaken(
        self, masses: int, *, remnant: bool = False
    ) -> tuple[LinearPlant, dict[str, Any], tuple[str, ...]]:
        """Return the plant with its faint noise, the spectra, and what is faint."""
        spectra = _heard_by(sensed_spectra(self.case, self.hook), self.heard)
        noise = spectra.pop(SET_POINT, None)
        if remnant and isinstance(noise, SwitchingNoise):
            # A filter that foretells what is slower still has states that hardly decay.
            spectra[SET_POINT] = replace(noise, slowest=_SLOWEST)
        return faint_noise(self.case, self.plant(masses), self.hook, spectra, self.faint)

    def bound(
        self,
        masses: int,
        *,
        remnant: bool = False,
        refits: int = 2,
        begin: Mapping[str, float] | None = None,
    ) -> Bound:
        """Return the bound on so many rope masses.

        It is as good a bound without the losses' remnant, which is none with the drum held.
        """
        plant, spectra, _ = self.shaken(masses, remnant=remnant)
        return lqg_bound(
            plant,
            spectra,
            {PAYLOAD: 1.0},
            self.limits,
            refits=refits,
            begin=begin,
            assumptions=self.said,
        )


@one_thread()
@shows_progress("the best possible")
def bound_for(
    subject: Case | _Judged,
    *,
    measurements: Sequence[str] | None = None,
    masses: int | None = None,
    faint: float = _FAINT,
) -> BestPossible:
    """Return the best possible for a case, or beside a design.

    Parameters
    ----------
    subject
        The case, or a design of any structure.
    measurements
        What a controller hears (`models.sensing.MEASURED`); by default what a design's structure
        hears, or all that is aboard in a case (`aboard`), with the drive's encoder.
    masses
        Rope masses; by default the design's or the case's, or a number that suits a quick loop.
    faint
        Noise of a sensor that the case calls exact: an independent error every 10 ms, over the
        rms of the hook's motion (for a tension: over the static one).  A tenth of it, over the
        static tension, is a force on the payload.

    Returns
    -------
    BestPossible
        The bound at once; the best found within the M_s, some ten seconds, when it is asked for.

    Raises
    ------
    InputError
        If a name is unknown, a design's loop is unstable, or a limit lies below the static load.
    SolverError
        If a Riccati equation has no stabilising solution.
    """
    check_range("bound", "faint", faint, low=0.0, open_low=True)
    if isinstance(subject, Case):
        question = pose(subject, masses=masses)
        heard = aboard(subject) if measurements is None else measurements
        terms = _terms(question, heard, question.drag_before, faint)
        return _beside(terms, subject.limits.max_sensitivity)
    case, controller, margins = subject.sea_case, subject.controller, subject.margins
    if margins is None:
        raise InputError("bound: the design's loop must be stable")
    question = pose(case, masses=subject.masses if masses is None else masses)
    heard = (*controller.measurements, *ENCODER) if measurements is None else measurements
    terms = _terms(question, heard, subject.drag, faint, subject.friction)
    plant, sources = _loop(terms, controller)
    bode = bode_estimate(Assessment(plant, controller, sources))
    names = list(dict.fromkeys([PAYLOAD, *terms.limits]))
    made = controller_rms(plant, sources, _proper(controller), names)
    # What the design itself uses is allowed: else it might not be among those compared with.
    room = {
        name: max(bound, made[name]) if math.isfinite(bound) else made[name]
        for name, bound in terms.limits.items()
    }
    own = HighOrder(rms=made[PAYLOAD], controller=controller, margins=margins)
    most = max(margins.max_sensitivity, case.limits.max_sensitivity)
    return _beside(replace(terms, limits=room), most, own, bode)


def _beside(
    terms: _Terms, most: float, own: HighOrder | None = None, bode: BodeEstimate | None = None
) -> BestPossible:
    return BestPossible(
        case=terms.case,
        free=terms.bound(terms.masses),
        exact=exact_sensors(terms.case, terms.heard),
        max_sensitivity=most,
        own=own,
        bode=bode,
        terms=terms,
    )


@one_thread()
def high_order_for(
    case: Case,
    *,
    measurements: Sequence[str],
    drag: float | None = None,
    friction: float = 0.0,
    rooms: Mapping[str, float] | None = None,
    states: int | None = None,
) -> HighOrder:
    """Return a controller of high order within the limits of a case.

    M_s and gain margins hold as a disk of S that is no larger than they ask for; limits on slow
    motion and on roll-off as they are; those on peaks as limits on an rms.  Those on power and on
    the delay margin are left out.  Drag is linear [N s/m], by default that with the drum held, and
    so is the `friction` of losses [N m s/rad]; `rooms` are limits on the rms of signals, where they
    are to be tighter than the case's, by name.  It has at most so many states.

    Raises SynthesisError if none is found.
    """
    question = pose(case)
    still = question.drag_before if drag is None else drag
    terms = _terms(question, measurements, still, _FAINT, friction)
    given, limits = rooms or {}, case.limits
    room = {n: min(limit, given.get(n, math.inf)) for n, limit in terms.limits.items()}
    disk = gain_disk(limits.max_sensitivity, limits.gain_margin_up, limits.gain_margin_down)
    return _high_order(
        replace(terms, limits=room),
        limits.max_sensitivity,
        states=states,
        disk=(disk[0], _TIGHTER * disk[1]),
        shapes=[m for m in question.limits if isinstance(m, LowFrequency | RollOff)],
        remnant=True,
    )


def _high_order(
    terms: _Terms,
    most: float,
    *,
    begin: Mapping[str, float] | None = None,
    states: int | None = None,
    remnant: bool = False,
    **limits: Any,
) -> HighOrder:
    """Return the best found within an M_s, on a rope that is fine enough to hold on the line."""
    modal = terms.case.rope.lumping != "thesis"
    fine = max(_FINE, terms.masses) if modal else terms.masses
    bound = terms.bound(fine, remnant=remnant, refits=0, begin=begin)
    plant = terms.plant(MAX_MASSES) if modal else bound.plant
    truth = Truth(plant=plant, line=terms.line if modal else None)
    heard = len(bound.plant.measurements)
    design = youla_design(
        bound,
        max_sensitivity=1.0 + SPARE * (most - 1.0),
        functions=int(np.clip(_NUMBERS // heard, _FEWEST, _MOST)),
        truth=truth,
        **limits,
    )
    return high_order(design, most, truth, states=states)


def exact_sensors(case: Case, measurements: Sequence[str]) -> tuple[str, ...]:
    """Return the sensors heard of payload or ship to which a case gives no noise."""
    payload, mru = case.sensors.payload, case.sensors.mru
    noise = {f"payload.{name}": getattr(payload, f"{name}_noise") for name in _SIGNALS}
    of_unit = ("noise_floor", "noise_fraction", "drift", "noise")
    noise |= dict.fromkeys(_MRU, max(getattr(mru, name, 0.0) for name in of_unit))
    return tuple(name for name in measurements if noise.get(name, 1.0) == 0.0)


def rms_limits(limits: Sequence[Limit], period: float) -> dict[str, float]:
    """Return the limits on signals as limits on their rms by name; others are left out.

    |static| + loss + k sigma <= bound with k = sqrt(2 ln(T/T_z)), and sqrt(static^2 + loss^2 +
    sigma^2) <= bound.  T_z is the signals' period [s].

    Raises InputError if a limit is not above the static load.
    """
    found: dict[str, float] = {}
    for limit in limits:
        if isinstance(limit, Rms):
            room = limit.bound
        elif isinstance(limit, Continuous):
            room = math.sqrt(max(limit.bound**2 - limit.static**2 - limit.loss**2, 0.0))
        elif isinstance(limit, Peak | Minimum):
            k = math.sqrt(2.0 * math.log(max(limit.duration / period, math.e**0.5)))
            if isinstance(limit, Minimum):
                room = (limit.static - limit.loss - limit.bound) / k
            else:
                room = (limit.bound - abs(limit.static) - limit.loss) / k
        else:
            continue
        if room <= 0.0:
            raise InputError(f"bound: {limit.name} leaves no room above the static load")
        found[limit.output] = min(room, found.get(limit.output, math.inf))
    return found


def faint_noise(
    case: Case, plant: LinearPlant, hook: HookMotion, spectra: Mapping[str, Any], faint: float
) -> tuple[LinearPlant, dict[str, Any], tuple[str, ...]]:
    """Return the plant and its spectra with a faint white noise where there is none.

    On every measurement that hears no white noise of its own, and as a force on the payload, which
    shakes the modes at zero frequency that a sea leaves at rest.
    """
    white = [plant.disturbances.index(n) for n, s in spectra.items() if isinstance(s, White)]
    exact = [n for n, row in zip(plant.measurements, plant.F, strict=True) if not row[white].any()]
    names = tuple(f"{name}.faint" for name in exact)
    m = len(names)
    columns = np.zeros((len(plant.measurements), m))
    for k, name in enumerate(exact):
        columns[plant.measurements.index(name), k] = 1.0
    noisy = replace(
        plant,
        E=np.hstack([plant.E, np.zeros((len(plant.A), m))]),
        F=np.hstack([plant.F, columns]),
        Fz=np.hstack([plant.Fz, np.zeros((len(plant.Cz), m))]),
        disturbances=(*plant.disturbances, *names),
    )
    scales = _scales(case, hook)
    result = dict(spectra)
    for name, of in zip(names, exact, strict=True):
        result[name] = White((faint * scales[of]) ** 2 * _SAMPLE)
    added = list(exact)
    if _SHAKEN not in result:
        result[_SHAKEN] = White((_FORCE * faint * case.hung_weight) ** 2 * _SAMPLE)
        added.append("the force on the payload")
    return noisy, result, tuple(added)


def command_limit(case: Case, plant: LinearPlant) -> tuple[str, float]:
    """Return the input and what its rms cannot exceed, whatever the drive does."""
    name = plant.inputs[0]
    motor, drive = case.winch.motor, case.winch.drive
    if motor.type == "dc":
        return name, float(drive.voltage or math.inf)
    if getattr(motor, "speed_gain", 0.0):
        return name, float(case.winch.speed_limit or math.inf)
    return name, float(drive.torque_peak or math.inf)


def _terms(
    question: DesignQuestion, heard: Sequence[str], drag: float, faint: float, friction: float = 0.0
) -> _Terms:
    """Return the terms of a case, with its limits on signals as limits on their rms."""
    case, hook = question.case, question.hook
    pick("bound", "measurement", MEASURED, heard)
    period = _LONGER * float(hook.displacement.zero_crossing_period)
    terms = _Terms(
        case=case,
        hook=hook,
        heard=tuple(name for name in MEASURED if name in heard),
        masses=question.masses,
        drag=drag,
        friction=friction,
        faint=faint,
        # A force on the payload is felt there at once, and what is white then has no variance.
        limits=rms_limits([x for x in question.limits if LOWER_TENSION not in x.outputs], period),
        said=(
            f"heard: {', '.join(name for name in MEASURED if name in heard)}",
            f"drag {drag:.4g} N s/m; {question.masses} rope masses",
            f"peaks as rms with T_z {period:.3g} s; no limits on margins or power",
        ),
    )
    plant, _, added = terms.shaken(terms.masses)
    command, top = command_limit(case, plant)
    limits = terms.limits if command in terms.limits else {command: top, **terms.limits}
    faintly = (f"faint noise ({faint:g}) of {', '.join(added)}",) if added else ()
    return replace(terms, limits=limits, said=(*terms.said, *faintly))


def _loop(
    terms: _Terms, controller: LinearController
) -> tuple[LinearPlant, tuple[Disturbance, ...]]:
    """Return a design's own plant, and what shakes it."""
    plant, spectra, _ = terms.shaken(terms.masses)
    plant = with_input_outputs(plant, list(terms.limits)).select(
        measurements=controller.measurements
    )
    heard = _heard_by(spectra, controller.measurements)
    return plant, disturbances(heard, plant.independent_disturbances)


def _scales(case: Case, hook: HookMotion) -> dict[str, float]:
    """Return the size of each measured signal if the payload is held still."""
    heave, rate = float(hook.displacement.rms), float(hook.velocity.rms)
    per_haul = case.winch.gearbox.ratio / PlantData.from_case(case).drum_radius
    return {
        "payload.acceleration": float(hook.acceleration.rms),
        "payload.velocity": rate,
        "payload.displacement": heave,
        "mru.heave": heave,
        "mru.heave_rate": rate,
        "drum.haul": heave,
        "motor.speed": rate * per_haul,
        "rope.tension": float(case.static_tension),
    }


def _proper(controller: LinearController) -> LinearController:
    """Return a controller behind a first-order low-pass, if it has a direct path."""
    if not np.any(controller.D):
        return controller
    one = np.eye(len(controller.inputs))
    low_pass = -_PROPER * one, _PROPER * one, one, 0.0 * one
    own = controller.A, controller.B, controller.C, controller.D
    A, B, C, D = series(own, low_pass)
    return replace(controller, A=A, B=B, C=C, D=D)


def _heard_by(spectra: Mapping[str, Any], measurements: Sequence[str]) -> dict[str, Any]:
    """Return the spectra without those of sensors that are not heard."""
    heard = set(measurements)
    own = {f"{name}{end}": {name} for name in MEASURED for end in ("_noise", ".faint")}
    own["mru.error"] = set(_MRU)
    return {name: value for name, value in spectra.items() if own.get(name, heard) & heard}
