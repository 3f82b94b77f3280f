"""Heave operators of the hook, from the six motions of its vessel.

    case.vessel (file, hook, heading) + case.sea (spreading) -> VesselRaos -> heave at the hook

The wave of zero phase is the one at the hook, as everywhere after this file.  In a short-crested
sea there is one operator for each heading of the sea; :func:`equivalent` makes the one of them
that gives the hook the same spectrum.

A case is read, changed and asked for its hook's motion again and again: files are read once, as
long as they stay as they are, and the operators of a place and a sea are kept.
"""

from functools import lru_cache

import numpy as np

from ..basics import ComplexArray, FloatArray, InputError, file_stamp, read_only
from ..sea import SeaSpectrum, Spreading
from .crane import Point
from .raos import VesselRaos
from .vessel import HeaveRao
from .vessel_section import Vessel

_ALIKE = 3.0
"""Difference of speeds that hardly matters to the motions [m/s]: a Froude number of 0.1 on 80 m."""

_HEADING_ERROR = 0.01
"""Share of the hook's rms above which lines between coarse headings are told [-]."""


def vessel_raos(vessel: Vessel, owner: str = "case") -> VesselRaos:
    """Return the six motions that a vessel names, at its own speed where the file has it.

    Raises InputError if the vessel has no `raos`, or the file is not what it should be; the field
    is named.
    """
    name = vessel.raos
    if name is None:
        raise InputError(f"{owner}: vessel.raos: is missing: the case has heave_rao only")
    try:
        raos = _read(name, *file_stamp(name))
    except InputError as error:
        raise InputError(
            f"{owner}: vessel.raos: {error}; `stillhook vessel import` reads a file with "
            "options, shows what is in it, and writes one that a case can name"
        ) from error
    speed = vessel.speed or 0.0
    if abs(raos.speed - speed) > 1e-3:
        return _read_at(name, *file_stamp(name), speed) or raos
    return raos


def speed_remark(vessel: Vessel, owner: str = "case") -> str | None:
    """Return a sentence if the operators are those of quite another speed than the vessel's."""
    if vessel.raos is None:
        return None
    at, speed = vessel_raos(vessel, owner).speed, vessel.speed or 0.0
    if abs(at - speed) <= _ALIKE:
        return None
    return (
        f"vessel.speed: the RAOs of {vessel.raos} hold for {at:.3g} m/s, the vessel makes "
        f"{speed:.3g} m/s: what the speed does to its motions in a wave is not in them"
    )


def heading_remark(vessel: Vessel, sea: SeaSpectrum, owner: str = "case") -> str | None:
    """Return a sentence if the hook's motion hangs on straight lines between coarse headings.

    Lines between headings that are uneven, or more than 30 degrees apart, are held against a
    smooth curve through the same headings: the hook's rms in this sea by both.  The curve knows no
    more of what lies between the headings than the lines do: on the bundled vessel at 45 degrees
    it tells two thirds of their error where that is large.
    """
    if vessel.raos is None or vessel.hook_point is None or vessel.heading is None:
        return None
    raos = vessel_raos(vessel, owner)
    if raos.even:
        return None
    omega, lines, headings, weights = hook_operators(vessel, sea.spreading, owner)
    curve = heave_operators(raos, vessel.hook_point, headings, smooth=True)
    by_lines, by_curve = (
        float(np.sqrt(np.trapezoid(sea.density(omega) * (np.abs(found) ** 2 @ weights), omega)))
        for found in (lines, curve)
    )
    error = by_lines / by_curve - 1.0 if by_curve > 0.0 else 0.0
    if abs(error) < _HEADING_ERROR:
        return None
    widest = float(np.max(np.diff(raos.heading_deg, append=raos.heading_deg[0] + 360.0)))
    return (
        f"vessel.raos: the headings of {vessel.raos} are uneven or coarse, up to {widest:.4g} deg "
        f"apart, and lines between them are {abs(error):.1%} {'low' if error < 0.0 else 'high'} in "
        "the hook's rms against a curve, which itself may be as far off; equal steps of at most "
        "30 deg round the circle make a Fourier series"
    )


@lru_cache(maxsize=256)
def sea_directions(heading: float, spreading: Spreading | None) -> tuple[FloatArray, FloatArray]:
    """Return the headings of a sea (n,) [rad] and their shares (n,); one if it is long-crested."""
    if spreading is None:
        return read_only([heading % (2.0 * np.pi)]), read_only([1.0])
    headings, weights = spreading.nodes(heading)
    return read_only(headings), read_only(weights)


def heave_operators(
    raos: VesselRaos, point: Point, headings: FloatArray, *, smooth: bool = False
) -> ComplexArray:
    """Return the heave of a point (3,) [m] per wave elevation there (k, n) [m/m].

    Between two headings of the table the six motions are interpolated about the table's own origin,
    where they change slowly with the heading, and then taken to the point: the wave's phase between
    the two places, k d cos b, would turn by a radian from one heading to the next.  Waves travel to
    the headings (n,) [rad]; if `smooth` a spline joins them where lines do, see
    :meth:`VesselRaos.response`.

    Raises InputError if the vessel has not been computed near a heading.
    """
    motions = raos.response(raos.omega[:, None], headings, smooth=smooth)
    x, y = point[0] - raos.origin[0], point[1] - raos.origin[1]
    heave, roll, pitch = motions[..., 2], motions[..., 3], motions[..., 4]
    ahead, abeam = point[0] - raos.phase_origin[0], point[1] - raos.phase_origin[1]
    way = ahead * np.cos(headings) + abeam * np.sin(headings)
    turn = np.exp(1j * np.multiply.outer(raos.wave_number(raos.omega), way))
    found: ComplexArray = (heave - x * pitch + y * roll) * turn
    return found


def hook_operators(
    vessel: Vessel, spreading: Spreading | None = None, owner: str = "case"
) -> tuple[FloatArray, ComplexArray, FloatArray, FloatArray]:
    """Return the heave of a vessel's hook in each heading of a sea, long-crested without spreading.

    Frequencies (k,) [rad/s], operators (k, n) [m/m], headings (n,) [rad], weights (n,).

    Raises InputError if the file is wrong, or the vessel has not been computed in these headings.
    """
    raos = vessel_raos(vessel, owner)
    point, heading = vessel.hook_point, vessel.heading
    if point is None or heading is None:  # the section's own check comes first
        raise InputError(f"{owner}: vessel: raos need hook (or crane) and heading")
    try:
        operators, headings, weights = _kept(raos, point, heading, spreading)
    except InputError as error:
        raise InputError(f"{owner}: vessel.heading: {error}") from error
    return raos.omega, operators, headings, weights


def hook_rao(vessel: Vessel, spreading: Spreading | None = None, owner: str = "case") -> HeaveRao:
    """Return the heave of a vessel's hook: the table that it gives, or that of its six motions.

    In a short-crested sea it is the one that gives the hook the same spectrum, see
    :func:`equivalent`.  Parameters and errors are those of :func:`hook_operators`.
    """
    table = vessel.heave_rao
    if table is not None:
        phase = None if table.phase is None else np.array(table.phase)
        return HeaveRao(
            omega=np.array(table.omega), amplitude=np.array(table.amplitude), phase=phase,
            below=vessel.below, beyond=vessel.beyond,
        )  # fmt: skip
    omega, operators, _, weights = hook_operators(vessel, spreading, owner)
    return rao_of_hook(vessel, omega, *equivalent(operators, weights))


def rao_of_hook(
    vessel: Vessel, omega: FloatArray, amplitude: FloatArray, phase: FloatArray | None = None
) -> HeaveRao:
    """Return an operator made of `vessel.raos`, with the ends that the case wants for it."""
    return HeaveRao(
        omega=omega, amplitude=amplitude, phase=phase,
        below=vessel.below, beyond=vessel.beyond, owner="vessel.raos",
    )  # fmt: skip


def equivalent(operators: ComplexArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return amplitude [m/m] and phase [rad] (k,) that give a hook the spectrum of many headings.

    The amplitude is the root of the weighted mean of squares.  The phase is that of the weighted
    mean, which is the phase of the cross-spectrum of the hook and the wave at the hook: for narrow
    spreading it is the operator's own.  The operators are (k, n), the shares of the headings (n,)
    add up to one.
    """
    amplitude: FloatArray = np.sqrt(np.abs(operators) ** 2 @ weights)
    return amplitude, np.angle(operators @ weights)


@lru_cache(maxsize=16)
def _read(name: str, modified: int, size: int) -> VesselRaos:
    del modified, size  # they only tell whether the file is the one that was read before
    from .readers import read_raos

    return read_raos(name)


@lru_cache(maxsize=64)
def _read_at(name: str, modified: int, size: int, speed: float) -> VesselRaos | None:
    """Return the operators of a speed; None if the file does not have them."""
    del modified, size
    from .readers import read_raos

    try:
        return read_raos(name, speed=speed)
    except InputError:
        return None


@lru_cache(maxsize=256)
def _kept(
    raos: VesselRaos, point: Point, heading: float, spreading: Spreading | None
) -> tuple[ComplexArray, FloatArray, FloatArray]:
    headings, weights = sea_directions(heading, spreading)
    operators = heave_operators(raos, point, headings)
    operators.setflags(write=False)
    return operators, headings, weights
