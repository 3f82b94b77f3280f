"""Tables and sentences of a comparison: what information, filter and plan do, who loses the load.

    Comparison --> tables, sentences computed from the numbers

Contenders are compared seed by seed: the ratio of two of them in the same sea varies far less
than either.  A difference is called one only where the 95 % interval of the ratio leaves out one,
and credit is given step by step: to a second sensor, to the filter, to the plan.
"""

import math
from collections.abc import Callable, Sequence

from models.basics import Interval

from ..text import Column, Table, Written, count, duration, listed, number, percent, quantity, scale
from .comparison import CAUSAL, Comparison

LEGEND = (
    "rms: pooled over seeds; largest: mean over seeds; sat.: of the time at the drive's limits; "
    "lost: runs in which the payload left its place by more than the hook's significant height, "
    "or the brake stepped in; drum held: of the payload's rms with the drum held; residual: of "
    "the hook's; intervals: 95 %, on a log scale"
)
"""What the headings of the table mean."""

_EVEN = 1.25  # an interval of the ratio within this factor says "no difference"
_UNSURE = "cannot be told from so few seeds"
_MANY = 1000.0  # beyond that a ratio says no more


def about_of(found: Comparison) -> str:
    """Return what was compared."""
    seas = f"{count(len(found.seeds), 'seed')} of {duration(found.question.duration)}"
    heights = ", ".join(f"{height:.4g}" for height in found.heights)
    text = f"{count(len(found.contenders), 'contender')}, H_s {heights} m, {seas}"
    off = found.question.mismatch.text
    return f"{text}; the plant is off by {off}" if off else text


def tables_at(found: Comparison, height: float) -> list[Table]:
    """Return the tables at a height, one row for each contender that has runs: sizes, ratios."""
    floor = found.floor_at(height)
    there = [
        each.name
        for each in found.contenders
        if found.of(each.name, height) and (each.group != "floor" or floor is not None)
    ]
    if not there:
        return []
    every = found.table[found.table["height"] == height].set_index("contender")
    sizes = [found.pooled(name, height) for name in there]
    factor, unit = scale("m", max((s for s in sizes if math.isfinite(s)), default=1.0))
    rows = []
    for name in there:
        row, mean, lost = every.loc[name], found.rms(name, height), found.lost(name, height)
        between = ""
        if math.isfinite(mean.low):
            between = f"{number(mean.low / factor, 2)} to {number(mean.high / factor, 2)}"
        rows.append(
            (
                name,
                mean.mean,
                between,
                *(float(row[column]) for column in ("largest", "saturated")),
                Written(lost, f"{lost}/{len(found.of(name, height))}"),
                0.01 * float(row["residual held"]),
            )
        )
    heads = (
        Column("contender", f"H_s {height:.4g} m"),
        Column("rms", write=lambda value: f"{number(value / factor)} {unit}"),
        Column("interval", "95 % interval"),
        Column("largest", write=lambda value: number(value / factor)),
        Column("saturated", "sat.", write=lambda share: f"{share:.3g} %"),
        Column("lost"),
        Column("residual_held", "drum held", write=percent),
    )
    sized = Table(columns=heads, rows=rows)
    best = found.best(height, CAUSAL)
    over = (
        Column("contender", "paired by seed"),
        Column("residual"),
        Column("over_the_best", f"over {best or 'the best'}"),
        Column("over_the_floor", "over the floor"),
    )
    ratios = [
        (
            name,
            _within(found.residual(name, height), 100.0, " %"),
            *("" if name == to else _within(found.ratio(name, height, to)) for to in (best, floor)),
        )
        for name in there
    ]
    return [sized, Table(columns=over, rows=ratios)]


def left_out(found: Comparison) -> list[str]:
    """Return who did not take part, and why, one line each."""
    reasons: dict[tuple[str, str], list[float]] = {}
    for each in found.contenders:
        for height in found.heights:
            reason = found.refused.get((each.name, height))
            if reason is not None:
                reasons.setdefault((each.name, reason), []).append(height)
    lines = []
    for (name, reason), heights in reasons.items():
        where = ""
        if len(heights) < len(found.heights):
            where = f" at H_s {', '.join(f'{height:.4g}' for height in heights)} m"
        lines.append(f"{name} did not take part{where}: {reason}")
    empty = [
        height
        for height in found.heights
        if found.floor is not None
        and found.of(found.floor.name, height)
        and found.floor_at(height) is None
    ]
    if empty:
        where = listed([f"{height:.4g}" for height in empty])
        text = "everything known in advance leaves under a thousandth of the stillest's rms"
        lines.append(f"no floor at H_s {where} m: {text}")
    return lines


def sentences_of(found: Comparison) -> tuple[str, ...]:
    """Return what the numbers say: for each height who is still, and what each step is worth."""
    lines = []
    for height in found.heights:
        parts = []
        linear = found.best(height, ("linear",))
        if linear is not None:
            parts.append(_best_linear(found, linear, height))
        parts += [_against(found, *step, height) for step in _steps(found, height)]
        lost = _lost(found, height)
        if lost:
            parts.append(lost)
        lines += [f"H_s {height:.4g} m: {part}." for part in parts]
    return (*lines, *_overall(found))


def _steps(found: Comparison, height: float) -> list[tuple[str, str, str]]:
    """Return what is credited, to whom, and against whom it is held."""
    best = {group: found.best(height, (group,)) for group in (*CAUSAL, "reference")}
    rival, plain, mpc, future = (
        best[group] for group in ("linear", "filter", "predictive", "reference")
    )
    both = _stillest(found, height, lambda heard: {"payload", "mru"} <= heard)
    single = _stillest(found, height, lambda heard: len(heard) == 1)
    # The stillest of all is held against, so that no credit comes from a weak rival.
    own = "filter and plan" if rival == both else "filter, plan and a second sensor"
    steps = [
        ("hearing payload and reference unit", both, single),
        ("the filter of MPC, without its plan", plain, rival),
        ("planning within the limits", mpc, plain),
        (own, mpc, rival),
        ("a controller of one's own", best["own"], rival),
        ("knowing the future", future, mpc),
        ("the rest to the floor", found.floor_at(height), mpc or rival),
    ]
    return [(what, a, b) for what, a, b in steps if a is not None and b is not None]


def _heard(found: Comparison, name: str, height: float) -> set[str]:
    """Return the sensors of payload and hook that a linear law hears."""
    contender = found.contender(name)
    recipe = contender.recipe
    if contender.group != "linear" or recipe is None:
        return set()
    law = recipe.design or found.laws.get((name, height))
    if law is None:
        return {"payload"} if name == "thesis" else {"mru"} if "forward" in name else set()
    sensors = {each.partition(".")[0] for each in law.values.get("measurements", ())}
    return sensors & {"payload", "mru"}


def _stillest(found: Comparison, height: float, wanted: Callable[[set[str]], bool]) -> str | None:
    """Return who is the stillest of the linear laws whose sensors are wanted."""
    known = {
        each.name: value
        for each in found.contenders
        if math.isfinite(value := found.pooled(each.name, height))
        and wanted(_heard(found, each.name, height))
    }
    return min(known, key=known.__getitem__, default=None)


def _best_linear(found: Comparison, name: str, height: float) -> str:
    """Return who is the best linear law, and how it is against the brake."""
    text = f"the best linear law is {name}, {quantity(found.pooled(name, height), 'm')} rms"
    lost = found.lost(name, height)
    if lost:
        text += (
            f" though it loses the load in {lost} of {count(len(found.of(name, height)), 'run')}"
        )
    ratio = found.ratio(name, height, found.best(height, ("brake",)))
    if math.isfinite(ratio.mean):
        text += f", {_within(ratio)} times that with the drum held"
    return text


def _against(found: Comparison, what: str, name: str, other: str, height: float) -> str:
    """Return whether what is credited to one contender makes it better than another."""
    ratio = found.ratio(name, height, other)
    if not ratio.count:
        return f"{what}: {name} and {other} have no run in common"
    text = f"{what}: {name} has {_within(ratio)} times the rms of {other}"
    if ratio.count == 1:
        return f"{text}, in a single sea"
    if found.contender(name).group == "floor":
        return text
    return f"{text}; {_it(_verdict(ratio))}"


def _within(ratio: Interval, factor: float = 1.0, unit: str = "") -> str:
    """Return a ratio with its interval."""
    if not math.isfinite(ratio.mean):
        return ""
    if ratio.mean > _MANY:
        return f"over {number(factor * _MANY, 4)}{unit}"
    text, low, high = (number(factor * each, 2) for each in (ratio.mean, ratio.low, ratio.high))
    return f"{text}{unit}" if math.isnan(ratio.low) else f"{text}{unit} ({low} to {high})"


def _verdict(ratio: Interval) -> str:
    """Return what an interval of a ratio says."""
    if ratio.high < 1.0:
        return "helps"
    told = ratio.low > 1.0 or (ratio.low >= 1.0 / _EVEN and ratio.high <= _EVEN)
    return "does not help" if told else _UNSURE


def _it(verdict: str) -> str:
    return f"{'whether it helps' if verdict == _UNSURE else 'it'} {verdict}"


def _lost(found: Comparison, height: float) -> str:
    """Return who loses the load at a height."""
    told = [
        f"{each.name} in {found.lost(each.name, height)}"
        for each in found.contenders
        if found.lost(each.name, height)
    ]
    return f"the load is lost by {listed(told)} of {len(found.seeds)}" if told else ""


def _overall(found: Comparison) -> Sequence[str]:
    """Return at which heights planning helps and at which it does not, where there are several."""
    verdicts: dict[str, list[float]] = {"helps": [], "does not help": [], _UNSURE: []}
    for height in found.heights:
        plain, mpc = found.best(height, ("filter",)), found.best(height, ("predictive",))
        if plain is not None and mpc is not None and len(found.heights) > 1:
            verdicts[_verdict(found.ratio(mpc, height, plain))].append(height)
    parts = [
        f"{_it(verdict)} at H_s {listed([f'{h:.4g}' for h in heights])} m"
        for verdict, heights in verdicts.items()
        if heights
    ]
    return (f"Planning within the limits: {'; '.join(parts)}.",) if parts else ()
