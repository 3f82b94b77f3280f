"""What a preview of the hook is worth: `python docs/make/preview.py [--quick]`.

The thesis's winch on one spring at 2.43 m, exact payload sensors, a reference unit with 1 % of
white noise.  `LinearMPC(..., predictor="bank", preview=...)` is handed the record of the next
seconds with an error: another record of the same sea, that grows evenly with the lead to a share of
the hook's at the last one.  Lead 0 is without a preview; ``all`` is the record itself for 14 s.
Minutes on one core; it writes `docs/data/preview.csv` and the table in `docs/mpc.md`.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import math
import warnings
from collections.abc import Iterator, Sequence

from other_seas import SETTLE, winch
from stored import DOCS, docs_folder, read_rows, study_parser, write_rows

import stillhook as sh
from models import PhysicsWarning
from models.operation import Motion, SpectrumMotion
from mpc.forecast import Forecast, PerfectPreview

COLUMNS = ("lead", "error", "seeds", "rms")
HEIGHT = 2.43  # m
LEADS, ERRORS = (1.0, 2.0, 3.0, 5.0), (0.0, 0.1, 0.2, 0.4)  # s, of the hook's rms
BEGIN, END = "<!-- preview -->\n", "<!-- preview, end -->\n"
_OTHER = 1000  # seed of the record that the error is made of


class Erring(PerfectPreview):
    """The record to come with an error that grows evenly with the lead, and is stated."""

    def __init__(self, case: sh.Case, lead: float, error: float) -> None:
        super().__init__(sample_time=0.05, horizon=lead)
        self._false = PerfectPreview(sample_time=0.05, horizon=lead)
        self._case, self._share = case, error * self.leads / lead

    def foresee(self, motion: Motion) -> None:
        """Take the record that follows, and make one that is false."""
        super().foresee(motion)
        seconds = (motion.rows - 1) * motion.step
        false = SpectrumMotion.from_case(self._case).motion(seconds, motion.step, _OTHER)
        self._false.foresee(false)
        z, v, _ = false.block(0, false.rows)
        self._sizes = float(z.std()), float(v.std())

    def update(self, heave: float, rate: float, valid: bool, time: float) -> None:
        """Take the time [s]."""
        super().update(heave, rate, valid, time)
        self._false.update(heave, rate, valid, time)

    def forecast(self) -> Forecast:
        """Return the record with its error, and the error's standard deviations."""
        true, false, (z, v) = super().forecast(), self._false.forecast(), self._sizes
        return Forecast(
            true.displacement + self._share * false.displacement,
            true.velocity + self._share * false.velocity,
            self._share * z,
            self._share * v,
        )


def study(seeds: int, seconds: float, leads: Sequence[float]) -> Iterator[dict[str, object]]:
    """Yield the rows."""
    case = winch(HEIGHT)
    weights = sh.tune_weights(case)

    def row(lead: object, error: float, controller: sh.LinearMPC) -> dict[str, object]:
        squares = [
            float((run["payload.displacement"][run.time > SETTLE] ** 2).mean())
            for run in sh.simulate(case, controller, seeds=seeds, duration=seconds)
        ]
        rms = math.sqrt(sum(squares) / seeds)
        print(lead, error, f"{1e3 * rms:.1f} mm", flush=True)
        return dict(zip(COLUMNS, (lead, error, seeds, f"{rms:.5g}"), strict=True))

    yield row(0, 0.0, sh.LinearMPC(case, weights=weights, predictor="bank"))
    yield row("all", 0.0, sh.LinearMPC(case, weights=weights, predictor="preview"))
    for lead in leads:
        for error in ERRORS:
            preview = Erring(case, lead, error)
            yield row(
                lead,
                error,
                sh.LinearMPC(case, weights=weights, predictor="bank", preview=preview),
            )


def table(rows: Sequence[dict[str, str]]) -> str:
    """Return the table of the page."""
    left = {(row["lead"], float(row["error"])): 1e3 * float(row["rms"]) for row in rows}
    head = "| preview | " + " | ".join(f"error {100.0 * error:g} %" for error in ERRORS) + " |"
    lines = [head, "| --- |" + " --- |" * len(ERRORS)]
    for lead in dict.fromkeys(lead for lead, _ in left if lead not in {"0", "all"}):
        cells = [f"{left[lead, error]:.3g}" for error in ERRORS]
        lines.append(f"| {float(lead):g} s | " + " | ".join(cells) + " |")
    none, every = left["0", 0.0], left["all", 0.0]
    seeds = rows[0]["seeds"]
    return (
        f"Payload's rms [mm] at {HEIGHT:g} m, {seeds} seeds of two minutes; the error grows evenly "
        f"with the\nlead, to a share of the hook's rms at the last. Without a preview {none:.3g} "
        f"mm are left, with the record for\n14 s {every:.3g}.\n\n" + "\n".join(lines) + "\n"
    )


def main() -> None:
    """Run the study, keep its rows and write the table."""
    given = study_parser(__doc__).parse_args()
    warnings.simplefilter("ignore", PhysicsWarning)
    leads = LEADS[2:3] if given.quick else LEADS
    found = study(1 if given.quick else 2, 90.0 if given.quick else SETTLE + 120.0, leads)
    path = docs_folder(given.quick) / "data" / "preview.csv"
    write_rows(
        path, COLUMNS, list(found), "SI units; leads, error of the last, rms of the payload."
    )
    if not given.quick:
        page = DOCS / "mpc.md"
        text = page.read_text(encoding="utf-8")
        before, after = text.partition(BEGIN)[0], text.partition(END)[2]
        page.write_text(
            before + BEGIN + "\n" + table(read_rows(path)) + "\n" + END + after, encoding="utf-8"
        )


if __name__ == "__main__":
    main()
