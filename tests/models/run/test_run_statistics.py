"""Statistics gathered while a run goes on, against plain computation on the whole record."""

from __future__ import annotations

import itertools
import math
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from models.basics import InputError
from models.hook import HookMotion
from models.run import ERROR, Accumulator
from models.sea import SeaSpectrum
from models.vessel import HeaveRao

STEP = 0.05
SIGNALS = (
    "hook.heave",
    "payload.displacement",
    "payload.velocity",
    "reference.displacement",
    "rope.tension",
    "rope.lower_tension",
    "rope.minimum_tension",
    "motor.torque",
    "motor.power",
    "motor.speed",
    "motor.temperature",
    "drive.saturated",
    "drum.haul",
    "contact.gap",
    "contact.force",
    "contact.closing_speed",
)
UNITS = {"payload.displacement": "m", "rope.tension": "N", "motor.torque": "N m"}
LEVELS = {"motor.torque": 500.0, "rope.tension": 1.0}
OPTIONS = {
    "settle": 33.3,
    "units": UNITS,
    "levels": LEVELS,
    "lock_limit": 2.0,
    "slack_tension": 0.0,
    "snap_window": 1.0,
    "block": 60.0,
    "thermal_time": 40.0,
}


def record(n: int = 10_000, seed: int = 1) -> np.ndarray:
    """A record in which everything happens: slack, snap, contact, saturation, loss of lock."""
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(n)
    smooth = np.apply_along_axis(
        lambda x: np.convolve(x, np.hanning(60), mode="same") / 5.0,
        0,
        rng.standard_normal((n, len(SIGNALS))),
    )
    x = dict(zip(SIGNALS, smooth.T, strict=True))
    x["payload.displacement"] = x["payload.displacement"] + 0.3 * np.sin(0.6 * time)
    x["rope.minimum_tension"] = np.maximum(x["rope.minimum_tension"] + 0.8, 0.0)
    x["rope.tension"] = 1.0 + x["rope.tension"] + 10.0 * (x["rope.minimum_tension"] < 0.05)
    x["motor.torque"] = 500.0 + 100.0 * x["motor.torque"]
    x["drive.saturated"] = (x["drive.saturated"] > 0.7).astype(float)
    x["contact.gap"] = 1.5 + x["contact.gap"]
    x["contact.force"] = np.maximum(-x["contact.gap"], 0.0)
    return np.column_stack([x[name] for name in SIGNALS])


RECORD = record()


def gathered(cuts=(), values=RECORD, signals=SIGNALS, **options):
    gather = Accumulator(signals, STEP, **{**OPTIONS, **options})
    for part in np.split(values, sorted(cuts)):
        gather.update(part)
    return gather.result()


WHOLE = gathered()


def everything(statistics) -> dict[str, object]:
    return {
        "rows": np.array([value for _, value, _ in statistics.table()]).tobytes(),
        "times": [(s.minimum_time, s.maximum_time) for s in statistics.signals.values()],
        "crests": [s.crests.tobytes() + s.troughs.tobytes() for s in statistics.signals.values()],
        "blocks": [b.maxima.tobytes() + b.minima.tobytes() for b in statistics.blocks.values()],
        "size": (statistics.samples, statistics.end),
    }


@settings(max_examples=25)
@given(cuts=st.lists(st.integers(0, len(RECORD)), max_size=40))
def test_the_result_is_the_same_to_the_last_bit_however_the_run_is_cut(cuts):
    assert everything(gathered(cuts)) == everything(WHOLE)


def test_one_sample_at_a_time_is_the_same_too():
    head = RECORD[:5000]
    assert everything(gathered(range(1, 5000), head)) == everything(gathered((), head))


SKIP = math.ceil(OPTIONS["settle"] / STEP)
TIME = STEP * np.arange(len(RECORD))


def column(name: str) -> np.ndarray:
    if name == ERROR:
        return column("payload.displacement") - column("reference.displacement")
    return RECORD[SKIP:, SIGNALS.index(name)]


@pytest.mark.parametrize("name", [*SIGNALS, ERROR])
def test_moments_and_extremes_are_those_of_the_whole_record(name):
    x, time, found = column(name), TIME[SKIP:], WHOLE[name]
    assert found.mean == pytest.approx(x.mean(), rel=1e-12, abs=1e-14)
    assert found.standard_deviation == pytest.approx(x.std(), rel=1e-12)
    assert found.rms == pytest.approx(math.sqrt((x**2).mean()), rel=1e-12)
    assert (found.minimum, found.maximum) == (x.min(), x.max())
    assert found.minimum_time == pytest.approx(time[x.argmin()], abs=1e-9)
    assert found.maximum_time == pytest.approx(time[x.argmax()], abs=1e-9)
    assert found.largest == np.abs(x).max()


def cycles_one_by_one(x: np.ndarray, level: float):
    ups = [i for i in range(1, len(x)) if x[i - 1] < level <= x[i]]
    pairs = [(x[a:b].max() - level, x[a:b].min() - level) for a, b in itertools.pairwise(ups)]
    exact = [i - (x[i] - level) / (x[i] - x[i - 1]) for i in (ups[0], ups[-1])]
    return np.array(pairs), (exact[1] - exact[0]) * STEP / len(pairs)


@pytest.mark.parametrize(
    ("name", "level"),
    [("hook.heave", 0.0), ("payload.displacement", 0.0), (ERROR, 0.0), *LEVELS.items()],
)
def test_cycles_are_those_counted_one_by_one(name, level):
    pairs, period = cycles_one_by_one(column(name), level)
    found = WHOLE[name]
    assert found.cycles == len(pairs) > 50
    assert found.level == level
    assert found.period == pytest.approx(period, rel=1e-12)
    np.testing.assert_array_equal(found.crests, pairs[:, 0].astype(np.float32))
    np.testing.assert_array_equal(found.troughs, pairs[:, 1].astype(np.float32))
    assert (found.crest, found.trough) == (pairs[:, 0].max(), pairs[:, 1].min())
    heights = np.sort(pairs[:, 0] - pairs[:, 1])[::-1]
    assert found.height == heights[0]
    assert found.significant == pytest.approx(heights[: math.ceil(len(heights) / 3)].mean(), 1e-6)


def test_slack_and_snap_are_those_counted_one_by_one():
    smallest = column("rope.minimum_tension")
    tension = np.maximum(column("rope.tension"), column("rope.lower_tension"))
    slack = smallest <= 0.0
    events = sum(bool(slack[i] and (i == 0 or not slack[i - 1])) for i in range(len(slack)))
    window = [
        i
        for i in range(len(slack))
        if not slack[i] and slack[max(0, i - round(1.0 / STEP)) : i].any()
    ]
    assert events > 10
    assert WHOLE.value("slack events") == events
    assert WHOLE.value("slack time") == pytest.approx(slack.sum() * STEP)
    assert WHOLE.value("slack share") == pytest.approx(100.0 * slack.mean())
    assert WHOLE.value("first slack at") == pytest.approx(TIME[SKIP + slack.argmax()])
    assert WHOLE.value("snap load") == tension[window].max()
    worst = window[int(tension[window].argmax())]
    assert WHOLE.value("snap load at") == pytest.approx(TIME[SKIP + worst])


@pytest.mark.parametrize("begin", range(4070, 4100))
def test_a_snap_counts_to_the_end_of_its_window_wherever_samples_are_worked_off(begin):
    # Samples are worked off 4096 at a time; slack and its window of 20 samples lie across that.
    smallest, tension = np.ones(4200), np.zeros(4200)
    smallest[begin : begin + 3] = 0.0
    tension[begin + 1] = 100.0  # while slack
    tension[begin + 22], tension[begin + 23] = 5.0, 50.0  # the last in the window, and the next
    tension[begin - 1] = 50.0
    found = gathered(
        (),
        np.column_stack((smallest, tension)),
        ("rope.minimum_tension", "rope.tension"),
        levels=None,
        settle=0.0,
    )
    assert found.value("snap load") == 5.0
    assert found.value("slack events") == 1
    assert found.value("slack time") == pytest.approx(3 * STEP)


@pytest.mark.parametrize("seed", range(20))
def test_a_signal_that_rests_on_its_level_is_counted_one_by_one_too(seed):
    x = np.random.default_rng(seed).integers(-1, 2, 9000).astype(float)
    found = gathered((), x[:, None], ["hook.heave"], levels=None, settle=0.0)["hook.heave"]
    pairs, period = cycles_one_by_one(x, 0.0)
    np.testing.assert_array_equal(found.crests, pairs[:, 0])
    np.testing.assert_array_equal(found.troughs, pairs[:, 1])
    assert found.period == pytest.approx(period, rel=1e-12)


@pytest.mark.parametrize("size", [1, 2, 1365, 4095, 4096, 4097, 9000, 9001])
def test_blocks_of_any_length_are_whole_ones(size):
    x = np.random.default_rng(size).standard_normal(9000)
    found = gathered((), x[:, None], ["hook.heave"], levels=None, settle=0.0, block=size * STEP)
    whole = x[: len(x) // size * size].reshape(-1, size)
    expected = [float(row.max()) for row in whole], [float(row.min()) for row in whole]
    blocks = found.blocks["hook.heave"]
    assert (blocks.maxima.tolist(), blocks.minima.tolist()) == expected


@pytest.mark.parametrize(("settle", "skipped"), [(0.0, 0), (0.3, 3), (1.1, 11), (0.65, 7)])
def test_the_sample_at_the_settling_time_counts(settle, skipped):
    gather = Accumulator(["hook.heave"], 0.1, settle=settle)
    gather.update(np.arange(100.0)[:, None])
    assert gather.result()["hook.heave"].minimum == skipped


def test_quantities_of_the_drive_are_those_of_the_whole_record():
    power, torque = column("motor.power"), column("motor.torque")
    forth, back = np.maximum(power, 0.0).mean(), np.maximum(-power, 0.0).mean()
    heat, hottest = LEVELS["motor.torque"] ** 2, 0.0
    for value in torque:
        heat += (1.0 - math.exp(-STEP / OPTIONS["thermal_time"])) * (value**2 - heat)
        hottest = max(hottest, heat)
    expected = {
        "motor power mean": power.mean(),
        "motor power largest": power.max(),
        "regenerated power mean": back,
        "regenerated power largest": -power.min(),
        "energy per hour, motoring": 3600.0 * forth,
        "energy per hour, regenerated": 3600.0 * back,
        "energy per hour, net": 3600.0 * power.mean(),
        "motor torque rms": math.sqrt((torque**2).mean()),
        "motor torque largest": np.abs(torque).max(),
        "motor torque thermal equivalent": math.sqrt(hottest),
        "motor speed largest": np.abs(column("motor.speed")).max(),
        "motor temperature rise largest": column("motor.temperature").max(),
        "saturated share": 100.0 * column("drive.saturated").mean(),
        "drum haul lowest": column("drum.haul").min(),
        "drum haul highest": column("drum.haul").max(),
    }
    for name, value in expected.items():
        assert WHOLE.value(name) == pytest.approx(value, rel=1e-10), name


def test_quantities_of_the_payload_are_those_of_the_whole_record():
    payload, hook, error = column("payload.displacement"), column("hook.heave"), column(ERROR)
    ratio = error.std() / hook.std()
    lost = int((np.abs(error) > OPTIONS["lock_limit"]).argmax())
    assert lost > 0
    expected = {
        "payload rms": payload.std(),
        "hook rms": hook.std(),
        "tracking error rms": math.sqrt((error**2).mean()),
        "tracking error largest": np.abs(error).max(),
        "residual": 100.0 * ratio,
        "attenuation": -20.0 * math.log10(ratio),
        "lost lock at": TIME[SKIP + lost],
        "rope tension largest": column("rope.tension").max(),
        "rope tension smallest": column("rope.minimum_tension").min(),
        "time counted": len(payload) * STEP,
    }
    for name, value in expected.items():
        assert WHOLE.value(name) == pytest.approx(value, rel=1e-10), name
    assert math.isnan(gathered(lock_limit=1e3).value("lost lock at"))


def test_touch_downs_are_those_of_the_whole_run_with_the_speed_just_before():
    gap = RECORD[:, SIGNALS.index("contact.gap")]
    closing = RECORD[:, SIGNALS.index("contact.closing_speed")]
    touched = [i for i in range(1, len(gap)) if gap[i] <= 0.0 < gap[i - 1]]
    speeds = [closing[i - 1] for i in touched]
    assert touched[0] < SKIP
    assert WHOLE.value("touch-downs") == len(touched) > 3
    assert WHOLE.value("touch-down at") == pytest.approx(TIME[touched[0]])
    assert WHOLE.value("touch-down speed") == pytest.approx(speeds[0], rel=1e-9)
    assert WHOLE.value("hardest touch-down") == pytest.approx(max(speeds), rel=1e-9)


def test_a_payload_lowered_at_constant_speed_touches_down_at_that_speed():
    time = STEP * np.arange(400)
    names = ("payload.displacement", "payload.velocity", "contact.force")
    down = np.where(time < 10.0, -0.3 * time, -3.0)
    rows = np.column_stack((down, np.where(time < 10.0, -0.3, 0.0), 1e3 * (time >= 10.0)))
    found = gathered((), rows, names, levels=None, settle=0.0)
    assert found.value("touch-down speed") == pytest.approx(0.3)
    assert found.value("touch-down at") == pytest.approx(10.0)
    assert found.value("touch-downs") == 1


def test_a_run_that_begins_in_contact_touches_down_when_it_comes_back():
    names = ("payload.velocity", "contact.force")
    force = np.array([5.0, 5.0, 0.0, 0.0, 4.0, 0.0])
    rows = np.column_stack(([0.0, 0.0, 1.0, -2.0, 0.0, 0.0], force))
    found = gathered((), rows, names, levels=None, settle=0.0)
    assert found.value("touch-downs") == 1
    assert found.value("touch-down speed") == 2.0


def test_block_extremes_are_those_of_each_whole_block():
    size = round(OPTIONS["block"] / STEP)
    for name in ("hook.heave", "payload.displacement", ERROR, "motor.torque", "rope.tension"):
        x = column(name)
        whole = x[: len(x) // size * size].reshape(-1, size)
        np.testing.assert_array_equal(WHOLE.blocks[name].maxima, whole.max(axis=1))
        np.testing.assert_array_equal(WHOLE.blocks[name].minima, whole.min(axis=1))
    assert WHOLE.block == 60.0
    assert set(gathered(block_signals=["motor.power"]).blocks) == {"motor.power"}


def test_a_large_mean_costs_no_digits():
    rng = np.random.default_rng(3)
    ripple = rng.standard_normal(50_000)
    found = gathered((), (1e9 + ripple)[:, None], ["rope.tension"], levels=None, settle=0.0)
    # Taken about its mean first, as sums of squares of 1e18 could not be.
    exact = ((1e9 + ripple) - 1e9).std()
    assert found["rope.tension"].standard_deviation == pytest.approx(exact, rel=1e-9)


def test_a_sine_has_its_own_period_and_height():
    time = STEP * np.arange(60_000)
    x = 0.7 + 0.25 * np.sin(2.0 * math.pi * time / 9.0)
    found = gathered((), x[:, None], ["hook.heave"], levels={"hook.heave": 0.7}, settle=0.0)
    heave = found["hook.heave"]
    # The interpolated crossings are off by 1e-6 of a period at most, over 332 cycles.
    assert heave.period == pytest.approx(9.0, rel=1e-6)
    # The largest sample of a cycle misses the crest by a quarter of (omega step)^2 / 2 at most.
    assert heave.significant == pytest.approx(0.5, rel=(2.0 * math.pi * STEP / 9.0) ** 2 / 8.0)
    assert heave.standard_deviation == pytest.approx(0.25 / math.sqrt(2.0), rel=1e-4)


def test_a_narrow_sea_has_the_spectrum_s_period_and_a_significant_height_near_four_sigma():
    sea = SeaSpectrum(kind="jonswap", significant_height=2.0, peak_period=10.0, gamma=5.0)
    rao = HeaveRao(omega=[0.4, 0.9], amplitude=[1.0, 1.0], beyond="zero", below="zero")
    motion = HookMotion(sea=sea, rao=rao)
    heave = motion.record(6 * 3600.0, step=0.1, seed=5).displacement
    gather = Accumulator(["hook.heave"], 0.1)
    gather.update(heave[:, None])
    found = gather.result()["hook.heave"]
    assert found.period == pytest.approx(motion.displacement.zero_crossing_period, rel=0.01)
    # Rayleigh heights have 4.004 sigma; the bandwidth takes some per cent off (Tayfun 1981).
    assert 3.7 < found.significant / found.standard_deviation < 4.0


def test_too_many_cycles_are_not_kept_and_the_result_says_so():
    few = gathered(cycle_capacity=10)["hook.heave"]
    all_of_them = WHOLE["hook.heave"]
    assert (few.significant, few.crests.size) == (4.0 * few.standard_deviation, 0)
    assert few.significant == 4.0 * all_of_them.standard_deviation
    assert (few.cycles, few.crest, few.trough, few.height) == (
        all_of_them.cycles,
        all_of_them.crest,
        all_of_them.trough,
        all_of_them.height,
    )


def test_a_look_in_between_changes_nothing():
    gather = Accumulator(SIGNALS, STEP, **OPTIONS)
    gather.update(RECORD[:6000])
    half = gather.result()
    gather.update(RECORD[6000:])
    assert everything(half) == everything(gathered((), RECORD[:6000]))
    assert everything(gather.result()) == everything(WHOLE)


def test_nothing_after_settling_gives_no_numbers_and_no_warning():
    found = gathered((), RECORD[:100])
    assert found.samples == 0
    assert math.isnan(found["hook.heave"].mean)
    assert math.isnan(found["hook.heave"].maximum)
    assert math.isnan(found.value("payload rms"))
    assert math.isnan(found.value("slack share"))
    assert gathered((), RECORD[:0]).samples == 0


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_run_that_diverged_shows_it_and_where(bad):
    values = RECORD.copy()
    values[7000, SIGNALS.index("payload.displacement")] = bad
    found = gathered((), values)
    payload = found["payload.displacement"]
    assert not math.isfinite(payload.maximum)
    assert payload.maximum_time == pytest.approx(7000 * STEP)
    assert math.isnan(payload.standard_deviation)
    assert found["hook.heave"].mean == WHOLE["hook.heave"].mean


def test_a_day_needs_no_more_memory_than_an_hour():
    gather = Accumulator(["hook.heave", "payload.displacement"], 0.01)
    time = 0.01 * np.arange(20_000)
    block = np.column_stack((np.sin(time), np.sin(1.1 * time)))
    gather.update(block)
    tracemalloc.start()
    for _ in range(100):
        gather.update(block)
    grown, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # 2e6 samples of two signals would be 32 MB; what stays is two floats for each of 6400 cycles.
    assert grown < 0.3e6
    assert peak < 3e6


def test_what_is_not_there_is_answered_with_what_is_near():
    with pytest.raises(InputError, match=r"no signal 'hook\.heav'; did you mean 'hook\.heave'"):
        WHOLE["hook.heav"]
    with pytest.raises(InputError, match=r"no quantity 'payload_rms'; did you mean 'payload rms'"):
        WHOLE.value("payload_rms")


def test_the_table_and_the_tree_tell_name_value_and_unit():
    rows = {name: (value, unit) for name, value, unit in WHOLE.table()}
    assert len(rows) == len(WHOLE.table())
    assert rows["payload.displacement maximum"] == (WHOLE["payload.displacement"].maximum, "m")
    assert rows["payload rms"] == (WHOLE.value("payload rms"), "m")
    assert rows["payload.error standard deviation"][1] == "m"
    assert "hook.heave mean period" in rows
    assert "contact.force mean period" not in rows
    assert "├ residual: " in str(WHOLE)
    assert str(WHOLE).splitlines()[-1] == "└ time counted: 466.7 s"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lock_limit": 0.0}, r"lock_limit must be above 0 m, got 0\.0"),
        ({"thermal_time": 0.1}, r"thermal_time must be at least 0\.5 s, got 0\.1"),
    ],
)
def test_what_cannot_be_is_refused(change, message):
    arguments = {"signals": ["a", "b"], "sample_time": STEP} | change
    with pytest.raises(InputError, match=message):
        Accumulator(arguments.pop("signals"), arguments.pop("sample_time"), **arguments)
