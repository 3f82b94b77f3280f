"""Tables and sentences of a comparison: where prediction helps, where not, who loses the load.

    Comparison --> tables, sentences computed from the numbers

Contenders are compared seed by seed: the ratio of two of them in the same sea varies far less
than either.  A difference is called one only where Student's 95 % interval of the mean log ratio
leaves out zero.
"""

import math
from collections.abc import Sequence

from models.basics import Interval, mean_interval

from ..text import Column, Table, Written, count, duration, listed, number, percent, quantity, scale
from .comparison import Comparison

LEGEND = (
    "sat.: of the time at the drive's limits; lost: runs in which the payload left its place by "
    "more than the hook's significant height, or the brake stepped in; residual: of the hook's "
    "motion; drum held: of the payload's with the drum held; / floor: mean square over the "
    "clairvoyant's"
)
"""What the headings of the table mean."""

_NOTHING = 1e-12  # [m]
_EVEN = math.log(1.25)  # an interval of the log ratio within this says "no difference"
_UNSURE = "cannot be told from so few seeds"
_MANY = 1000.0  # beyond that a ratio says no more


def about_of(found: Comparison) -> str:
    """Return what was compared."""
    seas = f"{count(len(found.seeds), 'seed')} of {duration(found.question.duration)}"
    heights = ", ".join(f"{height:.4g}" for height in found.heights)
    text = f"{count(len(found.contenders), 'contender')}, H_s {heights} m, {seas}"
    off = found.question.mismatch.text
    return f"{text}; the plant is off by {off}" if off else text


def table_at(found: Comparison, height: float) -> Table:
    """Return the table at a height, one row for each contender that has runs."""
    sizes = [found.pooled(each.name, height) for each in found.contenders]
    factor, unit = scale("m", max((s for s in sizes if math.isfinite(s)), default=1.0))
    every, rows = found.table, []
    for each in found.contenders:
        cells = found.of(each.name, height)
        if not cells:
            continue
        mean = found.rms(each.name, height)
        between = ""
        if math.isfinite(mean.low):
            between = f"{number(max(mean.low, 0.0) / factor)} to {number(mean.high / factor)}"
        row = every[(every["contender"] == each.name) & (every["height"] == height)].iloc[0]
        lost = found.lost(each.name, height)
        figures = (float(row[name]) for name in ("largest", "saturated"))
        rows.append(
            (
                each.name,
                mean.mean,
                between,
                *figures,
                Written(lost, f"{lost}/{len(cells)}"),
                0.01 * float(row["residual"]),
                0.01 * float(row["residual held"]),
                float(row["of the floor"]),
            )
        )
    heads = (
        Column("contender", f"H_s {height:.4g} m"),
        Column("rms", write=lambda value: f"{number(value / factor)} {unit}"),
        Column("interval", "95 % interval"),
        Column("largest", write=lambda value: number(value / factor)),
        Column("saturated", "sat.", write=lambda share: f"{share:.3g} %"),
        Column("lost"),
        Column("residual", write=percent),
        Column("residual_held", "drum held", write=percent),
        Column("of_the_floor", "/ floor"),
    )
    return Table(columns=heads, rows=rows)


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
    return lines


def sentences_of(found: Comparison) -> tuple[str, ...]:
    """Return what the numbers say: one sentence for each height, and what is the same for all."""
    lines = []
    for height in found.heights:
        linear = found.best(height, ("linear",))
        predictive = found.best(height, ("predictive",))
        parts = []
        if linear is not None:
            parts.append(_best_linear(found, linear, height))
        if linear is not None and predictive is not None:
            parts.append(_against(found, predictive, linear, height, "prediction"))
        reference = found.best(height, ("reference",))
        if reference is not None and predictive is not None:
            parts.append(_against(found, reference, predictive, height, "knowing the future"))
        own = found.best(height, ("own",))
        if linear is not None and own is not None:
            parts.append(_against(found, own, linear, height, ""))
        lost = _lost(found, height)
        if lost:
            parts.append(lost)
        if parts:
            lines.append(f"H_s {height:.4g} m: {'; '.join(parts)}.")
    return (*lines, *_overall(found))


def _best_linear(found: Comparison, name: str, height: float) -> str:
    """Return who is the best linear law, against the brake, and how far above the floor."""
    text = f"the best linear law is {name}, {quantity(found.pooled(name, height), 'm')} rms"
    lost = found.lost(name, height)
    if lost:
        text += (
            f" though it loses the load in {lost} of {count(len(found.of(name, height)), 'run')}"
        )
    held = found.best(height, ("brake",))
    if held is not None and found.pooled(name, height) > 0.0:
        share = found.pooled(held, height) / found.pooled(name, height)
        side = "less" if share >= 1.0 else "more"
        times = max(share, 1.0 / share)
        factor = number(times, 2) if times < _MANY else f"over {_MANY:.0f}"
        text += f", {factor} times {side} than with the drum held"
    if found.floor is not None:
        least = found.pooled(found.floor.name, height)
        if least > 0.0:
            text += f"; the floor is {quantity(least, 'm')}"
    return text


def _against(found: Comparison, name: str, other: str, height: float, what: str) -> str:
    """Return whether one contender is better than another, seed by seed."""
    ratios = _log_ratios(found, name, other, height)
    label = f"{name} ({what})" if what else name
    if not ratios:
        return f"{label} and {other} have no run in common"
    mean = mean_interval(ratios)
    factor = math.exp(mean.mean)
    if math.isnan(mean.low):
        side = "less" if factor < 1.0 else "more"
        times = number(max(factor, 1.0 / factor), 2)
        return f"{label} moves the load {times} times {side} than {other}, in a single sea"
    verdict, ends = _verdict(mean), (mean.low, mean.high)
    if mean.high < 0.0:  # as many times less
        ends = (-mean.high, -mean.low)
    band = " to ".join(number(math.exp(end), 2) for end in ends)
    if mean.low <= 0.0 <= mean.high:
        than = f"{band} times the rms of {other}"
    else:
        than = f"{band} times {'less' if mean.high < 0.0 else 'more'} rms than {other}"
    if verdict == _UNSURE:
        return f"whether {label} helps cannot be told from {count(len(ratios), 'seed')}: {than}"
    return f"{label} {verdict}: {than}"


def _verdict(mean: Interval) -> str:
    """Return what an interval of the mean log ratio says."""
    if mean.high < 0.0:
        return "helps"
    told = mean.low > 0.0 or max(-mean.low, mean.high) <= _EVEN
    return "does not help" if told else _UNSURE


def _log_ratios(found: Comparison, name: str, other: str, height: float) -> list[float]:
    theirs = {cell.seed: cell.rms for cell in found.of(other, height)}
    pairs = [(cell.rms, theirs.get(cell.seed, math.nan)) for cell in found.of(name, height)]
    return [
        math.log(max(a, _NOTHING) / max(b, _NOTHING))
        for a, b in pairs
        if math.isfinite(a) and math.isfinite(b)
    ]


def _lost(found: Comparison, height: float) -> str:
    """Return who loses the load at a height."""
    told = [
        f"{each.name} in {found.lost(each.name, height)}"
        for each in found.contenders
        if found.lost(each.name, height)
    ]
    return f"the load is lost by {listed(told)} of {len(found.seeds)}" if told else ""


def _overall(found: Comparison) -> Sequence[str]:
    """Return at which heights prediction helps and at which it does not."""
    verdicts: dict[str, list[float]] = {"helps": [], "does not help": [], _UNSURE: []}
    for height in found.heights:
        linear, best = found.best(height, ("linear",)), found.best(height, ("predictive",))
        if linear is None or best is None:
            continue
        ratios = _log_ratios(found, best, linear, height)
        verdicts[_verdict(mean_interval(ratios)) if ratios else _UNSURE].append(height)
    parts = [
        f"it {verdict} at H_s {listed([f'{h:.4g}' for h in heights])} m"
        for verdict, heights in verdicts.items()
        if heights
    ]
    if not parts:
        if any(each.group == "predictive" for each in found.contenders):
            return (
                "Whether prediction helps cannot be told: there is nothing to compare it with.",
            )
        return ()
    return (f"Prediction against the best linear law: {'; '.join(parts)}.",)
