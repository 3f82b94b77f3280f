"""Operability study of a design or a case: `operability`, the door of this room.

design or case, periods, headings -> columns of seas
    -> contours of the loop, of the held drum, of a perfect winch, for each rope length
    -> against a scatter diagram -> Operability

A contour with the gains found anew for every sea says what fixed gains give away.

    sea -> best gains without the drive's limits -> largest sea that any gains can do -> its limit

The largest sea is the programme of `synth.design.infeasible`, with the payload's criteria among the
limits; the gains that it ends with are then looked at like those of any design.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.signal import lfilter
from scipy.special import ndtr

from models.basics import (
    InputError,
    SolverError,
    check_ascending,
    check_range,
    one_thread,
    shows_progress,
)
from models.case import Case
from models.sea import SHORTEST, Scatter, SeaSeries, read_scatter

from ..design import Design, limit_uses, shortfall, tuning_of
from ..limits import Limit
from ..question import pose
from ..search import Progress, search
from .capability import capability
from .columns import SeaColumn, has_headings, has_period, sea_column
from .contour import Contour, assembled, contour_of
from .criteria import payload_criteria
from .depths import AtDepth, OwnSea, drum_layer
from .limiting import HIGHEST, SeaStates, limiting_heights
from .pose import OperabilityQuestion, pose_operability
from .record_limits import VesselHeading, gains_of, study_axes
from .result import Operability
from .workable import workable

_SCALES = (3.0, 2.8, 2.5, 2.0, 1.6, 1.4, 1.3, 1.4, 1.8, 2.3, 2.6, 2.9)  # of H_s by month [m]
_DAYS = (31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31)
_WEIBULL_SHAPE = 1.5  # of the Weibull distribution [-]
_CLASS_HEIGHTS = np.arange(0.0, 12.5, 0.5)  # edges of the classes [m]
_CLASS_PERIODS = np.arange(3.0, 20.5, 1.0)  # edges [s]
_MEMORY = (30.0, 12.0, 24.0)  # of H_s, T_p and direction of the example's year [h]
_LEAST_SHARE = 1e-6  # share of a month below which a class is left out
_PERIODS = (4.0, 18.0, 15)  # first, last and number of the default periods
_STEP = 30.0  # deg between the default headings
_MOST_HEADINGS = 361
_MOST_PERIODS = 200

_STARTS = 3  # of each search, besides the design's own gains


@one_thread()
@shows_progress("limiting seas")
def operability(
    design: Design | Case,
    *,
    periods: Sequence[float] | None = None,
    headings: Sequence[float] | None = None,
    payload_rms: float | str | None = None,
    payload_significant: float | str | None = None,
    payload_max: float | str | None = None,
    payload_speed: float | str | None = None,
    daf: float | None = None,
    snap: float | str | None = None,
    depths: Sequence[float] | None = None,
    scatter: Scatter | str | Path | None = None,
    seas: SeaSeries | None = None,
    vessel_heading: VesselHeading | None = None,
    reoptimise: bool = False,
    highest: float = HIGHEST,
    seed: int = 0,
    progress: Progress | None = None,
) -> Operability:
    """Return the limiting H_s over peak period and heading, for every limit, and what binds.

    The rule is that of all designs: |static| + loss + k sigma within the bound for peaks, with
    each signal's own k = sqrt(2 ln(T/T_z)); sqrt(static^2 + loss^2 + sigma^2) for continuous
    ratings.  The payload's drag agrees with its motion in each sea, so the response is not linear
    in H_s, and the limit is found as a root; where the spectrum is known at one H_s only it is
    rebuilt at each step.  The rope is damped as the case says.

    Parameters
    ----------
    design
        A design, whose gains are kept; or a case, for the drum held and for a perfect winch only.
    periods
        Peak periods [s], ascending; by default 4 to 18 s, or what the scatter diagram needs, or
        the case's own where its sea has no period to change.
    headings
        Headings [rad], ascending; by default every 30 deg where the vessel has RAOs.  A vessel
        that is given by the heave of its hook has none.
    payload_rms, payload_significant, payload_max
        How still the payload must be: standard deviation, significant double amplitude (4
        sigma), most probable maximum amplitude in the exposure time; in m or text with a unit.
    payload_speed
        Largest most probable maximum of the payload's speed, in m/s or text with a unit.
    daf
        Largest dynamic amplification factor at the load's end of the rope: the most probable
        maximum of the tension there over the load's submerged weight [-], above 1.
    snap
        Largest share of the load's least weight that the dynamic tension there may take up [-],
        0 to 1 or text in %: with all of it the rope goes slack, and snaps taut.
    depths
        Lengths of rope paid out [m]; the case's own if left out.
    scatter
        Scatter diagram, its file, or ``example`` for a made-up one: what share of the year the
        work can be done.
    seas
        Series of seas that weather windows are to be counted in: periods and headings, unless they
        are given, are those that reach all of them.
    vessel_heading
        How the vessel will lie in these.
    reoptimise
        Whether to find the gains anew for each sea as well: seconds for each point.
    highest
        Highest H_s that is looked at [m].
    seed
        Of the searches for new gains.
    progress
        Called as progress(stage, done, total).

    Returns
    -------
    Operability
        With `dataset`, an xarray Dataset.

    Raises
    ------
    InputError
        If the design has no stable loop, or an argument is out of its range.
    """
    case = design if isinstance(design, Case) else design.case
    check_range("operability", "highest", highest, low=0.1, high=HIGHEST, unit="m")
    diagram = _diagram(scatter)
    if reoptimise and not isinstance(design, Design):
        raise InputError(
            "operability: reoptimise begins at a design (`optimise_gains`, `evaluate_gains`), got "
            "a case alone"
        )
    if diagram is not None and not has_period(case):
        raise InputError(
            f"{case.label}: sea: the {case.sea.spectrum} spectrum has no peak_period "
            "of its own, so that it cannot be set against a scatter diagram; use jonswap"
        )
    criteria = payload_criteria(
        case,
        rms=payload_rms,
        significant=payload_significant,
        maximum=payload_max,
        speed=payload_speed,
        daf=daf,
        snap=snap,
    )
    if seas is not None:
        if not has_period(case):
            raise InputError(
                f"{case.label}: sea: the {case.sea.spectrum} spectrum has no peak_period of its "
                "own, so that it cannot be put into a series of seas; use jonswap"
            )
        reached = study_axes(case, seas, vessel_heading or VesselHeading())
        periods = reached[0] if periods is None else periods
        if headings is None and has_headings(case):
            headings = reached[1]
    angles = _headings(case, headings)
    times = _periods(case, periods, diagram)
    columns = [sea_column(case, period, angles) for period in times]
    lengths: list[float | None] = [None]
    if depths is not None:
        lengths = [
            check_range(case.label, "depths", depth, low=1.0, high=12000.0, unit="m")
            for depth in depths
        ]
    stages = [pose_operability(design, criteria, length=length) for length in lengths]
    count = sum(len(stage.systems) for stage in stages) * len(columns)
    count += len(stages) * len(columns) * len(columns[0].hooks) if reoptimise else 0
    done = 0

    def step() -> None:
        nonlocal done
        done += 1
        if progress is not None:
            progress("limiting seas", done, count)

    if progress is not None:
        progress("limiting seas", 0, count)
    found = []
    for stage in stages:
        rows = [_on_rope(column, stage) for column in columns]
        contours = {
            name: contour_of(system, stage.criteria[name], rows, highest=highest, step=step)
            for name, system in stage.systems.items()
        }
        if reoptimise and not isinstance(design, Case):
            contours["reoptimised"] = _reoptimised(design, stage, rows, highest, seed, step)
        found.append(_at_depth(stage, contours, rows, diagram, highest))
    return Operability(
        case=case,
        design=None if isinstance(design, Case) else design,
        depths=tuple(found),
        scatter=diagram,
        wanted=criteria,
    )


def _diagram(given: Scatter | str | Path | None) -> Scatter | None:
    if given is None or isinstance(given, Scatter):
        return given
    return example_scatter() if str(given) == "example" else read_scatter(given)


def _headings(case: Case, given: Sequence[float] | None) -> Sequence[float] | None:
    if given is None:
        return np.radians(np.arange(0.0, 360.0, _STEP)).tolist() if has_headings(case) else None
    return _axis("headings", given, _MOST_HEADINGS, "rad", 0.0, 2.0 * np.pi, open_high=True)


def _periods(
    case: Case, given: Sequence[float] | None, scatter: Scatter | None
) -> Sequence[float | None]:
    if given is None:
        if not has_period(case):
            return [None]
        if scatter is None:
            return list(map(float, np.linspace(*_PERIODS[:2], int(_PERIODS[2]))))
        # Whole seconds about those of the diagram.
        low = max(np.floor(float(scatter.peak_period.min())), 1.0)
        high = np.ceil(float(scatter.peak_period.max()))
        if low >= high:
            return [low]
        return list(map(float, np.linspace(low, high, int(min(high - low, 40.0)) + 1)))
    return _axis("periods", given, _MOST_PERIODS, "s", SHORTEST, 60.0)


def _axis(
    name: str, given: Sequence[float], most: int, unit: str, low: float, high: float, **ends: bool
) -> list[float]:
    """Return the values of an axis, ascending, within the ends that `check_range` is told."""
    axis = check_ascending("operability", name, given)
    if axis.size == 0 or axis.size > most:
        raise InputError(f"operability: {name} must be 1 to {most}, got {axis.size}")
    return [
        check_range("operability", name, v, low=low, high=high, unit=unit, **ends)
        for v in axis.tolist()
    ]


def _on_rope(column: SeaColumn, question: OperabilityQuestion) -> SeaColumn:
    """Return the column with the rope of the question, for the searches and the checks."""
    length = question.case.rope.length
    if all(c.rope.length == length for c in column.cases):
        return column
    return replace(column, cases=tuple(c.replace({"rope.length": length}) for c in column.cases))


def _at_depth(
    question: OperabilityQuestion,
    contours: dict[str, Contour],
    columns: Sequence[SeaColumn],
    scatter: Scatter | None,
    highest: float,
) -> AtDepth:
    vessel = question.case.vessel
    heading = getattr(vessel, "heading", None) if has_headings(question.case) else None
    # Where the diagram knows directions, the bow is along its axis until it is turned.
    turned = 0.0 if scatter is not None and scatter.heading is not None else heading
    shares = (
        {}
        if scatter is None
        else {name: workable(contour, scatter, turned) for name, contour in contours.items()}
    )
    layer, layers = drum_layer(question.case)
    low, high = contours["perfect"].periods[[0, -1]]
    lines = np.linspace(0.75 * low, 1.1 * high, 60)
    return AtDepth(
        case=question.case,
        layer=layer,
        layers=layers,
        contours=contours,
        columns=tuple(columns),
        gains={n: gains_of(question.systems.get(n), contour) for n, contour in contours.items()},
        capability=capability(question.perfect, question.criteria["perfect"], lines),
        workable=shares,
        own=_own_sea(question, highest),
        masses=question.masses,
        max_sensitivity=_sensitivity(question),
    )


def _own_sea(question: OperabilityQuestion, highest: float) -> OwnSea:
    """Return the verdict on the case's own sea, in which a design is looked at as it was made."""
    name = "held" if question.loop is None else "loop"
    column, criteria = sea_column(question.case, None), question.criteria[name]
    contour = contour_of(question.systems[name], criteria, [column], highest=highest)
    limit, binding = float(contour.limit[0, 0]), str(contour.binding[0, 0])
    broken: tuple[str, ...]
    if question.loop is None:
        broken = (binding,) if limit < question.case.sea.significant_height else ()
    elif question.own is None:
        broken = ("stability",)
    else:
        felt = [criterion for criterion in criteria if criterion.outputs]
        uses = limit_uses(felt, question.own, {})
        broken = tuple(use.name for use in uses.values() if not use.kept)
    return OwnSea(limit=limit, binding=binding, broken=broken)


def _sensitivity(question: OperabilityQuestion) -> float:
    """Return M_s of the loop at the drag in the case's own sea; see `AtDepth`."""
    if question.loop is None:
        return math.nan
    return math.inf if question.own is None else question.own.max_sensitivity


def example_scatter() -> Scatter:
    """Return a made-up scatter diagram, classes of 0.5 m and 1 s for each month.

    No site on earth, nobody's measurements.  Significant heights are Weibull distributed with a
    scale for each month, peak periods lognormal about a mean that grows with H_s: the forms of the
    joint environmental model of DNV-RP-C205 (3.6.3), with round numbers that make a northern
    open-sea site with rough winters.  Real work needs the diagram of the real site.
    """
    heights = 0.5 * (_CLASS_HEIGHTS[:-1] + _CLASS_HEIGHTS[1:])
    periods = 0.5 * (_CLASS_PERIODS[:-1] + _CLASS_PERIODS[1:])
    scales = np.array(_SCALES)[:, None]
    by_height = np.diff(1.0 - np.exp(-((_CLASS_HEIGHTS / scales) ** _WEIBULL_SHAPE)))  # (12, h)
    # Mean of the logarithm of T_p, and its spread, which narrows as the sea grows.
    mean = np.log(6.0 + 1.3 * heights**0.8)[:, None]
    spread = 0.12 + 0.14 * np.exp(-0.35 * heights)[:, None]
    by_period = np.diff(ndtr((np.log(_CLASS_PERIODS) - mean) / spread))  # (h, p)
    shares = by_height[:, :, None] * by_period
    month, height, period = np.nonzero(shares > _LEAST_SHARE)
    return Scatter(
        significant_height=heights[height],
        peak_period=periods[period],
        occurrence=shares[month, height, period] * np.array(_DAYS)[month],
        month=month + 1,
        source="made-up example site",
    )


def example_series() -> SeaSeries:
    """Return a made-up year of hourly seas at the site of `example_scatter`.

    H_s of each month has the same distribution, T_p the same about the same mean; both change as
    slowly as weather does, by processes of first order with 30 and 12 hours, and the waves come
    from the west.  It is one year of many that could be made so.
    """
    hours = np.arange(8760)
    rng = np.random.default_rng(1975)
    steps = rng.standard_normal((3, hours.size))
    slow = np.empty_like(steps)
    for row, (step, decay) in enumerate(zip(steps, np.exp(-1.0 / np.array(_MEMORY)), strict=True)):
        slow[row] = lfilter([math.sqrt(1.0 - decay**2)], [1.0, -decay], step)
    time = np.datetime64("2021-01-01T00", "s") + hours * np.timedelta64(3600, "s")
    # Scales of the months' middles, and between them as the year goes round.
    day = hours / 24.0
    middles = np.cumsum(_DAYS) - 0.5 * np.array(_DAYS)
    scale = np.interp(day, middles, _SCALES, period=365.0)
    heights = np.maximum(scale * (-np.log(ndtr(-slow[0]))) ** (1.0 / _WEIBULL_SHAPE), 0.1)
    mean = np.log(6.0 + 1.3 * heights**0.8)
    spread = 0.12 + 0.14 * np.exp(-0.35 * heights)
    return SeaSeries.from_arrays(
        time,
        np.round(heights, 2),
        np.round(np.exp(mean + spread * slow[1]), 1),
        np.radians(np.round(270.0 + 40.0 * slow[2])),
        source="made-up example year",
    )


def _reoptimised(
    design: Design,
    question: OperabilityQuestion,
    columns: Sequence[SeaColumn],
    highest: float,
    seed: int,
    step: Callable[[], None],
) -> Contour:
    """Return the contour of gains that are optimised for each sea, beginning at the design's."""
    assert question.loop is not None
    criteria = question.criteria["loop"]
    drive = tuple(limit for limit in criteria if limit.outputs)
    found = []
    for column in columns:
        heights = np.zeros((len(criteria), len(column.hooks)))
        drag = np.full(len(column.hooks), np.nan)
        for h, case in enumerate(column.cases):
            gains = _best(case, design, drive, seed)
            step()
            if gains is None:
                continue
            one = replace(column, headings=None, cases=(case,), hooks=(column.hooks[h],))
            loop = replace(
                question.loop,
                controller=pose(case, design.structure, design.masses).controller(gains),
            )
            states = SeaStates(system=loop, column=one)
            heights[:, [h]], drag[[h]] = limiting_heights(states, criteria, highest=highest)
        found.append((heights, drag))
    return assembled(criteria, columns, found, highest)


def _best(
    case: Case, design: Design, drive: tuple[Limit, ...], seed: int
) -> dict[str, float] | None:
    """Return the parameters of the largest sea that any can do, or None."""
    question = pose(case, design.structure, design.masses)
    problem = question.problem_with(question.loop)
    own = question.values(design.parameters)
    free = tuning_of(problem, search(problem, _STARTS, seed, [own], None))
    solved = free.found.solved
    if free.assessment is None or solved is None:
        return None
    if not free.ok:  # few starts did not arrive: the design's own parameters are a start as good
        free = replace(
            free, found=replace(free.found, solved=replace(solved, values=np.array(own)))
        )
    limited = replace(question, drive=drive, reported=())
    try:
        found = shortfall(limited.problem, free)
    except SolverError:
        found = None
    return None if found is None else question.named(found.values)
