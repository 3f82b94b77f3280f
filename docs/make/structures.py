"""Every structure on the 1975 winch, by depth and delay of the telemetry, as CSV.

    nice -n 19 python docs/make/structures.py [--starts N] [--structures A,B] [--lengths 2000,300]

M_s <= 2, lower gain margin <= 0.5; what the drive would need is reported, not enforced.  The
reference unit's error is white noise of 1 % of the heave's rms sampled at 4 Hz.  Delays: given
ones, and that of an acoustic link at 1500 m/s; light in an umbilical takes 10 us for 2000 m, which
is no delay here.

It takes hours, and can be stopped at any time: rows that today's code has made are not done again,
and those of other code are where searches begin.  The first pass goes from the simple structures to
those that contain them and from the longest delay to none, each search beginning with its
neighbours' answers too.  Further passes (``--passes``) look at every row again from the answers
around it, until none gets better.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import time
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path

from stored import digest_of, docs_folder, read_rows, study_parser, write_rows

from models import Case, PhysicsWarning, load_case
from synth.design import Design, optimise_gains
from synth.question import PAYLOAD

DELAYS = (0.1, 0.05, 0.025, 0.0)
LENGTHS = (2000.0, 1000.0, 300.0, 100.0)
SOUND = 1500.0  # m/s
#: Simple ones before those that contain them: their answers are starts.
STRUCTURES = (
    "feed-forward",
    "constant-tension",
    "payload-feedback",
    "payload-feedback-rolloff",
    "drum-feedback",
    "combined",
)
WITHIN: Mapping[str, tuple[str, ...]] = {
    "payload-feedback-rolloff": ("payload-feedback",),
    "payload-feedback-lead": ("payload-feedback",),
    "payload-feedback-notch": ("payload-feedback-rolloff",),
    "payload-feedback-integral": ("payload-feedback-rolloff",),
    "combined": ("feed-forward", "drum-feedback"),
}
HEARS_NO_PAYLOAD = ("feed-forward", "constant-tension")
# White noise sampled at 4 Hz has the density s^2/(2 Hz) up to 2 Hz: pi/(2 sqrt 2) times the
# corner is the bandwidth of a Butterworth low-pass of second order, so 11.31 rad/s is 2 Hz.
MRU = {"noise_floor": 0.0, "noise_fraction": 0.01, "noise_bandwidth": 11.31}
CELL = {"bandwidth": 1e4}  # exact, and as good as at once [rad/s]
LIMITS = {
    "limits.drive": "report",
    "limits.max_sensitivity": 2.0,
    "limits.gain_margin_down": 0.5,
}
OUTPUT = Path(__file__).parents[2] / "docs" / "data" / "structures.csv"
_BETTER = 1e-3  # relative, of the payload's rms that counts as better
_DIGITS = 9


@dataclass(frozen=True, kw_only=True)
class Row:
    """One row: lengths in m, delays in s, payload motions in m rms."""

    rope: str  # its length, or "one spring"
    structure: str
    delay: float
    link: str  # "given", "acoustic" or "any"
    ok: bool = False
    payload_rms: float = float("nan")
    from_sea: float = 0.0
    from_reference_unit: float = 0.0
    drum_held: float = float("nan")
    hook_rms: float = float("nan")
    max_sensitivity: float = float("nan")
    gain_margin_down: float = float("nan")
    delay_margin: float = float("nan")
    torque_peak_use: float = float("nan")
    checks: int = 0  # of the independent verification
    binding: str = ""
    at_bounds: str = ""
    masses: int = 0
    starts: int = 0
    agreed: int = 0
    seconds: float = 0.0
    code: str = ""  # that made it
    parameters: Mapping[str, float] = field(default_factory=dict)

    @property
    def key(self) -> tuple[str, str, str, float]:
        """What the row is about."""
        return self.rope, self.structure, self.link, round(self.delay, 6)

    @property
    def length(self) -> float | None:
        """Length of the rope [m], None on one spring."""
        return None if self.rope == "one spring" else float(self.rope)


def questions(structures: Sequence[str], ropes: Sequence[str]) -> list[Row]:
    """Return the rows to be filled, in the order in which they are."""
    rows = []
    for structure in structures:
        for rope in ropes:
            if structure in HEARS_NO_PAYLOAD:
                rows.append(Row(rope=rope, structure=structure, delay=0.0, link="any"))
                continue
            delays = [(d, "given") for d in DELAYS]
            if rope != "one spring":
                delays.append((float(rope) / SOUND, "acoustic"))
            rows += [
                Row(rope=rope, structure=structure, delay=d, link=link)
                for d, link in sorted(delays, reverse=True)
            ]
    return rows


def case_of(row: Row) -> Case:
    """Return the case of a row."""
    changes = {**LIMITS, "sensors.telemetry.delay": row.delay, "sensors.mru": MRU}
    changes |= {"sensors.load_cell": CELL}
    if row.length is None:
        return load_case("thesis-1975").replace(changes)
    return load_case("thesis-1975-rope").replace({**changes, "rope.length": row.length})


def filled(row: Row, design: Design, seconds: float) -> Row:
    """Return a row with what a design says."""
    margins, torque = design.margins, design.limits.get("motor.torque.peak")
    checked, parts = design.verification, design.shares.get(PAYLOAD, {})
    return replace(
        row,
        ok=design.ok,
        payload_rms=design.payload_rms,
        from_sea=parts.get("hook.heave", 0.0),
        from_reference_unit=parts.get("mru.error", 0.0),
        drum_held=design.payload_rms_before,
        hook_rms=design.hook_rms,
        max_sensitivity=margins.max_sensitivity if margins else float("nan"),
        gain_margin_down=margins.gain_down if margins else float("nan"),
        delay_margin=margins.delay if margins else float("nan"),
        torque_peak_use=torque.use if torque else float("nan"),
        checks=sum(check.ok for check in checked.checks) if checked else 0,
        binding=" ".join(design.binding),
        at_bounds=" ".join(design.at_bounds),
        masses=design.masses,
        starts=len(design.starts),
        agreed=design.agreed,
        seconds=seconds,
        parameters=design.parameters,
    )


def read(path: Path) -> dict[tuple[str, str, str, float], Row]:
    """Return the rows of a file by what they are about; none if there is no file."""
    if not path.exists():
        return {}
    rows = {}
    for entry in read_rows(path):
        values: dict[str, object] = {}
        for column in fields(Row):
            text = entry.get(column.name, "")
            if column.name == "parameters":
                pairs = (item.partition("=") for item in text.split(";") if item)
                values[column.name] = {name: float(value) for name, _, value in pairs}
            elif column.type == "bool":
                values[column.name] = text == "yes"
            else:
                values[column.name] = {"float": float, "int": int}.get(column.type, str)(text)
        row = Row(**values)  # type: ignore[arg-type]
        rows[row.key] = row
    return rows


def write(path: Path, rows: Mapping[tuple[str, str, str, float], Row]) -> None:
    """Write all rows, in the order of the questions, at once."""
    ropes = [*(f"{v:g}" for v in LENGTHS), "one spring"]
    order = [row.key for row in questions(STRUCTURES, ropes)]
    listed = sorted(rows.values(), key=lambda r: order.index(r.key) if r.key in order else 9999)
    names = [column.name for column in fields(Row)]
    write_rows(path, names, ({name: _text(getattr(row, name)) for name in names} for row in listed))


def _text(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.{_DIGITS}g}"
    if isinstance(value, Mapping):
        return ";".join(f"{name}={number:.{_DIGITS}g}" for name, number in value.items())
    return str(value)


def guesses(row: Row, rows: Mapping[tuple[str, str, str, float], Row]) -> list[dict[str, float]]:
    """Return the parameters of the answers around a row.

    Those of the next delays up and down, of the next ropes, and of the structures within.
    """
    found = []
    for name in WITHIN.get(row.structure, ()):
        same = [r for r in rows.values() if r.structure == name and r.rope == row.rope and r.ok]
        found += sorted(same, key=lambda r: abs(r.delay - row.delay))[:1]
    own = [r for r in rows.values() if r.structure == row.structure and r.key != row.key and r.ok]
    beside = [r for r in own if r.rope == row.rope]
    longer = [r for r in beside if r.delay > row.delay]
    shorter = [r for r in beside if r.delay <= row.delay]
    found += sorted(longer, key=lambda r: r.delay)[:1]
    found += sorted(shorter, key=lambda r: -r.delay)[:1]
    alike = [r for r in own if r.rope != row.rope and abs(r.delay - row.delay) < 0.02]
    length = row.length or LENGTHS[-1]
    found += sorted(alike, key=lambda r: abs(float(r.length or LENGTHS[-1]) - length))[:2]
    return [dict(r.parameters) for r in found if r.parameters]


def answered(row: Row, near: Sequence[Mapping[str, float]], starts: int) -> Row:
    """Return a row filled by a search."""
    began = time.process_time()
    design = optimise_gains(case_of(row), row.structure, starts=starts, guesses=near)
    return filled(row, design, time.process_time() - began)


def main(argv: Sequence[str] | None = None) -> None:
    """Fill the file."""
    parser = study_parser(__doc__)
    parser.add_argument("--starts", type=int, default=8)
    parser.add_argument("--passes", type=int, default=3)
    parser.add_argument("--structures", default=",".join(STRUCTURES))
    parser.add_argument("--lengths", default=",".join(f"{v:g}" for v in LENGTHS) + ",spring")
    given = parser.parse_args(argv)
    if given.quick:
        given.starts, given.passes, given.structures, given.lengths = (
            1,
            1,
            "payload-feedback",
            "300",
        )
    output = docs_folder(given.quick) / "data" / OUTPUT.name
    ropes = ["one spring" if v == "spring" else v for v in given.lengths.split(",")]
    asked = questions(given.structures.split(","), ropes)
    rows, code = read(output), digest_of("docs/make/structures.py")
    for k in range(given.passes):
        better = 0
        for row in asked:
            known = rows.get(row.key)
            if known is not None and k == 0 and known.ok and known.code == code:
                continue
            # Within a pass after the first, a few starts beside the neighbours' answers.
            near = guesses(row, rows)
            if known is not None and known.parameters:
                near.insert(0, dict(known.parameters))
            if known is not None and known.code != code:
                known = None
            new = replace(answered(row, near, given.starts if k == 0 else 1), code=code)
            if known is not None and known.ok:
                if not (new.ok and new.payload_rms < known.payload_rms * (1.0 - _BETTER)):
                    continue
                better += 1
            rows = {**read(output), row.key: new}
            write(output, rows)
            status = "" if new.ok else " (not ok)"
            print(
                f"pass {k + 1}: {row.rope}, {row.structure}, {1e3 * row.delay:.0f} ms: "
                f"{1e3 * new.payload_rms:.4g} mm{status}, {new.seconds:.0f} s",
                flush=True,
            )
        print(f"pass {k + 1}: {better} rows got better", flush=True)
        if k > 0 and not better:
            break


if __name__ == "__main__":
    warnings.simplefilter("ignore", PhysicsWarning)
    main()
