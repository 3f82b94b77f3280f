r"""The plant as an FMU: winch, rope and load as they are simulated, for a controller of others.

Case --> the simulation's plant and integration step as C --> NAME.fmu

Between two communication points the hook goes on with its rate and with the acceleration a that its
rate has had over the last communication step,

.. math:: z(t + \tau) = z + \dot z \tau + a \tau^2/2,

so that over a step h its rate is off by no more than h^2 times its jerk, and its heave by 5/12 h^3
times that: in a sea of 8 s and 1 m, with h = 10 ms, by 0.05 mm/s and 0.2 micrometres.  Over the
first step a is zero.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial

import casadi as ca
import numpy as np

from models.basics import FloatArray, SolverError, check_range
from models.case import Case
from models.operation import Scenario, scenario_named
from models.plant import MOTION, late_hold, weighed_tension
from models.sensing import FunctionInC, function_as_c, numbers
from models.simulation import (
    SimulatedPlant,
    SimulationOptions,
    braked_step,
    disturbances,
    own_parameters,
    simulated_plant,
)

from ..exported import Exported
from ..law import identifier
from .check import Slave, check_valid
from .description import Description, Variable
from .package import UNPROVED, Fmu, FmuModel, make_fmu, milliseconds

INPUTS = ("hook.heave", "hook.heave_rate", "drive.command", "brake.on")
_WHOLE = 1e-6  # of an integration step: a whole number of them, whatever is rounded
_STEPS = 200  # of the proof

_MEANINGS: Mapping[str, str] = {
    "hook.heave": "heave of the hook (the crane tip), up positive",
    "hook.heave_rate": "its rate, up positive",
    "drive.command": "what the drive is to do, its static part included",
    "brake.on": "how far the drum's brake is closed, from 0 (open) to 1",
    "payload.displacement": "payload's displacement from where it hung at rest, up positive",
    "payload.velocity": "payload's velocity, up positive",
    "payload.acceleration": "payload's acceleration, up positive",
    "drum.haul": "rope hauled in since the start, over the falls; paying out negative",
    "motor.torque": "torque of the motor, hauling in positive, its static part included",
    "motor.speed": "speed of the motor's shaft, hauling in positive",
    "motor.current": "current of a DC motor; of other motors the torque",
    "motor.voltage": "voltage at the motor",
    "motor.power": "power that the motor gives, braking negative",
    "rope.tension": "tension of the rope at the drum",
    "rope.upper_tension": "tension of the rope below the sheaves",
    "rope.lower_tension": "tension at the payload",
    "rope.minimum_tension": "least tension of any piece of the rope",
    "rope.length": "length of the rope",
    "drive.applied": "the command that the drive follows, within its limits",
    **{
        f"measured.{end}": f"payload's {end} behind the low-passes of sensor and link"
        for end in MOTION
    },
    "measured.tension": "tension that a load cell at the rope's upper end weighs",
}

_HEADER = """\
#define STATES {states}
#define SENT {sent}  /* commands that are on their way to the drive */

typedef struct {{
  double real[MODEL_REALS];
  int integer[1];
  double x[STATES];
  double sent[SENT]; /* newest first */
  double last;       /* command that the drive was told last */
  double rate, step; /* the hook's rate at the last communication point, and the step from it */
}} Model;
"""

_SOURCE = """\
/* The plant of a simulation: the same integration step, the hook's motion extrapolated. */

#include <math.h>
#include <string.h>

#include "model.h"

#define DT {step!r} /* integration step [s] */
#define HOLD {hold!r} /* command that holds the load at rest */

{advance.declaration}
{look.declaration}

static const double at_first[MODEL_REALS] = {{{first}}};
static const double at_rest[STATES] = {{{rest}}};
static const double p[] = {{{parameters}}};
/* What moves with the hook at the start, as if it always had. */
static const int displaced[] = {{{displaced}}};
static const int moved[] = {{{moved}}};

/* Command that acts on the drive, of those up to the newest: the mean of what arrives in a step. */
static double arriving(const Model *model) {{
  return {arriving};
}}

static void look(Model *model, double z, double v, double a) {{
  const double hook[3] = {{z, v, a}};
  double seen[{outputs}];
  {called_look}
  memcpy(model->real + MODEL_INPUTS, seen, sizeof seen);
  /* Of a command on its way that is not cut, the one asked for last: the delay is no limit. */
  model->real[{applied}] += model->sent[0] - arriving(model);
}}

void model_reset(Model *model) {{
  memset(model, 0, sizeof *model);
  memcpy(model->real, at_first, sizeof at_first);
  model_begin(model);
}}

void model_begin(Model *model) {{
  const double z = model->real[0], v = model->real[1];
  size_t i;
  memcpy(model->x, at_rest, sizeof at_rest);
  for (i = 0; i < sizeof displaced / sizeof *displaced; i++) model->x[displaced[i]] += z;
  for (i = 0; i < sizeof moved / sizeof *moved; i++) model->x[moved[i]] += v;
  for (i = 0; i < SENT; i++) model->sent[i] = HOLD;
  model->last = HOLD;
  model->rate = v;
  model->step = 0.0;
  look(model, z, v, 0.0);
}}

const char *model_step(Model *model, double elapsed, double step) {{
  const double z = model->real[0], v = model->real[1];
  const double command = model->real[2], brake = model->real[3];
  const double steps = step / DT, count = floor(steps + 0.5);
  const double a = model->step > 0.0 ? (v - model->rate) / model->step : 0.0;
  double next[STATES], ends[6];
  long long j;
  int i;
  (void)elapsed;
  for (i = 0; i < MODEL_INPUTS; i++) {{
    if (!isfinite(model->real[i])) return "an input is no number";
  }}
  if (count < 1.0 || fabs(steps - count) > {whole!r} * count) {{
    return "the communication step must be a whole number of integration steps of {told}";
  }}
  for (j = 0; j < (long long)count; j++) {{
    const double t0 = (double)j * DT, t1 = (double)(j + 1) * DT;
    for (i = SENT - 1; i > 0; i--) model->sent[i] = model->sent[i - 1];
    model->sent[0] = command;
    model->last = HOLD + (arriving(model) - HOLD);
    ends[0] = z + v * t0 + 0.5 * a * t0 * t0, ends[1] = v + a * t0, ends[2] = a;
    ends[3] = z + v * t1 + 0.5 * a * t1 * t1, ends[4] = v + a * t1, ends[5] = a;
    {called_advance}
    memcpy(model->x, next, sizeof next);
  }}
  for (i = 0; i < STATES; i++) {{
    if (!isfinite(model->x[i])) return "the plant diverged: the loop is unstable";
  }}
  model->rate = v;
  model->step = step;
  look(model, ends[3], ends[4], a);
  return NULL;
}}
"""

_TEXT = (
    "Winch, rope and payload of an offshore crane, nonlinear, within the limits of the drive, as "
    "Stillhook simulates them. The hook's heave and its rate, the command and the brake are read "
    "as they are at the beginning of a communication step; the outputs are those at its end. "
    "Communication steps are whole multiples of {step}."
)

_ABOUT = """\
## What it is

`{name}.fmu` is a slave of FMI 2.0 for Co-Simulation: winch, rope and load of the case, for those
who test a controller of their own.  It is the plant of the simulation, integrated by the same code
with the same step of {step}: limits of the drive, slack rope, quadratic drag, friction, losses of
the gear both ways, and the brake.  There are no sensors, no sea and no controller in it.

{inputs}

{outputs}

`drive.applied` is what a controller of Stillhook hears under that name; its `rope.tension` is
`measured.tension` here.  `{name}_OspModelDescription.xml` belongs beside the FMU for masters of the
Open Simulation Platform.

## Time

A communication step must be a whole number of integration steps of {step}; {sample} is the one that
it was made for.  `fmi2DoStep(t, h)` takes the inputs as they are at `t` and gives the outputs at
`t + h`.  So a sequential master steps the controller first, hands its command to the plant, and
steps that; a parallel master is one communication step late with every command.

The hook goes on from `t` with its rate, and with the acceleration that the rate has had over the
last communication step.  At the step's end its rate is off by at most the square of the step times
the hook's jerk, and its heave by 5/12 of the cube times that; in a sea of 8 s and 1 m, with 10 ms,
that is 0.05 mm/s and 0.2 micrometres.  The motion should therefore be set at every step, and be
smooth.  At the start everything moves with the hook, as if it always had: begin in a trough or a
crest, or let the motion grow, so that the load is not off by more than the drive can make up for.

State can be saved, restored and serialised, and any number of instances live side by side.
{built}"""


@dataclass(frozen=True, kw_only=True, eq=False)
class PlantRecursion:
    """The plant between two communication points, as functions and numbers."""

    made: SimulatedPlant
    parameters: Mapping[str, float]  #: The plant's, then those of brake and motor.
    waiting: int  #: Commands that are on their way to the drive.
    share: float  #: Part of an integration step in which the oldest of them still acts.

    @property
    def step(self) -> float:
        """Integration step [s]."""
        return self.made.step.step

    @cached_property
    def advance(self) -> ca.Function:
        """Integration step (x, u, ends, brake, p) -> x, as the simulation's."""
        return braked_step(self.made.plant, tuple(self.parameters), 1, self.step)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of what `look` returns."""
        measured = (f"measured.{end}" for end in (*MOTION, "tension"))
        return (*self.made.plant.outputs, "motor.power", *measured)

    @cached_property
    def look(self) -> ca.Function:
        """Outputs (x, u, hook, p) -> (n,), the hook's displacement, velocity and acceleration."""
        plant = self.made.plant
        x, u = ca.SX.sym("x", len(plant.states)), ca.SX.sym("u")
        hook, p = ca.SX.sym("hook", 3), ca.SX.sym("p", len(self.parameters))
        _, y, z = plant.function(x, u, disturbances(hook), p[: len(plant.parameters)])
        now = dict(zip(plant.outputs, ca.vertsplit(z), strict=True))
        power = now["motor.torque"] * now["motor.speed"]
        measured = [y[i] for i in reversed(range(len(MOTION)))]
        whole = ca.vertcat(z, power, *measured, now[weighed_tension(plant.outputs)])
        return ca.Function("look", [x, u, hook, p], [ca.densify(ca.cse(whole))])

    @property
    def unit(self) -> Mapping[str, str]:
        """Unit of every output, and of the inputs."""
        told = dict(self.made.plant.units)
        told |= {f"measured.{end}": told[f"payload.{end}"] for end in MOTION}
        return {**told, "measured.tension": "N", "motor.power": "W", "brake.on": "1"}

    def with_hook(self) -> tuple[list[int], list[int]]:
        """Return which states are displacements and velocities that the hook carries along."""
        carried = [
            (i, name)
            for i, name in enumerate(self.made.plant.states)
            if not name.startswith("motor")
        ]
        return (
            [i for i, name in carried if name.endswith("displacement")],
            [i for i, name in carried if name.endswith("velocity")],
        )


def plant_as_fmu(
    case: Case, *, sample_time: float, masses: int | None = None, name: str | None = None
) -> Exported:
    """Return the FMU of a case's plant, which takes the hook's motion and a controller's command.

    Parameters
    ----------
    case
        The case; its sea, sensors and link play no part, but for the low-passes of these.
    sample_time
        Communication step that it is made for [s]: the integration step divides it.
    masses
        Masses along the rope; by default those of the case.
    name
        What it is called; by default after the case.

    Raises
    ------
    InputError
        If a number is out of range, or fmpy, the extra ``export``, is not installed.
    SolverError
        If there is no static operating point, the compiler fails, FMPy finds a problem, or the FMU
        does not what its functions do.
    """
    recursion = plant_recursion(case, sample_time, masses)
    model = plant_model(case, recursion, sample_time, name)
    fmu = make_fmu(model)
    if fmu.compiler is None:
        proof = UNPROVED
    else:
        check_valid(fmu)
        proof = _proof(fmu, recursion, sample_time)
    step = milliseconds(recursion.step)
    variables = model.told.of_kind("Real")
    return Exported(
        kind="plant",
        title="FMU of the plant",
        files=fmu.files,
        about=_ABOUT.format(
            name=fmu.name,
            step=step,
            sample=milliseconds(sample_time),
            inputs=_listed("input", [v for v in variables if v.causality == "input"]),
            outputs=_listed("output", [v for v in variables if v.causality == "output"]),
            built=fmu.built,
        ),
        proof=proof,
        proved=fmu.compiler is not None,
    )


def plant_recursion(case: Case, sample_time: float, masses: int | None = None) -> PlantRecursion:
    """Return the plant of a case that is integrated in steps that divide a sample time [s].

    Raises InputError, SolverError as `plant_as_fmu`.
    """
    check_range("export: plant", "sample_time", sample_time, low=1e-5, high=1.0, unit="s")
    made = simulated_plant(case, sample_time, _held(case), SimulationOptions(masses=masses))
    waiting, share = late_hold(case.winch.drive.command_delay / made.step.step)
    own = own_parameters(case, sample_time, made.rest.command)
    parameters = {**made.parameters, **own}
    return PlantRecursion(made=made, parameters=parameters, waiting=waiting, share=share)


def plant_model(
    case: Case, recursion: PlantRecursion, sample_time: float, name: str | None = None
) -> FmuModel:
    """Return what becomes the FMU of a plant.

    Raises InputError if the name has no letter to begin with.
    """
    called = identifier(f"{case.label} plant" if name is None else name)
    variables = _variables(case, recursion, sample_time)
    told = Description(
        name=called,
        text=_TEXT.format(step=milliseconds(recursion.step)),
        variables=variables,
        step=sample_time,
        types={},
    )
    advance = function_as_c(recursion.advance, f"{called}_advance")
    look = function_as_c(recursion.look, f"{called}_look")
    return FmuModel(
        told=told,
        header=_HEADER.format(states=len(recursion.made.plant.states), sent=recursion.waiting + 1),
        sources={
            "model.c": _source(recursion, told, advance, look),
            f"{advance.name}.c": advance.source,
            f"{look.name}.c": look.source,
        },
    )


def _source(
    recursion: PlantRecursion, told: Description, advance: FunctionInC, look: FunctionInC
) -> str:
    displaced, moved = recursion.with_hook()
    reals = told.of_kind("Real")
    waiting, share = recursion.waiting, recursion.share
    arriving = "model->sent[0]"
    if waiting:
        old, new = f"model->sent[{waiting}]", f"model->sent[{waiting - 1}]"
        arriving = f"{share!r} * {old} + (1.0 - {share!r}) * {new}"
    return _SOURCE.format(
        step=recursion.step,
        hold=recursion.made.rest.command,
        told=milliseconds(recursion.step),
        whole=_WHOLE,
        advance=advance,
        look=look,
        first=numbers(float(v.start or 0.0) for v in reals),
        rest=numbers(recursion.made.start),
        parameters=numbers(recursion.parameters.values()),
        displaced=", ".join(map(str, displaced)),
        moved=", ".join(map(str, moved)),
        arriving=arriving,
        outputs=len(recursion.outputs),
        applied=len(INPUTS) + recursion.outputs.index("drive.applied"),
        called_look=look.call(["model->x", "&model->last", "hook", "p"], ["seen"]),
        called_advance=advance.call(["model->x", "&model->last", "ends", "&brake", "p"], ["next"]),
    )


def _variables(case: Case, recursion: PlantRecursion, sample_time: float) -> list[Variable]:
    unit, hold = recursion.unit, recursion.made.rest.command
    start = {"drive.command": hold}
    inputs = [
        Variable(
            name=name,
            meaning=_MEANINGS[name],
            causality="input",
            start=start.get(name, 0.0),
            unit=unit[name],
        )
        for name in INPUTS
    ]
    outputs = [
        Variable(
            name=name, meaning=_MEANINGS[name], causality="output", start=None, unit=unit[name]
        )
        for name in recursion.outputs
    ]
    told = partial(Variable, causality="local")
    return [
        *inputs,
        *outputs,
        told(name="plant.step", meaning="integration step", start=recursion.step, unit="s"),
        told(
            name="plant.sample_time",
            meaning="communication step that it was made for",
            start=float(sample_time),
            unit="s",
        ),
        told(name="plant.case", meaning="digest of the case file", start=case.digest),
    ]


def _proof(fmu: Fmu, recursion: PlantRecursion, sample_time: float) -> str:
    """Return what came of a comparison with the functions of the simulation, called one by one.

    Raises SolverError if a number is another.
    """
    made, step = recursion.made, recursion.step
    values = np.array(list(recursion.parameters.values()))
    count = made.step.substeps
    hook = _swaying(sample_time)
    commands = made.rest.command * (1.0 + 1.2 * np.sin(0.3 * np.arange(_STEPS)))
    brakes = np.where(np.arange(_STEPS) > 0.9 * _STEPS, 1.0, 0.0)
    worst = 0.0
    first = dict(zip(INPUTS, (*hook[0].tolist(), made.rest.command, 0.0), strict=True))
    with Slave(fmu, start=first) as slave:
        x = np.array(made.start)
        displaced, moved = recursion.with_hook()
        x[displaced] += hook[0, 0]
        x[moved] += hook[0, 1]
        sent, before = [made.rest.command] * (recursion.waiting + 1), hook[0, 1]
        for k in range(_STEPS):
            (z, v), command, brake = hook[k], commands[k], brakes[k]
            a = (v - before) / sample_time if k else 0.0
            for j in range(count):
                sent = [command, *sent[:-1]]
                told = made.rest.command + (_arriving(recursion, sent) - made.rest.command)
                ends = [w for t in (j * step, (j + 1) * step) for w in _carried(z, v, a, t)]
                x = np.asarray(recursion.advance(x, told, ends, brake, values)).ravel()
            seen = np.asarray(recursion.look(x, told, ends[3:], values)).ravel()
            at = recursion.outputs.index("drive.applied")
            seen[at] += sent[0] - _arriving(recursion, sent)
            slave.set(dict(zip(INPUTS, (z, v, command, brake), strict=True)))
            slave.step(k * sample_time, sample_time)
            worst = max(worst, float(np.max(np.abs(seen - slave.get(*recursion.outputs)))))
            before = v
    if worst != 0.0:
        raise SolverError(f"export: plant: the FMU's outputs are other ones, by up to {worst:.3g}")
    return (
        f"FMPy found the FMU valid and loaded it. Over {_STEPS} communication steps of "
        f"{milliseconds(sample_time)}, with the hook moving, a command that swings and the brake "
        "closed at the end, every output was the same to the last bit as by the functions that are "
        "simulated."
    )


def _arriving(recursion: PlantRecursion, sent: Sequence[float]) -> float:
    """Return the command that acts, of those sent, newest first."""
    if not recursion.waiting:
        return sent[0]
    share = recursion.share
    return share * sent[recursion.waiting] + (1.0 - share) * sent[recursion.waiting - 1]


def _carried(z: float, v: float, a: float, t: float) -> tuple[float, float, float]:
    """Return the hook's displacement, velocity and acceleration after a time t [s]."""
    return z + v * t + 0.5 * a * t * t, v + a * t, a


def _swaying(sample_time: float) -> FloatArray:
    """Return a hook's heave and rate at communication points, (n, 2)."""
    angle = 2.0 * math.pi / 8.0 * sample_time * np.arange(_STEPS)
    return np.column_stack([np.sin(angle), 2.0 * math.pi / 8.0 * np.cos(angle)])


def _held(case: Case) -> Scenario:
    return scenario_named("hold", case)


def _listed(kind: str, variables: Sequence[Variable]) -> str:
    rows = [f"| `{v.name}` | {v.unit} | {v.meaning} |" for v in variables]
    return "\n".join([f"| {kind} | unit | what it is |", "| --- | --- | --- |", *rows])
