"""Worth of each limit, sensor, delay and gear of a case: what to buy first.

    case or design -> optimum (`synth.sizing.follow`) -> items
        -> optimised again with the item a little better, and twice as good -> Worth

The elasticity of the optimum comes from gains that were optimised again with the figure a little
better.  Last, the figure is made twice as good and the gains are searched for anew, from this
optimum and from fresh starts, since the best may lie elsewhere then: what stillness that buys is
what the list is sorted by.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from models.basics import InputError, one_thread, shows_progress
from models.case import Case

from ..design import Design, optimise_gains
from ..limits import Limit
from ..question import Problem
from ..search import Progress, search
from .follow import Answer, answer_of, asked_by, follow, posed, with_bound
from .motor import motor_changes

_RPM = 0.10471975511965977
#: Natural steps of a limit by its unit [SI].
_STEPS = {"N m": 1e3, "rad/s": 100.0 * _RPM, "W": 1e5, "V": 100.0, "A": 100.0, "N": 1e4}
#: Sensors and link: name, path under `sensors`, unit, whether more is better, natural step (a tenth
#: of it where none is given), and the beginning of the measurements that it tells on.
_PARTS: tuple[tuple[str, str, str, int, float | None, str], ...] = (
    ("telemetry delay", "telemetry.delay", "s", -1, 0.01, "payload."),
    ("telemetry bandwidth", "telemetry.bandwidth", "rad/s", 1, 10.0, "payload."),
    ("payload sensor bandwidth", "payload.bandwidth", "rad/s", 1, 10.0, "payload."),
    *(
        (f"payload {signal} noise", f"payload.{signal}_noise", "", -1, None, f"payload.{signal}")
        for signal in ("acceleration", "velocity", "displacement")
    ),
    ("MRU error", "mru.noise_floor", "m", -1, 0.01, "mru."),
    ("MRU gain error", "mru.gain_error", "", -1, 0.01, "mru."),
    ("MRU phase error", "mru.phase_error", "rad", -1, 0.01, "mru."),
    ("MRU drift", "mru.drift", "m", -1, 0.01, "mru."),
    ("MRU noise", "mru.noise", "", -1, None, "mru."),
    ("MRU delay", "mru.delay", "s", -1, 0.01, "mru."),
    ("MRU heave filter", "mru.heave_filter_period", "s", 0, 10.0, "mru."),
    ("load cell noise", "load_cell.noise_fraction", "", -1, 0.01, "rope.tension"),
    ("load cell bandwidth", "load_cell.bandwidth", "rad/s", 1, 10.0, "rope.tension"),
)
_STEP = 0.05  # of the logarithm, for the elasticity
_FREE = 1e-6  # price (d log rms / d log bound) below which a limit is one that does not bind
_SHARES = (1.0, 0.5, 0.25, 0.125)  # of a factor of two, for the gear
_WORTH = 0.01  # share of the rms below which nothing is worth its money


@dataclass(frozen=True, kw_only=True, eq=False)
class Item:
    """One figure that could be another."""

    #: What it is called; ``drive``, ``rope``, ``sensor``, ``link``, ``gear`` or ``margin``.
    name: str
    kind: str
    #: What it is [SI].
    value: float
    unit: str
    better: int  #: 1 if more is better, -1 if less is, 0 if that has to be found out.
    step: float  #: A natural step of it [SI], as 10 ms of delay.
    limit: str | None = None  #: Name of the limit whose bound it is, if it is one.
    #: Returns the changes of the case, by dotted path, that make it so many times as large.
    changes: Callable[[float], dict[str, float]] | None = None

    @property
    def sold(self) -> bool:
        """Whether it can be bought: a margin is given away, a gear is chosen."""
        return self.kind not in ("margin", "gear")

    def case(self, case: Case, factor: float) -> Case | None:
        """Return the case with the figure times a factor; None if there is no such case."""
        if self.changes is None:
            return None
        try:
            return case.variant({"limits.drive": "report", **self.changes(factor)})
        except InputError:
            return None


def limit_items(limits: Sequence[Limit]) -> list[Item]:
    """Return the limits of a programme as items."""
    return [
        Item(
            name=limit.name,
            kind=("rope" if limit.name.startswith("rope.") else "drive")
            if limit.drive
            else "margin",
            value=limit.bound,
            unit=limit.unit,
            better=-1 if limit.at_least else 1,
            step=_STEPS.get(limit.unit, 0.1 * limit.bound),
            limit=limit.name,
        )
        for limit in limits
    ]


def part_items(case: Case, heard: Sequence[str], heave: float) -> list[Item]:
    """Return gear, motor, sensors and delays that a design depends on, by what it hears.

    `heave` is the rms of the hook's heave [m].
    """
    ratio, torque = case.winch.gearbox.ratio, case.winch.drive.torque_continuous
    found = [
        Item(
            name="gear ratio",
            kind="gear",
            value=ratio,
            unit="",
            better=0,
            step=0.1 * ratio,
            changes=lambda factor: {"winch.gearbox.ratio": ratio * factor},
        ),
        Item(
            name="motor, all of it",
            kind="drive",
            value=torque,
            unit="N m",
            better=1,
            step=1e3,
            changes=partial(motor_changes, case),
        ),
    ]
    for name, place, unit, better, step, signal in _PARTS:
        path = f"sensors.{place}"
        value = _number_at(case, path)
        # A sensor that is perfect is not for sale, nor is one that nobody listens to.
        if value is None or not any(y.startswith(signal) for y in heard):
            continue
        given, mru = {path: value}, case.sensors.mru
        if mru is not None and name == "MRU error":
            given["sensors.mru.noise_fraction"] = mru.noise_fraction
            value = max(mru.noise_floor, mru.noise_fraction * heave)
        if value > 0.0 or not name.endswith(("noise", "error", "drift")):
            found.append(
                Item(
                    name=name,
                    kind="link" if place.startswith("telemetry") else "sensor",
                    value=value,
                    unit=unit,
                    better=better,
                    step=step or 0.1 * value,
                    changes=partial(_scaled, given),
                )
            )
    return found if case.limits.drive == "enforce" else [found[0], *found[2:]]


def _scaled(given: Mapping[str, float], factor: float) -> dict[str, float]:
    return {path: value * factor for path, value in given.items()}


def _number_at(case: Case, path: str) -> float | None:
    """Return the number at a dotted path of a case; None where there is none."""
    value: Any = case
    for name in path.split("."):
        value = getattr(value, name, None)
    return float(value) if isinstance(value, int | float) else None


@dataclass(frozen=True, kw_only=True, eq=False)
class WorthRow:
    """What one figure is worth."""

    item: Item  #: The figure: its name, value, unit, and what kind of thing it is.
    #: d log(rms) / d log(figure), by optimising again with the figure 5 % better; nan where that
    #: could not be done.
    elasticity: float = 0.0
    #: What the payload's rms changes by if the figure gets better by its natural step [m].
    per_step: float = 0.0
    #: What the figure is multiplied by to be twice as good (a gear as far as the drive stands), and
    #: the payload rms with it [m]; nan if that could not be done.
    factor: float
    twice_rms: float
    gain: float = 0.0  #: What of the rms that takes away [m].


@dataclass(frozen=True, kw_only=True, eq=False)
class Worth:
    """The answer of `worth`."""

    #: The case and the controller structure.
    case: Case
    structure: str
    #: Whether the optimum to begin with is one; the sentence for the user.
    ok: bool = False
    status: str
    payload_rms: float  #: At the optimum [m].
    rows: tuple[WorthRow, ...] = ()  #: By what the figure twice as good takes away, most first.

    @property
    def first(self) -> WorthRow | None:
        """The row to buy first: not a margin, which is given away, and not the gear."""
        sold = [row for row in self.rows if row.item.sold and row.gain > _WORTH * self.payload_rms]
        return sold[0] if sold else None

    def to_csv(self) -> str:
        """Return the rows as CSV, SI units."""
        lines = ["item,kind,value,unit,elasticity,step,rms_per_step,rms_twice_as_good"]
        for row in self.rows:
            item = row.item
            figures = (row.elasticity, item.step, row.per_step, row.twice_rms)
            numbers = ["" if math.isnan(v) else f"{v:.8g}" for v in figures]
            lines.append(",".join([item.name, item.kind, f"{item.value:.8g}", item.unit, *numbers]))
        return "\n".join(lines) + "\n"


@one_thread()
@shows_progress("searching")
def worth(
    case: Case | Design,
    *,
    structure: str = "payload-feedback",
    starts: int = 4,
    seed: int = 0,
    progress: Progress | None = None,
) -> Worth:
    """Return what each limit, sensor, delay and the gear of a case are worth.

    The design that all begins from holds with the least damping of a hysteretic rope too; what
    becomes of it with other figures is told with the damping of the case.

    Parameters
    ----------
    case
        A case, or a design, whose structure counts then.
    structure
        Controller structure, see `synth.structures.structure_names`.
    starts, seed
        Size and seed of the searches for the optimum, and for that with a figure twice as good.
    progress
        Called as progress(stage, done, total).

    Raises
    ------
    InputError
        If there is no such structure.
    """
    if isinstance(case, Design):
        design = case
    else:
        design = optimise_gains(case, structure, starts=starts, seed=seed, progress=progress)
    tell: Progress = progress or (lambda stage, done, total: None)
    result = Worth(
        case=design.case,
        structure=design.structure,
        status=design.status,
        payload_rms=design.payload_rms,
    )
    if not (design.parameters and design.drive_kept and design.feasible):
        return result
    here = answer_of(design)
    if here is None:
        return replace(result, status="the optimum could not be followed")
    items = [
        *limit_items(here.problem.limits),
        *part_items(design.case, design.measurements, design.hook_rms),
    ]
    rows = []
    for k, item in enumerate(items):
        tell("what each thing is worth", k, len(items))
        rows.append(_row(design, here, item, starts, seed))
    rows.sort(key=lambda row: -row.gain if math.isfinite(row.gain) else 0.0)
    result = replace(result, ok=True, payload_rms=here.payload_rms, rows=tuple(rows))
    return replace(result, status=_sentence(result))


def _row(design: Design, here: Answer, item: Item, starts: int, seed: int) -> WorthRow:
    """Return what one figure is worth."""
    rms = here.payload_rms
    row = WorthRow(item=item, factor=2.0 if item.better > 0 else 0.5, twice_rms=rms)
    if item.value == 0.0:
        return row  # as good as it gets
    if item.limit is not None and abs(here.prices[item.limit]) < _FREE:
        return row  # a limit that does not bind: looser, it leaves the optimum where it is
    ways = (item.better,) if item.better else (1, -1)
    found = [(way, _again(design, here, item, math.exp(way * _STEP), here)) for way in ways]
    way, near = min(found, key=lambda pair: math.inf if pair[1] is None else pair[1].payload_rms)
    twice = None
    for share in _SHARES if item.kind == "gear" else (1.0,):
        # Half or twice the gear may be more than the drive stands: then as much as it does.
        factor = 2.0 ** (way * share)
        twice = _again(design, here, item, factor, near or here)
        if twice is not None:
            twice = _searched(twice, starts, seed)
            break
    step = way * item.step / item.value
    elasticity = math.nan if near is None else math.log(near.payload_rms / rms) / (way * _STEP)
    return replace(
        row,
        elasticity=elasticity,
        per_step=rms * math.expm1(elasticity * math.log1p(step)) if step > -1.0 else math.nan,
        factor=factor,
        twice_rms=twice.payload_rms if twice is not None else math.nan,
        gain=rms - twice.payload_rms if twice is not None else 0.0,
    )


def _again(design: Design, here: Answer, item: Item, factor: float, near: Answer) -> Answer | None:
    """Return the optimum with a figure times a factor."""
    problem = _changed(design, here, item, factor)
    if problem is None:
        return None
    return follow(problem, list(dict.fromkeys((near, here))))


def _searched(followed: Answer, starts: int, seed: int) -> Answer:
    """Return the best of an answer that was followed and of what a search finds."""
    problem = followed.problem
    fresh = Answer.of(problem, search(problem, starts, seed, guesses=[followed.solved.values]))
    found = [followed, fresh] if fresh is not None else [followed]
    return min(found, key=lambda answer: answer.payload_rms)


def _changed(design: Design, here: Answer, item: Item, factor: float) -> Problem | None:
    if item.limit is not None:
        return with_bound(here.problem, item.limit, item.value * factor)
    case = item.case(design.case, factor)
    if case is None:
        return None
    return asked_by(design.case, posed(case, design.structure, design.masses))


def _sentence(result: Worth) -> str:
    """Return what to buy first."""
    rms = 1e3 * result.payload_rms
    first = result.first
    if first is not None:
        text = (
            f"buy first: {first.item.name}; twice as good leaves {1e3 * first.twice_rms:.4g} mm "
            f"rms instead of {rms:.4g} mm"
        )
    else:
        text = f"nothing that is sold takes one per cent off the {rms:.4g} mm rms"
    given = [r for r in result.rows if not r.item.sold and r.gain > _WORTH * result.payload_rms]
    if given:
        other = given[0]
        value = other.item.value * other.factor
        text += f"; {other.item.name} at {value:.4g} would leave {1e3 * other.twice_rms:.4g} mm"
    return text
