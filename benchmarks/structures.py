"""Every structure on the 1975 winch, by depth and delay of the telemetry: a table in Markdown.

    python benchmarks/structures.py [--starts N] [--structures A,B] [--lengths 2000,300]

M_s <= 2, lower gain margin <= 0.5; what the drive would need is reported, not enforced.  The
reference unit's error is white noise of 1 % of the heave's rms sampled at 4 Hz (``noise``), or 5 cm
or 5 %, up to 1 rad/s (``datasheet``).  Delays: given ones, that of an acoustic link at 1500 m/s;
light in an umbilical takes 10 us for 2000 m, which is no delay here.  It takes hours: a row is
printed as soon as it is there.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Sequence

from models import Case, PhysicsWarning, load_case
from synth.structure_search import optimise_structure

DELAYS = (0.0, 0.025, 0.05, 0.1)
LENGTHS = (2000.0, 1000.0, 300.0, 100.0)
SOUND = 1500.0  # m/s
STRUCTURES = (
    "payload-feedback",
    "payload-feedback-rolloff",
    "payload-feedback-notch",
    "drum-feedback",
    "feed-forward",
    "combined",
    "constant-tension",
)
HEARS_NO_PAYLOAD = ("feed-forward", "constant-tension")
# White noise sampled at 4 Hz has the density s^2/(2 Hz) up to 2 Hz: pi/(2 sqrt 2) times the
# corner is the bandwidth of a Butterworth low-pass of second order, so 11.31 rad/s is 2 Hz.
MRU = {
    "noise": {"noise_floor": 0.0, "noise_fraction": 0.01, "noise_bandwidth": 11.31},
    "datasheet": {"noise_floor": 0.05, "noise_fraction": 0.05},
}
LIMITS = {
    "limits.drive": "report",
    "limits.max_sensitivity": 2.0,
    "limits.gain_margin_down": 0.5,
}


def case_at(length: float | None, delay: float, mru: str) -> Case:
    """Return the case: one spring without a length, else the rope of that length [m]."""
    changes = {**LIMITS, "sensors.telemetry.delay": delay, "sensors.mru": MRU[mru]}
    if length is None:
        return load_case("thesis-1975").replace(changes)
    return load_case("thesis-1975-rope").replace({**changes, "rope.length": length})


def row(case: Case, name: str, starts: int) -> tuple[str, str]:
    """Return the payload's rms [mm] of a structure, and a note."""
    begin = time.perf_counter()
    design = optimise_structure(case, name, starts=starts)
    wall = time.perf_counter() - begin
    ms = design.margins.max_sensitivity if design.margins is not None else float("nan")
    parts = ", ".join(f"{k} {1e3 * v:.3g}" for k, v in design.parts.items())
    torque = design.limits.get("motor.torque.peak")
    drive = f"torque {torque.use:.2f}" if torque is not None else ""
    note = f"M_s {ms:.2f}; {parts}; {drive}; {design.agreed}/{design.starts} agree; {wall:.0f} s"
    mark = "" if design.ok else f" (not ok: {design.status})"
    return f"{1e3 * design.payload_rms:.4g}{mark}", note


def main(argv: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--starts", type=int, default=4)
    parser.add_argument("--structures", default=",".join(STRUCTURES))
    parser.add_argument("--lengths", default=",".join(f"{v:g}" for v in LENGTHS) + ",spring")
    parser.add_argument("--delays", default=",".join(f"{v:g}" for v in DELAYS) + ",acoustic")
    parser.add_argument("--mru", choices=tuple(MRU), default="noise")
    given = parser.parse_args(argv)
    print("| rope | structure | delay | payload [mm rms] | |\n| --- | --- | --- | --- | --- |")
    for text in given.lengths.split(","):
        length = None if text == "spring" else float(text)
        for name in given.structures.split(","):
            for k, word in enumerate(given.delays.split(",")):
                if name in HEARS_NO_PAYLOAD and k > 0:
                    continue
                if word == "acoustic" and length is None:
                    continue
                delay = (length or 0.0) / SOUND if word == "acoustic" else float(word)
                rms, note = row(case_at(length, delay, given.mru), name, given.starts)
                late = "any" if name in HEARS_NO_PAYLOAD else f"{1e3 * delay:.0f} ms"
                where = "one spring" if length is None else f"{length:g} m"
                print(f"| {where} | {name} | {late} | {rms} | {note} |", flush=True)


if __name__ == "__main__":
    warnings.simplefilter("ignore", PhysicsWarning)
    main()
