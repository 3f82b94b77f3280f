"""`sh.failure_modes`: one thing at a time fails, and what the load does is told in numbers."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from former_cases import load_case
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import stillhook as sh
from models.operation import Scenario, SineMotion, scenario_named
from models.operation.profile import Move, Profile
from models.plant import PlantData
from mpc.linear import LinearMPC
from mpc.winch import ProcessNoise, Weights
from stillhook.runs import failure_data, failure_report, failure_sheet, failure_table
from stillhook.runs.failure_effects import (
    AFTER,
    FIRST,
    Afterwards,
    FirstSeconds,
    Reference,
    severity_of,
)
from stillhook.runs.failure_kinds import KINDS, RAMP, family_of, later, safeguard
from stillhook.runs.failures import BEGIN, RETURN
from stillhook.text import json_text, markdown
from synth.controllers import BrakeOn, operated

LASTING, WAIT, SEEDS = 10.0, 90.0, (0, 3)
KIND = {kind.identifier: kind for kind in KINDS}
HOW = {"seeds": SEEDS, "lasting": LASTING, "wait": WAIT}


@cache
def calm() -> sh.Case:
    return load_case("thesis-1975").replace({"sea.significant_height": 0.5})


@cache
def found(controller: str = "feed-forward") -> sh.FailureModes:
    return sh.failure_modes(calm(), controller, **HOW)


def simulated(controller: str = "feed-forward", scenario: Scenario | str = "hold") -> sh.Runs:
    return sh.simulate(
        calm(), controller, scenario=scenario, seeds=SEEDS, duration=found(controller).duration
    )


def failing(identifier: str) -> list[sh.Run]:
    """The runs of a failure by `sh.simulate`, each with its seed's moment."""
    modes, runs = found(), []
    for seed, moment in zip(SEEDS, modes.moments, strict=True):
        scenario = KIND[identifier].scenario(calm(), moment, LASTING, modes.duration)
        runs += sh.simulate(
            calm(), "feed-forward", scenario=scenario, seeds=[seed], duration=modes.duration
        ).runs
    return runs


# what nothing fails in


def test_undisturbed_and_drum_held_are_the_ordinary_simulations() -> None:
    modes = found()
    assert modes.duration == WAIT + LASTING + RETURN
    for reference, controller in ((modes.undisturbed, "feed-forward"), (modes.held, "none")):
        runs = simulated(controller)
        assert reference.rms == runs.summary["tracking error rms"].mean
        assert reference.largest == max(r.statistics.value("tracking error largest") for r in runs)
        counts = reference.after
        assert counts.slack == counts.tripped == counts.diverged == 0


def test_a_failure_begins_where_the_undisturbed_drum_turns_fastest() -> None:
    for run, moment in zip(simulated(), found().moments, strict=True):
        among = (run.time >= BEGIN) & (run.time < WAIT)
        fastest = np.abs(run["motor.speed"][among]).max()
        assert abs(run["motor.speed"][run.time == moment]) == fastest


# what a failure does


def test_the_numbers_are_those_of_the_runs() -> None:
    mode, modes = found()["mru-lost"], found()
    runs = failing("mru-lost")
    parts = [
        (run.time > at, run.time <= at + FIRST, run.time <= at + LASTING + AFTER)
        for run, at in zip(runs, modes.moments, strict=True)
    ]

    def of(name: str, *, first: bool) -> np.ndarray:
        columns = [
            run[name][since & soon if first else ~soon & whole]
            for run, (since, soon, whole) in zip(runs, parts, strict=True)
        ]
        return np.concatenate(columns)

    first, after = mode.first, mode.after
    assert first.largest == np.abs(of("payload.displacement", first=True)).max()
    assert first.speed == np.abs(of("payload.velocity", first=True)).max()
    assert first.load_tension_largest == of("rope.lower_tension", first=True).max()
    assert first.load_tension_least == of("rope.lower_tension", first=True).min()
    assert first.drum_tension_largest == of("rope.tension", first=True).max()
    assert first.drum_tension_least == of("rope.tension", first=True).min()
    then = of("payload.displacement", first=False)
    assert after.largest == np.abs(then).max()
    assert after.rms == pytest.approx(np.sqrt(np.mean(then**2)), rel=1e-12)
    assert after.drum_tension_largest == of("rope.tension", first=False).max()
    assert mode.ran
    assert mode.lasting == LASTING


def test_a_load_is_back_when_a_peak_period_of_it_is_calm() -> None:
    mode, period = found()["mru-lost"], calm().sea.spectral_peak_period
    slowest = 0.0
    for run, moment, usual in zip(failing("mru-lost"), found().moments, simulated(), strict=True):
        bound = 2.0 * usual.statistics.value("tracking error rms")
        ends, step = moment + LASTING, run.sample_time
        n = round(period / step)
        at = int(np.searchsorted(run.time, ends - 1e-9))
        while np.sqrt(np.mean(run["payload.displacement"][at : at + n] ** 2)) > bound:
            at += 1
        slowest = max(slowest, run.time[at] - ends)
    assert slowest > 5.0
    assert mode.recovery == pytest.approx(slowest, abs=2.0 * step)


def test_what_does_not_end_does_not_come_back() -> None:
    for identifier in ("encoder-lost", "drive-off"):
        mode = found()[identifier]
        assert mode.lasting == math.inf
        assert mode.recovery is None
        assert mode.after.tripped == 0, "the brake is what is asked for"
        assert mode.effect.endswith("the drum stays held")
        for run in failing(identifier):
            assert (run["brake.on"][-100:] == 1.0).all()
            assert np.ptp(run["drum.haul"][-5000:]) < 1e-9
    assert "the controller stops the drum" in found()["encoder-lost"].shows
    # Under constant tension the load moves half as much anyway.
    assert found("constant-tension")["drive-off"].recovery is None
    assert found("constant-tension")["brake-trip"].recovery is not None


def test_a_drive_that_is_off_has_no_torque_at_all() -> None:
    for run, moment in zip(failing("drive-off"), found().moments, strict=True):
        torque = np.abs(run["motor.torque"][run.time > moment + 0.05])
        assert torque.max() < 2e-3 * calm().winch.drive.torque_peak


def test_the_load_on_a_set_brake_is_a_mass_on_a_spring() -> None:
    """By another integration: M P'' = K (haul + hook - P) - C P', from where the brake holds."""
    data, modes = PlantData.from_case(calm()), found()
    mass, stiffness, drag = 89888.0, 80000.0, data.quadratic_drag
    largest = 0.0
    for run, moment in zip(failing("drive-off"), modes.moments, strict=True):
        held = run.time > moment + 0.5
        begins, ends = (np.searchsorted(run.time, moment + t) for t in (0.5, FIRST))
        haul, hook = run["drum.haul"][held], CubicSpline(run.time, run["hook.heave"])
        assert np.ptp(haul) < 1e-9

        def rates(t: float, state: np.ndarray, top: float = haul[0], z=hook) -> list[float]:
            p, v = state
            pull = stiffness * (top + z(t) - p) - drag * abs(v) * v
            return [v, pull / mass]

        times = run.time[begins : ends + 1]
        start = [run["payload.displacement"][begins], run["payload.velocity"][begins]]
        moved = solve_ivp(
            rates, (times[0], times[-1]), start, t_eval=times, rtol=1e-9, atol=1e-9
        ).y[0]
        assert moved == pytest.approx(run["payload.displacement"][begins : ends + 1], abs=2e-3)
        largest = max(largest, np.abs(moved).max())
    assert modes["drive-off"].first.largest == pytest.approx(largest, rel=0.01)


def test_a_load_that_is_lowered_overshoots_by_its_speed_over_the_frequency() -> None:
    """A brake that stops the drum at a speed v leaves a swing of v / omega_1, in still water."""
    speed, at, frequency = 0.4, 80.0, math.sqrt(80000.0 / 89888.0)
    tripped = KIND["drive-off"].scenario(calm(), at, LASTING, 110.0)
    # Set going over a whole period, so that the load does not swing before.
    slowly = speed * frequency / (2.0 * math.pi)
    down = Move(start=40.0, distance=-30.0, speed=speed, acceleration=slowly)
    lowered = replace(tripped, profile=Profile(moves=(down,)))
    run = sh.simulate(
        calm().replace({"payload.drag.coefficient": 0.0}),
        "feed-forward",
        scenario=lowered,
        hook=SineMotion(amplitude=0.0, period=10.0),
        parameters={"payload.quadratic_drag": 0.0},
        duration=110.0,
    )[0]
    # Of the swing, as the rope paid out stretches by some centimetres more.  While the brake closes
    # the drum goes on slowing down: a little less than at once.
    swing = run.time > at + 1.0
    moved, pull = (0.5 * np.ptp(run[x][swing]) for x in ("payload.displacement", "rope.tension"))
    assert moved == pytest.approx(speed / frequency, rel=0.03)
    assert pull == pytest.approx(speed * math.sqrt(80000.0 * 89888.0), rel=0.03)


def test_a_drive_with_too_little_torque_lets_the_load_go() -> None:
    weak = calm().replace({"winch.drive.torque_peak": "9 kN m", "winch.drive.current_peak": None})
    mode = sh.failure_modes(weak, "feed-forward", seeds=1, wait=70.0)["torque-halved"]
    assert mode.severity == "critical"
    assert mode.after.tripped == 1
    assert mode.recovery is None
    assert "in 1 of 1 seed: motor at" in mode.shows
    assert "stopped by the brake in 1 of 1 seed" in mode.effect


def test_a_loop_that_does_not_come_back_has_lost_lock() -> None:
    modes = sh.failure_modes(calm(), "feedback", seeds=1, lasting=20.0, wait=90.0)
    mode = modes["payload-stuck"]
    assert modes.undisturbed.after.lost_lock == 0
    assert (mode.severity, mode.after.lost_lock, mode.recovery) == ("critical", 1, None)
    assert mode.after.largest > modes.held.largest
    assert "not back 2 min after its end" in mode.effect
    # Its messages are flagged, those of a stuck sensor are not.
    assert "heard nothing of the payload" in modes["telemetry-lost"].shows
    assert "heard nothing" not in mode.shows


def test_a_load_that_moves_less_than_on_a_held_drum_has_not_lost_lock() -> None:
    mode, limit = found()["mru-lost"], simulated().lock_limit
    assert limit < max(mode.first.largest, mode.after.largest) < found().held.largest
    assert (mode.severity, mode.after.lost_lock) == ("minor", 0)
    # Nor one that swings while its brake is on.
    off = found()["drive-off"]
    assert max(off.first.largest, off.after.largest) > limit
    assert off.after.lost_lock == 0


# what is not run


@pytest.mark.parametrize(
    ("controller", "ran"),
    [
        ("feed-forward", {"mru-lost", "mru-biased", "mru-spikes"}),
        ("constant-tension", {"load-cell-lost"}),
        ("feedback", {"payload-lost", "payload-stuck", "telemetry-lost", "telemetry-late"}),
    ],
)
def test_only_what_a_controller_hears_is_taken_from_it(controller: str, ran: set[str]) -> None:
    modes = sh.failure_modes(calm(), controller, seeds=1, lasting=5.0, wait=70.0)
    every = {"encoder-lost", "torque-halved", "drive-off", "power-halved", "brake-trip"}
    assert {mode.identifier for mode in modes.modes if mode.ran} == ran | every
    assert [mode.identifier for mode in modes.modes] == list(KIND)
    for mode in modes.modes:
        assert mode.ran or mode.not_run == "not heard by this controller"
        assert mode.ran == bool(mode.severity and mode.effect and mode.shows and mode.safeguard)


def test_of_a_drum_on_its_brake_nothing_fails() -> None:
    modes = sh.failure_modes(calm(), "none", seeds=1, lasting=5.0, wait=70.0)
    assert modes.held == modes.undisturbed
    assert {mode.not_run for mode in modes.modes} == {
        "the drum is held by its brake, and the drive is off"
    }


def test_a_loop_is_prepared_once_for_all_failures_that_it_serves(monkeypatch) -> None:
    import stillhook.runs.simulation as module

    prepared, original = [], module.prepare

    def counted(case, controller, scenario, options):
        prepared.append(scenario.name)
        return original(case, controller, scenario, options)

    monkeypatch.setattr(module, "prepare", counted)
    sh.failure_modes(calm(), "feed-forward", seeds=2, lasting=5.0, wait=70.0)
    # Undisturbed, drum held, the operator's interface for the encoder, a limit of the power.
    assert len(prepared) == 4


# severity


def sizes(largest: float, **counts: int) -> Reference:
    first = FirstSeconds(
        largest=largest,
        speed=1.0,
        load_tension_largest=2.0,
        load_tension_least=1.0,
        drum_tension_largest=2.0,
        drum_tension_least=1.0,
        slack=0,
    )
    none = dict.fromkeys(("slack", "overloaded", "lost_lock", "tripped", "diverged"), 0)
    after = Afterwards(
        rms=largest,
        largest=largest,
        load_tension_largest=2.0,
        drum_tension_largest=2.0,
        **(none | counts),
    )
    return Reference(rms=largest, largest=largest, first=first, after=after)


@pytest.mark.parametrize(
    ("size", "counts", "severity"),
    [
        (1.2, {}, "none"),
        (1.21, {}, "minor"),
        (3.0, {}, "minor"),
        (3.01, {}, "major"),
        (1.0, {"tripped": 1}, "critical"),
        (1.0, {"lost_lock": 1}, "critical"),
        (1.0, {"overloaded": 1}, "critical"),
        (1.0, {"diverged": 2}, "critical"),
        (1.0, {"slack": 1}, "none"),
        (1.0, {"slack": 2}, "critical"),
        (math.nan, {"diverged": 1}, "critical"),
    ],
)
def test_severity_follows_from_the_numbers(size: float, counts: dict, severity: str) -> None:
    one = sizes(size, **counts)
    assert severity_of(one.first, one.after, sizes(1.0, slack=1), sizes(3.0)) == severity


def test_each_window_counts_for_the_severity() -> None:
    calm_one, far = sizes(1.0), sizes(5.0)
    usual = (sizes(1.0), sizes(3.0))
    assert severity_of(far.first, calm_one.after, *usual) == "major"
    for name in ("rms", "largest"):
        after = replace(calm_one.after, **{name: 5.0})
        assert severity_of(calm_one.first, after, *usual) == "major"


def test_a_rope_beyond_its_limit_is_counted() -> None:
    limited = calm().replace({"limits.rope_tension_peak": "468 kN"})
    modes = sh.failure_modes(limited, "feed-forward", **HOW)
    assert modes.undisturbed.after.overloaded == 0
    mode = modes["brake-trip"]
    assert max(mode.first.drum_tension_largest, mode.after.drum_tension_largest) > 468e3
    assert (mode.severity, mode.after.overloaded > 0) == ("critical", True)
    assert "the rope beyond its limit" in mode.effect


# kinds and safeguards


def test_each_kind_is_one_failure_at_a_time() -> None:
    case, hold = calm(), scenario_named("hold", calm())
    fields = {}
    for kind in KINDS:
        scenario = kind.scenario(case, 100.0, LASTING, 200.0)
        changed = {
            name
            for name in vars(hold)
            if name not in ("ramp", "settle", "duration")
            and vars(hold)[name] != vars(scenario)[name]
        }
        fields[kind.identifier] = changed - {"case_changes"}
        starts = [time for time, what, _ in scenario.events if what != "engaged"]
        assert min(starts) == 100.0
    ramps = {k.identifier: k.scenario(case, 100.0, LASTING, 200.0).ramp for k in KINDS}
    assert {name for name, ramp in ramps.items() if ramp} == {"brake-trip"}
    assert ramps["brake-trip"] == scenario_named("brake-trip", case).ramp == RAMP
    assert all(len(names) == 1 for k, names in fields.items() if k != "drive-off")
    assert fields["drive-off"] == {"brake_trips", "parameter_changes"}
    assert fields["mru-spikes"] == fields["mru-biased"] == {"mru_biases"}


def test_a_later_link_is_three_times_as_late_or_a_tenth_of_a_second() -> None:
    delayed = calm().replace({"sensors.telemetry.delay": "200 ms"})
    assert (later(calm()), later(delayed)) == (0.1, pytest.approx(0.4))
    told = KIND["telemetry-late"].told
    assert (told(calm()), told(delayed)) == ("messages later by 100 ms", "messages later by 400 ms")


def test_safeguards_have_the_numbers_of_the_law() -> None:
    slow = sh.VelocityFeedForward(calm(), fade=3.0, position_gain=0.02)
    assert "within 3.00 s" in safeguard(KIND["mru-lost"], slow)
    assert "0.02 1/s" in safeguard(KIND["mru-biased"], slow)
    gains = sh.LinearFeedback(calm(), {"a": 1.0, "a1": 5.0, "a2": 3.0}, hold_for=0.7)
    assert "older than 700 ms" in safeguard(KIND["telemetry-lost"], gains)
    assert "nothing to wind up" in safeguard(KIND["power-halved"], gains)
    assert safeguard(KIND["payload-stuck"], gains) == "none: what comes in time is believed"


def test_of_a_controller_of_ones_own_nothing_is_claimed() -> None:
    class Own:
        name, sample_time = "own", 0.05

        def reset(self): ...

        def step(self, measurement, time): ...

    assert family_of(Own()) == family_of(operated(Own(), calm())) == "other"
    assert safeguard(KIND["mru-lost"], Own()) == "none that is known of this controller"
    assert "stopped within 1.00 s" in safeguard(KIND["encoder-lost"], Own())


# asking


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lasting": 4.0}, "lasting must be"),
        ({"wait": 60.0}, "wait must be"),
        ({"seeds": 0}, "seeds must be"),
        ({"lasting": "5 m"}, "lasting"),
    ],
)
def test_what_makes_no_sense_is_refused(options: dict, message: str) -> None:
    with pytest.raises(sh.InputError, match=f"failure_modes.*{message}"):
        sh.failure_modes(calm(), "feed-forward", **options)
    with pytest.raises(sh.InputError, match=r"no 'mru-gone'; .*mru-lost"):
        found()["mru-gone"]


def test_progress_is_told_in_runs() -> None:
    told: list[tuple[str, int, int]] = []
    modes = sh.failure_modes(
        calm(),
        "feed-forward",
        seeds=2,
        lasting=5.0,
        wait=70.0,
        progress=lambda *it: told.append(it),
    )
    total = 2 * (2 + sum(mode.ran for mode in modes.modes))
    assert {of for _, _, of in told} == {total}
    assert [done for _, done, _ in told] == sorted(done for _, done, _ in told)
    assert told[-1] == ("brake", total, total)
    assert told[0] == ("undisturbed", 0, total)


def test_ctrl_c_leaves_what_there_is() -> None:
    def stop_at(when: int):
        def tell(what: str, done: int, total: int) -> None:
            if done == when:
                raise KeyboardInterrupt

        return tell

    how = {"seeds": 1, "lasting": 5.0, "wait": 70.0}
    modes = sh.failure_modes(calm(), "feed-forward", progress=stop_at(4), **how)
    assert not modes.complete
    assert [mode.identifier for mode in modes.modes if mode.ran] == ["mru-lost"]
    assert modes["brake-trip"].not_run == "not run: interrupted"
    assert modes["payload-lost"].not_run == "not heard by this controller"
    assert found().complete
    with pytest.raises(KeyboardInterrupt):
        sh.failure_modes(calm(), "feed-forward", progress=stop_at(1), **how)


# words, tables, data


def test_the_result_prints_as_a_small_tree() -> None:
    lines = str(found()).splitlines()
    assert lines[0].startswith("thesis-1975, feed-forward: 8 failures of 10 s in 2 seeds")
    assert lines[1].startswith("├ undisturbed: ")
    assert lines[2].startswith("├ drum held: ")
    assert "├ payload unit, gives no numbers: not heard by this controller" in lines
    assert lines[-1].startswith("└ brake, trips, and opens again: ")
    assert len(lines) == 3 + len(KINDS)


def test_tables_and_report_have_a_row_for_each_failure() -> None:
    modes = found()
    table, sheet = failure_table(modes), failure_sheet(modes)
    assert [row[0] for row in table.rows] == ["undisturbed", "drum held", *KIND]
    row = dict(zip((c.name for c in table.columns), table.rows[4], strict=True))
    mode = modes["mru-lost"]
    assert row["failure"] == "mru-lost"
    assert row["first_largest"] == mode.first.largest
    assert row["first_tension_least"] == mode.first.drum_tension_least
    assert (row["rms"], row["back"]) == (mode.after.rms, mode.recovery)
    assert table.cells(7)[-2:] == ["held", modes["encoder-lost"].severity]
    assert any(note.startswith("payload-lost, payload-stuck") for note in table.notes)
    assert all(len(cells) == 6 for cells in sheet.rows)
    assert mode.effect in markdown(sheet)
    report = failure_report(modes)
    assert report.ok is (not any(m.severity == "critical" for m in modes.modes))
    assert "safeguard: the brake closes, and holds the drum" in markdown(report).replace("S", "s")


def test_data_hold_every_number() -> None:
    data = json.loads(json_text(failure_data(found())))
    assert data["seeds"] == list(SEEDS)
    assert data["moments"] == list(found().moments)
    first = {mode["identifier"]: mode for mode in data["modes"]}
    assert first["mru-lost"]["first"]["largest"] == found()["mru-lost"].first.largest
    assert first["mru-lost"]["ends"] is True
    assert first["drive-off"]["ends"] is False
    assert first["drive-off"]["lasting"] is None
    assert first["payload-lost"]["first"] is None
    assert data["held"]["after"]["rms"] == found().held.after.rms


# whole cases


@pytest.mark.ci
def test_a_crane_with_feed_forward_keeps_its_load_whatever_fails() -> None:
    case = load_case("subsea-crane")
    modes = sh.failure_modes(case, "feed-forward", seeds=2, lasting=30.0, wait=120.0)
    assert modes.complete
    assert modes["power-halved"].severity in ("none", "minor")
    trip, off = modes["brake-trip"], modes["drive-off"]
    # The brake closes in 0.3 s either way; without torque the load turns the drum a little.
    assert trip.first.largest == pytest.approx(off.first.largest, rel=0.05)
    assert off.recovery is None
    assert trip.recovery is not None
    # On its brake, beyond what the drum held from the start leaves: nobody has lost it.
    assert max(off.first.largest, off.after.largest) > modes.held.largest
    assert off.after.lost_lock == 0
    for mode in modes.modes:
        assert not mode.ran or mode.after.diverged == 0
        assert not mode.ran or mode.first.drum_tension_least > 0.0


@pytest.mark.ci
def test_predictive_control_tells_what_it_does_without() -> None:
    case = load_case("subsea-crane").replace({"sea.significant_height": 0.8})
    noise = ProcessNoise(force=0.1, torque=0.05, rope=0.1)
    controller = LinearMPC(case, weights=Weights(torque=0.02, noise=noise, stiffness=1.0))
    modes = sh.failure_modes(case, controller, seeds=1, lasting=20.0, wait=80.0)
    assert all(mode.ran for mode in modes.modes)
    assert "heard nothing of the payload" in modes["telemetry-lost"].shows
    assert "did not believe a sensor" in modes["payload-stuck"].shows
    assert "the estimator does without" in modes["load-cell-lost"].safeguard
    assert modes["telemetry-lost"].severity != "critical"


def test_the_drum_on_its_brake_is_a_controller_of_none() -> None:
    assert sh.failure_modes(calm(), BrakeOn(calm()), seeds=1, lasting=5.0, wait=61.0).complete
