"""The bound beside a design: never above it, and told where it means something."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import stillhook as sh
from models.basics import InputError, SolverError
from stillhook.designs import bound_sentence, structures_table
from stillhook.designs.bound_text import bound_cell, bound_figures, bounds_note
from stillhook.designs.structures import structures
from stillhook.designs.summary import facts
from stillhook.text import markdown
from synth.bound import DesignBound, bound_beside, exact_sensors, verify_bound
from synth.loop import Assessment
from synth.question import pose_structure

CRANE_GAINS = {"A": 1.0, "a": 16.03, "a1": 44.47, "a2": 6.410}
NOISY_MRU = {"sensors.mru": {"noise_floor": "1 cm", "noise_fraction": 0.02}}

# What `sh.optimise_structure` finds on subsea-crane, to a few digits: parameters, drag [N s/m].
CRANE: Mapping[str, tuple[Mapping[str, float], float]] = {
    "payload-feedback": ({"a": 15.948, "a1": 44.248, "a2": 6.4222}, 6579.0),
    "payload-feedback-rolloff": (
        {"a": 109.77, "a1": 82.817, "a2": 318.11, "rolloff.corner": 33.427, "rolloff.damping": 2.0},
        2231.0,
    ),
    "payload-feedback-lead": (
        {"a": 130.92, "a1": 58.313, "a2": 365.36, "lead.zero": 29.496, "lead.pole": 4.8332},
        2143.0,
    ),
    "payload-feedback-notch": (
        {
            "a": 113.66,
            "a1": 115.34,
            "a2": 354.03,
            "notch.frequency": 27.273,
            "notch.width": 1.3505,
            "notch.depth": 0.32236,
            "rolloff.corner": 168.84,
            "rolloff.damping": 2.0,
        },
        1900.0,
    ),
    "payload-feedback-integral": (
        {
            "a": 109.73,
            "a1": 82.766,
            "a2": 317.84,
            "integral.corner": 0.002,
            "rolloff.corner": 33.437,
            "rolloff.damping": 2.0,
        },
        2234.0,
    ),
    "drum-feedback": (
        {
            "payload.acceleration_gain": 1.1952,
            "payload.velocity_gain": 0.87776,
            "payload.position_gain": 3.6201,
            "drum.position_gain": 0.27504,
            "rolloff.corner": 32.476,
            "rolloff.damping": 2.0,
        },
        2068.0,
    ),
    "feed-forward": (
        {
            "drum.position_gain": 0.001,
            "heave.gain": 0.97792,
            "heave.lead": 0.73684,
            "heave.bandwidth": 1.2854,
        },
        3936.0,
    ),
    "combined": (
        {
            "payload.acceleration_gain": 0.97123,
            "payload.velocity_gain": 1.6157,
            "payload.position_gain": 2.8549,
            "drum.position_gain": 0.67949,
            "heave.gain": 0.9291,
            "rolloff.corner": 19.684,
            "rolloff.damping": 0.97761,
            "heave.lead": 0.026346,
            "heave.bandwidth": 7.5648,
        },
        677.0,
    ),
    "constant-tension": ({"drum.position_gain": 0.0052164, "tension.gain": 8.3954e-06}, 7011.0),
}
RMS = {  # what it says they leave [mm]
    "payload-feedback": 373.1,
    "payload-feedback-rolloff": 119.1,
    "payload-feedback-lead": 111.8,
    "payload-feedback-notch": 102.4,
    "payload-feedback-integral": 119.3,
    "drum-feedback": 110.7,
    "feed-forward": 123.5,
    "combined": 20.86,
    "constant-tension": 411.5,
}
TIGHT = {"winch.drive.torque_continuous": "6.4 kN m", "winch.drive.torque_peak": "7 kN m"}
QUICK = ("payload-feedback", "combined")


@cache
def crane() -> sh.GainDesign:
    return sh.evaluate_gains(sh.load_case("subsea-crane"), CRANE_GAINS)


@cache
def forward() -> sh.StructureDesign:
    case = sh.load_case("thesis-1975").replace(NOISY_MRU)
    return sh.optimise_structure(case, "feed-forward", starts=2)


def crane_bound(name: str) -> DesignBound:
    values, drag = CRANE[name]
    case = sh.load_case("subsea-crane")
    posed = pose_structure(case, name)
    controller = posed.law.controller([values[p.name] for p in posed.law.parameters])
    return bound_beside(
        case,
        posed.question.hook,
        controller,
        masses=posed.question.masses,
        drag=drag,
        limits=(*posed.limits, *posed.drive),
    )


def holds(found: DesignBound) -> None:
    assert 0.0 < found.heard.value < found.rms
    assert 0.0 < found.every.value < found.rms
    # The controller beside one bound may hear all sensors and ignore most: so its motion, with
    # what it uses beyond the limits at their price, is above the other bound.
    one, other = found.heard, found.every
    price = sum(
        other.multipliers[name] * (one.rms[name] ** 2 - limit**2)
        for name, limit in other.limits.items()
    )
    assert one.attained**2 + price >= other.value**2 * (1.0 - 1e-6)
    assert max(found.heard.gap, found.every.gap) < 1e-4


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n in QUICK else pytest.mark.slow) for n in CRANE]
)
def test_bound_is_below_every_structure_of_the_crane(name: str) -> None:
    found = crane_bound(name)
    holds(found)
    assert not found.exact_heard
    assert 1e3 * found.rms == pytest.approx(RMS[name], rel=3e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["thesis-1975", "thesis-1975-rope"])
@pytest.mark.parametrize("structure", ["payload-feedback-rolloff", "feed-forward", "combined"])
def test_bound_is_below_the_thesis_winch_with_a_noisy_reference(name: str, structure: str) -> None:
    case = sh.load_case(name).replace({**NOISY_MRU, "limits.drive": "report"})
    design = sh.optimise_structure(case, structure, starts=2)
    holds(design.bound)


@pytest.mark.ci
def test_both_numbers_stand_on_the_terms_of_the_design() -> None:
    design = crane()
    found = design.bound
    holds(found)
    assert design.bound is found  # computed once
    # The gains are designed without the noise of the payload's sensors, which hardly counts.
    assert design.payload_rms < found.rms < 1.001 * design.payload_rms
    assert verify_bound(found.heard).ok


@pytest.mark.slow
def test_rms_by_another_quadrature() -> None:
    design = crane()
    found = design.bound
    other = Assessment(
        found.heard.plant, design.assessment.controller, found.heard.sources, coefficient=None
    )
    assert other.sigma("payload.displacement") == pytest.approx(found.rms, rel=1e-4)


@pytest.mark.ci
def test_no_limit_of_the_bound_is_tighter_than_what_the_design_uses() -> None:
    tight = crane().case.replace(TIGHT)
    design = sh.evaluate_gains(tight, CRANE_GAINS)
    loose = crane().bound.heard.limits
    bound = design.bound
    assert bound.heard.limits["motor.torque"] < loose["motor.torque"]
    assert bound.heard.value > crane().bound.heard.value
    holds(bound)


def test_words_of_a_bound() -> None:
    found = crane().bound
    assert "times the best possible with these sensors" in found.sentence
    near = replace(found, rms=1.05 * found.heard.value)
    assert near.sentence.startswith("within 5 % of the best possible with these sensors")
    assert near.factor == pytest.approx(1.05)
    text = str(found)
    assert "with all sensors of the case" in text
    assert "duality gap" in text
    row = dict(facts(crane()))["bound"]
    assert "times the best possible with these sensors, 1.22 mm" in row
    assert "duality gap" in row
    assert "bound" not in dict(facts(crane(), bound=False))


def test_exact_sensors_have_no_meaningful_bound() -> None:
    thesis = sh.load_case("thesis-1975")
    assert set(exact_sensors(thesis)) == {
        "payload.acceleration",
        "payload.velocity",
        "payload.displacement",
        "mru.heave",
        "mru.heave_rate",
    }
    assert exact_sensors(sh.load_case("subsea-crane")) == ()
    assert exact_sensors(sh.load_case("landing")) == ()
    design = sh.evaluate_gains(thesis, {"A": 200, "a": 50, "a1": 100, "a2": 100})
    assert bound_sentence(design).endswith("no meaningful bound")
    assert "bound" not in design.__dict__  # nor is it computed
    assert design.bound.rms == pytest.approx(design.payload_rms, rel=1e-2)
    assert "no meaningful bound" in design.bound.sentence


def test_a_structure_that_hears_noisy_sensors_only_has_one() -> None:
    design = forward()
    found = design.bound
    assert found.exact_heard == ()
    assert "payload.velocity" in found.exact_every
    assert 0.0 < found.heard.value < found.rms
    text = bound_sentence(design)
    assert "best possible with these sensors" in text
    assert "no meaningful bound with all sensors of the case" in text
    assert np.isnan(bound_figures(design)[1])


def test_table_and_figure_show_the_bound() -> None:
    design = forward()
    lost = replace(design, structure="lost", payload_rms=np.inf, margins=None, ok=False)
    table, plain = structures_table([design, lost]), structures_table([design], bound=False)
    column = table.headings.index("over best")
    assert table.cells(0)[column] == bound_cell(design) != "-"
    assert table.cells(1)[column] == "-"
    assert plain.cells(0)[column] == "-"
    assert bounds_note([design]) in markdown(structures_table([design]))
    assert "over best:" not in markdown(plain)
    marks = [
        line
        for line in structures([design, lost]).axes[0].lines
        if line.get_label() == "best with its sensors"
    ]
    assert len(marks) == 1
    assert marks[0].get_xdata()[0] == pytest.approx(1e3 * design.bound.heard.value)
    lines = structures([design], bound=False).axes[0].lines
    assert all(line.get_label() != "best with its sensors" for line in lines)


def test_what_cannot_be_computed_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    unstable = sh.evaluate_gains(crane().case, {**CRANE_GAINS, "A": -1.0})
    assert bound_sentence(unstable) == ""
    with pytest.raises(InputError, match="must be stable"):
        _ = unstable.bound

    def fails(*words: object, **more: object) -> DesignBound:
        raise SolverError("no stabilising solution")

    monkeypatch.setattr("synth.bound.case.bound_beside", fails)
    again = replace(crane())
    assert bound_sentence(again) == "not computed: no stabilising solution"
    structure = replace(forward())
    assert bound_cell(structure) == "-"
