"""Jobs in a process of their own: progress, cancel, and a process that is killed."""

from __future__ import annotations

import asyncio
import math
import os
import signal

import pytest

import stillhook as sh
from models import InputError
from stillhook.page.jobs import Capability, capability, moving, optimise, report
from stillhook.page.strip import Moving, strip_html
from stillhook.page.worker import CancelledError, Worker, WorkerDiedError

GAINS = {"A": 200, "a": 50, "a1": 100, "a2": 100}


def thesis():
    return sh.load_case("thesis-1975")


def test_a_worker_answers_fails_is_cancelled_dies_and_goes_on():
    async def main():
        worker, told = Worker(), []
        found = await worker.run(
            "verified", thesis(), "payload-feedback", GAINS, told=lambda *all: told.append(all)
        )
        assert found.verification is not None
        assert found.payload_rms == pytest.approx(0.0117, abs=1e-4)
        assert told == [("check", 0, 1)]
        first = worker.pid
        with pytest.raises(InputError, match="no structure"):
            await worker.run("verified", thesis(), "no-such", GAINS)
        assert worker.pid == first  # a job that fails is no end of the process

        long = asyncio.create_task(
            worker.run("optimise", thesis(), "low-order-4", None, 64, told=told.append)
        )
        await asyncio.sleep(0.3)
        os.kill(first, signal.SIGKILL)
        with pytest.raises(WorkerDiedError, match="was ended by SIGKILL; try again"):
            await long

        long = asyncio.create_task(worker.run("optimise", thesis(), "low-order-4", None, 64))
        await asyncio.sleep(0.3)
        assert worker.busy
        second = worker.pid
        assert second != first
        worker.cancel()
        with pytest.raises(CancelledError):
            await long
        assert not worker.busy
        assert worker.pid is None

        # So is one that nobody waits for any more: the next job has a process to itself.
        lost = asyncio.create_task(worker.run("optimise", thesis(), "low-order-4", None, 64))
        await asyncio.sleep(0.3)
        third = worker.pid
        lost.cancel()
        with pytest.raises(asyncio.CancelledError):
            await lost
        assert worker.pid is None
        again = await worker.run("verified", thesis(), "payload-feedback", GAINS)
        assert again.payload_rms == found.payload_rms
        assert worker.pid not in (second, third)
        worker.end()
        for _ in range(100):
            try:
                os.kill(second, 0)
            except ProcessLookupError:
                return
            await asyncio.sleep(0.02)
        raise AssertionError("the process is still there")

    asyncio.run(main())


def quiet(stage, done, total):
    assert done <= total


@pytest.mark.ci
def test_a_search_begins_at_the_gains_of_the_page():
    first = optimise(thesis(), "payload-feedback", None, 1, quiet)
    assert first.ok
    assert first.verification is not None
    again = optimise(thesis(), "payload-feedback", first.parameters, 1, quiet)
    assert again.payload_rms <= first.payload_rms * (1 + 1e-6)


@pytest.mark.ci
def test_a_capability_has_a_height_for_each_period():
    case = sh.load_case("landing")
    found = capability(case, "drum-feedback", _settled(case), quiet)
    assert len(found.periods) == len(found.heights) == len(found.held) == len(found.binding) == 8
    assert found.periods[0] <= case.sea.spectral_peak_period <= found.periods[-1]
    study = sh.operability(
        sh.evaluate_gains(case, _settled(case), "drum-feedback"), periods=[found.periods[3]]
    )
    assert found.heights[3] == pytest.approx(study.own_depth.contours["loop"].limit[0, 0], rel=0.02)


def _settled(case):
    law = sh.prepare(case, "drum-feedback").posed.first.law
    values = {p.name: 0.0 if math.isinf(p.low) else p.scale for p in law.parameters}
    return {**values, "drum.position_gain": 1.0}


def test_where_there_is_no_loop_there_is_no_capability():
    found = capability(thesis(), "payload-feedback", {**GAINS, "a2": -1e5}, quiet)
    assert found == Capability(
        periods=(),
        heights=(),
        held=(),
        binding=(),
        note="no stable loop, so there is no capability",
    )


@pytest.mark.ci
def test_a_minute_of_both_controllers():
    steps = []
    gains, mpc = moving(
        thesis(), "payload-feedback", GAINS, lambda *all: (quiet(*all), steps.append(all))
    )
    assert len(gains.hook) == len(gains.load) == len(gains.turn) == 601
    assert gains.step == pytest.approx(0.1)
    assert gains.hook == pytest.approx(mpc.hook, abs=1e-3)  # one sea for both
    # The thesis's gains ask for more than its drive has, which predictive control knows.
    assert 0.0 < mpc.rms < gains.rms
    assert {stage for stage, *_ in steps} == {"These gains", "Predictive control (MPC)"}
    with pytest.raises(InputError, match="not stable"):
        moving(thesis(), "payload-feedback", {**GAINS, "a2": -1e5}, quiet)


def test_what_moves_is_written_as_data_that_cannot_break_out():
    run = Moving(name="<b>", step=0.1, hook=(0.0, 1.0), load=(0.0, 0.1), turn=(0.0, 1.0), rms=0.05)
    text = strip_html([run, Moving.missing("MPC", "no </span> sensor")])
    assert "<b>&lt;b&gt;</b> load 50.0 mm rms" in text
    assert "no &lt;/span&gt; sensor" in text
    assert text.count("<svg") == 1
    assert "&quot;hook&quot;: [0.0, 1.0]" in text


@pytest.mark.ci
def test_the_report_is_one_html_file(tmp_path):
    found = report(thesis(), "payload-feedback", GAINS, str(tmp_path), quiet)
    assert found.startswith(b"<!DOCTYPE html>") or b"<html" in found[:200]
    assert b"thesis-1975" in found
