"""The vessel, as a section of the case file: where the hook is, and how it is moved there.

Either `heave_rao`, the heave of the hook as a table that somebody else has made, or `raos`, the six
motions of the whole vessel from a file, with the place of the hook and the heading of the waves.
The section only holds the data; `models.vessel.vessel` makes the hook's operator of it.

Directions are those of `models.vessel`: x forward, y to port, z up; a heading is where the waves
(or the current) go to, counter-clockwise seen from above relative to the bow: 0 following, 90 deg
to port, 180 deg head sea.
"""

import math
from collections.abc import Collection, Iterator
from typing import Annotated, Literal

from pydantic import Field

from ..basics import ascending_fault
from ..casefile import DataFile, Quantity, Section
from .crane import Point


def _bundled() -> Collection[str]:
    from .readers import bundled_vessels  # here, as most cases have no file

    return tuple(name for name, _ in bundled_vessels())


class HeaveTable(Section):
    """Heave of the hook per wave amplitude, as a table over frequency."""

    omega: Annotated[
        tuple[Annotated[float, Quantity("frequency", 0.0, 20.0)], ...], Field(min_length=2)
    ]
    """Frequencies, strictly ascending."""
    amplitude: tuple[Annotated[float, Quantity("ratio", 0.0, 50.0, unit="m/m")], ...]
    """Heave amplitude over wave amplitude at each frequency."""
    phase: tuple[Annotated[float, Quantity("angle", -1000.0, 1000.0)], ...] | None = None
    """How far the heave is ahead of the wave at the hook, at each frequency (e^{+i omega t}); by
    default 0."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        fault = ascending_fault(self.omega)
        if fault:
            yield ("omega", fault)
        for name in ("amplitude", "phase"):
            values = getattr(self, name)
            if values is not None and len(values) != len(self.omega):
                text = f"must have as many entries as omega, {len(self.omega)}, got {len(values)}"
                yield (name, text)


class Hook(Section):
    """Where the rope leaves the crane, in the vessel frame of the RAOs."""

    x: Annotated[float, Quantity("length", -500.0, 500.0)]
    """Forward of the frame's origin."""
    y: Annotated[float, Quantity("length", -200.0, 200.0)]
    """To port of it; negative to starboard."""
    z: Annotated[float, Quantity("length", -100.0, 300.0)] = 0.0
    """Above it; does not matter to the vertical motion of small angles."""


class Crane(Section):
    """A crane, from whose angles the place of its tip follows."""

    x: Annotated[float, Quantity("length", -500.0, 500.0)]
    """Slew axis, forward of the origin of the RAOs' frame."""
    y: Annotated[float, Quantity("length", -200.0, 200.0)]
    """Slew axis, to port of it."""
    z: Annotated[float, Quantity("length", -100.0, 300.0)] = 0.0
    """Height of the boom's heel above it."""
    slew: Annotated[float, Quantity("angle", -7.0, 7.0)]
    """Direction of the boom, counter-clockwise seen from above: 0 over the bow, 90 deg over port,
    -90 deg over starboard, 180 deg over the stern."""
    boom_length: Annotated[float, Quantity("length", 0.1, 300.0)]
    """Length of the boom from its heel."""
    boom_angle: Annotated[float, Quantity("angle", -1.6, 1.6)]
    """Angle of the boom above the horizontal."""
    jib_length: Annotated[float, Quantity("length", 0.0, 300.0)] = 0.0
    """Length of the second boom of a knuckle-boom crane."""
    jib_angle: Annotated[float, Quantity("angle", -3.2, 3.2)] = 0.0
    """Angle of that second boom above the horizontal; negative below it."""

    @property
    def tip(self) -> Point:
        """The boom's tip in the frame of the RAOs [m].

        A boom of 20 m at 60 degrees over the port side:

        >>> crane = Crane(x=-25.0, y=5.0, z=12.0, slew="90 deg", boom_length=20.0,
        ...               boom_angle="60 deg")
        >>> [round(x, 2) for x in crane.tip]
        [-25.0, 15.0, 29.32]
        """
        booms = ((self.boom_length, self.boom_angle), (self.jib_length, self.jib_angle))
        reach = sum(length * math.cos(angle) for length, angle in booms)
        rise = sum(length * math.sin(angle) for length, angle in booms)
        across = self.y + reach * math.sin(self.slew)
        return (self.x + reach * math.cos(self.slew), across, self.z + rise)


class Current(Section):
    """A current past the vessel."""

    speed: Annotated[float, Quantity("speed", 0.0, 5.0)]
    """Speed of the water over the ground."""
    heading: Annotated[float, Quantity("angle", -7.0, 7.0)]
    """Where the current flows to, counter-clockwise from the bow: 0 from astern, 180 deg from
    ahead."""


_GO_WITH_RAOS = ("hook", "crane", "heading", "speed", "current")


class Vessel(Section):
    """The vessel: the heave of its hook, or the RAOs of its six motions and the hook's place."""

    alternatives = (
        ("heave_rao", "raos"),
        ("hook", "crane"),
        *(("heave_rao", name) for name in _GO_WITH_RAOS),
    )

    heave_rao: HeaveTable | None = None
    """Heave of the hook per wave amplitude, or give `raos`."""
    raos: (
        Annotated[str, DataFile(names=_bundled, what="a RAO file or the name of a bundled vessel")]
        | None
    ) = None
    """RAOs of the vessel's six motions: a bundled vessel (`osv-83m`) or a file, as
    `stillhook vessel import` reads it; with `hook` or `crane`, and `heading`. Or give
    `heave_rao`."""
    hook: Hook | None = None
    """Where the rope leaves the crane, in the vessel frame of `raos`, or give `crane`."""
    crane: Crane | None = None
    """The crane whose tip that is, by its angles, or give `hook`."""
    heading: Annotated[float, Quantity("angle", -7.0, 7.0)] | None = None
    """Where the waves travel to, counter-clockwise from the bow: 0 following sea, 90 deg to port,
    180 deg head sea; the mean of a short-crested sea. Goes with `raos`."""
    speed: Annotated[float, Quantity("speed", -10.0, 25.0)] | None = None
    """Forward speed over the ground, negative astern; 0 if left out. The waves are then met at
    the frequency of encounter. Goes with `raos`."""
    current: Current | None = None
    """A current, which the waves ride on; none if left out. Goes with `raos`."""
    below: Literal["unity", "hold", "zero"] = "unity"
    """What the RAO is below its table: `unity` goes linearly to 1 at zero frequency (in long
    waves a vessel follows the sea), `hold` keeps the first value, `zero` is 0."""
    beyond: Literal["hold", "zero", "decay"] = "decay"
    """What the RAO is above its table: `hold` keeps the last value, `zero` is 0, `decay` falls
    as 1/omega^2."""

    def _faults(self) -> Iterator[tuple[str, str]]:
        extra = [name for name in _GO_WITH_RAOS if getattr(self, name) is not None]
        if self.heave_rao is not None:
            for name in (["raos"] if self.raos is not None else []) + extra:
                yield (name, "goes with raos; heave_rao is that of one hook in one heading already")
        elif self.raos is None:
            what = f"; {', '.join(extra)} alone {'does' if len(extra) == 1 else 'do'} not do"
            text = "is missing: give it, the heave of the hook, or raos with hook and heading"
            yield ("heave_rao", text + (what if extra else ""))
        else:
            if self.hook is None and self.crane is None:
                yield ("hook", "is missing: raos need the place of the hook, or a crane")
            if self.hook is not None and self.crane is not None:
                yield ("crane", "must not be given beside hook: both say where the tip is")
            if self.heading is None:
                text = "is missing: raos need the heading of the waves (180 deg: head sea)"
                yield ("heading", text)

    @property
    def hook_point(self) -> Point | None:
        """Where the rope leaves the crane, in the frame of the RAOs [m]; None with `heave_rao`."""
        if self.crane is not None:
            return self.crane.tip
        return None if self.hook is None else (self.hook.x, self.hook.y, self.hook.z)

    @property
    def moves(self) -> bool:
        """Whether the vessel moves through the water: waves are met at another frequency."""
        flows = self.current is not None and self.current.speed != 0.0
        return flows or (self.speed is not None and self.speed != 0.0)
