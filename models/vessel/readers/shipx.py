"""RAOs from ShipX (Veres): the `.re1` file, motion transfer functions.

Six lines of text, then numbers: density and gravity; L_pp, B, T; LCG (aft of L_pp/2) and VCG (above
the baseline); how many speeds, headings, frequencies and modes; for each speed a line with the
speed [m/s], sinkage, trim, and the x and z of the point whose motions follow; for each heading its
line [deg]; for each frequency its line [rad/s] and a line of mode, real and imaginary part each.

Convention, as MSS reads it (Fossen, `read_veres_TF.m`), confirmed by the long-wave limits: x aft,
y to starboard, z up; time factor e^{+i omega t}; heading 0 is head sea.  That is the project's
frame turned by half a circle about z, and so are the headings.
"""

import math

import numpy as np

from ...basics import InputError, check_range
from ..assemble import finished, grid, numbers
from ..convention import Convention
from ..raos import VesselRaos

SHIPX = Convention(
    surge="aft", sway="starboard", roll="starboard up", pitch="bow up", heading_zero=180.0
)
"""What the numbers of a `.re1` file mean."""

_HEADER = 6  # lines of text


def looks_like_shipx(text: str) -> bool:
    """Say whether the first lines are those of a Veres file."""
    head = "\n".join(text.splitlines()[:_HEADER]).upper()
    return "TRANSFER FUNCTIONS" in head or "VERES" in head or "SHIPX" in head


class _Lines:
    """Lines of numbers, one after the other."""

    def __init__(self, owner: str, text: str) -> None:
        self.owner = owner
        self.lines = text.splitlines()
        self.at = _HEADER

    def next(self, count: int, what: str) -> list[float]:
        """Return the numbers of the next line, of which there must be `count` at least."""
        while self.at < len(self.lines) and not self.lines[self.at].strip():
            self.at += 1
        if self.at >= len(self.lines):
            raise InputError(
                f"{self.owner}: the file ends after line {len(self.lines)}, where {what} should "
                "be; is the file cut off?"
            )
        words = self.lines[self.at].split()
        self.at += 1
        if len(words) < count:
            raise InputError(
                f"{self.owner}, line {self.at}: {what} should be here ({count} numbers), got "
                f"{' '.join(words)[:60]!r}"
            )
        return numbers(self.owner, self.at, words[:count])


def parse_shipx(owner: str, text: str, *, speed: float | None = None) -> VesselRaos:
    """Return the motions at one speed; arguments are those of `read_raos`.

    Raises InputError if the file is something else, is cut off, has more than it says, or lacks the
    speed.
    """
    head = text.splitlines()[:_HEADER]
    if len(head) < _HEADER or not looks_like_shipx(text):
        raise InputError(f"{owner}: this is no ShipX file: its first lines are not those of one")
    if "FORCE" in head[0].upper():
        raise InputError(
            f"{owner}: this ShipX file holds forces (.re8); the motions are in the .re1 file"
        )
    lines = _Lines(owner, text)
    lines.next(2, "density and gravity")
    _, _, draught = lines.next(3, "length, breadth and draught")
    lines.next(2, "the centre of gravity")
    counts = lines.next(4, "the numbers of speeds, headings, frequencies and modes")
    most = {"speeds": 100, "headings": 1000, "frequencies": 5000, "modes": 6}
    speeds, headings, frequencies, modes = (
        int(check_range(owner, f"number of {what}", value, low=1, high=high))
        for (what, high), value in zip(most.items(), counts, strict=True)
    )
    if modes != 6:
        raise InputError(f"{owner}: number of modes must be 6, got {modes}")
    found: dict[float, tuple[list[float], list[tuple[float, float, list[complex]]]]] = {}
    for _ in range(speeds):
        about = lines.next(5, "speed, sinkage, trim, x and z")
        rows: list[tuple[float, float, list[complex]]] = []
        for _ in range(headings):
            (heading,) = lines.next(1, "a heading [deg]")
            check_range(
                owner, f"heading on line {lines.at}", heading, low=-360, high=720, unit="deg"
            )
            for _ in range(frequencies):
                (frequency,) = lines.next(1, "a frequency [rad/s]")
                check_range(
                    owner, f"frequency on line {lines.at}", frequency, low=0.0, high=100.0,
                    unit="rad/s", open_low=True,
                )  # fmt: skip
                rows.append((frequency, heading, _modes(lines)))
        found[about[0]] = (about, rows)
    rest = [line for line in lines.lines[lines.at :] if line.strip()]
    if rest:
        raise InputError(
            f"{owner}, line {lines.at + 1}: there is more than the file's header counts: "
            f"{rest[0].strip()[:60]!r}"
        )
    chosen, told = chosen_speed(owner, list(found), speed)
    about, rows = found[chosen]
    omega = np.array([row[0] for row in rows])
    direction = SHIPX.directions([row[1] for row in rows])
    table = SHIPX.complex_values([row[2] for row in rows], np.ones(len(rows)))
    w, b, values = grid(owner, omega, direction, table)
    # Their x is aft of midships, their z above the baseline; ours are forward and above the water.
    origin = (-about[3], 0.0, about[4] - draught)
    notes = [
        f"ShipX .re1: {SHIPX.words()}; turned half a circle about z",
        f"motions of the point {origin[0]:g} m forward of L_pp/2, {origin[2]:g} m above the still "
        "water, which the file names; positions count from L_pp/2, centre line and still water",
        *told,
    ]
    ship = head[2].partition(":")[2].strip()
    return finished(
        VesselRaos(
            name=ship or "vessel", omega=w, heading=b, values=values, origin=origin,
            phase_origin=origin[:2], speed=chosen, source=owner, notes=tuple(notes),
        )
    )  # fmt: skip


def chosen_speed(owner: str, speeds: list[float], wanted: float | None) -> tuple[float, list[str]]:
    """Return the speed of a file that is asked for, the slowest if none is, and a note of it.

    Raises InputError if the file has no such speed.
    """
    near = 0.0 if wanted is None else wanted
    chosen = min(speeds, key=lambda v: abs(v - near))
    every = ", ".join(f"{v:g}" for v in sorted(speeds))
    if wanted is not None and not abs(chosen - wanted) <= 1e-3:
        raise InputError(f"{owner}: speed must be one of {every} m/s, got {wanted:g} m/s")
    return chosen, [f"speed {chosen:g} m/s of {every} m/s"] if len(speeds) > 1 else []


def _modes(lines: _Lines) -> list[complex]:
    """Return the six operators that follow a frequency."""
    row = [complex(math.nan)] * 6
    for _ in range(6):
        mode, real, imaginary = lines.next(3, "mode, real and imaginary part")
        if mode not in {1.0, 2.0, 3.0, 4.0, 5.0, 6.0} or row[int(mode) - 1] == row[int(mode) - 1]:
            raise InputError(
                f"{lines.owner}, line {lines.at}: the modes 1 to 6 must follow, each once, got "
                f"{mode:g}"
            )
        row[int(mode) - 1] = complex(real, imaginary)
    return row
