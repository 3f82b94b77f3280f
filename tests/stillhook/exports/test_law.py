"""The law that is exported, its recording, and what is told of both."""

from __future__ import annotations

import io
import math

import numpy as np
import pandas as pd
import pytest
from former_cases import load_case

import stillhook as sh
from models.basics import InputError
from models.sensing import HEARD, STATUSES, Measurement
from stillhook.exports.law import identifier, law_of
from stillhook.exports.recording import EVENTS, record
from stillhook.exports.signals import SIGNALS, STATUS_TEXTS

CASE = load_case("subsea-crane")
GAINS = {"A": 1.0, "a": 16.0, "a1": 44.0, "a2": 6.4}


def test_every_signal_is_told_with_unit_sign_and_what_to_do_without() -> None:
    assert [signal.name for signal in SIGNALS] == list(HEARD)
    assert all(signal.meaning and signal.missing for signal in SIGNALS)
    assert [signal.name for signal in SIGNALS if not signal.unit] == ["drive.applied"]
    assert len({signal.identifier for signal in SIGNALS}) == len(HEARD)
    assert [name for name, _ in STATUS_TEXTS] == list(STATUSES)
    assert all(text for _, text in STATUS_TEXTS)


@pytest.mark.parametrize("kind", ["feedback", "feed-forward", "constant-tension"])
def test_a_law_of_a_case_has_the_interface_about_it(kind: str) -> None:
    gains = GAINS if kind == "feedback" else None
    law = law_of(CASE, controller=kind, gains=gains, rate=0.1, ramp=3.0)
    assert law.name == kind.replace("-", "_")
    assert law.unit == "rad/s"
    assert law.controller.operated  # type: ignore[attr-defined]
    assert law.recursion is not None
    assert law.native.prefix == law.name
    command = law.controller.step(law.rest, 0.0)
    assert command == pytest.approx(law.rest["drive.applied"], rel=1e-9)
    assert abs(command) < law.highest == 0.5 * law.span


def test_a_design_brings_case_and_law() -> None:
    case = load_case("thesis-1975")
    design = sh.evaluate_gains(case, {"A": 200, "a": 50, "a1": 100, "a2": 100})
    law = law_of(design)
    assert law.case == case
    assert law.design is design
    assert law.name == "payload_feedback"
    assert law.unit == "V"
    assert law.highest == case.winch.drive.voltage


def test_the_highest_command_is_one_that_no_drive_exceeds() -> None:
    law = law_of(CASE, controller="feedback", gains=GAINS)
    loud = law.rest.values.copy()
    loud[HEARD.index("payload.velocity")] = -1e6
    law.controller.reset()
    commands = [law.controller.step(Measurement(loud), 0.005 * k) for k in range(2000)]
    assert max(commands) == law.highest


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"what": CASE}, "say which controller is meant"),
        ({"what": CASE, "controller": "none"}, "holds the drum with its brake"),
        ({"what": CASE, "controller": "nonsense"}, "controller"),
        ({"what": CASE, "controller": "nonlinear-mpc"}, "can be stepped from Python alone"),
        ({"what": CASE, "controller": "feed-forward", "ramp": -1.0}, "ramp"),
        ({"what": CASE, "controller": "feed-forward", "rate": 0.0}, "rate"),
        ({"what": CASE, "controller": "feed-forward", "name": "?"}, "must begin with a letter"),
        ({"what": CASE, "controller": "feed-forward", "sample_time": 20.0}, "sample_time"),
    ],
)  # fmt: skip
def test_what_cannot_be_exported_is_told_in_a_sentence(
    wrong: dict[str, object], message: str
) -> None:
    with pytest.raises((InputError, sh.SynthesisError), match=message):
        law_of(**wrong)  # type: ignore[arg-type]


def test_a_controller_without_a_case_asks_for_one() -> None:
    law = law_of(CASE, controller="feed-forward")
    with pytest.raises(InputError, match="say which case the controller is for"):
        law_of(law.inner)
    assert law_of(law.inner, case=CASE).case == CASE
    with pytest.raises(InputError, match="a design brings its own"):
        law_of(law.inner, case=CASE, controller="feed-forward")


@pytest.mark.parametrize(
    ("name", "found"),
    [("feed-forward-lead", "feed_forward_lead"), ("PI + lead", "pi_lead"), ("m" * 60, "m" * 32)],
)
def test_names_become_identifiers(name: str, found: str) -> None:
    assert identifier(name) == found


def test_in_the_recording_everything_happens_and_nothing_else_is_commanded() -> None:
    law = law_of(CASE, controller="feedback", gains=GAINS)
    made = record(law)
    assert made.measured.shape == (12001, len(HEARD))
    law.controller.reset()
    for row, command, status in zip(made.measured, made.commands, made.statuses, strict=True):
        assert law.controller.step(Measurement(row), 0.0) == command
        assert list(STATUSES).index(law.controller.status) == status  # type: ignore[attr-defined]
    told = {list(STATUSES)[int(code)] for code in made.statuses}
    assert told == {"engaged", "limited", "blind", "blending", "held", "stopping", "braked"}
    column = {name: made.measured[:, i] for i, name in enumerate(HEARD)}
    for name in ("payload.valid", "mru.valid", "encoder.valid", "load_cell.valid"):
        assert {0.0, 1.0} == set(column[name])
    assert column["operator.reset"].sum() == 1.0
    assert column["reference.displacement"].max() == pytest.approx(0.3)
    assert np.ptp(column["payload.displacement"][np.isfinite(column["payload.displacement"])]) > 0.5
    assert [time for time, _ in EVENTS] == sorted(time for time, _ in EVENTS)


def test_the_recording_reads_back_to_the_last_bit() -> None:
    made = record(law_of(CASE, controller="constant-tension"))
    read = pd.read_csv(io.StringIO(made.csv()), float_precision="round_trip")
    assert list(read.columns) == ["time", *(s.identifier for s in SIGNALS), "command", "status"]
    found = read.iloc[:, 1:-2].to_numpy(dtype=float)
    same = (found == made.measured) | (np.isnan(found) & np.isnan(made.measured))
    assert same.all()
    assert read["command"].to_numpy().tobytes() == made.commands.tobytes()
    assert read["time"].iloc[-1] == pytest.approx(60.0)
    assert math.isclose(made.sample_time, 0.02)
