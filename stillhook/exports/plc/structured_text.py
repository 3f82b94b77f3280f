"""A law as IEC 61131-3 structured text: a function block in LREAL, one in REAL, and an example.

    Law --> NAME.st, NAME_real.st, their PLCopen XML, example.st --> run by our interpreter

The REAL one is for a controller without LREAL.  It is written if it keeps its tolerance over the
recording: a law that answers the last digit of a measurement with more than that cannot, however
it is calculated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from models.basics import FloatArray, InputError, SolverError
from models.sensing import STATUSES, Recursion

from ..c_code import VECTOR
from ..exported import Exported
from ..law import Law
from ..recording import Recording
from ..signals import SIGNALS
from .block import Block, block_of
from .code import may_stop
from .example import example_of, time_literal
from .graph import graph_of
from .interpreter import Program
from .plcopen import as_plcopen

EXACT = 1e-12  #: Of the command's range: what the block in LREAL may be off.
SINGLE = 1e-4  #: What the one in REAL may be off.

_LIMITED = tuple(STATUSES).index("limited")  # before it there is only `engaged`

_ABOUT = """\
## The files

| file | what |
| --- | --- |
| `{name}.st` | function block `{block}`, in LREAL |
{real_row}| `{name}.xml` | the same as PLCopen XML (TC6 2.01){and_real} |
| `{example}` | a program that calls it, and the task that it runs in |
| `vector.csv` | what it was compared with |

Each block has the {signals} signals of the table below as inputs, with underscores instead of dots,
and two outputs: `command` [{unit}] and `status`, a number of the table of statuses. Signals that
are 0 or 1 (`payload_valid`, `mru_valid`, `operator_enable`, `operator_reset`, `encoder_valid`,
`load_cell_valid`) are BOOL. It needs no library.

## How to import it

- **CODESYS** 3.5: *Project*, *Import PLCopenXML*, `{name}.xml`. Or add a function block in ST and
  paste the declarations and the statements of `{name}.st`.
- **TwinCAT 3**: on the PLC project, *Import PLCopenXML*, `{name}.xml`.
- **Beremiz**: open a project, and paste `{name}.st` into a function block in ST.
- **TIA Portal** (S7-1200, S7-1500): add a function block in SCL, declare the variables in its
  interface and paste the statements. SCL wants the parameters of SEL, MIN, MAX and LIMIT by name:
  `SEL(G := .., IN0 := .., IN1 := ..)`, `MIN(IN1 := .., IN2 := ..)`.

`SEL(G, IN0, IN1)` is IN1 where G is TRUE, as in the standard.

## The task

Call the block once in every cycle of a task of {period}, whether it is enabled or not: each call
is one sample of {milliseconds:g} ms, whatever the clock says. In a task that is twice as slow every
filter and integral is twice as slow, and the margins are lost: export the law with the cycle of the
task as its sample time instead. A jitter of the task is a change of delay. Measurements of one
cycle belong together.

The states keep their values from call to call; do not make them RETAIN. After a stop begin with
`operator_reset`.

## Numbers that are not there

Feed finite numbers alone, smaller in size than {largest}: a controller may stop at a number that is
none. In place of a missing number stand the flags: FALSE, with the value of the table below. An
input that is not wired is at rest, `payload_valid` and `mru_valid` are FALSE, `payload_age` is
1000 s, and the controller is not enabled. `encoder_valid` and `load_cell_valid` are TRUE, for
drives that have no such flag; wire them if there is one.

{stops}{clocks}
"""

_CLOCKS = """

In `{name}_real.st` the clocks of the law count whole samples, as a sum of a thousand small steps is
not exact in REAL, and two commands are the same if they differ by less than 1E-6 of their size. Its
status may say `limited` (1) where that in LREAL says `engaged` (0), and the other way about, when
the drive reports a command that it was not given to the last digit. All else is the same law."""


@dataclass(frozen=True, kw_only=True)
class Replay:
    """What a block did with the recording."""

    difference: float  #: Largest of its command, over the command's range.
    statuses: int  #: Samples in which its status was another,
    modes: int  #: and those of them in which more than the drive's limit was told otherwise.


def as_structured_text(law: Law, recording: Recording) -> Exported:
    """Return a law as structured text, run on a recording of it.

    Raises
    ------
    InputError
        If the law is none that structured text can hold.
    SolverError
        If the block in LREAL does not do what was simulated.
    """
    recursion = law.recursion
    if recursion is None:
        raise InputError(
            f"structured text: {law.inner.name} solves a programme in every sample, which is not "
            "written as structured text; export it as C or as an FMU (--to c, --to fmu)"
        )
    double = _block(law, recursion, "LREAL")
    files = {f"{law.name}.st": double.text, f"{law.name}.xml": as_plcopen(double)}
    found = replay(double, recording, law.span)
    if found.difference > EXACT or found.statuses:
        raise SolverError(
            f"structured text: the block in LREAL is off by up to {found.difference:.2g} of the "
            f"command's range, and in {found.statuses} samples by its status"
        )
    count = len(recording.commands)
    proof = (
        f"The block in LREAL was run over the {count} samples of `{VECTOR}`: its command differs "
        f"by {_told(found.difference)}, and the status is the same in all of them. "
    )
    single, told = _single(law, recursion, double, recording)
    if single is not None:
        files |= {f"{law.name}_real.st": single.text, f"{law.name}_real.xml": as_plcopen(single)}
    files |= {_example(law): example_of(law, double), VECTOR: recording.csv()}
    proof += (
        f"{told} Both were run by an interpreter of structured text that belongs to Stillhook and "
        "reads the files as they are here, with every operation rounded to its type; no compiler "
        "of a controller has seen them, so replay the vector on yours."
    )
    return Exported(
        kind="st",
        title=f"{law.name}: structured text (IEC 61131-3)",
        files=files,
        about=_about(law, recursion, double, single is not None),
        proof=proof,
    )


def replay(block: Block, recording: Recording, span: float, *, rounded: bool = False) -> Replay:
    """Return what the interpreter makes of a block and a recording.

    Parameters
    ----------
    block
        The function block; it is run from its text.
    recording
        What goes in, and what should come out.  For a number that is none the last one goes in,
        as on a controller.
    span
        The command's range.
    rounded
        Whether the measurements are rounded to single precision first.
    """
    measured = _held(recording.measured)
    if rounded:
        measured = measured.astype(np.float32).astype(np.float64)
    made = Program.read(block.text).run(
        {signal.identifier: measured[:, i] for i, signal in enumerate(SIGNALS)}
    )
    other = made["STATUS"] != recording.statuses
    mode = other & (np.maximum(made["STATUS"], recording.statuses) > _LIMITED)
    return Replay(
        difference=float(np.abs(made["COMMAND"] - recording.commands).max()) / span,
        statuses=int(np.count_nonzero(other)),
        modes=int(np.count_nonzero(mode)),
    )


def _single(
    law: Law, recursion: Recursion, double: Block, recording: Recording
) -> tuple[Block | None, str]:
    """Return the block in REAL if it keeps its tolerance, and what is told of it."""
    try:
        single = _block(law, recursion, "REAL")
        found = replay(single, recording, law.span)
    except InputError as error:
        return None, f"There is none in REAL: {error}."
    if found.difference <= SINGLE:
        only = f"all but {found.modes} of them " if found.modes else ""
        return single, (
            f"That in REAL differs by {_told(found.difference)}, and by its status in "
            f"{found.statuses} samples, {only}between `engaged` and `limited`: the drive of the "
            "recording follows the commands of the simulation to the last digit, not the block's."
        )
    rounding = replay(double, recording, law.span, rounded=True).difference
    return None, (
        f"There is none in REAL: it would differ by {_told(found.difference)}, more than "
        f"{SINGLE:g}; to round nothing but the measurements to REAL already makes "
        f"{_told(rounding)}."
    )


def _block(law: Law, recursion: Recursion, kind: str) -> Block:
    about = (
        f"{law.inner.name}: one step of the law in {kind}, to be called every "
        f"{1e3 * law.sample_time:g} ms\n\nThis is no safety function. Signals, signs, statuses and "
        "the test that it passed: README.md"
    )
    return block_of(recursion, law.name, kind, about=about, unit=law.unit, rest=law.rest)


def _about(law: Law, recursion: Recursion, block: Block, real: bool) -> str:
    graph = graph_of(recursion.function)
    stop = [i for i in graph.reached() if may_stop(graph, i)]
    if stop:
        stops = (
            f"{len(stop)} of its operations have no result for some numbers (division by a "
            "variable, root, logarithm); where only one side of a choice asks for one, it stands "
            "in an IF."
        )
    else:
        stops = (
            "The law divides by constants alone and takes no root and no logarithm, so that no "
            "finite number of that size stops it."
        )
    row = f"| `{law.name}_real.st` | the same in REAL, for a controller without LREAL |\n"
    return _ABOUT.format(
        name=law.name,
        block=block.name,
        example=_example(law),
        real_row=row if real else "",
        and_real=f"; `{law.name}_real.xml` of that in REAL" if real else "",
        signals=len(SIGNALS),
        unit=law.unit,
        period=f"`{time_literal(law.sample_time)}`",
        milliseconds=1e3 * law.sample_time,
        largest="1E12",
        stops=stops,
        clocks=_CLOCKS.format(name=law.name) if real else "",
    )


def _example(law: Law) -> str:
    """Return the example's file, which is not that of a law of the same name."""
    return "example_task.st" if law.name == "example" else "example.st"


def _held(measured: FloatArray) -> FloatArray:
    """Return measurements with the last number in the place of what is none, (n, 21)."""
    held = measured.copy()
    held[0] = np.nan_to_num(held[0], nan=0.0)
    for k in range(1, len(held)):
        held[k] = np.where(np.isfinite(held[k]), held[k], held[k - 1])
    return held


def _told(difference: float) -> str:
    return f"{difference:.2g} of the command's range at most" if difference else "nothing at all"
