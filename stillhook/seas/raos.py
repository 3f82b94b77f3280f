"""A vessel's RAOs as figure and report: amplitudes, phases, and the check in long waves."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from models.vessel import MODES, VesselRaos

from ..text import (
    AFTER,
    BEFORE,
    DRUM,
    HOOK,
    REFERENCE,
    Drawing,
    Report,
    ReportSection,
    Table,
    Written,
    columns,
    drawn,
    headline,
    new_figure,
    pairs,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from models.vessel.readers import LongWaveCheck

_HEADINGS = (0.0, 45.0, 90.0, 135.0, 180.0)
_COLOURS = (AFTER, "#56b4e9", DRUM, BEFORE, REFERENCE)
_DASHES = ("-", (0, (5, 1.5)), "-", (0, (5, 1.5)), "-")
_FAINT = 0.02  # of a motion's largest amplitude, below which its phase says nothing


@drawn
def rao_figure(raos: VesselRaos) -> Figure:
    """Return amplitudes over frequency above phases, for the headings nearest 0, 45, .. 180 deg.

    Parameters
    ----------
    raos
        The vessel.
    """
    columns = _columns(raos)
    figure = new_figure(9.6, 9.2)
    # Twelve panels in known places: to let matplotlib find them takes a second for each file.
    figure.set_layout_engine("none")
    grid = {
        "left": 0.08, "right": 0.985, "top": 0.925, "bottom": 0.095,
        "hspace": 0.26, "wspace": 0.33, "height_ratios": [1.6, 1.0, 1.6, 1.0],
    }  # fmt: skip
    axes = figure.subplots(4, 3, sharex=True, gridspec_kw=grid)
    for i, mode in enumerate(MODES):
        top, below = axes[2 * (i // 3), i % 3], axes[2 * (i // 3) + 1, i % 3]
        _panel(top, below, raos, mode, columns)
    for below in axes[3]:
        below.set_xlabel("wave frequency [rad/s]")
        below.set_xlim(0.0, _last(raos, columns))
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=len(labels))
    x, y, z = raos.origin
    speed = f", {raos.speed:g} m/s" if raos.speed else ""
    point = f"({x:g}, {y:g}, {z:g}) m"
    return headline(figure, f"{raos.name}: motions of the point {point} per metre of wave{speed}")


def rao_report(raos: VesselRaos, check: LongWaveCheck, *, stem: str = "raos") -> Report:
    """Return what a table of RAOs is, how it was read, and whether it can be true.

    `stem` is the name of its figure.
    """
    drawing = Drawing(stem, "RAOs", lambda: rao_figure(raos))
    return Report(
        name=raos.name,
        about=raos.source,
        status=long_wave_verdict(check),
        mark="ok" if check.ok else "DOUBTFUL" if check.long else "not checked",
        sections=[
            ReportSection("", [pairs(_facts(raos)), drawing]),
            ReportSection("Found and converted", [f"- {note}" for note in raos.notes]),
            long_waves(check),
        ],
    )


def long_waves(check: LongWaveCheck) -> ReportSection:
    """Return the motions in long waves beside those that they have to be."""
    heads = columns(
        "heading; motion <; found; found_phase=phase; expected; expected_phase=phase; verdict=<"
    )
    rows = [
        (
            Written(row.heading_deg, f"{row.heading_deg:.0f} deg"),
            row.motion,
            *(c for x in (row.found, row.expected) for c in (_size(x), _phase(x))),
            row.verdict,
        )
        for row in check.rows
    ]
    title = f"Long waves, {check.omega:.3g} rad/s; angles over the wave slope"
    return ReportSection(title, [Table(columns=heads, rows=rows)])


def long_wave_verdict(check: LongWaveCheck) -> str:
    """Return whether the motions in long waves are those of a ship, in a sentence."""
    where = f"long waves ({check.omega:.3g} rad/s, {check.wave_length:.0f} m)"
    if check.mistake:
        return f"in {where} the motions look like {check.mistake}"
    if check.ok:
        return f"in {where} it heaves with the water and turns with its slope"
    return check.remarks[0] if check.remarks else f"in {where} it does not move as the water does"


def _facts(raos: VesselRaos) -> list[tuple[str, str]]:
    omega, heading = raos.omega, raos.heading_deg
    x, y, z = raos.origin
    gaps = np.diff([*raos.heading, raos.heading[0] + 2.0 * math.pi])
    gap = math.degrees(float(np.max(gaps)))
    return [
        (
            "frequencies",
            f"{omega.size}, {omega[0]:.3g} to {omega[-1]:.3g} rad/s "
            f"(periods {2.0 * math.pi / omega[-1]:.3g} to {2.0 * math.pi / omega[0]:.3g} s)",
        ),
        (
            "headings",
            f"{heading.size}, {heading[0]:.4g} to {heading[-1]:.4g} deg, at most {gap:.4g} deg "
            "apart (0 following, 90 to port, 180 head)",
        ),
        ("motions of the point", f"x {x:g} m forward, y {y:g} m to port, z {z:g} m up"),
        ("water depth", "deep" if math.isinf(raos.depth) else f"{raos.depth:g} m"),
        ("forward speed", f"{raos.speed:g} m/s"),
        ("largest heave, roll, pitch", largest_motions(raos)),
    ]


def largest_motions(raos: VesselRaos) -> str:
    """Return the largest heave, roll and pitch, and where they are."""
    texts = []
    for mode, factor, unit in (
        ("heave", 1.0, "m/m"),
        ("roll", math.degrees(1.0), "deg/m"),
        ("pitch", math.degrees(1.0), "deg/m"),
    ):
        size = np.abs(raos.mode(mode)) * factor
        row, column = np.unravel_index(int(np.argmax(size)), size.shape)
        period = 2.0 * math.pi / raos.omega[row]
        texts.append(
            f"{mode} {size[row, column]:.3g} {unit} ({period:.3g} s, "
            f"{raos.heading_deg[column]:.4g} deg)"
        )
    return ", ".join(texts)


def _size(value: complex) -> Written:
    return Written(abs(value), f"{abs(value):.3f}")


def _phase(value: complex) -> str:
    if abs(value) < 1e-9:
        return "-"
    degrees = math.degrees(math.atan2(value.imag, value.real))
    # -180 and 180 are one; so are 0 and -0.
    rounded = round(degrees)
    return f"{180 if rounded == -180 else rounded + 0} deg"


def _columns(raos: VesselRaos) -> list[int]:
    """Return the headings to draw: those nearest the usual ones, each once."""
    found: list[int] = []
    for degrees in _HEADINGS:
        away = np.abs(np.angle(np.exp(1j * (raos.heading - math.radians(degrees)))))
        nearest = int(np.argmin(away))
        if nearest not in found and away[nearest] < math.radians(40.0):
            found.append(nearest)
    return found or [0]


def _last(raos: VesselRaos, columns: list[int]) -> float:
    """Return the frequency above which the vessel lies still, or the table's last [rad/s]."""
    size = np.abs(raos.values[:, columns]).max(axis=1)
    largest = np.maximum(size.max(axis=0), 1e-12)
    moving = np.flatnonzero((size > _FAINT * largest).any(axis=1))
    return (
        float(raos.omega[min(moving[-1] + 1, raos.omega.size - 1)])
        if moving.size
        else float(raos.omega[-1])
    )


def _panel(top: Axes, below: Axes, raos: VesselRaos, mode: str, columns: list[int]) -> None:
    """Draw one motion: its amplitude, and its phase below."""
    angle = mode in MODES[3:]
    values = raos.mode(mode) * (math.degrees(1.0) if angle else 1.0)
    largest = float(np.abs(values[:, columns]).max())
    for k, column in enumerate(columns):
        amplitude = np.abs(values[:, column])
        phase = np.degrees(np.angle(values[:, column]))
        # What is nothing but rounding has no phase worth drawing.
        shown = np.where(amplitude > _FAINT * largest, phase, np.nan)
        degrees = float(raos.heading_deg[column])
        style: dict[str, Any] = {
            "color": _COLOURS[k % 5], "linestyle": _DASHES[k % 5], "linewidth": 1.4
        }  # fmt: skip
        name = {0: " (following)", 90: " (to port)", 180: " (head)"}.get(round(degrees), "")
        top.plot(raos.omega, amplitude, label=f"{degrees:.0f}°{name}", **style)
        x, y = _broken(raos.omega, shown)
        below.plot(x, y, **style)
    top.set_title(mode, fontsize=10.0, fontweight="bold")
    top.set_ylabel("amplitude [deg/m]" if angle else "amplitude [m/m]", fontsize=9.0)
    # A motion that is nothing but rounding is a flat line at zero.
    top.set_ylim(0.0, 1.08 * largest if largest > 1e-6 else 1.0)
    below.set_ylim(-180.0, 180.0)
    below.set_yticks([-180, -90, 0, 90, 180])
    below.set_ylabel("phase [deg]", fontsize=9.0)
    below.axhline(0.0, color=HOOK, linewidth=0.6)


def _broken(
    omega: np.ndarray[tuple[int], np.dtype[np.float64]],
    phase: np.ndarray[tuple[int], np.dtype[np.float64]],
) -> tuple[list[float], list[float]]:
    """Return the phase with a gap where it leaves at one edge and comes back at the other."""
    x, y = [float(omega[0])], [float(phase[0])]
    for i in range(1, omega.size):
        if abs(phase[i] - phase[i - 1]) > 180.0:
            x.append(float(omega[i]))
            y.append(math.nan)
        x.append(float(omega[i]))
        y.append(float(phase[i]))
    return x, y
