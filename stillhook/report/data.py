"""Everything that a report tells, as plain data in SI: what `report.json` and its figures hold.

    Findings, TitleBlock --> results --> {"motion": ..., "system": ..., "loads": ..., ...}

Designs and studies stand in it as they are, reports of studies as `stillhook.text.json_data` has
them; what is missing is null.  `stillhook.report.document` is written from it.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from models.basics import FloatArray
from models.hook import HookMotion, hook_motion
from synth.controllers import LinearFeedback
from synth.design import Design, design_loads
from synth.question import system_facts
from synth.structures import sampled

from .._version import __version__
from ..comparison import comparison_report
from ..designs import (
    MotionView,
    alternatives_table,
    bound_rows,
    design_report,
    design_text,
    expected_table,
    label_of,
    sensitivity_report,
    share_table,
)
from ..runs import Runs, failure_data, failure_sheet, failure_table
from ..seas import motion_report, operability_report, windows_section
from ..sweeps import sweep_report
from ..text import Drawing, Report, ReportSection, json_data, pairs
from .findings import Findings, TitleBlock

_PERIODS = (4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0)  # of waves [s]
_WORST = 5  # cases of a sweep that are told
LARGEST_LAW = 12  #: States up to which a controller's matrices stand in the document.


@dataclass(frozen=True, kw_only=True, eq=False)
class Told:
    """Reports of the studies, from which the document takes tables and figures."""

    findings: Findings
    wants_bound: bool = True  #: Whether the best possible is computed.

    @cached_property
    def design_text(self) -> str:
        """The design as a file."""
        return design_text(self.findings.design)

    @cached_property
    def hook(self) -> Report:
        """The hook's motion over headings and periods."""
        return motion_report(hook_motion(self.findings.design.sea_case))

    @cached_property
    def sensitivity(self) -> Report | None:
        """Elasticities of the design."""
        study = self.findings.sensitivity
        return None if study is None else sensitivity_report(study, study.moved(), None)

    @cached_property
    def sweep(self) -> Report | None:
        """The design on many cases."""
        found = self.findings.sweep
        name = self.findings.case.name
        return None if found is None else sweep_report(found, name, worst=_WORST)

    @cached_property
    def robustness(self) -> Report | None:
        """How far numbers may be off."""
        found = self.findings.robustness
        if found is None:
            return None
        _, *lines = str(found).splitlines()
        words = [line.lstrip("├└ ") for line in lines]
        return Report(
            name=self.findings.case.name,
            status=found.status,
            ok=found.ok,
            sections=[ReportSection("", words)],
        )

    @cached_property
    def operability(self) -> Report | None:
        """In which seas the winch can work."""
        study = self.findings.operability
        return None if study is None else operability_report(study, study.verify())

    @cached_property
    def windows(self) -> ReportSection | None:
        """Weather windows."""
        found = self.findings.windows
        return None if found is None else windows_section(found)

    @cached_property
    def comparison(self) -> Report | None:
        """Controllers in the same seas."""
        found = self.findings.comparison
        return None if found is None else comparison_report(found)

    @cached_property
    def bound(self) -> Report:
        """How close to the best possible the design is."""
        rows = bound_rows(self.findings.design) if self.wants_bound else []
        return Report(name="bound", sections=[ReportSection("", [pairs(rows)] if rows else [])])

    @cached_property
    def _drawings(self) -> Mapping[str, Drawing]:
        found = design_report(self.findings.design, bound=False).drawings
        return {drawing.name: drawing for drawing in found}

    def drawing(self, name: str) -> Drawing | None:
        """Return a figure of the design's own report, where it has that one."""
        return self._drawings.get(name)

    @cached_property
    def tables(self) -> Mapping[str, Any]:
        """Tables of the design that its own report has, by name, where there are any."""
        design = self.findings.design
        found = {
            "structures": alternatives_table(design),
            "shares": share_table(design),
            "expected": expected_table(design),
        }
        failures = self.findings.failures
        if failures is not None:
            found |= {"failures": failure_table(failures), "sheet": failure_sheet(failures)}
        return {name: table for name, table in found.items() if table is not None}


def results(findings: Findings, block: TitleBlock, told: Told) -> dict[str, Any]:
    """Return everything that a report tells, by what it is about."""
    design = findings.design
    reports = {
        name: getattr(told, name)
        for name in (
            "hook", "sensitivity", "sweep", "robustness", "operability", "windows", "comparison",
            "bound",
        )
    }  # fmt: skip
    tree = {
        "identification": _identification(findings, block, told.design_text),
        "motion": _motion(design),
        "requirement": _requirement(findings),
        "labels": {name: label_of(design, name) for name in design.limits},
        "sea": _sea(design),
        "system": plain(system_facts(design.sea_case)),
        "controller": _controller(design),
        "loads": plain(design_loads(design)),
        "operation": {"design": _runs(findings.runs), "held": _runs(findings.held)},
        "failures": None if findings.failures is None else failure_data(findings.failures),
        "verification": _verification(design),
        "tables": told.tables,
        "reports": reports,
    }
    found: dict[str, Any] = json_data(tree)
    return found


def plain(value: Any) -> Any:
    """Return a result as plain data: its fields by their names, arrays as lists."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [plain(item) for item in value] if isinstance(value, tuple | list) else value


def _identification(findings: Findings, block: TitleBlock, text: str) -> dict[str, Any]:
    design, case = findings.design, findings.case
    seeds: dict[str, Any] = {
        "comparison": None if findings.comparison is None else list(findings.comparison.seeds),
        "simulation": None if findings.runs is None else list(findings.runs.seeds),
        "failure modes": None if findings.failures is None else list(findings.failures.seeds),
        "sweep": None if findings.sweep is None else [int(findings.sweep.attrs.get("seed", 0))],
    }
    version = sys.version_info
    return {
        "title": block.title or f"Heave compensation of {case.name}",
        "project": block.project,
        "client": block.client,
        "document": block.document,
        "date": block.day,
        "author": block.author,
        "checker": block.checker,
        "approver": block.approver,
        "revisions": [dataclasses.asdict(revision) for revision in block.table],
        "case": case.name,
        "description": " ".join(case.description.split()),
        "digest": case.digest,
        "design_digest": hashlib.sha256(text.encode()).hexdigest(),
        "stillhook": __version__,
        "python": f"{version.major}.{version.minor}.{version.micro}",
        "structure": design.structure,
        "ok": verdict(findings)[0],
        "status": verdict(findings)[1],
        "seeds": {what: numbers for what, numbers in seeds.items() if numbers is not None},
    }


def _motion(design: Design) -> dict[str, Any]:
    names = {"hook": "hook", "payload, drum held": "held", "payload, compensated": "compensated"}
    rows = MotionView(design).motions()
    limits = design.case.limits
    return {
        **{
            names[name]: {"rms": rms, "significant": significant, "largest": largest}
            for name, rms, significant, largest in rows
        },
        "residual": design.residual,
        "residual_held": design.residual_held,
        "attenuation": design.attenuation,
        "attenuation_held": design.attenuation_held,
        "exposure_time": limits.exposure_time,
        "exceedance": limits.exceedance,
        "members": [one.payload_rms for one in design.members],
    }


def verdict(findings: Findings) -> tuple[bool, str]:
    """Return whether the design is ok and keeps what is required, and the sentence about it."""
    design = findings.design
    broken = [one["name"] for one in _requirement(findings) if not one["kept"]]
    if not broken:
        return design.ok, design.status
    missed = f"does not keep what is required: {', '.join(broken)}"
    return False, f"{missed}; {design.status}"


def _requirement(findings: Findings) -> list[dict[str, Any]]:
    design, found = findings.design, []
    for limit in findings.requirement:
        value = math.inf if design.margins is None else limit.worst(design.assessment)
        found.append(
            {
                "name": limit.name,
                "unit": limit.unit,
                "bound": limit.bound,
                "value": float(value),
                "use": float(limit.use(value)),
                "kept": bool(limit.use(value) <= 1.0),
            }
        )
    return found


def _sea(design: Design) -> dict[str, Any]:
    case = design.sea_case
    hook, sea = HookMotion.from_case(case, warn=False), case.sea
    statistics = hook.sea.statistics
    time = case.limits.exposure_time
    response = hook.rao.response(2.0 * math.pi / np.array(_PERIODS))
    motions = {
        name: {
            "unit": unit,
            "rms": motion.rms,
            "significant": 4.0 * motion.rms,
            "zero_crossing_period": motion.zero_crossing_period,
            "largest": motion.most_probable_maximum(time),
        }
        for name, unit in (("displacement", "m"), ("velocity", "m/s"), ("acceleration", "m/s2"))
        for motion in (getattr(hook, name),)
    }
    return {
        "spectrum": sea.spectrum,
        "significant_height": sea.significant_height,
        "peak_period": sea.spectral_peak_period,
        "zero_crossing_period": statistics.zero_crossing_period,
        "steepness": sea.steepness,
        "breaking_steepness": sea.breaking_steepness,
        "heading": case.vessel.heading,
        "outside_table": hook.rao.share_outside(hook.sea).total,
        "tip_motions": motions,
        "tip_operator": [
            {"period": period, "amplitude": abs(value), "phase": float(np.angle(value))}
            for period, value in zip(_PERIODS, response.tolist(), strict=True)
        ],
    }


def _controller(design: Design) -> dict[str, Any]:
    """Return the law in continuous time, u = +C y, and as it is sampled."""
    law, plant = design.controller, design.question.plant
    sampling = LinearFeedback.from_design(design).sample_time
    delays = dict(zip(plant.measurements, plant.delays, strict=True))
    matrices = sampled(law, sampling)

    def packed(A: FloatArray, B: FloatArray, C: FloatArray, D: FloatArray) -> list[list[float]]:
        rows = np.block([[np.atleast_2d(A), B], [C, D]]) if len(A) else np.atleast_2d(D)
        return [[float(value) for value in row] for row in rows]

    return {
        "structure": design.structure,
        "states": len(law.A),
        "command": {"name": law.inputs[0], "unit": plant.units.get(law.inputs[0], "")},
        "signals": [
            {"name": name, "unit": plant.units.get(name, ""), "delay": float(delays.get(name, 0.0))}
            for name in law.measurements
        ],
        "continuous": packed(law.A, law.B, law.C, law.D),
        "discrete": packed(*(np.asarray(matrix) for matrix in matrices)),
        "sample_time": sampling,
    }


def _runs(runs: Runs | None) -> dict[str, Any] | None:
    """Return what runs came to: means over seeds, extremes and shares."""
    if runs is None:
        return None
    summary = runs.summary
    everywhere = set.intersection(*({*run.statistics.quantities} for run in runs))
    known = [
        name
        for name in runs[0].statistics.quantities
        if name in everywhere and not any(math.isnan(run.statistics.value(name)) for run in runs)
    ]
    return {
        "controller": runs.controller,
        "seeds": list(runs.seeds),
        "duration": runs[0].duration,
        "completed": runs.completed,
        "means": {
            name: {"value": m.mean, "low": m.low, "high": m.high, "unit": m.unit}
            for name, m in summary.means.items()
        },
        **{
            way: {name: pick(run.statistics.value(name) for run in runs) for name in known}
            for way, pick in (("largest", max), ("least", min))
        },
        "shares": {
            name: {"count": s.count, "total": s.total} for name, s in summary.shares.items()
        },
    }


def _verification(design: Design) -> dict[str, Any] | None:
    found = design.verification
    if found is None:
        return None
    rows = []
    for check in found.checks:
        claimed, second = check.claimed, check.found
        difference = None
        if claimed and second is not None and math.isfinite(claimed):
            difference = abs(second / claimed - 1.0)
            if check.ok and difference > check.tolerance:
                difference = None  # a bound that is kept
        rows.append(
            {
                "name": check.name,
                "ok": check.ok,
                "counts": check.counts,
                "claimed": check.claimed,
                "found": check.found,
                "difference": difference,
                "tolerance": check.tolerance,
                "note": check.note,
            }
        )
    return {"ok": found.ok, "status": found.status, "checks": rows}
