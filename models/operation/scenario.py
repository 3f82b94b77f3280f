"""The scenario of a run: an operation as data, from set-points to faults.

A scenario knows nothing of the controller and of the hook's motion; it says what the operator asks
of the payload over time, when the controller is engaged, what fails, and what the payload meets on
its way.  `models.operation.scenarios` is a library of them, by name, with figures that fit a case;
`models.operation.schedule` turns one into the rows that a simulation reads.

Times count from the start of the run.  The payload's set-point is a displacement from where it
hangs at rest at the start.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from ..basics import FloatArray, InputError, check_range
from ..case import Case
from ..plant import Surroundings
from ..sensing import BIAS, LATE, Bias, Interval, Late, check_intervals
from .excitation import MotionSource
from .profile import Profile
from .touch_down import TouchDown


@dataclass(frozen=True, kw_only=True, eq=False)
class Scenario:
    """An operation.

    Raises InputError if a time is out of order, or a motion is missing or not needed.
    """

    name: str  #: What it is called.
    description: str  #: What it is, in one line.
    duration: float  #: How long it takes unless the run says otherwise [s].
    profile: Profile = field(default_factory=Profile)  #: What is asked of the payload.
    warm_up: float = 0.0  #: Time with the brake on, in which sensors and filters settle [s].
    ramp: float = 0.0  #: Time in which the controller's command is ramped in, and out [s].
    settle: float = 0.0  #: Time from which statistics of the run count [s].
    #: When the controller begins to ramp out, after which the brake is set [s].
    disengage_at: float | None = None
    #: Periods in which the operator enables the controller, which holds the drum before, between
    #: and after them [s]; None for always.
    enabled: tuple[Interval, ...] | None = None
    resets: tuple[float, ...] = ()  #: When the operator resets the controller [s].
    rate: float = math.inf  #: The operator's highest rate of the set point, when enabling it [m/s].
    #: Periods in which the brake is on although nobody asked for it [s].
    brake_trips: tuple[Interval, ...] = ()
    #: (start, end, lasting) [s]: the brake is on for so long from the moment between start and end
    #: at which the drum turns fastest, which each run finds in the same run without the trip.
    worst_trip: tuple[float, float, float] | None = None
    telemetry_outages: tuple[Interval, ...] = ()  #: Periods without messages from the payload [s].
    #: Periods with a payload sensor that gives no numbers [s].
    sensor_failures: tuple[Interval, ...] = ()
    #: Periods in which the payload's sensors show the same for ever, as if it were true [s].
    stuck_readings: tuple[Interval, ...] = ()
    mru_outages: tuple[Interval, ...] = ()  #: Periods without the motion reference unit [s].
    #: Periods without the drum's encoder [s], after which the brake is on: the controller must have
    #: the operator's interface (`synth.controllers.operated`).
    encoder_outages: tuple[Interval, ...] = ()
    load_cell_outages: tuple[Interval, ...] = ()  #: Periods without the load cell [s]; likewise.
    #: (start, end, extra) [s]: messages sent in the period are late by so much more.
    telemetry_delays: tuple[Late, ...] = ()
    #: (start, end, heave, rate) [s], [m], [m/s]: what the reference unit shows too much.
    mru_biases: tuple[Bias, ...] = ()
    #: New values of plant parameters by the time from which they hold [s] and by name; None takes a
    #: parameter back to its own value.
    parameter_changes: Mapping[float, Mapping[str, float | None]] = field(default_factory=dict)
    surroundings: Surroundings | None = None  #: What the payload meets.
    #: What the winch does when the ground takes the load; its controller must know of it
    #: (`synth.controllers.touching_down`).
    touch_down: TouchDown | None = None
    #: Sources of the motions that the surroundings need: ``deck``, ``surface``.
    motions: Mapping[str, MotionSource] = field(default_factory=dict)
    #: Where the drum stands at the start, in metres of rope hauled in from where it holds the
    #: submerged payload at P = 0; negative for a payload that stands, with slack rope.
    initial_haul: float = 0.0
    #: Fields of the case that belong to the operation, by dotted path: a lift in air has less rope
    #: out and no water around it.
    case_changes: Mapping[str, object] = field(default_factory=dict)

    def __post_init__(self) -> None:
        owner = f"scenario {self.name}"
        check_range(owner, "duration", self.duration, low=0.0, unit="s", open_low=True)
        check_range(owner, "warm_up", self.warm_up, low=0.0, unit="s")
        check_range(owner, "ramp", self.ramp, low=0.0, unit="s")
        check_range(owner, "settle", self.settle, low=0.0, unit="s")
        check_range(owner, "initial_haul", self.initial_haul, unit="m")
        if self.disengage_at is not None:
            check_range(owner, "disengage_at", self.disengage_at, low=self.warm_up, unit="s")
        for name in (
            "brake_trips",
            "telemetry_outages",
            "sensor_failures",
            "stuck_readings",
            "mru_outages",
            "encoder_outages",
            "load_cell_outages",
        ):
            periods = getattr(self, name)
            checked = check_intervals(owner, name.replace("_", " "), periods, apart=True)
            object.__setattr__(self, name, checked)
        if self.touch_down is not None and (self.encoder_outages or self.load_cell_outages):
            raise InputError(
                f"{owner}: a touch-down phase needs encoder and load cell: ask for touchdown none"
            )
        if self.enabled is not None:
            checked = check_intervals(owner, "enabled", self.enabled, apart=True)
            object.__setattr__(self, "enabled", checked)
        for time in self.resets:
            check_range(owner, "time of a reset", time, low=0.0, unit="s")
        if self.worst_trip is not None:
            start, end, lasting = self.worst_trip
            check_range(owner, "start of worst_trip", start, low=0.0, unit="s")
            check_range(owner, "end of worst_trip", end, low=start, unit="s", open_low=True)
            check_range(owner, "lasting of worst_trip", lasting, low=0.0, unit="s", open_low=True)
        late = check_intervals(owner, "telemetry delays", self.telemetry_delays, LATE)
        object.__setattr__(self, "telemetry_delays", late)
        biases = check_intervals(owner, "MRU biases", self.mru_biases, BIAS)
        object.__setattr__(self, "mru_biases", biases)
        changes: dict[float, Mapping[str, float | None]] = {}
        for time, values in self.parameter_changes.items():
            check_range(owner, "time of a parameter change", time, low=0.0, unit="s")
            for name, value in values.items():
                if value is not None:
                    check_range(owner, f"{name} at {time:g} s", value)
            changes[float(time)] = MappingProxyType(dict(values))
        object.__setattr__(self, "parameter_changes", MappingProxyType(changes))
        for name in ("motions", "case_changes"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        needed = self.surroundings.motions if self.surroundings is not None else ()
        if set(self.motions) != set(needed):
            raise InputError(
                f"{owner}: its surroundings need the motions {', '.join(needed) or 'none'}, "
                f"got {', '.join(self.motions) or 'none'}"
            )

    @property
    def operated(self) -> bool:
        """Whether the controller has to have the operator's interface.

        That is where the operator enables or resets it, and where encoder or load cell give no
        numbers.
        """
        lost = self.encoder_outages or self.load_cell_outages
        return self.enabled is not None or bool(self.resets or lost)

    @property
    def events(self) -> tuple[tuple[float, str, str], ...]:
        """What happens by itself: time [s], kind and sentence, in order of time."""
        found: list[tuple[float, str, str]] = []
        if self.warm_up > 0.0:
            found.append((self.warm_up, "engaged", "the brake opens and the controller engages"))
        if self.disengage_at is not None:
            found.append((self.disengage_at, "disengaged", "the controller ramps out"))
        for start, end in self.enabled or ():
            found.append((start, "enabled", "the operator enables the controller"))
            if end < math.inf:
                found.append((end, "disabled", "the operator disables the controller"))
        found += [(at, "reset", "the operator resets the controller") for at in self.resets]
        for kind, what, periods in (
            ("brake", "the brake trips", self.brake_trips),
            ("telemetry", "the link from the payload is lost", self.telemetry_outages),
            ("sensor", "the payload's sensor gives no numbers", self.sensor_failures),
            ("sensor", "the payload's sensors are stuck", self.stuck_readings),
            ("mru", "the motion reference unit gives no numbers", self.mru_outages),
            ("sensor", "the drum's encoder gives no numbers", self.encoder_outages),
            ("sensor", "the load cell gives no numbers", self.load_cell_outages),
        ):
            found += [(start, kind, f"{what} until {end:g} s") for start, end in periods]
        for start, end, extra in self.telemetry_delays:
            text = f"the link from the payload is late by {extra:.4g} s more until {end:g} s"
            found.append((start, "telemetry", text))
        for start, end, heave, rate in self.mru_biases:
            off = f"{heave:.4g} m and {rate:.4g} m/s"
            text = f"the motion reference unit is off by {off} until {end:g} s"
            found.append((start, "mru", text))
        for move in self.profile.moves:
            verb = "raise" if move.distance > 0.0 else "lower"
            text = f"{verb} by {abs(move.distance):g} m at {move.speed:.3g} m/s"
            found.append((move.start, "reference", text))
        for time, changes in self.parameter_changes.items():
            parts = [
                f"{name} is {'as before' if value is None else f'{value:.4g} from now on'}"
                for name, value in changes.items()
            ]
            found.append((time, "parameter", ", ".join(parts)))
        return tuple(sorted(found))

    def initial_displacements(self, compliances: npt.ArrayLike) -> FloatArray:
        """Return where rope masses and payload are at rest at first, from the drum down [m].

        The payload is at P = 0.  The masses above it have moved with the drum, and by what the
        rope's tension differs from that of the submerged payload, `Surroundings.rest_force` F: x_j
        = initial_haul + F times the compliance of the springs above mass j.  The compliances are of
        each spring, likewise (n,) [m/N].
        """
        force = self.surroundings.rest_force if self.surroundings is not None else 0.0
        above = np.cumsum(np.asarray(compliances, dtype=np.float64))
        result: FloatArray = self.initial_haul + force * above
        result[-1] = 0.0
        return result

    def case_for(self, case: Case) -> Case:
        """Return the case as it is during the operation.

        Raises InputError if the case cannot be that, such as a drive that cannot hold the load in
        air.
        """
        if not self.case_changes:
            return case
        try:
            return case.replace(self.case_changes)
        except InputError as error:
            raise InputError(f"scenario {self.name}: {error}") from error
