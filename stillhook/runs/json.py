"""Runs as plain data for programs: every quantity of every run, and what the seeds say together.

Numbers are in SI under the names of `models.run.summary`.  JSON has no NaN and no infinity: where
a quantity did not occur, or has no end, it is null.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

from models.run import ExtremeEstimate, Run, attributes

from .runs import Runs

FORMAT = 1
"""Version of the format."""


def summary_of(
    compared: Sequence[Runs], question: Mapping[str, object] | None = None
) -> dict[str, Any]:
    """Return runs of one or more controllers as plain data.

    Parameters
    ----------
    compared
        Runs of one controller, or of several on the same case and scenario.
    question
        What was asked; plain data.
    """
    first = compared[0]
    origin = attributes(first[0])
    return {
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


def summary_text(content: Mapping[str, Any]) -> str:
    """Return plain data as JSON."""
    return json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False) + "\n"


def _controller(runs: Runs) -> dict[str, Any]:
    summary, first = runs.summary, runs[0]
    return {
        "sample_time": first.sample_time,
        "step": first.step,
        "compiled": first.compiled,
        "completed": runs.completed,
        "tripped": runs.tripped,
        "lock_limit": runs.lock_limit,
        "summary": {
            name: {
                "mean": number(each.mean),
                "low": number(each.low),
                "high": number(each.high),
                "unit": each.unit,
                "runs": each.count,
            }
            for name, each in summary.means.items()
            if each.count
        },
        "shares": {
            name: {
                "runs": each.count,
                "of": each.total,
                "low": number(each.low),
                "high": number(each.high),
            }
            for name, each in summary.shares.items()
        },
        "confidence": summary.confidence,
        "time_to_loss_of_lock": _fall_time(runs),
        "extremes": {
            name: {method: _extreme(estimate) for method, estimate in methods.items()}
            for name, methods in runs.extremes.items()
        },
        "runs": [_run(run) for run in runs],
    }


def _run(run: Run) -> dict[str, Any]:
    timings = run.timings
    return {
        "seed": run.seed,
        "status": run.status,
        "message": run.message,
        "quantities": {name: number(q.value) for name, q in run.statistics.quantities.items()},
        "events": [{"time": e.time, "kind": e.kind, "text": e.text} for e in run.events],
        "fallbacks": dict(timings.fallbacks),
        "wall_seconds": timings.wall_seconds,
        "times_real_time": number(timings.real_time_factor),
        "controller_step": {
            "median": number(timings.controller_median),
            "p99": number(timings.controller_p99),
            "max": number(timings.controller_max),
        },
    }


def _extreme(estimate: ExtremeEstimate) -> dict[str, Any]:
    return {
        "duration": estimate.duration,
        "value": number(estimate.value),
        "low": number(estimate.low),
        "high": number(estimate.high),
        "rayleigh": number(estimate.rayleigh),
        "count": estimate.count,
        "status": estimate.status,
    }


def _fall_time(runs: Runs) -> dict[str, Any] | None:
    time = runs.summary.fall_time
    if time is None:
        return None
    mean, low, high = (number(value) for value in time.mean)
    return {"falls": time.falls, "exposure": time.exposure, "mean": mean, "low": low, "high": high}


def number(value: float) -> float | None:
    """Return a number as JSON can hold it: null for NaN and infinity."""
    return float(value) if math.isfinite(value) else None
