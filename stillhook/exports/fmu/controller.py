"""A law as an FMU: FMI 2.0 for Co-Simulation, with sources, and the description for OSP.

Law, Recording --> NAME.fmu, NAME_OspModelDescription.xml, replayed through FMPy
"""

from __future__ import annotations

from functools import partial

import numpy as np

from models.basics import FloatArray, SolverError
from models.sensing import HEARD, STATUSES, numbers

from ..c_code import PREDICTIVE
from ..exported import Exported
from ..law import Law
from ..recording import Recording
from ..signals import SIGNALS, STATUS_TEXTS
from .check import check_valid, replayed
from .description import Description, Variable
from .package import UNPROVED, FmuModel, make_fmu, milliseconds

COMMAND, STATUS = "drive.command", "status"
_TYPE = "Status"
_ENGAGED, _LIMITED = (tuple(STATUSES).index(name) for name in ("engaged", "limited"))

_HEADER = """\
#include "{prefix}.h"

typedef struct {{
  double real[MODEL_REALS];
  int integer[MODEL_INTEGERS];
  long long samples; /* that have been taken */
  {prefix}_memory memory;
}} Model;
"""

_SOURCE = """\
/* The clock of the law: the sample k is taken in the communication step that holds k T. */

#include <string.h>

#include "model.h"

#define T {period!r} /* [s] */
#define ALIKE 1e-6  /* of T: two times no further apart are the same */

static const double at_first[MODEL_REALS] = {{{first}}};

void model_reset(Model *model) {{
  memcpy(model->real, at_first, sizeof at_first);
  memset(model->integer, 0, sizeof model->integer);
  model->samples = 0;
  {prefix}_reset(&model->memory);
}}

void model_begin(Model *model) {{
  (void)model; /* until the first sample the command is what holds the load at rest */
}}

const char *model_step(Model *model, double elapsed, double step) {{
  while ((double)model->samples * T < elapsed + step - ALIKE * T) {{
    model->real[{command}] = {prefix}_step(&model->memory, model->real);
    model->integer[0] = {prefix}_status(&model->memory);
    model->samples++;
  }}
  return NULL;
}}
"""

_TEXT = (
    "Controller of an offshore winch ({law}), every {period}. Inputs are read as they are at the "
    "beginning of a communication step, and the command that it has made of them is there when the "
    "step has been done. A sequential master that does the controller's step before the plant's "
    "adds no delay; a parallel (Jacobi) master adds one communication step. No safety function."
)

_ABOUT = """\
## What it is

`{name}.fmu` is a slave of FMI 2.0 for Co-Simulation: the law with the operator's interface.  It has
the {count} inputs of the table of signals under their names, the outputs `{command}` [{unit}] and
`{status}` (a number, see below), and needs nothing else on the machine.  What is not connected
keeps its start value: nothing moves, all sensors are there, the operator has enabled the law.

`{name}_OspModelDescription.xml` belongs beside it for masters of the Open Simulation Platform.

## Time

The law has its own clock: it is stepped every {period}, first at the start, in the communication
step that begins at or before the sample's time and ends after it.  A communication step may be any
part or multiple of that, and differ from one to the next; over a longer one the inputs are held and
the last command is seen.

`fmi2DoStep(t, h)` reads the inputs as they are at `t`, and afterwards `{command}` is the command
made of them, which belongs to the whole step.  So it hangs on the master what the loop is like:

- **Sequential** (Gauss-Seidel): set the controller's inputs from the plant at `t`, step the
  controller over `[t, t + h]`, read the command, then step the plant over the same step with it.
  With `h` = {period} that is the loop that was designed and simulated, without added delay.
- **Parallel** (Jacobi): all slaves step at once, and the plant gets the command one communication
  step late.  **The loop has `h` more delay** than the one that was designed.{step}
  Connect the controller's own `{command}` with its `drive.applied` then: what the plant has
  followed is a step older than the last command, which looks like a drive at its limit.

State can be saved, restored and serialised, and any number of instances live side by side.
{built}"""

_LATE = """
  At the step that was asked for, {step}, that is {step} of delay."""


def as_fmu(law: Law, recording: Recording, *, communication_step: float | None = None) -> Exported:
    """Return the FMU of a law, replayed if it could be compiled.

    A communication step [s] is told of in the text alone: the FMU takes any.

    Raises
    ------
    InputError
        If fmpy, the extra ``export``, is not installed.
    SolverError
        If the compiler fails, FMPy finds a problem, or the replay finds other commands.
    """
    fmu = make_fmu(fmu_model(law))
    if fmu.compiler is None:
        proof = UNPROVED
    else:
        check_valid(fmu)
        commands, statuses = replayed(
            fmu, HEARD, recording.measured, recording.sample_time, COMMAND, STATUS
        )
        proof = _compared(law, recording, commands, statuses)
    period = milliseconds(law.sample_time)
    late = "" if communication_step is None else _LATE.format(step=milliseconds(communication_step))
    return Exported(
        kind="fmu",
        title="FMU of the controller",
        files=fmu.files,
        about=_ABOUT.format(
            name=fmu.name,
            count=len(SIGNALS),
            command=COMMAND,
            status=STATUS,
            unit=law.unit,
            period=period,
            step=late,
            built=fmu.built,
        ),
        proof=proof,
        proved=fmu.compiler is not None,
    )


def fmu_model(law: Law) -> FmuModel:
    """Return what becomes the FMU of a law."""
    native, prefix = law.native, law.name
    told = Description(
        name=prefix,
        text=_TEXT.format(law=law.inner.name, period=milliseconds(law.sample_time)),
        variables=_variables(law),
        step=law.sample_time,
        types={_TYPE: STATUS_TEXTS},
    )
    first = [float(v.start or 0.0) for v in told.of_kind("Real") if not isinstance(v.start, str)]
    source = _SOURCE.format(
        prefix=prefix, period=law.sample_time, first=numbers(first), command=len(HEARD)
    )
    return FmuModel(
        told=told,
        header=_HEADER.format(prefix=prefix),
        sources={**native.files, "model.c": source},
        copied=native.copied,
        links=native.links,
    )


def _variables(law: Law) -> list[Variable]:
    flags = [signal.unit == "-" for signal in SIGNALS]
    inputs = [
        Variable(
            name=signal.name,
            meaning=f"{signal.meaning}; where there is no such sensor: {signal.missing}",
            causality="input",
            start=law.rest[signal.name],
            unit="1" if flag else signal.unit or law.unit,
            discrete=flag,
        )
        for signal, flag in zip(SIGNALS, flags, strict=True)
    ]
    output = partial(Variable, causality="output", discrete=True)
    told = partial(Variable, causality="local")
    return [
        *inputs,
        output(
            name=COMMAND,
            meaning="what the drive is to do, its static part included, until the next sample",
            start=law.rest["drive.applied"],
            unit=law.unit,
        ),
        output(name=STATUS, meaning="what the last step was", start=0, declared=_TYPE),
        told(
            name="law.sample_time",
            meaning="time from one sample of the law to the next",
            start=law.sample_time,
            unit="s",
        ),
        told(
            name="law.highest",
            meaning="highest size of the command",
            start=law.highest,
            unit=law.unit,
        ),
        told(name="law.name", meaning="the law within", start=law.inner.name),
        told(name="law.case", meaning="digest of the case file", start=law.case.digest),
    ]


def _compared(law: Law, recording: Recording, commands: FloatArray, statuses: FloatArray) -> str:
    """Return what the replay found.

    Raises SolverError if it found other commands or statuses.
    """
    predictive = law.recursion is None
    allowed = PREDICTIVE * law.span if predictive else 0.0
    worst = float(np.max(np.abs(commands - recording.commands)))
    ours, theirs = statuses, recording.statuses
    if predictive:
        # A drive that has followed the recorded command, not the one that is a rounding off it,
        # looks as if it were at a limit.
        ours, theirs = (np.where(codes == _LIMITED, _ENGAGED, codes) for codes in (ours, theirs))
    other = int(np.count_nonzero(ours != theirs))
    if not worst <= allowed or other:
        raise SolverError(
            f"export: fmu: the replay finds other commands, by up to {worst:.3g} {law.unit} "
            f"(allowed {allowed:.3g}), and {other} other statuses"
        )
    found = f"commands within {worst / law.span:.2g} of their range"
    if worst == 0.0:
        found = "the same commands to the last bit"
    apart = ", limited or not aside" if predictive else ""
    return (
        f"FMPy found the FMU valid, loaded it and replayed the test vector of {len(commands)} "
        f"samples: {found}, and the same statuses{apart}."
    )
