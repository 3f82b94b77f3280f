"""An example of how a function block is called: a program, and the task that it runs in."""

from __future__ import annotations

from models.sensing import STATUSES

from ..law import Law
from ..signals import SIGNALS
from .block import Block
from .code import literal

_BRAKED = tuple(STATUSES).index("braked")

_EXAMPLE = """\
(* How {block} is called: a program, and the task of {milliseconds:g} ms that it runs in. *)
(* Wire the inputs; what a drive or a winch does not have keeps its initial value. *)
PROGRAM Winch
VAR_INPUT
{wires}
    (* TRUE in the cycle in which a message of the payload has arrived *)
    message : BOOL := FALSE;
    (* [s] time that a message of the payload takes *)
    link_delay : LREAL := {delay};
END_VAR
VAR_OUTPUT
    (* [{unit}] to the drive *)
    drive_command : LREAL := {rest};
    (* sets the brake, until somebody releases it *)
    set_brake : BOOL := FALSE;
END_VAR
VAR
    law : {block};
    age : LREAL := 1000.0;
END_VAR

IF message THEN
    age := link_delay;
ELSE
    age := MIN(1000.0, age + {period});
END_IF;
law(
{given}
);
drive_command := law.command;
IF law.status = {braked} THEN
    set_brake := TRUE;
END_IF;
END_PROGRAM

CONFIGURATION Plant
    RESOURCE Controller ON PLC
        TASK Cyclic(INTERVAL := {interval}, PRIORITY := 1);
        PROGRAM Main WITH Cyclic : Winch;
    END_RESOURCE
END_CONFIGURATION
"""

_OWN = {"payload.age": "age", "payload.valid": "message"}


def example_of(law: Law, block: Block) -> str:
    """Return the example of a law's function block in LREAL."""
    wires, given = [], []
    for signal, variable in zip(SIGNALS, block.inputs, strict=True):
        own = _OWN.get(signal.name)
        given.append(f"    {signal.identifier} := {own or signal.identifier}")
        if own is None:
            wires += variable.lines()
    return _EXAMPLE.format(
        block=block.name,
        milliseconds=1e3 * law.sample_time,
        wires="\n".join(wires),
        unit=law.unit,
        delay=literal(law.case.sensors.telemetry.delay, "LREAL"),
        rest=literal(float(law.rest["drive.applied"]), "LREAL"),
        period=literal(law.sample_time, "LREAL"),
        given=",\n".join(given),
        braked=_BRAKED,
        interval=time_literal(law.sample_time),
    )


def time_literal(seconds: float) -> str:
    """Return a time as IEC 61131-3 writes it, as ``T#5ms``."""
    return f"T#{round(1e3 * seconds, 6):.10g}ms"
