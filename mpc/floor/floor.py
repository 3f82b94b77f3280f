"""The clairvoyant optimum of a record, `Clairvoyant`, worked out from a solver's answer.

    RecordProblem, RecordSolution --> `floor_of` --> Clairvoyant

The same code makes it of an answer that has just been found and of one from the cache, so that
nothing that was stored has to be believed.
"""

import time as clock
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np

from models.basics import FloatArray, ReadOnlyArrays
from models.case import Case
from models.plant import DriveLimits

from .certificate import Certificate, certify, rollout
from .plant import Hold
from .problem import RecordProblem, RecordSolution
from .verification import RecordVerification, verify_record

Start = Literal["free", "hook"]

_AT_LIMIT = 1e-3  # closer to a limit than this share of it counts as at the limit


@dataclass(frozen=True, kw_only=True, eq=False)
class Clairvoyant(ReadOnlyArrays):
    """The floor of a record, with the motion that reaches it."""

    case: Case
    limits: DriveLimits  #: Limits of the drive.
    hold: Hold  #: What is held over a sample.
    start: Start  #: Where it starts.
    settle: float  #: Time from which the payload counts [s].
    payload_rms: float  #: Root mean square of the payload's displacement [m].
    payload_max: float  #: Its largest size [m].
    hook_rms: float  #: Root mean square of the hook's over the same time [m].
    torque_peak: float  #: Largest motor torque [N m].
    torque_rms: float  #: Its root mean square [N m].
    speed_peak: float  #: Highest motor speed [rad/s].
    tension_least: float  #: Smallest tension of the lowest piece of rope [N].
    #: Share of the time at each limit: torque, speed, power, voltage, tension [-].
    shares: Mapping[str, float]
    time: FloatArray  #: The samples, (N+1,) [s]; what follows is at them.
    hook: FloatArray  #: [m]
    payload: FloatArray  #: [m]
    haul: FloatArray  #: [m]
    torque: FloatArray  #: [N m]
    speed: FloatArray  #: [rad/s]
    #: Asked of the drive at the start of each sample, (N,) [unit of the command].
    command: FloatArray
    drag: float  #: Linear drag coefficient [N s/m].
    seconds: float  #: Time taken [s].
    #: Residuals of the optimality conditions, by code that did not solve it.
    certificate: Certificate
    problem: RecordProblem = field(repr=False)  #: What was solved.
    solution: RecordSolution = field(repr=False)  #: The solver's answer.

    def __post_init__(self) -> None:
        """Make arrays and mapping read-only."""
        super().__post_init__()
        object.__setattr__(self, "shares", MappingProxyType(dict(self.shares)))

    @property
    def lower_bound(self) -> float:
        """Below this no controller gets on the linear plant [m]."""
        return self.certificate.lower_bound

    @property
    def status(self) -> str:
        """What was found, in a sentence."""
        share = max(self.shares.values())
        name = max(self.shares, key=lambda key: self.shares[key])
        bound = (
            "no limit binds"
            if share == 0.0
            else f"the drive is at its {name} limit {100 * share:.3g} % of the time"
        )
        return (
            f"with all of the record known, the payload cannot be held stiller than "
            f"{1e3 * self.payload_rms:.4g} mm rms; {bound}"
        )

    def verify(self) -> RecordVerification:
        """Simulate the demand on the linear plant by another route, to confirm the answer."""
        return verify_record(
            self.case,
            self.problem,
            self.solution,
            payload=np.asarray(self.payload),
            payload_rms=self.payload_rms,
        )

    def __str__(self) -> str:
        """Return a small tree of the numbers."""
        at = ", ".join(f"{name} {100 * share:.3g} %" for name, share in self.shares.items())
        return (
            f"Clairvoyant over {self.time[-1]:g} s: {self.status}\n"
            f"├ payload: {1e3 * self.payload_rms:.4g} mm rms (at least "
            f"{1e3 * self.lower_bound:.4g} mm), {1e3 * self.payload_max:.4g} mm at most; "
            f"hook {1e3 * self.hook_rms:.4g} mm rms\n"
            f"├ motor: {self.torque_peak / 1e3:.4g} kN m, {self.speed_peak:.4g} rad/s at most\n"
            f"├ at limits: {at}\n"
            f"├ linear drag: {self.drag:.4g} N s/m; demand per sample: {self.hold}; "
            f"start: {self.start}\n"
            f"└ solver: piqp, {self.solution.iterations} steps; {self.certificate}"
        )


def floor_of(
    case: Case,
    limits: DriveLimits,
    start: Start,
    settle: float,
    problem: RecordProblem,
    solution: RecordSolution,
    began: float,
) -> Clairvoyant:
    """Return the numbers of an answer, begun at `began` by `time.perf_counter` [s].

    The other arguments are attributes of `Clairvoyant`.
    """
    plant, N = problem.plant, problem.samples
    y = rollout(problem, solution.start, solution.inputs)
    states, inputs = y + problem.still, solution.inputs + problem.still_inputs
    demand = np.stack([plant.demand(states, inputs, end) for end in (0, 1)], axis=1)
    speed = states @ plant.speed
    payload = y @ plant.payload
    counted = slice(problem.first, None)
    on_demand, on_states = plant.torque
    rest = plant.static_demand * (1.0 - on_demand)
    torque_ends = plant.peak * (on_demand * demand + rest)
    torque_ends += plant.peak * np.stack([states[:-1] @ on_states, states[1:] @ on_states], axis=1)
    torque = np.append(torque_ends[:, 0], torque_ends[-1, 1])
    tensions = problem.still_tensions() + y[:N] @ plant.tensions.T
    at = np.abs(plant.levels(states, inputs)[problem.first :, 0]) >= 1.0 - _AT_LIMIT
    names = tuple(dict.fromkeys(plant.window_names))
    shares = {
        name: float(at[:, [n == name for n in plant.window_names]].any(axis=1).mean())
        for name in names
    }
    left = tensions[problem.first :] - problem.minimum_tension
    low = left <= _AT_LIMIT * plant.static_tensions
    shares["tension"] = float(low.any(axis=1).mean()) if problem.first < N else 0.0
    return Clairvoyant(
        case=case,
        limits=limits,
        hold=plant.hold,
        start=start,
        settle=settle,
        payload_rms=float(np.sqrt(np.mean(payload[counted] ** 2))),
        payload_max=float(np.abs(payload[counted]).max()),
        hook_rms=float(np.sqrt(np.mean(problem.heave[counted] ** 2))),
        torque_peak=float(np.abs(torque_ends).max()),
        torque_rms=float(np.sqrt(np.mean(torque[counted] ** 2))),
        speed_peak=float(np.abs(speed).max()),
        tension_least=float(tensions[:, 0].min()),
        shares=shares,
        time=plant.sample_time * np.arange(N + 1, dtype=np.float64),
        hook=problem.heave,
        payload=payload,
        haul=states[:, plant.states.index("motor.angle")],
        torque=torque,
        speed=speed,
        command=plant.commands(states[:N], demand[:, 0]),
        drag=plant.drag,
        seconds=clock.perf_counter() - began,
        certificate=certify(problem, solution),
        problem=problem,
        solution=solution,
    )
