"""What the solvers of predictive control are asked: a closed loop, recorded sample by sample.

    LinearMPC in the simulator --> Recording: measurements, states, gradients, bounds

A recording holds what came in at every sample, so that the loop can be gone through again without
the simulator, and the quadratic programme that was solved (`mpc_statements` words it for others).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from models import Case, load_case
from models.sensing import Measurement
from models.simulation import SimulationOptions, prepare, run_simulation
from mpc.linear import LinearMPC
from mpc.programme import SoftQP
from mpc.winch import ProcessNoise, Weights

__all__ = [
    "HEIGHTS",
    "SAMPLE_TIME",
    "WEIGHTS",
    "Question",
    "Recording",
    "again",
    "record",
    "sea_case",
]

FloatArray = npt.NDArray[np.float64]
Question = tuple[FloatArray, FloatArray, FloatArray]

SAMPLE_TIME = 0.05
#: Significant wave heights [m]: limits are met seldom or never, often, nearly always.
HEIGHTS = {"calm": 1.0, "rough": 2.43, "extreme": 3.75}
#: Those that `tune_weights` finds for this case, rounded.
WEIGHTS = Weights(torque=0.03, noise=ProcessNoise(force=0.06, torque=0.01, rope=0.5, sensors=2e-4))
# White noise of 1 % of the heave's rms, sampled at 4 Hz.
_UNIT = {"noise_floor": 0.0, "noise_fraction": 0.01, "noise_bandwidth": 11.31}
_SEED = 1


def sea_case(sea: str, name: str = "thesis-1975") -> Case:
    """Return the case in one of `HEIGHTS`."""
    return load_case(name).replace({"sea.significant_height": HEIGHTS[sea], "sensors.mru": _UNIT})


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """A closed loop of a controller, of which the last `steps` samples count.

    Attributes
    ----------
    sea
        Of `HEIGHTS`.
    controller
        The one that was recorded.
    measurements, times
        What it was given at every sample, from the start.
    commands
        What it answered, (n,).
    states, questions, moves
        Of the samples that count: the estimate chi (steps, size), the programme's gradient and
        bounds, and the first move of the answer (steps,).
    """

    sea: str
    controller: LinearMPC
    measurements: tuple[Measurement, ...]
    times: tuple[float, ...]
    commands: FloatArray
    states: FloatArray
    questions: tuple[Question, ...]
    moves: FloatArray
    steps: int

    @cached_property
    def limited(self) -> float:
        """Share of the questions in whose answer a limit is met."""
        qp = again(self.controller.qp)
        active = [bool((qp.solve(*asked).multipliers != 0.0).any()) for asked in self.questions]
        return float(np.mean(active))


def again(qp: SoftQP) -> SoftQP:
    """Return a programme of the same matrices that has seen nothing yet."""
    return SoftQP(qp.H, qp.rows, quadratic=qp.quadratic, linear=qp.linear)


def record(sea: str, controller: LinearMPC, *, steps: int, settle: float = 40.0) -> Recording:
    """Return a recording of a controller whose case is in that sea.

    Parameters
    ----------
    sea
        Of `HEIGHTS`; named only.
    controller
        The controller.
    steps
        Samples that count.
    settle
        What is gone through before them, so that the loop settles [s].
    """
    given: list[Measurement] = []
    times: list[float] = []
    commands: list[float] = []
    states: list[FloatArray] = []
    questions: list[Question] = []
    moves: list[float] = []
    first = round(settle / controller.sample_time)

    class Recorder:
        name, sample_time = controller.name, controller.sample_time

        def reset(self) -> None:
            controller.reset()

        def step(self, measurement: Measurement, time: float) -> float:
            given.append(Measurement(measurement.values.copy()))
            times.append(time)
            command = controller.step(measurement, time)
            commands.append(command)
            if len(given) > first:
                asked, solved = controller.question, controller.solved
                if asked is None or solved is None:
                    raise ValueError(f"no answer at {time:g} s of the recording")
                states.append(controller.estimator.state.copy())
                f, low, high = asked
                questions.append((f.copy(), low.copy(), high.copy()))
                moves.append(float(solved.v[0]))
            return command

    # The loop asks its controller once more at the end.
    duration = (first + steps - 1) * controller.sample_time
    run = run_simulation(
        prepare(controller.case, Recorder(), options=SimulationOptions(duration=duration)),
        seed=_SEED,
    )
    if run.status != "completed" or len(questions) < steps:
        raise ValueError(f"recording of {sea}: {run.status} after {len(questions)} questions")
    return Recording(
        sea=sea,
        controller=controller,
        measurements=tuple(given),
        times=tuple(times),
        commands=np.array(commands),
        states=np.array(states),
        questions=tuple(questions),
        moves=np.array(moves),
        steps=len(questions),
    )
