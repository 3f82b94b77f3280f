"""The loop of a design as a block diagram: the plant, and what its structure hears and commands.

::

    sea --> vessel --+--> rope <--> payload
                     |     ^           |
             +----- MRU    |           |
             v             v           |
    controller --> drive ----> drum    |
             ^         |               |
             +------ encoder           |
             +------ telemetry <-------+

Sensors that the structure does not hear are left out.  Places and sizes are inches of the drawing,
as are those of its words, so that they go together however many rows there are.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from synth.design import Design

from ..designs import about_of, command_of, heard
from ..text import (
    AFTER,
    DRUM,
    HOOK,
    REFERENCE,
    Axes,
    Figure,
    drawn,
    headline,
    listed,
    panel,
    quantity,
)

#: What stands on the arrow of a measurement, with the symbols of docs/conventions.md.
_SIGNALS = {
    "payload.acceleration": "acceleration P'' [m/s²]",
    "payload.velocity": "velocity P' [m/s]",
    "payload.displacement": "displacement P [m]",
    "mru.heave": "heave Z [m]",
    "mru.heave_rate": "heave rate Z' [m/s]",
    "drum.haul": "haul X [m]",
    "motor.speed": "motor speed ω [rad/s]",
    "rope.tension": "tension at drum [N]",
}
_SENSOR, _QUIET = "#888888", "#555555"
_WIDTH, _ROW, _HIGH = 7.6, 0.94, 0.54  # of the drawing; from row to row; of a box
_TAP, _CELL, _HAUL = 3.77, 4.5, 5.12  # where heave and speed, tension, and haul are taken
_GAP = 0.045  # from an arrow to its words
_NAME, _WORDS = 10.5, 9.5  # [pt]
_CENTRED: Any = {"ha": "center", "va": "center", "linespacing": 1.15}
_SIGNS = "Z and P count upwards, X and ω when hauling in"


class Place(NamedTuple):
    """Where a box is: its row, its middle and width across, and the colour of its edge."""

    row: str
    x: float
    width: float = 1.0
    colour: str = _SENSOR

    @property
    def left(self) -> float:
        """Where its left edge is."""
        return self.x - 0.5 * self.width

    @property
    def right(self) -> float:
        """Where its right edge is."""
        return self.x + 0.5 * self.width


_PLACES = {
    "sea": Place("ship", 0.72, 0.8, HOOK),
    "vessel": Place("ship", 2.83, colour=HOOK),
    "rope": Place("ship", 4.76, 1.16, REFERENCE),
    "payload": Place("ship", 6.98, 1.08, AFTER),
    "MRU": Place("MRU", _TAP),
    "load cell": Place("load cell", _CELL),
    "drive": Place("winch", 2.83, colour=DRUM),
    "drum": Place("winch", 4.76, 1.16, DRUM),
    "encoder": Place("encoder", _TAP),
    "telemetry": Place("payload", 4.76, 1.16),
    "payload unit": Place("payload", 6.98, 1.08),
}
_CONTROLLER = Place("", 0.72, 1.3, REFERENCE)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sheet:
    """What is drawn on, with the height of each row."""

    axes: Axes
    rows: Mapping[str, float]

    def bottom(self, name: str) -> float:
        """Return where the lower edge of a box is."""
        return self.rows[_PLACES[name].row] - 0.5 * _HIGH

    def top(self, name: str) -> float:
        """Return where the upper edge of a box is."""
        return self.rows[_PLACES[name].row] + 0.5 * _HIGH

    def box(self, name: str, text: str = "", about: str = "") -> None:
        """Draw a box with a name, and in small what is to be known of it."""
        place = _PLACES[name]
        self.frame(place, self.rows[place.row], _HIGH)
        y, up = self.rows[place.row], 0.1 if about else 0.0
        self.axes.text(place.x, y + up, text or name, fontsize=_NAME, **_CENTRED)
        if about:
            self.axes.text(place.x, y - 0.11, about, fontsize=_WORDS, color=_QUIET, **_CENTRED)

    def frame(self, place: Place, y: float, high: float) -> None:
        """Draw the edge of a box about a height."""
        from matplotlib.patches import Rectangle

        corner = place.left, y - 0.5 * high
        paint: Any = {"facecolor": "white", "edgecolor": place.colour, "linewidth": 1.5}
        self.axes.add_patch(Rectangle(corner, place.width, high, **paint))

    def arrow(self, start: tuple[float, float], end: tuple[float, float], style: str) -> None:
        """Draw an arrow."""
        shape: Any = {"arrowstyle": style, "color": REFERENCE, "linewidth": 1.2}
        shape |= {"shrinkA": 0.0, "shrinkB": 0.0, "mutation_scale": 12.0}
        self.axes.annotate("", end, xytext=start, arrowprops=shape)

    def across(
        self, start: float, end: float, row: str, above: str, below: str = "", style: str = "-|>"
    ) -> None:
        """Draw an arrow along a row, with words above and below its middle."""
        y = self.rows[row]
        self.arrow((start, y), (end, y), style)
        for text, up, side in ((above, _GAP, "bottom"), (below, -_GAP, "top")):
            middle: Any = {"ha": "center", "va": side, "fontsize": _WORDS}
            self.axes.text(0.5 * (start + end), y + up, text, **middle)

    def down(self, x: float, start: float, end: float, words: str = "", style: str = "-|>") -> None:
        """Draw an arrow downwards, with words to the right of its middle."""
        self.arrow((x, start), (x, end), style)
        self.axes.text(x + 2.0 * _GAP, 0.5 * (start + end), words, fontsize=_WORDS, va="center")

    def tap(self, x: float, row: str, name: str) -> None:
        """Draw an arrow from a point of a row's arrow down to a box."""
        self.axes.plot(x, self.rows[row], "o", color=REFERENCE, markersize=4.0)
        self.down(x, self.rows[row], self.top(name))


@drawn
def block_diagram(design: Design) -> Figure:
    """Return the loop of a design in boxes and arrows: plant, sensors that it hears, controller.

    On the arrows stand the signals with their units, below them the law with its sign.
    """
    instruments = heard(design)
    # What hears the rope's upper end stands above the winch, the rest below.
    order = ("ship", "MRU", "load cell", "winch", "encoder", "payload")
    shown = [row for row in order if row in ("ship", "winch", *instruments)]
    rows = {row: -_ROW * k for k, row in enumerate(shown)}
    low = rows[shown[-1]] - 0.5 * _HIGH - 0.32
    figure, axes = panel(_WIDTH, 0.5 * _HIGH - low + 0.72)
    axes.set_axis_off()
    axes.set_aspect("equal")
    axes.set_xlim(0.0, _WIDTH)
    axes.set_ylim(low, 0.5 * _HIGH + 0.14)
    sheet = Sheet(axes=axes, rows=rows)
    _plant(sheet, design)
    _winch(sheet, design)
    _controller(sheet, design, rows[shown[1]], rows[shown[-1]])
    for name in instruments:
        _INSTRUMENTS[name](sheet, design)
    law = "u = -A (a P'' + a1 P' + a2 P)"
    if design.structure != "payload-feedback":
        law = "u = +C y, with y all that the controller hears"
    axes.text(_CONTROLLER.left, low, f"{law}.  {_SIGNS}.", fontsize=_WORDS, va="bottom")
    command = command_of(design).partition(" [")[0]
    finding = f"{design.structure} sets the {command}, hearing {listed(instruments)}"
    return headline(figure, finding, about_of(design))


def _plant(sheet: Sheet, design: Design) -> None:
    """Draw sea, vessel, rope and payload, and how the drum moves the rope."""
    case, at = design.case, _PLACES
    sheet.box("sea")
    sheet.box("vessel")
    sheet.box("rope", about=quantity(case.rope.length, "m"))
    sheet.box("payload", about=quantity(case.payload.mass, "kg"))
    sheet.across(at["sea"].right, at["vessel"].left, "ship", "waves [m]")
    sheet.across(at["vessel"].right, at["rope"].left, "ship", "hook heave\nZ [m]")
    ends = at["rope"].right, at["payload"].left
    sheet.across(*ends, "ship", "tension [N] →", "← P [m]", style="<|-|>")
    words = "haul X [m] ↑\ntension [N] ↓"
    sheet.down(_HAUL, sheet.bottom("rope"), sheet.top("drum"), words, style="<|-|>")


def _winch(sheet: Sheet, design: Design) -> None:
    """Draw command, drive and drum."""
    drive, drum = _PLACES["drive"], _PLACES["drum"]
    late = _late(design.case.winch.drive.command_delay)
    sheet.box("drive", "drive, motor" if late else "drive and\nmotor", late)
    sheet.box("drum", "gear and\ndrum")
    name, _, unit = command_of(design).partition(" [")
    words = name.replace(" ", "\n")
    sheet.across(_CONTROLLER.right, drive.left, "winch", f"u: {words}", f"[{unit}")
    sheet.across(drive.right, drum.left, "winch", "speed ω\n[rad/s]")


def _controller(sheet: Sheet, design: Design, top: float, bottom: float) -> None:
    """Draw the controller, beside all that it is joined to."""
    middle = 0.5 * (top + bottom)
    sheet.frame(_CONTROLLER, middle, top - bottom + _HIGH)
    name = design.structure.replace("-", "-\n")
    sheet.axes.text(_CONTROLLER.x, middle, f"controller:\n{name}", fontsize=_NAME, **_CENTRED)


def _late(delay: float) -> str:
    return f"{quantity(delay, 's', 2)} late" if delay else ""


def _shown(sheet: Sheet, design: Design, box: str, prefixes: tuple[str, ...]) -> None:
    """Draw what a box shows to the controller."""
    signals = [_SIGNALS[name] for name in design.measurements if name.startswith(prefixes)]
    half = -(-len(signals) // 2)
    above, below = "\n".join(signals[:half]), "\n".join(signals[half:])
    place = _PLACES[box]
    sheet.across(place.left, _CONTROLLER.right, place.row, above, below)


def _mru(sheet: Sheet, design: Design) -> None:
    unit = design.case.sensors.mru
    sheet.box("MRU", about="" if unit is None else _late(unit.delay))
    sheet.tap(_TAP, "ship", "MRU")
    _shown(sheet, design, "MRU", ("mru",))


def _load_cell(sheet: Sheet, design: Design) -> None:
    sheet.box("load cell")
    sheet.down(_CELL, sheet.bottom("rope"), sheet.top("load cell"))
    _shown(sheet, design, "load cell", ("rope",))


def _encoder(sheet: Sheet, design: Design) -> None:
    sheet.box("encoder")
    sheet.tap(_TAP, "winch", "encoder")
    _shown(sheet, design, "encoder", ("drum", "motor"))


def _payload_unit(sheet: Sheet, design: Design) -> None:
    late = _late(design.case.sensors.telemetry.delay)
    unit, link = _PLACES["payload unit"], _PLACES["telemetry"]
    sheet.box("payload unit", "payload\nunit")
    sheet.box("telemetry", about=late or "no delay")
    # Left of the middle, so that its words have room.
    x = unit.left + 0.1
    sheet.down(x, sheet.bottom("payload"), sheet.top("payload unit"), "motion P [m]")
    sheet.across(unit.left, link.right, unit.row, "")
    _shown(sheet, design, "telemetry", ("payload",))


_INSTRUMENTS = {
    "payload": _payload_unit,
    "MRU": _mru,
    "load cell": _load_cell,
    "encoder": _encoder,
}
