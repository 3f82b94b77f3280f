"""The link from the payload: which message is known when."""

from __future__ import annotations

import math

import numpy as np
import pytest
import scipy.stats
from hypothesis import example, given, settings
from hypothesis import strategies as st

from models.rig import Telemetry
from models.sensing import TelemetrySchedule
from models.sensing.draws import TELEMETRY, draw
from models.sensing.telemetry import during

TS = 0.02

times = st.floats(0.0, 0.3).map(lambda t: round(t, 4))
links = st.builds(
    lambda delay, jitter, dropout, length: Telemetry(
        delay=delay, jitter=jitter, dropout=dropout, dropout_length=length
    ),
    times,
    st.one_of(st.just(0.0), times),
    st.sampled_from([0.0, 0.05, 0.3, 0.8]),
    st.sampled_from([0.0, 0.01, 0.1, 1.0]),
)
gaps = st.lists(
    st.tuples(st.floats(0.0, 8.0), st.floats(0.01, 4.0)).map(lambda p: (p[0], p[0] + p[1])),
    max_size=2,
)
schedules = st.builds(
    lambda link, seed, outages, broken: TelemetrySchedule(link, TS, seed, outages, broken),
    links,
    st.integers(0, 100),
    gaps,
    gaps,
)


def lost_messages(schedule, count):
    """Which of the first messages are lost, by walking along the chain one by one."""
    link, before = schedule.telemetry, schedule.lags.stop
    numbers = draw(schedule.seed, TELEMETRY, 0, count + before, 2, "uniform")[:, 0]
    length = max(link.dropout_length / TS, 1.0 / (1.0 - link.dropout))
    stays = 1.0 - 1.0 / length if link.dropout else 0.0
    begins = link.dropout / (length * (1.0 - link.dropout))
    lost = [bool(numbers[0] < link.dropout)]
    for number in numbers[1:]:
        lost.append(bool(number < (stays if lost[-1] else begins)))
    return lost


def by_events(schedule, count):
    """Fresh and content [sample], message by message as they come in."""
    link, before = schedule.telemetry, schedule.lags.stop
    numbers = draw(schedule.seed, TELEMETRY, 0, count + before, 2, "uniform")
    lost = lost_messages(schedule, count)

    def usable(j):
        inside = any(a / TS <= j + 1e-6 < b / TS for a, b in (*schedule.outages, *schedule.broken))
        return not lost[j + before] and not inside

    mailbox: dict[int, list[float]] = {}
    for j in range(-before, count - 1):
        if usable(j):
            late = (link.delay + link.jitter * numbers[j + before, 1]) / TS
            if abs(late - round(late)) < 1e-6:
                late = round(late)
            arrival = j + math.ceil(late)
            content = arrival - late if late == int(late) or usable(j + 1) else j
            mailbox.setdefault(arrival, []).append(content)
    known, rows = float(-before), []
    for k in range(-before, count - 1):
        newest = max(mailbox.get(k, [-math.inf]))
        if k >= 0:
            rows.append((newest > known, max(newest, known)))
        known = max(newest, known)
    return np.array(rows)


class TestSchedule:
    def test_without_delay_everything_is_known_at_once(self):
        schedule = TelemetrySchedule(Telemetry(), TS, 0)
        block = schedule.block(0, 100)
        assert schedule.lags.stop == 1
        assert np.array_equal(block.weights, np.ones((100, 1)))
        assert np.array_equal(block.fresh, np.ones(100))
        assert np.array_equal(block.age, np.zeros(100))

    @pytest.mark.parametrize(
        ("delay", "lags", "weights"),
        [
            (0.03, [1, 2], [0.5, 0.5]),
            (0.055, [2, 3], [0.25, 0.75]),
            (0.14, [7], [1.0]),  # 7.000000000000001 samples
            (60.0, [3000], [1.0]),
        ],
    )
    def test_constant_delay_is_exact_on_average(self, delay, lags, weights):
        schedule = TelemetrySchedule(Telemetry(delay=delay), TS, 0)
        block = schedule.block(5, 50)
        assert list(schedule.lags) == lags
        assert schedule.lags.stop == lags[-1] + 1
        np.testing.assert_allclose(block.weights, np.tile(weights, (50, 1)), atol=1e-12)
        np.testing.assert_allclose(block.age, delay, rtol=1e-12)
        assert block.fresh.all()

    @settings(max_examples=150)
    @given(schedules)
    @example(TelemetrySchedule(Telemetry(jitter=0.2, dropout=0.8, dropout_length=1.0), TS, 3))
    @example(TelemetrySchedule(Telemetry(delay=0.05), TS, 3, [(0.0, 3.0)], [(2.0, 5.0)]))
    def test_agrees_with_messages_that_come_in_one_by_one(self, schedule):
        block = schedule.block(0, 599)
        fresh, known = by_events(schedule, 600).T
        assert np.array_equal(block.fresh, fresh)
        np.testing.assert_allclose(block.age, (np.arange(599) - known) * TS, atol=1e-11)

    @given(schedules)
    def test_no_content_is_younger_than_the_delay(self, schedule):
        block = schedule.block(0, 600)
        assert block.age.min() >= schedule.telemetry.delay - 1e-9
        latest = schedule.telemetry.delay + schedule.telemetry.jitter + TS
        assert block.age[block.fresh == 1.0].max(initial=0.0) <= latest

    def test_what_is_stuck_is_held_and_said_to_be_fresh(self):
        link = TelemetrySchedule(Telemetry(delay=0.03), TS, 1, stuck=((1.0, 2.0),))
        block, usual = link.block(0, 400), TelemetrySchedule(Telemetry(delay=0.03), TS, 1)
        stuck = (np.arange(400) >= 50) & (np.arange(400) < 100)
        assert block.valid.all()
        assert np.array_equal(block.fresh == 0.0, stuck)
        assert not block.weights[stuck].any()
        assert np.array_equal(block.age, usual.block(0, 400).age)

    @given(schedules)
    def test_age_is_time_minus_the_time_of_the_content(self, schedule):
        block = schedule.block(0, 600)
        fresh = block.fresh == 1.0
        sent = np.arange(600)[:, None] - np.array(schedule.lags)
        content = (block.weights * sent).sum(axis=1)[fresh] * TS
        np.testing.assert_allclose((np.arange(600) * TS - block.age)[fresh], content, atol=1e-9)
        # Held: older by a sample each time.
        held = np.flatnonzero(~fresh[1:]) + 1
        np.testing.assert_allclose(block.age[held] - block.age[held - 1], TS, rtol=1e-9)

    @given(schedules)
    def test_weights_are_those_of_a_mean_of_two(self, schedule):
        block = schedule.block(0, 300)
        assert block.weights.shape == (300, len(schedule.lags))
        np.testing.assert_allclose(block.weights.sum(axis=1), block.fresh, atol=1e-12)
        assert block.weights.min() >= 0.0
        assert (block.weights > 0.0).sum(axis=1).max() <= 2
        assert not block.age.flags.writeable

    @settings(max_examples=40)
    @given(schedules, st.lists(st.integers(1, 120), min_size=1, max_size=6), st.integers(0, 300))
    def test_does_not_depend_on_the_chunks(self, schedule, counts, start):
        whole = schedule.block(start, sum(counts))
        at = start
        for count in counts:
            part = schedule.block(at, count)
            for name in ("weights", "fresh", "age"):
                rows = getattr(whole, name)[at - start : at - start + count]
                assert np.array_equal(getattr(part, name), rows)
            at += count

    def test_the_same_a_day_later_as_across_the_blocks_of_the_draws(self):
        link = Telemetry(delay=0.03, jitter=0.1, dropout=0.4, dropout_length=2.0)
        schedule = TelemetrySchedule(link, TS, 7)
        for middle in (65536, 65536 * 131):
            whole = schedule.block(middle - 200, 400)
            parts = [schedule.block(middle - 200 + 50 * i, 50) for i in range(8)]
            assert np.array_equal(whole.age, np.concatenate([part.age for part in parts]))
            assert 0.3 < 1.0 - whole.fresh.mean() < 0.95

    def test_runs_of_losses_longer_than_any_chunk_go_on_from_one_to_the_next(self):
        link = Telemetry(dropout=0.5, dropout_length=60.0)  # 3000 messages
        schedule = TelemetrySchedule(link, TS, 2)
        whole = schedule.block(0, 40_000)
        assert 0.2 < whole.fresh.mean() < 0.8
        for start in range(0, 40_000, 1600):
            part = schedule.block(start, 5)
            assert np.array_equal(part.fresh, whole.fresh[start : start + 5])
            assert np.array_equal(part.age, whole.age[start : start + 5])

    def test_seeds(self):
        link = Telemetry(jitter=0.1)
        first, again, other = (TelemetrySchedule(link, TS, s).block(0, 50) for s in (1, 1, 2))
        assert np.array_equal(first.age, again.age)
        assert not np.array_equal(first.age, other.age)


class TestChance:
    N = 200_000

    def test_jitter_is_uniform(self):
        # Below a sample nothing overtakes: every sample shows the transit time of one message.
        schedule = TelemetrySchedule(Telemetry(delay=0.02, jitter=0.015), TS, 11)
        block = schedule.block(0, 20_000)
        assert block.fresh.all()
        result = scipy.stats.kstest(block.age, scipy.stats.uniform(0.02, 0.015).cdf)
        assert result.pvalue > 0.003

    @pytest.mark.parametrize("share", [0.01, 0.3])
    def test_single_losses(self, share):
        block = TelemetrySchedule(Telemetry(dropout=share), TS, 5).block(0, self.N)
        lost = block.fresh == 0.0
        error = math.sqrt(share * (1.0 - share) / self.N)
        assert abs(lost.mean() - share) < 3.0 * error
        runs = runs_of(lost)
        mean = 1.0 / (1.0 - share)
        spread = math.sqrt(share) / (1.0 - share)  # geometric law
        assert abs(runs.mean() - mean) < 3.0 * spread / math.sqrt(len(runs))

    @pytest.mark.parametrize(("share", "length"), [(0.05, 0.5), (0.3, 0.1), (0.7, 0.2)])
    def test_runs_of_losses(self, share, length):
        link = Telemetry(dropout=share, dropout_length=length)
        lost = TelemetrySchedule(link, TS, 5).block(0, self.N).fresh == 0.0
        mean = length / TS
        # Of a chain of two states with the correlation rho from one message to the next.
        rho = 1.0 - 1.0 / mean - share / (mean * (1.0 - share))
        error = math.sqrt(share * (1.0 - share) / self.N * (1.0 + rho) / (1.0 - rho))
        assert abs(lost.mean() - share) < 3.0 * error
        runs = runs_of(lost)
        spread = mean * math.sqrt(1.0 - 1.0 / mean)
        assert abs(runs.mean() - mean) < 3.0 * spread / math.sqrt(len(runs))

    def test_a_run_shorter_than_chance_is_chance(self):
        single, short = (
            TelemetrySchedule(Telemetry(dropout=0.3, dropout_length=length), TS, 5)
            for length in (0.0, 0.028)
        )
        assert np.array_equal(single.block(0, 5000).fresh, short.block(0, 5000).fresh)


class TestGaps:
    @pytest.mark.parametrize("kind", ["outages", "broken"])
    def test_nothing_new_during_a_gap(self, kind):
        schedule = TelemetrySchedule(Telemetry(delay=0.05), TS, 0, **{kind: [(1.0, 2.0)]})
        block = schedule.block(0, 200)
        # The last one is sent at 0.98 s and known at 1.04 s, by itself: its neighbour, with which
        # it would be interpolated, was never sent.  The first one after the gap is sent at 2 s.
        stale = np.flatnonzero(block.fresh == 0.0) * TS
        assert stale[0] == pytest.approx(1.06)
        assert stale[-1] == pytest.approx(2.04)
        np.testing.assert_allclose(block.age[50:54], [0.05, 0.05, 0.06, 0.08])
        assert block.age.max() == pytest.approx(2.04 - 0.98)
        assert block.age[103] == pytest.approx(0.05)

    def test_hours_without_a_message_are_remembered(self):
        schedule = TelemetrySchedule(Telemetry(delay=0.05), TS, 0, [(60.0, 7260.0)])
        late = schedule.block(round(7200.0 / TS), 2)
        assert late.age[0] == pytest.approx(7200.0 - 59.98)
        assert not late.fresh.any()

    def test_gone_from_the_start_and_for_ever(self):
        schedule = TelemetrySchedule(Telemetry(), TS, 0, [(-10.0, math.inf)])
        block = schedule.block(0, 10)
        assert not block.fresh.any()
        np.testing.assert_allclose(np.diff(block.age), TS, rtol=1e-9)

    def test_ends_of_an_interval_meet_samples_in_spite_of_rounding(self):
        inside = during([(0.7, 2.1)], np.arange(30), 0.1)  # 0.7/0.1 = 6.999999999999999
        assert np.flatnonzero(inside).tolist() == list(range(7, 21))


def runs_of(flags):
    """Lengths of the runs of True that begin and end within the record."""
    edges = np.diff(np.concatenate(([0], flags.astype(int), [0])))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    inner = (starts > 0) & (ends < len(flags))
    return (ends - starts)[inner]
