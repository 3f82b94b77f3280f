"""Controllers by their names: what each takes, and what it is refused for."""

from __future__ import annotations

import pytest
from former_cases import load_case

from models.basics import InputError
from models.plant import MEAN_LOSSES, build_plant
from models.sensing import HEARD, Measurement
from stillhook.controllers import CONTROLLER_TEXTS
from stillhook.controllers.named import controller_by_name
from synth.loop import LinearController
from synth.structures.recursive import at_rest

LINEAR = [name for name in CONTROLLER_TEXTS if "mpc" not in name]
# A design with an integrator and a lag stands for what `tune` hands over.
DYNAMIC = LinearController(
    A=[[0.0, 0.0], [0.0, -3.0]],
    B=[[0.0, 0.0, -0.1], [1.0, 2.0, 0.0]],
    C=[[1.0, -4.0]],
    D=[[-1.0, 0.0, -2.0]],
    measurements=("payload.acceleration", "payload.velocity", "payload.displacement"),
    inputs=("drive.command",),
)


def test_sample_time_is_the_controllers_own_unless_asked_for() -> None:
    case = load_case("thesis-1975")
    for kind in set(LINEAR) - {"feedback-no-antiwindup"}:
        own = controller_by_name(kind, case).sample_time
        assert own == (0.005 if kind == "feedback" else 0.02)
        assert controller_by_name(kind, case, sample_time=0.05).sample_time == 0.05


def test_feedback_takes_gains_before_a_design_before_those_of_the_case() -> None:
    case = load_case("thesis-1975")  # A = 200, a2 = 100
    m = at_rest(build_plant(case).operating_point(MEAN_LOSSES)).values.copy()
    m[HEARD.index("payload.displacement")] = 0.01
    static = build_plant(case).operating_point(MEAN_LOSSES).command

    class Design:  # all that is asked of a Tuning
        controller, status = DYNAMIC, "found"

    def asked(**given: object) -> float:
        return controller_by_name("feedback", case, **given).step(Measurement(m), 0.0) - static

    assert asked() == pytest.approx(-200.0 * 100.0 * 0.01)
    # Tustin at 5 ms, a design's own: D, and half a sample of the integrator.
    assert asked(design=Design()) == pytest.approx((-2.0 - 0.1 * 0.0025) * 0.01)
    gains = {"A": 2.0, "a": 0.0, "a1": 0.0, "a2": 3.0}
    assert asked(design=Design(), gains=gains) == pytest.approx(-6.0 * 0.01)
    without = controller_by_name("feedback-no-antiwindup", case, design=Design())
    assert without.name == "feedback-no-antiwindup"


def test_feedback_without_gains_says_what_to_do() -> None:
    with pytest.raises(InputError, match="subsea-crane has no gains in use: optimise them, or"):
        controller_by_name("feedback", load_case("subsea-crane"))


def test_static_gains_have_no_version_without_anti_windup() -> None:
    with pytest.raises(InputError, match="static gains have no state that could wind up"):
        controller_by_name("feedback-no-antiwindup", load_case("thesis-1975"))


def test_unknown_controllers_are_told_with_those_that_there_are() -> None:
    text = r"no controller 'pid'; there are: feedback, .*constant-tension, none"
    with pytest.raises(InputError, match=text):
        controller_by_name("pid", load_case("thesis-1975"))
