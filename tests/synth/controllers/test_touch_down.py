"""The touch-down phase: no snaps, no bump, and nothing where nothing touches down."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from former_cases import load_case

import stillhook as sh
from models.basics import InputError
from models.operation import TouchDown, scenario_named
from models.simulation import prepare
from synth.controllers import BrakeOn, VelocityFeedForward, touching_down

LIMIT = 0.5  # of the static tension: a load after slack that is no snap


class Stepped:
    """A controller whose law is hidden: it has to be called from Python."""

    def __init__(self, within):
        self.within, self.asked = within, 0
        self.name, self.sample_time = within.name, within.sample_time
        self.status = "gated"

    def reset(self):
        self.within.reset()
        self.asked = 0

    def step(self, measurement, time):
        self.asked += 1
        return self.within.step(measurement, time)


def landed(controller, touchdown, seeds=2, case="landing"):
    return sh.simulate(
        sh.load_case(case),
        controller,
        scenario="landing",
        seeds=seeds,
        options={"touchdown": touchdown},
    )


def snaps(runs):
    """Return the largest tension after slack of each run, 0 without [N]."""
    return np.nan_to_num([run.statistics.value("snap load") for run in runs])


@pytest.mark.parametrize(
    "controller",
    # The weights of predictive control are tuned anew: half a minute.
    [
        "constant-tension",
        *(pytest.param(name, marks=pytest.mark.ci) for name in ("mpc", "nonlinear-mpc")),
    ],
)
def test_snaps_stop(controller):
    case = sh.load_case("landing")
    if controller == "mpc":  # made once
        controller = sh.LinearMPC(case)
    static = case.static_tension
    assert snaps(landed(controller, "none")).max() > static
    for mode in ("release", "tension"):
        runs = landed(controller, mode)
        assert runs.completed
        assert snaps(runs).max() < LIMIT * static
        for run in runs:
            # It stands where it was set down, and is not lifted again.
            late = run.time > run.time[-1] - 20.0
            assert run["contact.gap"][late].max() <= 0.0


def test_what_was_worst_for_feed_forward():
    before = snaps(landed("feed-forward", "none", seeds=[2, 5, 8, 11, 14]))
    after = snaps(landed("feed-forward", "release", seeds=[2, 5, 8, 11, 14]))
    assert np.all(after <= before)
    assert after.max() == 0.0


def test_the_rope_ends_slack_or_taut():
    case = sh.load_case("landing")
    (slack,), (taut,) = (landed("feed-forward", mode, seeds=1) for mode in ("release", "tension"))
    late = slack.time > slack.time[-1] - 20.0
    assert slack["rope.lower_tension"][late].max() < 0.02 * case.payload.submerged_weight
    assert slack["brake.on"][-1] == 1.0
    assert np.ptp(slack["drum.haul"][late]) == 0.0
    lower = taut["rope.lower_tension"][late] / case.payload.submerged_weight
    assert lower.mean() == pytest.approx(0.5, abs=0.1)
    assert 0.1 < lower.min() < lower.max() < 0.95
    assert taut["engaged"][-1] == 1.0


def test_nothing_changes_before_contact():
    runs = [landed("feed-forward", mode, seeds=1)[0] for mode in ("none", "release", "tension")]
    before = runs[0].time < runs[0].statistics.value("touch-down at") + 0.2
    for run in runs[1:]:
        for name in ("drive.command", "payload.displacement", "rope.tension"):
            assert np.array_equal(run[name][before], runs[0][name][before]), name


def test_nothing_changes_without_contact():
    """In a hold, whose set-point never goes down, the phase is not even armed."""
    case = sh.load_case("landing")
    phase = TouchDown(unloaded=0.01, unloaded_for=0.0)  # which the waves would trigger
    bare = VelocityFeedForward(case)
    runs = [
        sh.simulate(case, c, seeds=1, duration=120.0)[0]
        for c in (bare, touching_down(bare, case, phase))
    ]
    for name in ("drive.command", "payload.displacement"):
        assert np.array_equal(runs[0][name], runs[1][name])


@pytest.mark.parametrize("controller", ["feed-forward", "constant-tension"])
def test_the_command_has_no_bump(controller):
    """The first command of the phase is next to what the controller would have said."""
    case = sh.load_case("landing")
    runs = {
        mode: sh.simulate(
            case,
            controller,
            scenario="landing",
            seeds=[4],
            store_step=0.02,
            options={"touchdown": mode},
        )[0]["drive.command"]
        for mode in ("none", "release", "tension")
    }
    for mode in ("release", "tension"):
        both = min(len(runs["none"]), len(runs[mode]))
        first = int(np.argmax(runs["none"][:both] != runs[mode][:both]))
        jump = abs(runs[mode][first] - runs["none"][first])
        assert 0.0 < jump < 0.012 * case.winch.speed_limit, mode


def test_compiled_and_stepped_are_the_same():
    case = load_case("landing")
    bare = VelocityFeedForward(case)
    runs = [sh.simulate(case, c, scenario="landing", seeds=[3])[0] for c in (bare, Stepped(bare))]
    assert np.allclose(runs[0]["drum.haul"], runs[1]["drum.haul"], atol=1e-7)


def test_a_controller_in_python_is_not_asked_once_the_load_stands():
    case = load_case("landing")
    within = Stepped(VelocityFeedForward(case))
    (run,) = sh.simulate(case, within, scenario="landing", seeds=[3])
    touched = run.statistics.value("touch-down at")
    assert touched < within.asked * within.sample_time < touched + 5.0
    # Nor does it tell of what it no longer does.
    assert run.timings.statuses["gated"] == pytest.approx(within.asked, abs=1)


def test_a_brake_and_a_phase_of_its_own_are_left_alone():
    case = load_case("landing")
    brake, phase = BrakeOn(case), TouchDown()
    assert touching_down(brake, case, phase) is brake
    made = touching_down(VelocityFeedForward(case), case, phase)
    assert touching_down(made, case, TouchDown(mode="tension")) is made
    again = pickle.loads(pickle.dumps(made))
    assert again.touch_down == phase


def test_a_controller_that_does_not_know_of_the_phase_is_refused():
    case = load_case("landing")
    with pytest.raises(InputError, match="scenario landing: feed-forward has no touch-down phase"):
        prepare(case, VelocityFeedForward(case), scenario_named("landing", case))
