"""What a bank of seas is worth: `python docs/make/other_seas.py [--quick] [--full]`.

The thesis's winch on one spring, exact payload sensors, a reference unit with 1 % of white noise,
told its own sea at 1.9 m.  Part ``sea``: in other seas, the bank against the filter's own sea, the
bank that was told, feed-forward and the hook, by time; part ``floor``: in the sea as told, 20
minutes, for the ratio to the clairvoyant floor in `comparison.csv`.  ``--full`` has ten seas and
five seeds, else four seas and one; quarter of an hour on one core, ``--full`` an hour.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import warnings
from collections.abc import Iterator, Mapping

import numpy as np
from stored import docs_folder, study_parser, write_rows

import stillhook as sh
from models import PhysicsWarning

UNIT = {"noise_floor": 0.0, "noise_fraction": 0.01, "noise_bandwidth": 11.31}
COLUMNS = ("part", "sea", "contender", "height", "seed", "begin", "end", "rms", "misfit_at")
SPANS = ((30.0, 180.0), (180.0, 600.0), (600.0, 720.0))  # s
SETTLE = 60.0  # before which nothing counts, as in `comparison.csv`
HEIGHTS = (2.43, 1.9)  # of the floor's part [m]


def two(long: float, short: float, height: float = 1.9) -> Mapping[str, object]:
    """Return a sea of two systems with peaks at so many seconds."""
    swell = {"spectrum": "jonswap", "significant_height": 0.8 * height, "peak_period": long}
    wind = {"spectrum": "jonswap", "significant_height": 0.6 * height, "peak_period": short}
    return {"sea": {"spectrum": "sum", "parts": [{**swell, "gamma": 3.3}, {**wind, "gamma": 2.0}]}}


def jonswap(peak: float) -> Mapping[str, object]:
    """Return a sea of one system."""
    own = {"spectrum": "jonswap", "significant_height": 1.9, "peak_period": peak, "gamma": 3.3}
    return {"sea": own}


#: What the sea is where the case tells another; those of a short study first.
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
}


def winch(height: float) -> sh.Case:
    """Return the case as it is told."""
    changes = {"sensors.mru": UNIT, "sea.significant_height": height}
    return sh.load_case("thesis-1975").replace(changes)


def in_seas(names: list[str], seeds: int, weights: sh.Weights) -> Iterator[dict[str, object]]:
    """Yield rows of the controllers in other seas."""
    told = winch(1.9)
    for name in names:
        case = told.replace(SEAS[name])
        contenders = {
            "bank": sh.LinearMPC(told, weights=weights, predictor="bank"),
            "kalman": sh.LinearMPC(told, weights=weights, predictor="kalman"),
            "bank, told": sh.LinearMPC(case, weights=weights, predictor="bank"),
            "feed-forward": sh.VelocityFeedForward(case, share=1.0),
        }
        for who, controller in contenders.items():
            if name == "as told" and who == "bank, told":
                continue
            runs = sh.simulate(case, controller, seeds=seeds, duration=SPANS[-1][1])
            for seed, run in enumerate(runs):
                seen = [event.time for event in run.events if "not as the controller" in event.text]
                signals = {who: "payload.displacement"}
                if who == "bank":
                    signals["hook"] = "hook.heave"
                for label, signal in signals.items():
                    for begin, end in SPANS:
                        part = run[signal][(run.time > begin) & (run.time <= end)]
                        rms = float(np.sqrt((part**2).mean())) if part.size else np.inf
                        row = dict(
                            zip(
                                COLUMNS,
                                ("sea", name, label, 1.9, seed, begin, end, rms),
                                strict=False,
                            )
                        )
                        row["misfit_at"] = seen[0] if seen and label == "bank" else ""
                        yield row
            print(name, who, flush=True)


def over_the_floor(seeds: int, weights: sh.Weights, seconds: float) -> Iterator[dict[str, object]]:
    """Yield rows of the sea as told, for the ratio to the floor."""
    for height in HEIGHTS:
        case = winch(height)
        controller = sh.LinearMPC(case, weights=weights, predictor="bank")
        for seed, run in enumerate(sh.simulate(case, controller, seeds=seeds, duration=seconds)):
            rms = float(run["payload.displacement"][run.time > SETTLE].std())
            values = ("floor", "as told", "bank", height, seed, SETTLE, seconds, rms)
            yield {**dict(zip(COLUMNS, values, strict=False)), "misfit_at": ""}
            print(height, seed, flush=True)


def main() -> None:
    """Run both parts and keep their rows."""
    parser = study_parser(__doc__)
    parser.add_argument("--full", action="store_true", help="ten seas and five seeds")
    given = parser.parse_args()
    warnings.simplefilter("ignore", PhysicsWarning)
    weights = sh.tune_weights(winch(2.43))
    names = list(SEAS) if given.full else list(SEAS)[: 2 if given.quick else 4]
    rows = [
        *over_the_floor(1 if given.quick else 10, weights, 180.0 if given.quick else 1200.0),
        *in_seas(names, 5 if given.full else 1, weights),
    ]
    shown = [{**row, "rms": f"{row['rms']:.6g}"} for row in rows]
    path = docs_folder(given.quick) / "data" / "other_seas.csv"
    write_rows(path, COLUMNS, shown, "SI units; rms of the payload from begin to end of a run.")


if __name__ == "__main__":
    main()
