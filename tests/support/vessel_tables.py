"""Tables of RAOs for tests, and the texts of files in other programs' formats.

`swinging()` is made up, without symmetry, so that no mix-up of sides, headings or modes can hide;
its long waves keep the limits.  The writers follow each format's description, apart from the
readers; they know the project's convention only.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from models.vessel import VesselRaos
from models.vessel.raos import MIRRORED

DATA = Path(__file__).parents[3] / "shared" / "data"


def swinging(headings: int = 12, *, symmetric: bool = False, seed: int = 3) -> VesselRaos:
    """Motions that keep the limits of long waves and differ everywhere else."""
    rng = np.random.default_rng(seed)
    omega = np.array([0.08, 0.15, 0.3, 0.5, 0.7, 0.9, 1.2, 1.7])
    heading = np.radians(np.arange(headings) * 360.0 / headings)
    k = (omega**2 / 9.80665)[:, None]
    c, s = np.cos(heading)[None, :], np.sin(heading)[None, :]
    shape = (omega.size, heading.size)
    still = 1.0 / (1.0 + (omega[:, None] / 0.8) ** 4)

    def off(size: float) -> np.ndarray:
        values = rng.normal(size=shape) + 1j * rng.normal(size=shape)
        return 1.0 + (0.0 if symmetric else size) * values * (omega[:, None] / 1.7)

    lag = np.exp(-0.4j * omega[:, None])
    values = np.stack(
        [
            -1j * c * still * off(0.1),
            -1j * s * still * off(0.1),
            (1.0 + 0.2 * c * (omega[:, None] / 1.7)) * still * lag * off(0.1),
            -1j * k * s * still * lag * off(0.2),
            1j * k * c * still * lag * off(0.2),
            0.1 * k * s * c * still * off(0.2),
        ],
        axis=-1,
    )
    return VesselRaos(name="swing", omega=omega, heading=heading, values=values, source="made up")


def wamit_text(raos: VesselRaos, *, length: float = 1.0, frequency: bool = False) -> str:
    lines = []
    for i, omega in enumerate(raos.omega):
        first = omega if frequency else 2.0 * math.pi / omega
        for j, degrees in enumerate(raos.heading_deg):
            for mode in range(6):
                value = complex(raos.values[i, j, mode]) * (length if mode > 2 else 1.0)
                phase = math.degrees(cmath.phase(value))
                lines.append(
                    f"{first:.12E} {degrees:.9E} {mode + 1:5d} {abs(value):.9E} {phase:.9E} "
                    f"{value.real:.9E} {value.imag:.9E}"
                )
    return "\n".join(lines) + "\n"


def shipx_text(speeds: dict[float, VesselRaos], *, draught: float = 6.0) -> str:
    """The transfer functions with Veres's axes: x aft, y to starboard, head sea 0 deg."""
    first = next(iter(speeds.values()))
    lines = [" MOTION TRANSFER FUNCTIONS  - VERES", " Run name:", " Ship name: swing", "", "", ""]
    lines += [" 1025.0 9.81", f" 80.0 20.0 {draught}", " 3.0 7.0"]
    lines += [f" {len(speeds)} {first.heading.size} {first.omega.size} 6"]
    sign = (-1, -1, 1, -1, -1, 1)
    for speed, raos in speeds.items():
        x, _, z = raos.origin
        lines.append(f" {speed} 0.0 0.0 {-x} {z + draught}")
        for j, heading in enumerate(raos.heading_deg):
            lines.append(f" {(heading - 180.0) % 360.0:.6f}")
            for i, omega in enumerate(raos.omega):
                lines.append(f" {omega:.9f}")
                for mode in range(6):
                    value = complex(raos.values[i, j, mode]) * sign[mode]
                    lines.append(f" {mode + 1} {value.real:.10E} {value.imag:.10E}")
    return "\n".join(lines) + "\n"


def mss_vessel(raos: VesselRaos, speeds: int = 1) -> dict[str, object]:
    """The structure for scipy.io.savemat: Fossen's axes, z down."""
    sign = np.array([1, -1, -1, 1, -1, -1])
    values = raos.values * sign
    amp, phase = np.empty(6, dtype=object), np.empty(6, dtype=object)
    for mode in range(6):
        table = np.zeros((*values.shape[:2], 10))
        table[:, :, :speeds] = np.abs(values[:, :, mode])[:, :, None]
        amp[mode] = table
        phase[mode] = np.repeat(np.angle(values[:, :, mode])[:, :, None], 10, axis=2)
    headings = np.mod(-raos.heading, 2.0 * math.pi)
    rao = {"amp": amp, "phase": phase, "w": raos.omega}
    return {
        "vessel": {
            "main": {"name": "swing"},
            "motionRAO": rao,
            "headings": headings,
            "velocities": np.arange(float(speeds)),
        }
    }


def orcaflex_phase(value: complex, sense: str, relative_to: str) -> float:
    """The phase by its definition: when the motion is at its largest, against an event [rad].

    The wave is cos(t), the motion |H| cos(t + arg H), at its largest at t = -arg H.
    """
    event = {
        "crest": 0.0,
        "trough": math.pi,
        "zero up-crossing": -0.5 * math.pi,
        "zero down-crossing": 0.5 * math.pi,
    }[relative_to]
    late = -cmath.phase(value) - event
    return late if sense == "lags" else -late


def orcaflex_text(
    raos: VesselRaos,
    *,
    sense: str = "leads",
    relative_to: str = "crest",
    phases: str = "degrees",
    angles: str = "degrees",
    wave: str = "amplitude",
    waves: str = "period (s)",
    signs: tuple[int, ...] = (1, 1, 1, 1, 1, 1),
    symmetry: str = "None",
    directions: list[int] | None = None,
    key: str = "RAOPeriodOrFrequency",
    phase_origin: str = "[~, ~, ~]",
    spread_out: bool = False,
    units: str = "SI",
    metres: float = 1.0,
    depth: float | None = None,
) -> str:
    """A vessel type, with the conventions asked for; lengths in a unit of so many metres."""
    words = [
        ("forward", "aft"), ("port", "starboard"), ("up", "down"),
        ("down", "up"), ("down", "up"), ("port", "starboard"),
    ]  # fmt: skip
    keys = ("SurgePositive", "SwayPositive", "HeavePositive", "RollPositiveStarboard",
            "PitchPositiveBow", "YawPositiveBow")  # fmt: skip
    names = ("Surge", "Sway", "Heave", "Roll", "Pitch", "Yaw")
    x, y, z = (each / metres for each in raos.origin)
    lines = [
        "%YAML 1.1", "# Type: Model", "---", "General:", f"  UnitsSystem: {units}",
        *([] if depth is None else ["Environment:", f"  WaterDepth: {depth / metres!r}"]),
        "VesselTypes:",
        "  - Name: swing", "    Length: ~", f"    RAOResponseUnits: {angles}",
        f"    RAOWaveUnit: {wave}", f"    WavesReferredToBy: {waves}",
        f"    RAOPhaseConvention: {sense}", f"    RAOPhaseUnitsConvention: {phases}",
        f"    RAOPhaseRelativeToConvention: {relative_to}",
        *(f"    {k}: {w[0 if s > 0 else 1]}" for k, w, s in zip(keys, words, signs, strict=True)),
        f"    Symmetry: {symmetry}", "    Draughts:", "      - Name: Draught1", "        Mass: 1",
        "        DisplacementRAOs:", f"          RAOOrigin: [{x}, {y}, {z}]",
        f"          PhaseOrigin: {phase_origin}", "          RAOs:",
    ]  # fmt: skip
    head = ", ".join([key, *(f"RAO{n}{part}" for n in names for part in ("Amp", "Phase"))])
    for j in range(raos.heading.size) if directions is None else directions:
        lines.append(f"            - RAODirection: {raos.heading_deg[j]:.9g}")
        lines.append(f"              {head}:")
        for i, omega in enumerate(raos.omega):
            first = {
                "period (s)": 2.0 * math.pi / omega,
                "frequency (rad/s)": omega,
                "frequency (Hz)": omega / (2.0 * math.pi),
            }[waves]
            # Wave slope in deep water, in the unit of the angles, per metre.
            slope = {"amplitude": 1.0 / metres, "max wave slope": omega**2 / 9.80665,
                     "wave steepness": omega**2 / 9.80665 / math.pi}[wave]  # fmt: skip
            degrees = math.degrees(1.0) if angles == "degrees" and wave == "amplitude" else 1.0
            cells = [repr(float(first))]
            for mode in range(6):
                value = complex(raos.values[i, j, mode]) * signs[mode]
                size = abs(value) * (degrees / slope if mode > 2 else 1.0)
                phase = orcaflex_phase(value, sense, relative_to)
                cells += [repr(float(size))]
                cells += [repr(float(math.degrees(phase) if phases == "degrees" else phase))]
            if spread_out:
                lines.append("                - [")
                lines += [f"                    {cell}," for cell in cells]
                lines.append("                  ]")
            else:
                lines.append(f"                - [{', '.join(cells)}]")
    lines += ["        LoadRAOs:", "          RAOs: []", "Lines:", "  - Name: Line1", "..."]
    return "\n".join(lines) + "\n"


def aqwa_text(raos: VesselRaos, *, structure: int = 1, version: str = "2023 R1") -> str:
    """A listing of Aqwa-Line with both tables of RAOs, phases that lag and degrees per metre."""
    gap = " " * 30
    x, y, z = raos.origin
    depth = 1000.0 if math.isinf(raos.depth) else raos.depth
    lines = [
        f" Aqwa-Line    - {version}                64BIT VERSION {version}",
        f"{gap}* * * * G L O B A L   P A R A M E T E R S * * * *",
        f"{gap}WATER  DEPTH  . . . . . . . . . . . . . . . . = {depth:11.4f}",
        f"{gap}ACCELERATION  DUE  TO GRAVITY . . . . . . . . =       9.810", "1",
        f"{gap}* * * * F O R   S T R U C T U R E   {structure} * * * *",
        f"{gap}STRUCTURE C.O.G.            GX= {x:9.4f}  GY= {y:9.4f}  GZ= {z:9.4f}", "1",
    ]  # fmt: skip
    head = [
        "", " PERIOD   FREQ   DIRECTION   X   Y   Z   RX   RY   RZ", " ------   -----  ---------",
        " (SECS)  (RAD/S) (DEGREES)    AMP      PHASE    AMP      PHASE", " ---------", "",
    ]  # fmt: skip

    def row(i: int, j: int, *, omega: bool, heading: bool) -> str:
        first, degrees = float(raos.omega[i]), float(raos.heading_deg[j])
        text = f"{2.0 * math.pi / first:8.2f} {first:7.3f}" if omega else " " * 16
        text += f"{degrees if degrees <= 180.0 else degrees - 360.0:11.2f}" if heading else " " * 11
        for mode in range(6):
            value = complex(raos.values[i, j, mode]) * (math.degrees(1.0) if mode > 2 else 1.0)
            text += f"{abs(value):10.4f}{-math.degrees(cmath.phase(value)):8.2f}"
        return text

    for kind in ("", "VEL "):
        every = range(raos.omega.size), range(raos.heading.size)
        structure_line = f"   P A R A M E T E R S   F O R   S T R U C T U R E   {structure} * * * *"
        lines += [structure_line, f"{gap}{kind}R.A.O.S-VARIATION WITH WAVE PERIOD/FREQUENCY", *head]
        for j in every[1]:
            lines += [row(i, j, omega=True, heading=i == 0) for i in every[0]] + [""]
        lines += ["1", structure_line, f"{gap}{kind}R.A.O.S-VARIATION WITH WAVE DIRECTION", *head]
        for i in every[0]:
            lines += [row(i, j, omega=j == 0, heading=True) for j in every[1]] + [""]
        lines.append("1")
    return "\n".join(lines) + "\n"


def wamit_listing_text(
    raos: VesselRaos, *, length: float = 1.0, place: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
) -> str:
    """A listing of WAMIT: exciting forces, then the motions, phases to a whole degree."""
    x, y, z, turn = place
    depth = "infinite" if math.isinf(raos.depth) else f"{raos.depth:.6f}"
    lines = [
        f" {'-' * 71}", "                        WAMIT  Version 7.2(x64)        ", "",
        f" Gravity:     9.81000                Length scale:        {length:.5f}",
        f" Water depth:        {depth}",
        f" XBODY = {x:9.4f} YBODY = {y:9.4f} ZBODY = {z:9.4f} PHIBODY = {turn:5.1f}",
        " Wave period = infinite                                 Wavenumber = zero ",
        "    ADDED-MASS COEFFICIENTS", "     I     J         A(I,J)", "", "     1     1   1.9E+01",
    ]  # fmt: skip
    for i, omega in enumerate(raos.omega):
        lines.append(
            f" Wave period (sec) =  {2.0 * math.pi / omega:.6E}        Wavenumber (kL) =  0"
        )
        for title, name, factor in (
            ("DIFFRACTION EXCITING FORCES AND MOMENTS", "Xh", 63.0),
            ("RESPONSE AMPLITUDE OPERATORS", "RAO", 1.0),
        ):
            lines += ["", f"    {title}", ""]
            for j, degrees in enumerate(raos.heading_deg):
                head = f"     I     Mod[{name}(I)]     Pha[{name}(I)]"
                lines += [f"  Wave Heading (deg) :  {degrees:.2f}", "", head, ""]
                for mode in range(6):
                    value = complex(raos.values[i, j, mode]) * (length if mode > 2 else 1.0)
                    phase = math.degrees(cmath.phase(value))
                    lines.append(f"     {mode + 1}   {factor * abs(value):.6E}   {phase:12.0f}")
                lines.append("")
    return "\n".join(lines) + "\n"


def mirrored(raos: VesselRaos) -> VesselRaos:
    """Return the mirror image of a vessel: port and starboard swapped."""
    heading = np.mod(-raos.heading, 2.0 * math.pi)
    order = np.argsort(heading)
    x, y, z = raos.origin
    return replace(
        raos,
        heading=heading[order],
        values=(raos.values * MIRRORED)[:, order],
        origin=(x, -y, z),
        phase_origin=(raos.phase_origin[0], -raos.phase_origin[1]),
    )
