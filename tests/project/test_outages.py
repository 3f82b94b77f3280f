"""The studies of lost sensors and of faults: windows, rivals, ratios, and what is told."""

from __future__ import annotations

import importlib
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from models.basics import pooled_interval
from stillhook.sweeps.usual import FAULT_SPREADS

FOLDER = Path(__file__).parents[2] / "docs" / "make"


def _module(name):
    sys.path.insert(0, str(FOLDER))
    try:
        return importlib.import_module(name)
    finally:
        sys.path.remove(str(FOLDER))


outages = _module("outages")
faults = _module("faults")


class Moved:
    """A run of which only the payload is known."""

    def __init__(self, time, moved):
        self.time, self._signals = time, {"payload.displacement": moved}

    def __getitem__(self, name):
        return self._signals[name]


def row(seed, lost, law, values, length=60.0, case="subsea-crane"):
    shown = " ".join(map(str, values))
    return dict(zip(outages.COLUMNS, (case, str(seed), lost, str(length), law, shown), strict=True))


def test_each_window_is_an_outage_and_the_minute_after_it():
    time = np.arange(0.0, 500.0, 0.05)
    moved = np.zeros_like(time)
    first, second = outages.begins(20.0, 2)
    assert second - first == 20.0 + 60.0 + 30.0
    moved[(time > first) & (time <= first + 80.0)] = 2.0
    moved[(time > second + 80.0) & (time < second + 110.0)] = 5.0
    moved[time < first] = 5.0
    run = Moved(time, moved)
    assert outages.windows(run, 20.0, 2) == pytest.approx([2.0, 0.0], abs=0.1)
    # A run that ended before has lost its load.
    assert outages.windows(run, 20.0, 8)[-1] == math.inf


@pytest.mark.parametrize(
    ("lost", "laws"),
    [
        ("telemetry", {"none", "constant-tension", "feed-forward", "feed-forward-full"}),
        ("telemetry, mru", {"none", "constant-tension"}),
        ("mru, load cell", {"none", "drum-feedback", "payload-feedback"}),
    ],
)
def test_a_rival_does_without_what_is_lost(lost, laws):
    found = set(outages.able(lost)) - {"feed-forward, designed", "payload-feedback-rolloff"}
    assert found == laws


def test_the_rival_is_the_stillest_and_paired_by_outage():
    rows = [
        row(0, "", "none", [3.0, 3.0]),
        row(0, "", "feed-forward", [1.0, 2.0]),
        row(0, "", "combined", [0.1, 0.1]),
        row(0, "telemetry", "mpc", [0.5, 1.1]),
        row(1, "telemetry", "mpc", [9.0, 9.0]),  # whose rivals have not been run
    ]
    ours, theirs, law, over = outages.ratio(rows, "subsea-crane", "telemetry", 60.0)
    assert law == "feed-forward"
    assert (ours.count, theirs.count) == (2, 2)
    wanted = pooled_interval([0.5, 1.1], [1.0, 2.0], confidence=0.9)
    assert (over.mean, over.high) == (wanted.mean, wanted.high)
    rows.append(row(0, "load cell", "mpc", [0.1, 0.2]))
    assert outages.ratio(rows, "subsea-crane", "load cell", 60.0)[2] == "combined"
    assert outages.ratio(rows, "subsea-crane", "mru", 60.0) is None
    assert outages.ratio(rows, "landing", "telemetry", 60.0) is None
    told = outages.section(rows)
    assert told.startswith(
        "1 of 2 that were run are as asked; 2 of them with fewer than 3 seeds of 20 outages; "
        "not run yet: subsea-crane 22 of 24"
    )


def test_a_study_goes_on_with_what_is_missing(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(outages, "laws", lambda case, folder: {"none": "none"})
    monkeypatch.setattr(outages, "predictive", lambda case: "mpc")
    monkeypatch.setattr(outages, "simulated", lambda *key: asked.append(key) or [1.0, 2.0])
    monkeypatch.setattr(outages, "write_rows", lambda *a: None)
    path = tmp_path / "outages.csv"
    wanted = [key for key in outages.tasks(["landing"], 1, ["mru"]) if key[3] == 5.0]
    rows = outages.study(wanted, path, 2)
    assert [(key[1], key[3]) for key in asked] == [("none", ""), ("mpc", "mru")]
    monkeypatch.setattr(outages, "read_rows", lambda path: rows)
    path.touch()
    assert outages.study(wanted, path, 2) == rows
    assert len(asked) == 2


def test_the_page_tells_what_is_stored():
    rows = outages.read_rows(outages.DOCS / "data" / "outages.csv")
    page = outages.PAGE.read_text(encoding="utf-8")
    assert f"<!-- outages: begin -->\n\n{outages.section(rows)}\n\n<!-- outages: end -->" in page
    failed = faults.read_rows(outages.DOCS / "data" / "faults.csv")
    assert f"<!-- faults: begin -->\n\n{faults.section(failed)}\n\n<!-- faults: end -->" in page
    assert all(len(outages.values(each)) == outages.OUTAGES for each in rows)


def test_faults_tell_the_share_that_lost_the_load():
    rows = [
        {"case": "a", "controller": "mpc", "kind": "stuck", "status": status}
        for status in ("completed", "completed", "brake", "diverged")
    ]
    rows.append({"case": "a", "controller": "mpc", "kind": "spikes", "status": "completed"})
    rows.append({"case": "b", "controller": "mpc", "kind": "outages", "status": "brake"})
    one, other, every, missing = faults.told(rows, "a", "mpc")
    assert one == "stuck: 2 of 4 lost the load (6.8 to 93.2 %): brake, diverged"
    assert other.startswith("spikes: 0 of 1 lost the load (0.0 to 97.5 %)")
    assert every.startswith("all: 2 of 5 lost the load (5.3 to 85.3 %)")
    assert missing.startswith("not run: dropouts, outages, delay-jumps")
    stored = faults.read_rows(outages.DOCS / "data" / "faults.csv")
    assert {each["kind"] for each in stored} <= set(FAULT_SPREADS)
