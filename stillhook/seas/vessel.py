"""A vessel as figures and reports: her RAOs and the check in long waves, her hull afloat.

RAOs are shown as amplitudes and phases, a hull by its panels from three sides.
"""

import math
from typing import Any

import numpy as np

from models.basics import FloatArray
from models.vessel import MODES, VesselRaos
from models.vessel.hull import HullVessel
from models.vessel.readers import LongWaveCheck

from ..text import (
    AFTER,
    BEFORE,
    DRUM,
    HOOK,
    REFERENCE,
    Axes,
    Drawing,
    Figure,
    Report,
    ReportSection,
    Table,
    Written,
    columns,
    drawn,
    headline,
    new_figure,
    number,
    pairs,
    percent,
    quantity,
    remarks,
)

_HEADINGS = (0.0, 45.0, 90.0, 135.0, 180.0)
_COLOURS = (AFTER, "#56b4e9", DRUM, BEFORE, REFERENCE)
_DASHES = ("-", (0, (5, 1.5)), "-", (0, (5, 1.5)), "-")
_FAINT = 0.02  # of a motion's largest amplitude, below which its phase says nothing


@drawn
def rao_figure(raos: VesselRaos) -> Figure:
    """Return amplitudes over frequency above phases, for the headings nearest 0, 45, .. 180 deg."""
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
        ok=check.ok,
        mark=_mark(check),
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
            row.verdict if check.long else "not long",
        )
        for row in check.rows
    ]
    title = f"Long waves, {check.omega:.3g} rad/s; angles over the wave slope"
    return ReportSection(title, [Table(columns=heads, rows=rows)])


def _mark(check: LongWaveCheck) -> str:
    """Return the word before the verdict."""
    return "ok" if check.ok else "DOUBTFUL" if check.long else "not checked"


def long_wave_verdict(check: LongWaveCheck) -> str:
    """Return whether the motions in long waves are those of a ship, in a sentence."""
    where = f"long waves ({check.omega:.3g} rad/s, {check.wave_length:.0f} m)"
    if check.mistake:
        return f"in {where} the motions look like {check.mistake}"
    if check.ok:
        turns = any(row.motion in ("roll", "pitch") for row in check.rows)
        what = "turns with its slope" if turns else "has no roll and pitch that could be checked"
        return f"in {where} it heaves with the water and {what}"
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
    beyond = moving[-1] + 1 if moving.size else raos.omega.size
    return float(raos.omega[min(beyond, raos.omega.size - 1)])


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
        # A gap where the phase leaves at one edge and comes back at the other.
        across = np.flatnonzero(np.abs(np.diff(shown)) > 180.0) + 1
        x, y = np.insert(raos.omega, across, raos.omega[across]), np.insert(shown, across, np.nan)
        below.plot(x, y, **style)
    top.set_title(mode, fontsize=10.0, fontweight="bold")
    top.set_ylabel("amplitude [deg/m]" if angle else "amplitude [m/m]", fontsize=9.0)
    # A motion that is nothing but rounding is a flat line at zero.
    top.set_ylim(0.0, 1.08 * largest if largest > 1e-6 else 1.0)
    below.set_ylim(-180.0, 180.0)
    below.set_yticks([-180, -90, 0, 90, 180])
    below.set_ylabel("phase [deg]", fontsize=9.0)
    below.axhline(0.0, color=HOOK, linewidth=0.6)


@drawn
def hull_figure(vessel: HullVessel) -> Figure:
    """Return the panels of a hull in three views, with its centres."""
    panels = vessel.hull.panels
    middle = 0.5 * (panels[..., 0].max() + panels[..., 0].min())
    fore = panels[..., 0].mean(axis=1) > middle
    gravity, plane = vessel.loading.centre, vessel.waterplane
    buoyancy = plane.centre_of_buoyancy
    height = gravity[2] + vessel.metacentric_heights[0]
    figure = new_figure(9.6, 5.6)
    grid = figure.add_gridspec(2, 2, width_ratios=[1.0, 2.3])
    ends = figure.add_subplot(grid[0, 0])
    side = figure.add_subplot(grid[0, 1])
    below = figure.add_subplot(grid[1, 1])
    # As on a body plan: the bow on the right, the stern on the left.
    centred = panels[..., 1].mean(axis=1)
    _draw(ends, panels[fore & (centred <= 0.0)] * (1.0, -1.0, 1.0), 1, 2)
    _draw(ends, panels[~fore & (centred >= 0.0)] * (1.0, -1.0, 1.0), 1, 2)
    port = centred >= 0.0
    _draw(side, panels[port], 0, 2)
    _draw(below, panels, 0, 1)
    for axes, column in ((ends, 1), (side, 0)):
        axes.axhline(0.0, color=AFTER, linewidth=1.0)
        for point, colour, mark, name in (
            (gravity, BEFORE, "o", "centre of gravity"),
            (buoyancy, AFTER, "s", "centre of buoyancy"),
        ):
            axes.plot(point[column], point[2], mark, color=colour, markersize=5.0, label=name)
    ends.plot(0.0, height, "^", color=DRUM, markersize=6.0, label="metacentre")
    ends.set_title("stern | bow", fontsize=9.5, color="#555555")
    side.set_title("from port", fontsize=9.5, color="#555555")
    below.set_title("from below", fontsize=9.5, color="#555555")
    ends.set_xlabel("y [m]")
    ends.set_ylabel("z [m]")
    below.set_xlabel("x forward [m]")
    below.set_ylabel("y [m]")
    side.set_ylabel("z [m]")
    for axes in (ends, side, below):
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(visible=False)
    handles, labels = ends.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower left", frameon=False)
    finding = (
        f"{vessel.raos.name}: {vessel.loading.mass / 1e3:.0f} t, GM "
        f"{vessel.metacentric_heights[0]:.2f} m, rolls in "
        f"{vessel.natural_periods.roll:.1f} s, {vessel.hull.count} panels"
    )
    return headline(figure, finding)


def hull_report(vessel: HullVessel, check: LongWaveCheck, *, stem: str = "raos") -> Report:
    """Return how a hull floats and moves, and whether its motions can be true.

    `stem` is the name of the figure of its RAOs.
    """
    name = "hull" if stem == "raos" else f"{stem}-hull"
    drawings = [
        Drawing(stem, "RAOs", lambda: rao_figure(vessel.raos)),
        Drawing(name, "The hull", lambda: hull_figure(vessel)),
    ]
    afloat, motions = remarks("afloat", _afloat(vessel)), remarks("motions", _motions(vessel))
    return Report(
        name=vessel.raos.name,
        about=vessel.raos.source,
        status=long_wave_verdict(check),
        ok=check.ok,
        mark=_mark(check),
        sections=[
            ReportSection("", [afloat, motions, pairs(_about(vessel)), *drawings]),
            long_waves(check),
            ReportSection("", [f"note: {warning}" for warning in vessel.warnings]),
        ],
    )


def _afloat(vessel: HullVessel) -> list[tuple[str, str, str]]:
    plane, load = vessel.waterplane, vessel.loading
    keel = plane.draught
    roll, pitch = vessel.metacentric_heights
    buoyancy = plane.centre_of_buoyancy
    return [
        ("displacement", quantity(load.mass, "kg", 4), f"{number(plane.volume, 4)} m3"),
        (
            "length x beam x draught",
            f"{number(plane.length)} x {number(plane.beam)} x {number(plane.draught)} m",
            f"block coefficient {number(plane.block)}",
        ),
        ("waterplane", f"{number(plane.area, 4)} m2", ""),
        (
            "centre of gravity, KG",
            f"{load.centre[2] + keel:.2f} m",
            f"x {load.centre[0]:+.2f} m, above the centre of buoyancy",
        ),
        ("KB + BM", f"{buoyancy[2] + keel:.2f} + {plane.metacentric_radii[0]:.2f} m", ""),
        ("metacentric height, GM", f"{roll:.2f} m", f"of pitch {pitch:.0f} m"),
        ("radii of gyration", ", ".join(f"{r:.2f}" for r in load.radii) + " m", "roll, pitch, yaw"),
    ]


def _motions(vessel: HullVessel) -> list[tuple[str, str, str]]:
    periods = vessel.natural_periods
    omega = vessel.body.hydrodynamics.omega
    rows = []
    for name in ("heave", "roll", "pitch"):
        period = getattr(periods, name)
        inside = omega[0] <= 2.0 * math.pi / period <= omega[-1]
        rows.append(
            (
                f"natural period of {name}",
                quantity(period, "s"),
                "" if inside else "beyond the frequencies computed",
            )
        )
    rows.append(
        (
            "damping of roll added",
            percent(vessel.body.roll_damping),
            f"of critical, {vessel.body.critical_roll_damping / 1e6:.4g} MN m s",
        )
    )
    return rows


def _about(vessel: HullVessel) -> list[tuple[str, str]]:
    raos, body = vessel.raos, vessel.body
    error = body.hydrodynamics.energy_error(body.roll_damping * body.critical_roll_damping)
    found = [
        (
            "table",
            f"{raos.omega.size} frequencies, {raos.omega[0]:.3g} to {raos.omega[-1]:.3g} rad/s, "
            f"{raos.heading.size} headings",
        ),
        ("panels", f"{vessel.hull.count}" + (", kept from an earlier run" if vessel.kept else "")),
        ("largest heave, roll, pitch", largest_motions(raos)),
    ]
    if math.isfinite(error):
        found.insert(2, ("waves made and felt", f"agree within {percent(error)}"))
    return found


def _draw(axes: Axes, panels: FloatArray, horizontal: int, vertical: int) -> None:
    """Draw the edges of panels seen along an axis."""
    from matplotlib.collections import PolyCollection

    shape = np.asarray(panels)[..., [horizontal, vertical]]
    axes.add_collection(
        PolyCollection(
            list(shape), facecolors="#e8eef4", edgecolors=REFERENCE, linewidths=0.35, zorder=1
        )
    )
    axes.autoscale_view()
