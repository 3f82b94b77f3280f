"""A prepared simulation: everything about a run that does not hang on its seed.

    Case, controller, scenario, options --> prepare --> Simulation --> run_simulation(seed) --> Run

Preparing solves for rest, chooses the integration step, writes the closed loop as one recursion
and compiles it; that takes a second or less, and every seed uses it again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..basics import FloatArray, InputError, check_range
from ..case import Case
from ..operation import MotionSource, Scenario, Schedule, SpectrumMotion
from ..plant import (
    MEAN_LOSSES,
    SPEED_BAND,
    DriveLimits,
    DrumTravel,
    OperatingPoint,
    Plant,
    PlantData,
    Surroundings,
    build_plant,
)
from ..run import Run
from ..sensing import (
    Controller,
    MruModel,
    NativeLaw,
    SensorModel,
    TelemetrySchedule,
    holds_brake,
    native_of,
    recursion_of,
)
from .closed_loop import HOOK, LoopRecursion, build_closed_loop
from .compiler import find_compiler
from .integrate import StepChoice, choose_step
from .kernel import Kernel
from .native_loop import NativeLoop
from .rows import RowMaker

EASE = 30.0  # in which the hook's motion grows where the controller is engaged from the start [s]
_CLOSING_TIME = 0.3  # of a brake that the case says nothing about [s]
_TRAVELS = 1.0  # a payload that is moved by more takes up rope and layers of the drum [m]
_HEAVE_SAMPLE = (600.0, 0.1)  # what a record's rms is taken over: duration and step [s]
_PREFIX = "controller"  # of the C of a controller in the loop
_GEAR_TURN = 1.0  # motor speed over which the gear's losses change sides [rad/s]


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulationOptions:
    """How to simulate, and what to keep of it."""

    hook: MotionSource | None = None  #: Motion of the hook; by default drawn from the case's sea.
    duration: float | None = None  #: Length of a run [s]; by default the scenario's own.
    #: Integration step [s]; by default the longest that the plant's fastest mode allows.
    step: float | None = None
    #: Masses along the rope; by default those of the case, or of the controller's design if more.
    masses: int | None = None
    #: Limits of the drive; by default those of the case, `DriveLimits()` for none.
    limits: DriveLimits | None = None
    #: Values of plant parameters by name, such as ``{"payload.quadratic_drag": 0.0}``.
    parameters: Mapping[str, float] | None = None
    #: Time from which statistics count [s]; by default the scenario's own, or the 30 s in which the
    #: hook's motion grows and ten peak periods of the sea; at most a tenth of the run, but not
    #: before a controller that warms up is engaged.
    settle: float | None = None
    #: Time between stored samples [s]; by default such that at most 40 000 are kept.
    store_step: float | None = None
    #: Size of the payload's error beyond which it counts as having lost lock [m]; by default not
    #: watched.
    lock_limit: float | None = None
    #: Wall time that a controller in Python may take for a step [s]; a later command is not used,
    #: the one before is held.
    deadline: float | None = None
    #: True: as C; False: in CasADi's virtual machine; None: as C if there is a compiler.
    compiled: bool | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Simulation:
    """A controller on a plant, ready to run; `prepare` makes it."""

    #: What is simulated, and how.
    case: Case
    controller: Controller
    scenario: Scenario
    options: SimulationOptions
    hook: MotionSource  #: Where the hook's motion comes from.
    loop: LoopRecursion  #: The recursion of one sample.
    #: What runs it: one kernel with the controller inside, or two, of what comes before the
    #: controller and of what comes after, between which it is called from Python.
    kernels: tuple[Kernel, ...] | tuple[NativeLoop]
    sensors: SensorModel  #: What the controller sees.
    schedule: Schedule
    rest: OperatingPoint  #: The plant at rest.

    @property
    def fused(self) -> bool:
        """Whether no sample goes through Python: the controller is part of what is compiled."""
        return len(self.kernels) == 1

    @property
    def compiled(self) -> bool:
        """Whether the recursion runs as C."""
        return all(kernel.compiled for kernel in self.kernels)

    @property
    def ease(self) -> float:
        """Time in which the motions of hook, deck and surface grow out of rest [s].

        A controller that is engaged from the start has to find the load at rest: a payload that
        is off by the height of a wave would saturate the drive at once.  One that is engaged
        after a warm-up meets the sea as it is.
        """
        engaged_at_once = self.scenario.warm_up <= 0.0 and not holds_brake(self.controller)
        return EASE if engaged_at_once else 0.0

    @property
    def duration(self) -> float:
        """Length of a run [s]."""
        asked = self.options.duration
        return self.scenario.duration if asked is None else asked

    def with_options(self, **changes: Any) -> Simulation:
        """Return it with other options of its runs: those of the plant were used to prepare it."""
        return replace(self, options=replace(self.options, **changes))

    def serves(self, scenario: Scenario) -> bool:
        """Return whether another scenario has the same loop, and need not be prepared anew.

        Set-points, the brake, the drive's limits and what is lost come in with the rows; another
        plant, a link that is later and another interface of the operator do not.
        """
        late = scenario.telemetry_delays
        sensors = SensorModel.from_case(self.case, self.loop.sample_time, late)
        return sensors.lags == self.sensors.lags and _looped(scenario) == _looped(self.scenario)

    def with_scenario(self, scenario: Scenario) -> Simulation:
        """Return it with another scenario that it serves.

        Raises InputError if that needs a loop of its own.
        """
        if not self.serves(scenario):
            raise InputError(f"scenario {scenario.name}: needs a simulation of its own: prepare it")
        schedule = Schedule(scenario=scenario, sample_time=self.loop.sample_time)
        return replace(self, scenario=scenario, schedule=schedule)

    def with_trip(self, whole: Run | None) -> Simulation:
        """Return it with the scenario's `worst_trip` at its moment in the run without, whole.

        Without that run the trip is left out, to find the moment by.
        """
        trips = self.scenario.brake_trips
        if whole is not None and self.scenario.worst_trip is not None:
            start, end, lasting = self.scenario.worst_trip
            among = np.flatnonzero((whole.time >= start) & (whole.time < end))
            if among.size:
                fastest = np.argmax(np.abs(whole["motor.speed"][among]))
                at = float(whole.time[among[fastest]])
                trips = (*trips, (at, at + lasting))
        scenario = replace(self.scenario, worst_trip=None, brake_trips=trips)
        step = self.options.store_step if whole is not None else self.loop.sample_time
        return self.with_options(store_step=step).with_scenario(scenario)

    def rows(self, seed: int, duration: float) -> RowMaker:
        """Return what makes the rows of one run of a duration [s]."""
        loop, scenario, case = self.loop, self.scenario, self.case
        h = loop.step.step
        length = (self.samples(duration) - 1) * loop.sample_time
        sources = [self.hook, *(scenario.motions[name] for name in loop.motions[1:])]
        rms, frequency = self._heave(duration)
        brake = case.winch.brake
        return RowMaker(
            motions=tuple(source.motion(length, h, seed).eased(self.ease) for source in sources),
            substeps=loop.step.substeps,
            sensors=self.sensors,
            telemetry=TelemetrySchedule(
                case.sensors.telemetry,
                loop.sample_time,
                seed,
                outages=scenario.telemetry_outages,
                broken=scenario.sensor_failures,
                stuck=scenario.stuck_readings,
                late=scenario.telemetry_delays,
            ),
            mru=MruModel(
                case.sensors.mru,
                loop.sample_time,
                rms,
                seed,
                outages=scenario.mru_outages,
                biases=scenario.mru_biases,
                heave_frequency=frequency,
            ),
            schedule=self.schedule,
            seed=seed,
            closing_time=_CLOSING_TIME if brake is None else brake.closing_time,
            always_braked=holds_brake(self.controller),
        )

    def samples(self, duration: float) -> int:
        """Return the number of samples in a duration [s], both ends included."""
        return math.floor(duration / self.loop.sample_time * (1.0 + 1e-12) + 1e-9) + 1

    def start(self, rows: RowMaker) -> FloatArray:
        """Return the state at the start: everything moves with the hook, as if it always had.

        A payload that stands on a deck moves with that instead.
        """
        state = self.loop.initial.copy()
        states = self.loop.states
        ends = [motion.block(0, 1) for motion in rows.motions]
        moves = {
            name: (float(z[0]), float(v[0]))
            for name, (z, v, _) in zip(self.loop.motions, ends, strict=True)
        }
        around = self.scenario.surroundings
        standing = around is not None and around.ground is not None and around.ground.below < 0.0
        for at, name in enumerate(states):
            part, _, signal = name.partition(".")
            if part not in ("plant", "sensor") or signal.startswith("motor"):
                continue
            below = not signal.startswith("rope.")
            z, v = moves.get("deck", (0.0, 0.0)) if standing and below else moves[HOOK]
            if signal.endswith("displacement"):
                state[at] += z
            elif signal.endswith("velocity"):
                state[at] += v
        return state

    def _heave(self, duration: float) -> tuple[float, float]:
        """Return standard deviation [m] and mean frequency [rad/s] of the hook's heave."""
        if isinstance(self.hook, SpectrumMotion):
            hook = self.hook.hook
            rms = hook.displacement.rms
            return rms, hook.velocity.rms / rms
        longest, step = _HEAVE_SAMPLE
        motion = self.hook.motion(min(longest, duration), min(step, duration), 0)
        z, v, _ = motion.block(0, motion.rows)
        rms, rate = float(z.std()), float(v.std())
        return (rms, rate / rms) if rms > 0.0 and rate > 0.0 else (0.0, 1.0)


def prepare(
    case: Case,
    controller: Controller,
    scenario: Scenario | str = "hold",
    options: SimulationOptions | None = None,
) -> Simulation:
    """Prepare the simulation of a case under a controller, which makes the drive's commands.

    Every run resets the controller.  The scenario says what is asked of it, and may be given by its
    name.

    Raises
    ------
    InputError
        If an argument is out of range, or the step is too long for the plant.
    SolverError
        If there is no static operating point, or C was demanded and there is no compiler.
    """
    options = options or SimulationOptions()
    if not isinstance(scenario, Scenario):
        from ..operation import scenario_named  # the library of them is only needed by name

        scenario = scenario_named(scenario, case)
    case = scenario.case_for(case)
    knows = holds_brake(controller) or hasattr(controller, "touch_down")
    if scenario.touch_down is not None and not knows:
        raise InputError(
            f"scenario {scenario.name}: {controller.name} has no touch-down phase: wrap it in "
            "synth.controllers.touching_down, or ask for touchdown none"
        )
    lost = scenario.encoder_outages or scenario.load_cell_outages
    if lost and not (holds_brake(controller) or getattr(controller, "operated", False)):
        raise InputError(
            f"scenario {scenario.name}: {controller.name} does not know of a lost encoder or load "
            "cell: wrap it in synth.controllers.operated"
        )
    sample_time = check_range(
        controller.name, "sample_time", controller.sample_time, low=0.0, unit="s", open_low=True
    )
    made = simulated_plant(
        case, sample_time, scenario, options, least=int(getattr(controller, "masses", 0))
    )
    sensors = SensorModel.from_case(case, sample_time, scenario.telemetry_delays)
    recursion = recursion_of(controller)
    law = None if recursion is not None else _law_in_c(controller, options)
    knows = hasattr(controller, "status") if recursion is None else recursion.status is not None
    loop = build_closed_loop(
        case,
        made.plant,
        sensors,
        step=made.step,
        parameters=made.parameters,
        start=made.start,
        hold=made.rest.command,
        recursion=recursion,
        with_status=knows and scenario.operated,
    )
    kernels: tuple[Kernel, ...] | tuple[NativeLoop]
    if law is not None:
        measure, advance = loop.functions
        native = NativeLoop(measure, advance, law, command=made.rest.command)
        loop = replace(loop, initial=np.concatenate([loop.initial, native.start()]))
        kernels = (native,)
    else:
        kernels = tuple(Kernel(function, compiled=options.compiled) for function in loop.functions)
    return Simulation(
        case=case,
        controller=controller,
        scenario=scenario,
        options=options,
        hook=SpectrumMotion.from_case(case) if options.hook is None else options.hook,
        loop=loop,
        kernels=kernels,
        sensors=sensors,
        schedule=Schedule(scenario=scenario, sample_time=sample_time),
        rest=made.rest,
    )


def _law_in_c(controller: Controller, options: SimulationOptions) -> NativeLaw | None:
    """Return the C of a controller that would else be called from Python, where that can be used.

    What is to be stopped at a deadline is called from Python all the same.
    """
    if options.compiled is False or options.deadline is not None or find_compiler() is None:
        return None
    return native_of(controller, _PREFIX)


@dataclass(frozen=True, kw_only=True, eq=False)
class SimulatedPlant:
    """The plant that a simulation integrates; `simulated_plant` makes it."""

    plant: Plant  #: With the limits of its drive.
    rest: OperatingPoint  #: The load at rest, the drive without limits.
    parameters: Mapping[str, float]  #: Values of the plant's parameters by name.
    step: StepChoice  #: The integration step, and what set it.
    start: FloatArray  #: State before anything moves, (nx,).


def simulated_plant(
    case: Case,
    sample_time: float,
    scenario: Scenario,
    options: SimulationOptions,
    *,
    least: int = 0,
) -> SimulatedPlant:
    """Return the plant of a case as a simulation integrates it, the sample time given [s].

    It has as many masses along the rope as the options say, or at least so many.

    Raises InputError, SolverError as `prepare`.
    """
    limits = DriveLimits.from_case(case) if options.limits is None else options.limits
    masses = options.masses
    if masses is None:
        # A loop that reaches the rope's higher modes holds where these are, and few masses have
        # them elsewhere.
        data = PlantData.from_case(case)
        masses = least if data.masses is None and least > data.chosen_masses() else None
    surroundings = scenario.surroundings
    travel = DrumTravel.from_case(case) if _travels(scenario) else None
    plant = build_plant(case, masses, limits=limits, travel=travel, surroundings=surroundings)
    rest = _rest(case, masses, surroundings)  # without limits, which rest must not depend on
    values = _parameters(case, plant, options.parameters or {})
    return SimulatedPlant(
        plant=plant,
        rest=rest,
        parameters=values,
        step=_choose_step(plant, rest, values, sample_time, options.step, surroundings),
        start=_initial_state(plant, rest, scenario),
    )


def _travels(scenario: Scenario) -> bool:
    """Return whether the drum takes up so much rope that its radius and the rope change."""
    farthest = max((abs(move.distance) for move in scenario.profile.moves), default=0.0)
    return max(farthest, abs(scenario.initial_haul)) > _TRAVELS


def _looped(scenario: Scenario) -> tuple[object, ...]:
    """Return what of a scenario is part of the loop itself, or of the state that it starts from."""
    interface = (scenario.rate, scenario.ramp) if scenario.operated else None
    return (
        dict(scenario.case_changes),
        scenario.surroundings,
        scenario.touch_down,
        scenario.initial_haul,
        _travels(scenario),
        interface,
    )


def _rest(case: Case, masses: int | None, surroundings: Surroundings | None) -> OperatingPoint:
    """Return the load at rest, the gear with the mean of its losses, the drive without limits.

    A payload that stands on a deck, or hangs in air, has another weight than in the water.

    Raises InputError if the drive cannot hold the load.
    """
    lifted = 0.0 if surroundings is None else surroundings.rest_force
    weight = {"payload.submerged_weight": case.payload.submerged_weight - lifted}
    rest = build_plant(case, masses).operating_point({**MEAN_LOSSES, **weight})
    peak = case.winch.drive.torque_peak
    if abs(rest.torque) > peak:
        raise InputError(
            f"{case.label}: winch.drive.torque_peak must be at least the static "
            f"torque, {rest.torque:.4g} N m, got {peak:g} N m: the motor cannot hold the load"
        )
    return rest


def _parameters(case: Case, plant: Plant, changes: Mapping[str, float]) -> dict[str, float]:
    """Return the plant's parameters by name: losses and friction in, then the changes."""
    losses: dict[str, float] = {}
    if case.winch.gearbox.efficiency * case.rope.sheaves_efficiency < 1.0:
        losses["winch.gear_switching"] = 1.0 / _GEAR_TURN
    if "winch.coulomb_friction" in plant.parameters:
        losses["winch.coulomb_friction"] = case.winch.motor.coulomb_friction
    vector = plant.parameter_vector({**losses, **changes})
    return dict(zip(plant.parameters, (float(value) for value in vector), strict=True))


def _choose_step(
    plant: Plant,
    rest: OperatingPoint,
    values: Mapping[str, float],
    sample_time: float,
    step: float | None,
    surroundings: Surroundings | None,
) -> StepChoice:
    """Return the integration step for everything that is fast: modes, motor, limits, contact."""
    p = np.array(list(values.values()))
    w = np.zeros(len(plant.disturbances))
    A = np.asarray(plant.jacobians(rest.x, rest.u, w, p)[0])
    rates = []
    if "drive.speed_limit" in values:
        # beyond the highest speed the torque falls to the other side within a narrow band
        peak = values.get("drive.torque_limit", 0.0)
        if "drive.current_limit" in values:
            current = values["motor.torque_constant"] * values["drive.current_limit"]
            peak = min(peak or math.inf, current)
        rates.append(peak / (SPEED_BAND * values["drive.speed_limit"]) / values["winch.inertia"])
    if surroundings is not None:
        rates += surroundings.stiffness_rates(values["payload.virtual_mass"])
    return choose_step(A, sample_time, step, extra_rates=rates)


def _initial_state(plant: Plant, rest: OperatingPoint, scenario: Scenario) -> FloatArray:
    """Return the plant at rest where the scenario has it, before anything moves."""
    state = np.array(rest.x)
    p, states = plant.parameters, plant.states
    # A drum that truly stands, not at the solver's 1e-16 rad/s: the brake is to hold it.
    state[states.index("motor.speed")] = 0.0
    turned = scenario.initial_haul / p["winch.drum_radius"] * p["winch.gear_ratio"]
    state[states.index("motor.angle")] = turned
    hanging = scenario.initial_displacements([1.0 / link.series for link in plant.chain])
    for name, displacement in zip(plant.displacements, hanging, strict=True):
        state[states.index(name)] = displacement
    return state
