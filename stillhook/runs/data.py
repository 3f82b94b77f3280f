"""Runs as plain data for programs: every quantity of every run, and what the seeds say together.

Numbers are in SI under the names of `models.run.summary`.  JSON has no NaN and no infinity: where
a quantity did not occur, or has no end, it is null.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from models.basics import Interval, Share
from models.run import ExtremeEstimate, Run, attributes

from ..text import json_data
from .runs import Runs

FORMAT = 1  #: Version of the format.


def runs_data(
    compared: Sequence[Runs], question: Mapping[str, object] | None = None
) -> dict[str, Any]:
    """Return runs of one or more controllers on a case, and what was asked, as plain data."""
    first = compared[0]
    origin = attributes(first[0])
    data: dict[str, Any] = json_data(
        {
            "stillhook_runs": FORMAT,
            "versions": json.loads(str(origin["versions"])),
            "case": first.case.name,
            "scenario": first.scenario.name,
            "description": first.scenario.description,
            "duration": first[0].duration,
            "settle": first[0].statistics.settle,
            "question": dict(question or {}),
            "controllers": {runs.controller: _controller(runs) for runs in compared},
        }
    )
    return data


def _controller(runs: Runs) -> dict[str, Any]:
    summary, first = runs.summary, runs[0]
    falls = summary.fall_time
    return {
        "sample_time": first.sample_time,
        "step": first.step,
        "compiled": first.compiled,
        "completed": runs.completed,
        "tripped": runs.tripped,
        "lock_limit": runs.lock_limit,
        "summary": {
            name: {**_ends(each), "mean": each.mean, "unit": each.unit, "runs": each.count}
            for name, each in summary.means.items()
            if each.count
        },
        "shares": {
            name: {**_ends(each), "runs": each.count, "of": each.total}
            for name, each in summary.shares.items()
        },
        "confidence": summary.confidence,
        "time_to_loss_of_lock": None
        if falls is None
        else {
            "falls": falls.falls,
            "exposure": falls.exposure,
            **dict(zip(("mean", "low", "high"), falls.mean, strict=True)),
        },
        "extremes": {name: _extreme(estimate) for name, estimate in runs.extremes.items()},
        "runs": [_run(run) for run in runs],
    }


def _run(run: Run) -> dict[str, Any]:
    timings = run.timings
    return {
        "seed": run.seed,
        "status": run.status,
        "message": run.message,
        "quantities": {name: q.value for name, q in run.statistics.quantities.items()},
        "events": [{"time": e.time, "kind": e.kind, "text": e.text} for e in run.events],
        "fallbacks": dict(timings.fallbacks),
        "statuses": dict(timings.statuses),
        "wall_seconds": timings.wall_seconds,
        "times_real_time": timings.real_time_factor,
        "controller_step": {
            "median": timings.controller_median,
            "p99": timings.controller_p99,
            "max": timings.controller_max,
        },
    }


def _extreme(estimate: ExtremeEstimate) -> dict[str, Any]:
    names = ("duration", "value", "low", "high", "rayleigh", "count", "status")
    return {name: getattr(estimate, name) for name in names}


def _ends(each: Interval | Share) -> dict[str, float]:
    return {"low": each.low, "high": each.high}
