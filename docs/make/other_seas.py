"""What a bank of seas is worth: `python docs/make/other_seas.py [--quick] [--page]`.

The thesis's winch on one spring, exact payload sensors, a reference unit with 1 % of white noise,
told its own sea at 1.9 m.

    part sea    5 seeds of 12 minutes in the sea as told and in ten others: the bank, the bank that
                was told, feed-forward and the hook; the filter's own sea where it is as told
    part alarm  100 hours of the bank alone on the hook as told, an hour from each start
    part floor  10 seeds of 20 minutes as told, for the ratio to the floor in `comparison.csv`
    part limit  the same handed what the true hook's past foretells at best, by code of its own

Writes `docs/data/other_seas.csv` and its tables in `docs/mpc.md`; half an hour on one core.
``--page`` makes the tables from the rows that are there.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from stored import DOCS, docs_folder, read_rows, study_parser, write_rows

import stillhook as sh
from models import PhysicsWarning
from models.basics import FloatArray
from models.hook import HookMotion
from models.operation import SpectrumMotion
from models.sensing import Controller
from mpc.forecast import Forecast, PerfectPreview, SeaBank

Row = Mapping[str, str]
PAGE = DOCS / "mpc.md"

UNIT = {"noise_floor": 0.0, "noise_fraction": 0.01, "noise_bandwidth": 11.31}
COLUMNS = ("part", "sea", "contender", "height", "seed", "begin", "end", "rms", "misfit_at")
SPANS = ((30.0, 180.0), (180.0, 600.0), (600.0, 720.0))  # s
HOUR = 3600.0  # s
SEEDS, HOURS, FLOORS = 5, 100, 10  # runs of each sea, starts as told, runs over each floor
KNOWN = 2e-3  # error of the filter's hook in the alarms' part, over the hook's rms
# Asked: seconds to notice, times what is left when told, mean squares over the floor's.
AT_ONCE, WORST, RATIOS = 60.0, (3.0, 1.5), (4.5, 5.0)
SETTLE = 60.0  # before which nothing counts, as in `comparison.csv`
HEIGHTS = (2.43, 1.9)  # of the floor's part [m]
# Of the best forecast: samples that it remembers, relative error of the hook that it knows, and
# distance of the lines of its spectrum [rad/s].
PAST, EXACT, SPACING = 1600, 1e-3, 2.0 * np.pi / 4000.0


def two(long: float, short: float, height: float = 1.9) -> Mapping[str, object]:
    """Return a sea of two systems with peaks at so many seconds."""
    swell = {"spectrum": "jonswap", "significant_height": 0.8 * height, "peak_period": long}
    wind = {"spectrum": "jonswap", "significant_height": 0.6 * height, "peak_period": short}
    return {"sea": {"spectrum": "sum", "parts": [{**swell, "gamma": 3.3}, {**wind, "gamma": 2.0}]}}


def jonswap(peak: float) -> Mapping[str, object]:
    """Return a sea of one system."""
    own = {"spectrum": "jonswap", "significant_height": 1.9, "peak_period": peak, "gamma": 3.3}
    return {"sea": own}


#: What the sea is where the case tells another.
SEAS: Mapping[str, Mapping[str, object]] = {
    "as told": {},
    "period +30 %": {"sea.significant_period": 10.53},
    "period -30 %": {"sea.significant_period": 5.67},
    "14 s and 6.5 s": two(14.0, 6.5),
    "period +15 %": {"sea.significant_period": 9.3},
    "17 s and 7 s": two(17.0, 7.0),
    "11 s and 5.5 s": two(11.0, 5.5),
    "jonswap 9 s": jonswap(9.0),
    "jonswap 12 s": jonswap(12.0),
    "jonswap 16 s": jonswap(16.0),
    "height +30 %": {"sea.significant_height": 2.47},
}
#: Of these, foretold as well by who is told another: a height that is not judged, almost his sea.
ALIKE = ("height +30 %", "jonswap 9 s")


def winch(height: float) -> sh.Case:
    """Return the case as it is told."""
    changes = {"sensors.mru": UNIT, "sea.significant_height": height}
    return sh.load_case("thesis-1975").replace(changes)


class BestOfPast(PerfectPreview):
    """The best that a linear forecast can do: the normal equations of the sea that is told.

    It knows the true hook of the last 80 s to a thousandth, as exact sensors tell it; earlier, as
    it has no such past, it is the record itself.  Covariances are sums over the spectrum: nothing
    here is code of the bank's.
    """

    def __init__(self, case: sh.Case) -> None:
        super().__init__(sample_time=0.05, horizon=8.0)
        hook, T = HookMotion.from_case(case), self.sample_time
        self._ago = np.concatenate([np.arange(160), np.arange(160, PAST, 2)])
        omega = np.arange(1, round(hook.band[1] / SPACING)) * SPACING
        lines = hook.density(omega) * SPACING
        lags = np.arange(PAST + self.leads.size) * T
        c, s, w = (
            np.array([float(power @ turn(omega * lag)) for lag in lags])
            for power, turn in (
                (lines, np.cos),
                (lines * omega, np.sin),  # of displacement later and velocity now
                (lines * omega**2, np.cos),
            )
        )
        apart = self._ago[None, :] - self._ago[:, None]
        cross = np.sign(apart) * s[np.abs(apart)]
        seen = np.block([[c[np.abs(apart)], cross], [-cross, w[np.abs(apart)]]])
        seen += np.diag(np.repeat(np.square(EXACT) * np.array([c[0], w[0]]), self._ago.size))
        later = np.arange(self.leads.size)[:, None] + self._ago[None, :]
        wanted = np.block([[c[later], s[later]], [-s[later], w[later]]])
        self._gain = np.linalg.solve(seen, wanted.T).T
        left = np.repeat([c[0], w[0]], self.leads.size) - np.sum(self._gain * wanted, axis=1)
        self.errors = np.sqrt(np.maximum(left, 0.0)).reshape(2, -1)

    def forecast(self) -> Forecast:
        """Return the forecast at now + leads."""
        true, record = super().forecast(), self._record
        now = round(self._time / self.sample_time)
        if record is None or now < PAST:
            return true
        mean = (self._gain @ record[:, now - self._ago].ravel()).reshape(2, -1)
        return Forecast(*mean, *self.errors)


def row(*values: object, misfit_at: float | None = None) -> dict[str, object]:
    """Return a row of the study."""
    return {**dict(zip(COLUMNS, values, strict=False)), "misfit_at": misfit_at or ""}


def in_seas(names: Sequence[str], seeds: int, weights: sh.Weights) -> Iterator[dict[str, object]]:
    """Yield rows of the controllers in other seas."""
    told = winch(1.9)
    for name in names:
        case = told.replace(SEAS[name])
        contenders: dict[str, Controller] = {
            "bank": sh.LinearMPC(told, weights=weights, predictor="bank"),
            "feed-forward": sh.VelocityFeedForward(case, share=1.0),
        }
        if name == "as told":
            contenders["kalman"] = sh.LinearMPC(told, weights=weights, predictor="kalman")
        else:
            contenders["bank, told"] = sh.LinearMPC(case, weights=weights, predictor="bank")
        for who, controller in contenders.items():
            runs = sh.simulate(case, controller, seeds=seeds, duration=SPANS[-1][1])
            for seed, run in enumerate(runs):
                seen = [event.time for event in run.events if "not as the controller" in event.text]
                signals = {who: "payload.displacement"}
                if who == "bank":
                    signals["hook"] = "hook.heave"
                for label, signal in signals.items():
                    for begin, end in SPANS:
                        part = run[signal][(run.time > begin) & (run.time <= end)]
                        rms = float(np.sqrt((part**2).mean()))
                        first = seen[0] if seen and label == "bank" else None
                        yield row("sea", name, label, 1.9, seed, begin, end, rms, misfit_at=first)
            print(name, who, flush=True)


def alarms(hours: int, weights: sh.Weights) -> Iterator[dict[str, object]]:
    """Yield rows of the bank alone on the hook of the sea as told, an hour each."""
    told = winch(1.9)
    bank = sh.LinearMPC(told, weights=weights, predictor="bank").predictor
    assert isinstance(bank, SeaBank)
    hook, T = HookMotion.from_case(told), bank.sample_time
    errors = KNOWN * np.array([hook.displacement.rms, hook.velocity.rms])
    for seed in range(hours):
        motion = SpectrumMotion(hook=hook).motion(HOUR, T, seed)
        z, v, _ = motion.block(0, motion.rows)
        noise = errors[:, None] * np.random.default_rng(seed).standard_normal((2, z.size))
        shown = np.array([z, v]) + noise
        bank.reset()
        first = None
        for k, (heave, rate) in enumerate(shown.T.tolist()):
            bank.update(heave, rate, True, k * T)
            if bank.misfit:
                first = k * T
                break
        rms = float(hook.displacement.rms)
        yield row("alarm", "as told", "bank", 1.9, seed, 0.0, HOUR, rms, misfit_at=first)


def over_the_floor(
    part: str, seeds: int, weights: sh.Weights, seconds: float
) -> Iterator[dict[str, object]]:
    """Yield rows of the sea as told, for the ratio to the floor."""
    for height in HEIGHTS:
        case = winch(height)
        preview = BestOfPast(case) if part == "limit" else None
        controller = sh.LinearMPC(case, weights=weights, predictor="bank", preview=preview)
        who = "bank" if preview is None else "best of the past"
        for seed, run in enumerate(sh.simulate(case, controller, seeds=seeds, duration=seconds)):
            rms = float(run["payload.displacement"][run.time > SETTLE].std())
            yield row(part, "as told", who, height, seed, SETTLE, seconds, rms)
            print(part, height, seed, flush=True)


def of(rows: Sequence[Row], sea: str, who: str, span: int) -> FloatArray:
    """Return a contender's rms in a sea and a span, by seed [m]."""
    found = [
        float(r["rms"])
        for r in rows
        if (r["part"], r["sea"], r["contender"]) == ("sea", sea, who)
        and float(r["begin"]) == SPANS[span][0]
    ]
    return np.array(found)


def over_floor(row: Row, height: float, part: str = "floor") -> bool:
    """Return whether a row is of a part that is held to the floor, at a height [m]."""
    return row["part"] == part and float(row["height"]) == height


def pooled(rows: Sequence[Row], sea: str, who: str, span: int) -> float:
    """Return a contender's rms over all seeds [m]."""
    return float(np.sqrt((of(rows, sea, who, span) ** 2).mean()))


def seen_after(rows: Sequence[Row], sea: str) -> list[float]:
    """Return when each seed's sea was seen to be another [s], infinity if never."""
    return [
        float(r["misfit_at"] or np.inf)
        for r in rows
        if (r["sea"], r["contender"]) == (sea, "bank")
        and r["part"] == "sea"
        and float(r["begin"]) == SPANS[0][0]
    ]


def millimetres(metres: float) -> str:
    """Return a length with three digits or, from 100 mm on, in whole ones."""
    return f"{1e3 * metres:.0f}" if metres > 0.1 else f"{1e3 * metres:.3g}"


def seas_table(rows: Sequence[Row]) -> str:
    """Return what was left in each sea, and when it was seen, as Markdown."""
    head = ("the sea is", "`bank`", "`bank`, told", "feed-forward", "hook", "seen after")
    lines = [f"| {' | '.join(head)} |", f"|{' --- |' * len(head)}"]
    for sea in SEAS:
        cells = [sea]
        for who in ("bank", "bank, told", "feed-forward", "hook"):
            if sea == "as told" and who == "bank, told":
                cells.append("")
                continue
            cells.append(
                ", ".join(millimetres(pooled(rows, sea, who, k)) for k in range(len(SPANS)))
            )
        seen = seen_after(rows, sea)
        late = sorted(at for at in seen if at < np.inf)
        if late:
            when = f"{late[0]:.0f} to {late[-1]:.0f} s"
            cells.append(when if len(late) == len(seen) else f"{when}, {len(late)} of {len(seen)}")
        else:
            cells.append("never")
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def asked_table(rows: Sequence[Row]) -> str:
    """Return what was asked of the bank and what it does, as Markdown."""
    others = [sea for sea in SEAS if sea != "as told"]
    seen = np.array([seen_after(rows, sea) for sea in others])
    costs = [sea not in ALIKE for sea in others]
    alarm = [r for r in rows if r["part"] == "alarm"]
    false = sum(r["misfit_at"] != "" for r in alarm)
    spans = range(len(SPANS))

    def share(good: Sequence[NDArray[np.bool_]]) -> str:
        all_of = np.concatenate(good)
        return f"{all_of.sum()} of {all_of.size}"

    def bank(sea: str, k: int) -> FloatArray:
        return of(rows, sea, "bank", k)

    hook = [bank(sea, k) <= of(rows, sea, "hook", k) for sea in SEAS for k in spans]
    plain = [bank(sea, k) <= 1.2 * of(rows, sea, "feed-forward", k) for sea in SEAS for k in spans]
    lines = [
        ("another sea seen within 60 s", "95 %", f"{100.0 * (seen <= AT_ONCE).mean():.0f} %"),
        ("without the two told below", "95 %", f"{100.0 * (seen[costs] <= AT_ONCE).mean():.0f} %"),
        ("false alarms, sea as told", "< 1 in 100 h", f"{false} in {len(alarm)} h"),
        ("no worse than the hook, from 30 s on", "always", share(hook)),
        ("nor than 1.2 times feed-forward", "always", share(plain)),
    ]
    for k, most in zip((1, 2), WORST, strict=True):
        times = {s: pooled(rows, s, "bank", k) / pooled(rows, s, "bank, told", k) for s in others}
        worst = max(times, key=lambda sea: times[sea])
        lines.append(
            (
                f"times what is left when told, from {SPANS[k][0] / 60.0:.0f} min on",
                f"{most:g}",
                f"{times[worst]:.2g} at worst ({worst})",
            )
        )
    both = [
        float(
            np.sqrt(
                sum(
                    (of(rows, "as told", who, k) ** 2).mean() * (b - a)
                    for k, (a, b) in enumerate(SPANS)
                )
            )
        )
        for who in ("bank", "kalman")
    ]
    lines.append(("left in the sea as told, over `kalman`", "1.05", f"{both[0] / both[1]:.2g}"))
    for height, most in zip(HEIGHTS, RATIOS, strict=True):
        ratios = {}
        for part in ("floor", "limit"):
            own = {r["seed"]: float(r["rms"]) for r in rows if over_floor(r, height, part)}
            least = [
                float(r["rms"])
                for r in read_rows(DOCS / "data" / "comparison.csv")
                if (r["case"], r["noise"], r["mismatch"]) == ("thesis-1975", "0.01", "")
                and r["contender"] == "clairvoyant"
                and float(r["height"]) == height
                and r["seed"] in own
            ]
            ratios[part] = float(np.square(list(own.values())).sum() / np.square(least).sum())
        lines += [
            (
                f"mean square over the floor's, {height:g} m, {FLOORS} seeds",
                f"{most:g}",
                f"{ratios['floor']:.2g}",
            ),
            ("the same by the best forecast from the hook's past", "", f"{ratios['limit']:.2g}"),
        ]
    table = [f"| {' | '.join(cells)} |" for cells in [("", "asked", "found"), *lines]]
    return "\n".join([table[0], "| --- | --- | --- |", *table[1:]])


TABLES: Mapping[str, Callable[[Sequence[Row]], str]] = {"seas": seas_table, "asked": asked_table}


def page(text: str, rows: Sequence[Row]) -> str:
    """Return the page with its tables anew."""
    for name, make in TABLES.items():
        begin, end = f"<!-- {name}: begin -->\n", f"\n<!-- {name}: end -->"
        before, _, rest = text.partition(begin)
        text = before + begin + make(rows) + end + rest.partition(end)[2]
    return text


def main() -> None:
    """Run the parts, keep their rows, and write the tables."""
    parser = study_parser(__doc__)
    parser.add_argument("--page", action="store_true", help="only make the tables anew")
    given = parser.parse_args()
    warnings.simplefilter("ignore", PhysicsWarning)
    docs = docs_folder(given.quick)
    path = docs / "data" / "other_seas.csv"
    if not given.page:
        weights = sh.tune_weights(winch(2.43))
        if given.quick:
            rows = [*alarms(1, weights), *in_seas(list(SEAS)[:2], 1, weights)]
        else:
            rows = [
                *in_seas(list(SEAS), SEEDS, weights),
                *alarms(HOURS, weights),
                *over_the_floor("floor", FLOORS, weights, 1200.0),
                *over_the_floor("limit", FLOORS, weights, 1200.0),
            ]
        shown = [{**row, "rms": f"{row['rms']:.6g}"} for row in rows]
        write_rows(path, COLUMNS, shown, "SI units; rms of the payload from begin to end of a run.")
    if not given.quick:
        text = page(PAGE.read_text(encoding="utf-8"), read_rows(path))
        PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
