"""RAOs from OrcaFlex: the vessel types of a text data file (.yml).

The file tells every convention there is, and each of them is honoured: lead or lag, degrees or
radians, relative to crest, trough or zero crossing; period or frequency; angles over amplitude,
largest wave slope or steepness; the positive direction of each motion; symmetry; and *two* points,
the one whose motions the RAOs are (`RAOOrigin`) and the one where the wave has zero phase
(`PhaseOrigin`, `~` for the former).  Both are given in the vessel's axes, x forward, y to port, z
up, whatever the positive directions are; directions are where the waves travel towards (Orcina,
OrcaFlex help, *Vessel types: Conventions* and *RAOs*).  Slope and steepness go by the wave length
in deep water, as OrcaFlex itself does.

Of the units only that of length matters to motions: rotations are per length of wave, points and
water depth are lengths.  `UnitsSystem` SI has metres, US feet, User what `LengthUnits` says.

Older versions write `RAOPeriodOrFreq` where newer ones write `RAOPeriodOrFrequency`.
"""

import cmath
import json
import math
import re
from typing import Any

import numpy as np

from ...basics import (
    ComplexArray,
    FloatArray,
    InputError,
    check_finite,
    check_range,
    read_quantity,
    wave_number,
)
from ..assemble import finished, grid
from ..convention import Convention, one_of
from ..raos import MODES, VesselRaos
from ..symmetry import SYMMETRIES
from .wamit import at_rest

Entry = dict[str, Any]

_SECTION = "DisplacementRAOs"
_TOLD = r"^[ ]*{key}:[ ]*([^\s#]+)"  # a key of the model, above its vessel types
_PERIODS = (1e-6, 1e6)
_TABLE_KEYS = ("RAOPeriodOrFrequency", "RAOPeriodOrFreq")
"""How the heading of a RAO table begins, in newer and in older versions."""

_KEPT = {"VesselTypes", "Draughts", _SECTION, "RAOs"}
_COLUMNS = 13
_KEY = re.compile(r"^(?P<indent>[ ]*(?:- +)*)(?P<key>[A-Za-z][^:#\[\]{}]*?):(?P<rest>\s.*|)$")
_ROW = re.compile(r"\[([^\[\]]*)\]")
_MARK = "@table"
_NO_TYPES = (
    "there is no list of VesselTypes in this file; is it an OrcaFlex text file with a vessel type?"
)
_LONGEST = 400_000  # lines


def looks_like_orcaflex(text: str) -> bool:
    """Say whether a text has vessel types, or tables of RAOs as OrcaFlex heads them."""
    return "VesselTypes:" in text or any(f"{key}," in text for key in _TABLE_KEYS)


def parse_orcaflex(
    owner: str,
    text: str,
    *,
    vessel_type: str | None = None,
    draught: str | None = None,
    depth: float | None = None,
) -> VesselRaos:
    """Return the motions at one draught of one vessel type.

    Arguments are those of `read_raos`; by default the first that has RAOs.

    Raises InputError if the file is something else, cut off, lacks a convention or knows one that
    OrcaFlex does not have, or the vessel type, the draught or its RAOs are not there.
    """
    unit, metres = _length_unit(owner, text)
    types, tables = _vessel_types(owner, text)
    found = _candidates(owner, types, vessel_type, draught)
    vessel, state, block = found[0]
    convention = _convention(owner, vessel)
    omega, heading, values = _table(owner, block, tables, convention)
    if convention.rotations in ("rad/m", "deg/m"):
        values[:, :, 3:] /= metres
    middle = (0.0, 0.0, 0.0)
    origin = _point(owner, f"{_SECTION}.RAOOrigin", block.get("RAOOrigin"), middle, metres)
    zero = _point(owner, f"{_SECTION}.PhaseOrigin", block.get("PhaseOrigin"), origin, metres)
    symmetry = one_of(owner, "Symmetry", vessel.get("Symmetry", "None"), SYMMETRIES)
    title = str(vessel.get("Name", "vessel"))
    notes = [
        f"OrcaFlex vessel type {title!r}, draught {state.get('Name', '1')!r}",
        f"conventions of the file: {convention.words()}",
    ]
    if metres != 1.0:
        notes.append(f"lengths of the file are in {unit}: converted")
    if depth is None:
        depth = _water_depth(owner, text, metres)
    if len(found) > 1:
        rest = ", ".join(f"{v.get('Name')!r} {d.get('Name')!r}" for v, d, _ in found[1:4])
        notes.append(f"other RAOs in the file: {rest}{', ..' if len(found) > 4 else ''}")
    raos = VesselRaos(
        name=title, omega=omega, heading=heading, values=values, origin=origin,
        phase_origin=zero[:2], depth=depth, source=owner, notes=tuple(notes),
    )  # fmt: skip
    return finished(raos, symmetry=symmetry)


def orcaflex_text(raos: VesselRaos) -> str:
    """Return a table as an OrcaFlex text file with one vessel type, in SI units.

    Raises InputError if the vessel moves forward.
    """
    found = at_rest(raos, "an OrcaFlex file")
    name, own = json.dumps(raos.name), Convention()
    origin = ", ".join(repr(each) for each in raos.origin)
    zero = ", ".join(repr(each) for each in (*raos.phase_origin, raos.origin[2]))
    depth = [] if math.isinf(raos.depth) else ["Environment:", f"  WaterDepth: {raos.depth!r}"]
    lines = [
        "%YAML 1.1", "---", "General:", "  UnitsSystem: SI", *depth, "VesselTypes:",
        f"  - Name: {name}", "    RAOResponseUnits: radians", "    RAOWaveUnit: amplitude",
        f"    WavesReferredToBy: {own.waves}", f"    RAOPhaseConvention: {own.phase}",
        f"    RAOPhaseUnitsConvention: {own.phase_unit}",
        f"    RAOPhaseRelativeToConvention: {own.phase_relative_to}",
        f"    SurgePositive: {own.surge}", f"    SwayPositive: {own.sway}",
        f"    HeavePositive: {own.heave}",
        f"    RollPositiveStarboard: {own.roll.rpartition(' ')[2]}",
        f"    PitchPositiveBow: {own.pitch.rpartition(' ')[2]}",
        f"    YawPositiveBow: {own.yaw.rpartition(' ')[2]}", "    Symmetry: None",
        "    Draughts:", "      - Name: Draught1", f"        {_SECTION}:",
        f"          RAOOrigin: [{origin}]", f"          PhaseOrigin: [{zero}]", "          RAOs:",
    ]  # fmt: skip
    parts = (f"RAO{mode.capitalize()}{part}" for mode in MODES for part in ("Amp", "Phase"))
    head = ", ".join([_TABLE_KEYS[0], *parts])
    for j, degrees in enumerate(found.heading_deg):
        lines += [f"            - RAODirection: {float(degrees)!r}", f"              {head}:"]
        for i, omega in enumerate(found.omega):
            cells = [float(omega)]
            for value in found.values[i, j]:
                cells += [abs(value), math.degrees(cmath.phase(value))]
            row = ", ".join(repr(float(cell)) for cell in cells)
            lines.append(f"                - [{row}]")
    return "\n".join(lines) + "\n"


def _told(text: str, key: str) -> str | None:
    """Return what the model says under a key that it has once, if it does."""
    found = re.search(_TOLD.format(key=key), text, re.MULTILINE)
    return found[1] if found else None


def _length_unit(owner: str, text: str) -> tuple[str, float]:
    """Return the unit of length of a file, and its size [m]."""
    system = _told(text, "UnitsSystem") or "SI"
    if system not in {"SI", "US", "User"}:
        raise InputError(f"{owner}: UnitsSystem must be one of SI, US, User; got {system!r}")
    unit = {"SI": "m", "US": "ft"}.get(system) or _told(text, "LengthUnits")
    if unit is None:
        raise InputError(f"{owner}: LengthUnits is missing, which UnitsSystem User asks for")
    try:
        return unit, float(read_quantity(f"1 {unit}", "length"))
    except InputError:
        raise InputError(
            f"{owner}: LengthUnits must be a length such as m, km, ft; got {unit!r}"
        ) from None


def _water_depth(owner: str, text: str, metres: float) -> float:
    """Return the water depth that the model has [m], infinite where it tells of none."""
    told = _told(text, "WaterDepth")
    if told is None or told == "~":
        return math.inf
    return metres * check_range(owner, "WaterDepth", told, low=0.0, open_low=True)


def _candidates(
    owner: str, types: list[Entry], vessel_type: str | None, draught: str | None
) -> list[tuple[Entry, Entry, Entry]]:
    """Return what has RAOs and the names asked for: vessel type, draught, the RAOs' block."""
    found = []
    names = []
    for vessel in types:
        states = vessel.get("Draughts")
        for state in states if isinstance(states, list) else [vessel]:
            if not isinstance(state, dict):
                continue
            names.append(f"{vessel.get('Name')!r} {state.get('Name')!r}")
            asked = vessel_type in {None, str(vessel.get("Name"))}
            asked = asked and draught in {None, str(state.get("Name"))}
            block = state.get(_SECTION)
            if asked and isinstance(block, dict) and _has_table(block):
                found.append((vessel, state, block))
    if not found:
        wanted = " ".join(repr(x) for x in (vessel_type, draught) if x is not None)
        raise InputError(
            f"{owner}: there are no {_SECTION} for {wanted or 'any vessel type'} in this file, "
            f"which has {', '.join(names[:6]) or 'no draught'}"
            "; it may have load RAOs only"
        )
    return found


def _has_table(block: Entry) -> bool:
    rows = block.get("RAOs")
    return isinstance(rows, list) and any(isinstance(r, dict) and _entry(r) for r in rows)


def _entry(row: Entry) -> Any:
    """Return the table of a direction, whatever the version calls it."""
    for key, value in row.items():
        if str(key).startswith(_TABLE_KEYS):
            return value
    return None


def _convention(owner: str, vessel: Entry) -> Convention:
    """Return what the vessel type says its numbers mean."""

    def told(key: str, choices: tuple[str, ...]) -> str:
        if key not in vessel:
            raise InputError(
                f"{owner}: {key} is missing (one of {', '.join(choices)}); without it the RAOs "
                "mean nothing; is the file cut off?"
            )
        return one_of(owner, key, vessel[key], choices)

    unit = told("RAOResponseUnits", ("degrees", "radians"))
    wave = told("RAOWaveUnit", ("amplitude", "max wave slope", "wave steepness"))
    # Over a slope in the same unit, degrees and radians are the same number.
    rotations = ("deg/m" if unit == "degrees" else "rad/m") if wave == "amplitude" else wave
    return Convention(
        waves=told("WavesReferredToBy", ("period (s)", "frequency (rad/s)", "frequency (Hz)")),
        phase=told("RAOPhaseConvention", ("leads", "lags")),
        phase_unit=told("RAOPhaseUnitsConvention", ("degrees", "radians")),
        phase_relative_to=told(
            "RAOPhaseRelativeToConvention",
            ("crest", "trough", "zero up-crossing", "zero down-crossing"),
        ),
        rotations=rotations,
        surge=told("SurgePositive", ("forward", "aft")),
        sway=told("SwayPositive", ("port", "starboard")),
        heave=told("HeavePositive", ("up", "down")),
        roll=f"starboard {told('RollPositiveStarboard', ('down', 'up'))}",
        pitch=f"bow {told('PitchPositiveBow', ('down', 'up'))}",
        yaw=f"bow to {told('YawPositiveBow', ('port', 'starboard'))}",
    )


def _table(
    owner: str, block: Entry, tables: list[FloatArray], convention: Convention
) -> tuple[FloatArray, FloatArray, ComplexArray]:
    """Return frequencies, headings and operators of a block of RAOs."""
    omega, heading, values = [], [], []
    for row in block["RAOs"]:
        entry = _entry(row) if isinstance(row, dict) else None
        if not entry:
            continue
        direction = check_range(owner, "RAODirection", row.get("RAODirection"), unit="deg")
        table = _table_of(owner, entry, tables)
        first = table[:, 0]
        low, high = _PERIODS
        # An infinite or zero period is no wave of a sea.
        real = (first > low) & (first < high)
        if not np.any(real):
            raise InputError(f"{owner}: no period or frequency in ({low:g}, {high:g}) in a table")
        frequency = convention.omega(first[real])
        omega.append(frequency)
        heading.append(np.full(frequency.size, float(convention.directions(direction))))
        slope = wave_number(frequency)
        values.append(convention.values(table[real, 1::2], table[real, 2::2], slope))
    rows = np.concatenate(values)
    if not np.any(rows):
        raise InputError(
            f"{owner}: all RAOs of this vessel type are zero: they were never filled in"
        )
    return grid(owner, np.concatenate(omega), np.concatenate(heading), rows)


def _point(
    owner: str, name: str, value: object, default: tuple[float, float, float], metres: float
) -> tuple[float, float, float]:
    """Return a point of the vessel [m] told in a unit of so many metres; `~` is the default [m]."""
    if value is None:
        return default
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(f"{owner}: {name} must be 3 numbers, got {value!r}")
    filled = [
        d / metres if v is None or v == "~" else v for v, d in zip(value, default, strict=True)
    ]
    x, y, z = metres * check_finite(owner, name, filled)
    if max(abs(x), abs(y), abs(z)) > 1e4:
        raise InputError(f"{owner}: {name} must be within 10 km, got {value!r}")
    return float(x), float(y), float(z)


def _vessel_types(owner: str, text: str) -> tuple[list[dict[str, Any]], list[FloatArray]]:
    """Return the vessel types of a file, and the tables that they point at.

    Where one of them has a table of RAOs, the text "@table 3" stands for the third table, with 13
    columns.
    """
    from ruamel.yaml import YAML

    pruned, tables = _pruned(owner, text)
    found = YAML(typ="safe", pure=True).load(pruned)
    types = found.get("VesselTypes") if isinstance(found, dict) else None
    if not isinstance(types, list) or not types or not all(isinstance(t, dict) for t in types):
        raise InputError(f"{owner}: {_NO_TYPES}")
    return types, tables


def _pruned(owner: str, text: str) -> tuple[str, list[FloatArray]]:
    """Return what leads to the RAOs, with marks for the tables, and the tables.

    Such a file may be a whole model of tens of thousands of lines, and a YAML reader in Python
    takes seconds for it.  So it is pruned before it is read: blocks below a vessel type that are
    not on the way to the RAOs are skipped by their indentation, and the tables of numbers are taken
    out and read by numpy.  What is left, some dozens of lines of names and conventions, goes to the
    YAML reader.
    """
    lines = text.splitlines()
    if len(lines) > _LONGEST:
        raise InputError(f"{owner}: must have at most {_LONGEST} lines, got {len(lines)}")
    kept: list[str] = []
    tables: list[FloatArray] = []
    heads = (n for n, line in enumerate(lines) if line.strip().startswith("VesselTypes:"))
    i = first = next(heads, -1)
    if first < 0:
        raise InputError(f"{owner}: {_NO_TYPES}")
    base = len(lines[first]) - len(lines[first].lstrip())
    while i < len(lines):
        line = lines[i]
        indent = len(line) - len(line.lstrip())
        blank = not line.strip() or line.lstrip().startswith("#")
        if i > first and not blank and indent <= base and not line.lstrip().startswith("- "):
            break  # the next section of the model
        match = _KEY.match(line)
        i += 1
        if blank:
            continue
        if match is None:
            kept.append(line)
            continue
        column = len(match["indent"])
        key, rest = match["key"], match["rest"].split(" #")[0].strip()
        if key.startswith(_TABLE_KEYS) and not rest:
            end = _end(lines, i, column)
            table = _rows_of_text(lines[i:end])
            if table is not None:
                kept.append(f'{match["indent"]}{_heading(key)}: "{_MARK} {len(tables)}"')
                tables.append(table)
                i = end
                continue
        elif not rest and key not in _KEPT:
            i = _end(lines, i, column)
            continue
        kept.append(f"{match['indent']}{_heading(key)}: {rest}" if "," in key else line)
    return "\n".join(kept), tables


def _heading(key: str) -> str:
    return f'"{key}"' if '"' not in key else key


def _end(lines: list[str], start: int, column: int) -> int:
    """Return where the block below a key in this column ends."""
    for number in range(start, len(lines)):
        line = lines[number]
        body = line.lstrip()
        if not body or body.startswith("#"):
            continue
        indent = len(line) - len(body)
        # A list may stand in the column of its key.
        if indent < column or (indent == column and not body.startswith("- ")):
            return number
    return len(lines)


def _rows_of_text(lines: list[str]) -> FloatArray | None:
    """Return a list of flow sequences of 13 numbers, or None if the lines are something else."""
    text = " ".join(line.split("#")[0] for line in lines)
    rows = _ROW.findall(text)
    if not rows or re.sub(r"[\s-]", "", _ROW.sub("", text)):
        return None
    try:
        table = [[float(word) for word in row.split(",") if word.strip()] for row in rows]
    except ValueError:
        return None
    if any(len(row) != _COLUMNS for row in table):
        return None
    return np.array(table, dtype=np.float64)


def _table_of(owner: str, entry: object, tables: list[FloatArray]) -> FloatArray:
    """Return the table that an entry of a vessel type points at, or holds itself.

    Raises InputError if it is no table of 13 columns of finite numbers.
    """
    if isinstance(entry, str) and entry.startswith(_MARK):
        index = entry[len(_MARK) :].strip()
        if index.isdigit() and int(index) < len(tables):
            table = tables[int(index)]
            if np.all(np.isfinite(table)):
                return table
    try:
        rows = np.array(entry, dtype=np.float64)
    except (TypeError, ValueError):
        rows = np.empty(0)
    if rows.ndim != 2 or rows.shape[1] != _COLUMNS or not np.all(np.isfinite(rows)):
        raise InputError(
            f"{owner}: a table of RAOs must have 13 columns of finite numbers: period or "
            "frequency, then amplitude and phase of the six motions"
        )
    return rows
