"""The stored headline study: complete, within its limits, told correctly, and repeatable."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def _benchmark():
    path = ROOT / "docs" / "make" / "headline.py"
    spec = importlib.util.spec_from_file_location("headline", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


headline = _benchmark()


@pytest.fixture(scope="module")
def rows():
    return headline.load()


def test_complete(rows):
    kinds = [row["kind"] for row in rows]
    counts = {kind: kinds.count(kind) for kind in set(kinds)}
    assert counts == {"thesis": 8, "redesign": 24, "transplant": 12, "filter": 2}


def test_every_redesign_is_ok_and_keeps_its_margin(rows):
    for row in rows:
        if row["kind"] in ("redesign", "filter"):
            assert row["ok"] == 1.0
            assert row["margin.max_sensitivity"] <= 2.0 * (1.0 + 1e-4)
            assert row["payload_rms"] < row["payload_rms_before"]


def test_the_thesis_s_gains(rows):
    for length in headline.LENGTHS:
        spring = headline.pick(rows, kind="thesis", model="spring", length=length)
        assert spring["growth_rate"] == 0.0
        assert spring["margin.max_sensitivity"] > 4.0
    deep = headline.pick(rows, kind="thesis", model="rope", length=2000.0)
    assert deep["growth_rate"] == pytest.approx(4.6, abs=0.1)
    shallow = headline.pick(rows, kind="thesis", model="rope", length=100.0)
    assert shallow["growth_rate"] == 0.0


def test_what_the_page_says_of_depth_and_delay(rows):
    def payload(model, length, delay):
        key = {"kind": "redesign", "model": model, "length": length, "delay": delay}
        return headline.pick(rows, **key)["payload_rms"]

    for delay in headline.DELAYS:
        # "At 100 m the rope is a spring", "put on the rope it is unstable".
        assert payload("rope", 100.0, delay) == pytest.approx(
            payload("spring", 100.0, delay), rel=0.01
        )
        put = headline.pick(rows, kind="transplant", length=2000.0, delay=delay)
        assert put["growth_rate"] > 0.0
        assert payload("rope", 2000.0, delay) > 0.5 * rows[0]["hook_rms"]
    # "More delay can help", and a filter does so without any.
    assert payload("rope", 2000.0, 0.1) < payload("rope", 2000.0, 0.0)
    for length in headline.FILTERS:
        filtered = headline.pick(rows, kind="filter", length=length)
        assert filtered["payload_rms"] < payload("rope", length, 0.0)


def test_the_page_shows_these_rows(rows):
    stored = headline.PAGE.read_text(encoding="utf-8")
    again = headline.page(rows, [1.0])

    def body(text):  # without the last paragraph, the times
        return text.rpartition("\n\n")[0]

    assert body(stored) == body(again)


def test_asking_for_a_row_that_is_not_there(rows):
    with pytest.raises(KeyError, match="0 rows have"):
        headline.pick(rows, kind="redesign", length=12.0)


@pytest.mark.slow
def test_all_rows_again(rows):
    again, _ = headline.study()
    assert len(again) == len(rows)
    for stored, now in zip(rows, again, strict=True):
        for name in ("kind", "model", "length", "delay", "bandwidth", "ok"):
            assert now[name] == stored[name], stored
        for name in ("payload_rms", "payload_rms_before"):
            assert math.isclose(now[name], stored[name], rel_tol=1e-3), (name, stored, now)
        assert now["growth_rate"] == pytest.approx(stored["growth_rate"], abs=0.02)
